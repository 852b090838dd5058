"""Photos of things before backgrounds, with the mask of what is meant.

Problem: a photo shows one thing, none or several; some are in its background or cut by its frame.
Without a hint the thing meant is the one in front; with points or a box it is what they mark.

Equation: from the back to the front, light I <- (1 - a) I (1 - s) + a B for each body B of cover a
and the shadow s that it casts: its cover sheared onto the ground, to (x + h k_x, b + h k_y) for the
height h over its lowest row b, and blurred; and its cover, moved by a few pixels and blurred, where
it touches. Then exposure, white balance, and the camera of `training.world.camera`.

Limits: bodies are not lit by their background; shadows are those of flat cut-outs.
"""

from dataclasses import dataclass

import numpy as np
import torch
from torch.nn import functional

from isc_core.networks.mask_network import POINT

from ..world.camera import decoded_srgb, draw_camera, exposed, photographed
from ..world.random_draws import log_uniform
from ..world.tensor_batch import TensorBatch
from .ingredients import LENGTH, SIDE, Ingredients
from .scenes import MEANT, SHARES, Scene, Thing, draw_scene
from .variation import varied_light, varied_scene

_HALVED = (0.62, 0.31)  # bodies smaller than that are taken from pictures of half the size
_COARSE = 2  # pixels of a pixel of shadow
_VISIBLE = 40  # pixels of a thing that a hint may mean


@dataclass(frozen=True)
class Composite(TensorBatch):
    """A batch of photos with their masks.

    Attributes
    ----------
    photo : (B, 3, SIDE, SIDE) tensor
        Linear light, 0 outside of the frame.
    frame : (B, 1, SIDE, SIDE) tensor
        1 inside of the photo.
    hints : (B, 3, SIDE, SIDE) tensor
        Points on the object, points on the background, the box.
    mask : (B, 1, SIDE, SIDE) tensor
        Cover of what is meant.
    count : (B,) int64 tensor
        Of `isc_core.networks.mask_network.Count`.
    """

    photo: torch.Tensor
    frame: torch.Tensor
    hints: torch.Tensor
    mask: torch.Tensor
    count: torch.Tensor


class Composites:
    """Draws batches of composites.

    Parameters
    ----------
    ingredients : Ingredients
    size : int
        Photos of a batch.
    side : int
        Of the photos, pixels: a multiple of 32.
    hinted : float
        Share of photos with hints.
    shares : tuple of float
        Of scenes without a thing, with one, with several.
    varied : bool
        Vary bodies and backgrounds, see `variation`.
    """

    def __init__(
        self,
        ingredients: Ingredients,
        size: int,
        side: int = SIDE,
        hinted: float = 0.5,
        shares: tuple[float, ...] = SHARES,
        varied: bool = False,
    ) -> None:
        self._bodies = [torch.from_numpy(ingredients.bodies)]
        for _ in _HALVED:
            self._bodies.append(_halved(self._bodies[-1]))
        self._backgrounds = torch.from_numpy(ingredients.backgrounds)
        self._linear = decoded_srgb(torch.arange(256) / 255)
        self._size, self._side, self._hinted, self._shares = size, side, hinted, shares
        self._varied = varied

    def __call__(self, rng: np.random.Generator) -> Composite:
        """Draw a batch.

        Parameters
        ----------
        rng : numpy.random.Generator

        Returns
        -------
        Composite
        """
        scenes = [draw_scene(rng, len(self._bodies[0]), self._shares) for _ in range(self._size)]
        if self._varied:
            scenes = [varied_scene(one, rng) for one in scenes]
        frame = frames(np.array([one.shape for one in scenes]), self._side)
        light = self._grounds(scenes, rng)
        most = max(len(one.things) for one in scenes)
        covers = torch.zeros(self._size, max(most, 1), self._side, self._side)
        for k in range(most):
            rows = torch.tensor([b for b, one in enumerate(scenes) if len(one.things) > k])
            things = [scenes[int(b)].things[k] for b in rows]
            body, cover = self._placed(things)
            light[rows] = pasted(light[rows], body, cover, things)
            covers[rows, :k] *= 1 - cover
            covers[rows, k] = cover[:, 0]
        covers = covers * frame
        mask, hints, count = self._meant(scenes, covers, frame, rng)
        photo = taken(light, frame, rng)
        return Composite(photo, frame, hints, mask, count)

    def _grounds(self, scenes: list[Scene], rng: np.random.Generator) -> torch.Tensor:
        chosen = torch.from_numpy(rng.integers(len(self._backgrounds), size=len(scenes)))
        light = self._linear[self._backgrounds[chosen].long()]
        zoom = rng.uniform(0.6, 1, len(scenes))
        theta = np.zeros((len(scenes), 2, 3))
        theta[:, 0, 0], theta[:, 1, 1] = zoom * rng.choice([-1, 1], len(scenes)), zoom
        theta[:, :, 2] = (1 - zoom[:, None]) * rng.uniform(-1, 1, (len(scenes), 2))
        size = [len(scenes), 3, self._side, self._side]
        grid = functional.affine_grid(torch.from_numpy(theta).float(), size, align_corners=False)
        light = functional.grid_sample(light, grid, padding_mode="border", align_corners=False)
        if self._varied:
            light = varied_light(light, rng)
        level = torch.tensor([one.level for one in scenes]).float()[:, None, None, None]
        return light * (level / light.mean((1, 2, 3), keepdim=True).clamp(min=1e-3))

    def _placed(self, things: list[Thing]) -> tuple[torch.Tensor, torch.Tensor]:
        """Light and cover of bodies where they are."""
        enlarged = self._side / self._bodies[0].shape[-1]
        factors = [one.length / LENGTH * enlarged for one in things]
        levels = np.array([sum(factor < limit for limit in _HALVED) for factor in factors])
        found = torch.zeros(len(things), 4, self._side, self._side)
        theta = torch.from_numpy(np.stack([_inverse(one) for one in things])).float()
        for level in np.unique(levels):
            rows = np.flatnonzero(levels == level)
            coded = self._bodies[level][torch.tensor([things[k].body for k in rows])]
            cover = coded[:, 3:].float() / 255
            shown = torch.tensor([things[k].channels for k in rows])
            colours = coded[torch.arange(len(rows))[:, None], shown]
            layers = torch.cat([self._linear[colours.long()] * cover, cover], dim=1)
            size = [len(rows), 4, self._side, self._side]
            grid = functional.affine_grid(theta[rows], size, align_corners=False)
            found[rows] = functional.grid_sample(layers, grid, align_corners=False)
        cover = found[:, 3:]
        gain = torch.from_numpy(np.stack([one.gain for one in things])).float()[..., None, None]
        mean = found[:, :3].mean((1, 2, 3)) / cover.mean((1, 2, 3)).clamp(min=1e-4)
        gain = gain / mean.clamp(min=0.02)[:, None, None, None]
        return found[:, :3] * gain, cover

    def _meant(
        self,
        scenes: list[Scene],
        covers: torch.Tensor,
        frame: torch.Tensor,
        rng: np.random.Generator,
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Masks, hints and counts."""
        masks, hints = torch.zeros_like(frame), torch.zeros(len(scenes), 3, *frame.shape[2:])
        counts = np.zeros(len(scenes), np.int64)
        for b, scene in enumerate(scenes):
            parts = covers[b].numpy()
            chosen, counts[b] = scene.meant, scene.count
            if rng.random() < self._hinted:
                chosen, counts[b] = _hinted(scene, parts, rng), MEANT
                truth = parts[chosen].sum(axis=0) if chosen else np.zeros_like(parts[0])
                inside = frame[b, 0].numpy() > 0
                if not chosen:
                    counts[b] = 0
                hints[b] = torch.from_numpy(draw_hints(truth > 0.5, inside, rng))
            if chosen:
                masks[b, 0] = covers[b, chosen].sum(0)
        return masks.clamp(max=1), hints, torch.from_numpy(counts)


def _hinted(scene: Scene, covers: np.ndarray, rng: np.random.Generator) -> list[int]:
    """The thing (a list of one) that a hint means; empty: the background."""
    seen = [k for k in range(len(scene.things)) if (covers[k] > 0.5).sum() > _VISIBLE]
    if not seen or rng.random() < 0.06:
        return []
    if scene.count == MEANT and scene.meant[0] in seen and rng.random() < 0.6:
        return scene.meant
    return [int(rng.choice(seen))]


def draw_hints(truth: np.ndarray, inside: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Draw points and a box as a user gives them.

    Parameters
    ----------
    truth : (H, W) bool ndarray
        What is meant; empty: points lie on the background.
    inside : (H, W) bool ndarray
        The frame.
    rng : numpy.random.Generator

    Returns
    -------
    (3, H, W) float32 ndarray
        See `Composite`.
    """
    kind = rng.random()
    points, others, box = kind < 0.7, rng.random() < 0.35, kind > 0.5
    known = truth if truth.any() else inside
    hints = np.zeros((3, *truth.shape), np.float32)
    if points:
        hints[0] = discs(_some(known, rng, int(rng.integers(1, 4))), truth.shape)
    if others and (inside & ~truth).any():
        hints[1] = discs(_some(inside & ~truth, rng, int(rng.integers(1, 4))), truth.shape)
    if box and truth.any():
        rows, columns = np.flatnonzero(truth.any(1)), np.flatnonzero(truth.any(0))
        high, wide = rows[-1] - rows[0] + 1, columns[-1] - columns[0] + 1
        off = rng.normal(0.03, 0.04, 4).clip(-0.06, 0.2) * [high, high, wide, wide]
        top, bottom = round(rows[0] - off[0]), round(rows[-1] + 1 + off[1])
        left, right = round(columns[0] - off[2]), round(columns[-1] + 1 + off[3])
        hints[2, max(top, 0) : bottom, max(left, 0) : right] = 1
        hints[2] *= inside
    return hints


def _some(where: np.ndarray, rng: np.random.Generator, count: int) -> np.ndarray:
    places = np.argwhere(where)
    return places[rng.integers(len(places), size=count)]


def discs(places: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Draw points as discs.

    Parameters
    ----------
    places : (N, 2) ndarray
        Row and column.
    shape : tuple of int

    Returns
    -------
    (H, W) float32 ndarray
    """
    rows, columns = np.indices(shape)
    found = np.zeros(shape, np.float32)
    for row, column in places:
        found[(rows - row) ** 2 + (columns - column) ** 2 <= POINT**2] = 1
    return found


def frames(shapes: np.ndarray, side: int) -> torch.Tensor:
    """Return where photos lie in the network's frame.

    Parameters
    ----------
    shapes : (B, 2) ndarray
        Width and height over the longer one.
    side : int

    Returns
    -------
    (B, 1, side, side) tensor
        1 inside.
    """
    across = torch.from_numpy(np.abs((np.arange(side) + 0.5) * (2 / side) - 1)).float()
    wide, high = torch.from_numpy(shapes).float().T
    inside = (across[None, None, :] < wide[:, None, None]) & (
        across[None, :, None] < high[:, None, None]
    )
    return inside[:, None].float()


def _inverse(thing: Thing) -> np.ndarray:
    """The affine map (2, 3) from the frame to the body's picture, as `affine_grid` wants it."""
    c, s = np.cos(thing.angle), np.sin(thing.angle)
    turn = np.array([[c, s], [-s, c]]) * [[thing.mirror], [1]]
    scale = LENGTH / thing.length / np.array(thing.stretch)[:, None]
    turn = scale * turn
    return np.concatenate([turn, -turn @ thing.place[:, None]], axis=1)


def _halved(bodies: torch.Tensor) -> torch.Tensor:
    """Bodies (N, 4, s, s) of 8 bits, half as large."""
    cover = bodies[:, 3:].float()
    colours = functional.avg_pool2d(bodies[:, :3].float() * cover, 2)
    cover = functional.avg_pool2d(cover, 2)
    return torch.cat([colours / cover.clamp(min=1), cover], dim=1).round().byte()


def pasted(
    light: torch.Tensor, body: torch.Tensor, cover: torch.Tensor, things: list[Thing]
) -> torch.Tensor:
    """Put bodies with their shadows before pictures.

    Parameters
    ----------
    light : (B, 3, H, W) tensor
    body : (B, 3, H, W) tensor
        Its light times its cover.
    cover : (B, 1, H, W) tensor
    things : list of Thing

    Returns
    -------
    (B, 3, H, W) tensor
    """
    shade = _shadow(cover, things)
    return (1 - cover) * light * (1 - shade) + body


def _shadow(cover: torch.Tensor, things: list[Thing]) -> torch.Tensor:
    full, cover = cover.shape[-1], functional.avg_pool2d(cover, _COARSE)
    side = full // _COARSE
    across = (torch.arange(side) + 0.5) * (2 / side) - 1
    low = torch.where(cover.amax(3)[:, 0] > 0.5, across, -9.0).amax(1)
    theta = torch.zeros(2, len(things), 2, 3)
    for k, thing in enumerate(things):
        lean, fall = thing.shear
        # height over the lowest row: h = (y - low) / fall
        bottom = float(low[k].clamp(min=-1))
        theta[0, k] = torch.tensor(
            [[1, -lean / fall, lean / fall * bottom], [0, -1 / fall, bottom * (1 + 1 / fall)]]
        )
        theta[1, k] = torch.tensor([[1, 0, -thing.touch[0]], [0, 1, -thing.touch[1]]])
    grid = functional.affine_grid(
        theta.flatten(0, 1), [2 * len(things), 1, side, side], align_corners=False
    )
    maps = functional.grid_sample(cover.repeat(2, 1, 1, 1), grid, align_corners=False)
    maps = _blurred(maps, torch.tensor([one.blur for one in things]).repeat(2))
    strength = torch.tensor([one.strength for one in things]).float().T.reshape(-1, 1, 1, 1)
    shadow = (maps * strength).view(2, len(things), 1, side, side).amax(0)
    return functional.interpolate(shadow, (full, full), mode="bilinear", align_corners=False)


def _blurred(maps: torch.Tensor, steps: torch.Tensor) -> torch.Tensor:
    """Maps after 0 to 3 box filters of 3, 3 and 5 pixels."""
    for k, width in enumerate((3, 3, 5)):
        rows = torch.nonzero(steps > k)[:, 0]
        if len(rows):
            maps = maps.clone()
            maps[rows] = functional.avg_pool2d(
                maps[rows], width, 1, width // 2, count_include_pad=False
            )
    return maps


def taken(light: torch.Tensor, frame: torch.Tensor, rng: np.random.Generator) -> torch.Tensor:
    """Expose, balance and photograph pictures.

    Parameters
    ----------
    light : (B, 3, H, W) tensor
    frame : (B, 1, H, W) tensor
    rng : numpy.random.Generator

    Returns
    -------
    (B, 3, H, W) tensor
        Linear, 0 outside of the frame.
    """
    count = len(light)
    balance = torch.from_numpy(np.exp(rng.normal(0, 0.08, (count, 3, 1, 1)))).float()
    light = light * balance
    grey = torch.from_numpy(rng.random(count) < 0.04)[:, None, None, None]
    light = torch.where(grey, light.mean(1, keepdim=True), light)
    cameras = [draw_camera(rng) for _ in range(count)]
    camera = {
        name: torch.tensor([getattr(one, name) for one in cameras]).float()
        for name in vars(cameras[0])
    }
    light = light * exposed(light, frame, camera["exposure"] * log_uniform(rng, 0.8, 1.3))
    return photographed(light, torch.ones_like(frame), camera) * frame
