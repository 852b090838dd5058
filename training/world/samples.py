"""Training samples: lit views placed in the network's frame, photographed, with their targets.

Equation: a picture is turned by t, mirrored or not, scaled and moved; directions of the camera
frame are turned and mirrored with it, and so are harmonics: those of order m by m t. Log shading
and the light's constant are those of a photo whose mean light on the object is 1.

Limits: resampling is bilinear.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch.nn import functional

from isc_core.scene.light_estimate import PLACES

from ..data.random_draws import log_uniform
from .camera import CameraDraw, draw_camera, exposed, photographed
from .lighting import LitViews, PreparedView, ViewBatch, basis_of, batch_of
from .patterns import Atlas
from .pictures import Bank, lit_pictures, stacked
from .recipes import Shares, draw_recipe
from .views import SIDE

OUTPUT = 128  # pixels of the network's input
OBJECT = 112  # longer side of an object as the network sees it
PHOTOS = 2  # of each lit view, placed and taken differently: lighting is most of the work
_CLEARANCE = (OUTPUT - OBJECT) // 2
_LEAST_LAMP = 0.12  # of all lamps' light in the picture: below, a lamp does not count
_LEAST_LIT = 0.2  # of all light: below, the strongest lamp is not looked for
_EDGE = 0.12  # of the picture's half side: a step in depth between neighbours that is an edge
_LEAST = 1e-4
_MOST_RATIO = 5.0  # of log ratios


@dataclass(frozen=True)
class Placement:
    """How a picture is placed in the network's frame.

    Attributes
    ----------
    angle : float
        Radians, counter-clockwise.
    mirror : float
        -1: left and right are exchanged, after the turn; else 1.
    length : float
        Longer side of the object, in pixels of the network's frame.
    shift : (2,) ndarray
        Of the object's middle, pixels, right and down.
    cut : (4,) ndarray
        Pixels taken off the frame at left, top, right and bottom, as a photo's frame cuts objects.
    mask_error : float
        Pixels by which the mask is too large, or too small if negative.
    mask_shift : (2,) ndarray
        Pixels.
    """

    angle: float
    mirror: float
    length: float
    shift: np.ndarray
    cut: np.ndarray
    mask_error: float
    mask_shift: np.ndarray


@dataclass(frozen=True)
class Draw:
    """All that is drawn for one batch, on the CPU.

    Attributes
    ----------
    views : ViewBatch
    recipes, cameras, placements : dict of str to tensor
        The attributes of `Recipe`, `CameraDraw` and `Placement`, stacked.
    """

    views: ViewBatch
    recipes: dict[str, torch.Tensor]
    cameras: dict[str, torch.Tensor]
    placements: dict[str, torch.Tensor]

    def to(self, device: str) -> "Draw":
        """Return the draw on a device.

        Parameters
        ----------
        device : str

        Returns
        -------
        Draw
        """
        parts = (self.recipes, self.cameras, self.placements)
        moved = [{name: part.to(device) for name, part in parts_.items()} for parts_ in parts]
        return Draw(self.views.to(torch.device(device)), *moved)


@dataclass(frozen=True)
class Sample:
    """A batch of photos with their truth, side by side `OUTPUT` pixels.

    Attributes
    ----------
    photo : (B, 3, side, side) tensor
        Linear light.
    mask : (B, 1, side, side) tensor
        The object's mask as given, which may be wrong.
    known : (B, 1, side, side) tensor
        1 where the truth is known: on the object.
    normal : (B, 3, side, side) tensor
    ratio : (B, 3, side, side) tensor
        Log of light over diffuse light.
    log_shading : (B, 3, side, side) tensor
    edge : (B, 1, side, side) tensor
        1 where the depth jumps.
    light : (B, 27) tensor
        Coefficients of the log shading, nine for each channel.
    count : (B,) int64 tensor
        Lamps: none, one, several.
    place : (B,) int64 tensor
        Of `PLACES`, the strongest lamp's; -1 without.
    kind : (B,) int64 tensor
        Of `recipes.Kind`.
    """

    photo: torch.Tensor
    mask: torch.Tensor
    known: torch.Tensor
    normal: torch.Tensor
    ratio: torch.Tensor
    log_shading: torch.Tensor
    edge: torch.Tensor
    light: torch.Tensor
    count: torch.Tensor
    place: torch.Tensor
    kind: torch.Tensor


def draw_batch(
    views: list[PreparedView],
    atlas: Atlas,
    environments: np.ndarray,
    rng: np.random.Generator,
    shares: Shares,
    plain_camera: bool = False,
) -> Draw:
    """Draw everything random of a batch.

    Parameters
    ----------
    views : list of PreparedView
        `PHOTOS` photos are taken of each.
    atlas : Atlas
    environments : (N,) ndarray of int
        Those of the bank that may be used.
    rng : numpy.random.Generator
    shares : Shares
    plain_camera : bool
        See `draw_camera`.

    Returns
    -------
    Draw
    """
    recipes = [draw_recipe(view.directions, atlas, environments, rng, shares) for view in views]
    photos = PHOTOS * len(views)
    cameras = [draw_camera(rng, plain_camera) for _ in range(photos)]
    placements = [draw_placement(rng) for _ in range(photos)]
    return Draw(batch_of(views), stacked(recipes), _attributes(cameras), _attributes(placements))


def _attributes(drawn: list[CameraDraw] | list[Placement]) -> dict[str, torch.Tensor]:
    names = drawn[0].__dataclass_fields__
    return {
        name: torch.from_numpy(np.stack([np.asarray(getattr(one, name)) for one in drawn])).float()
        for name in names
    }


def draw_placement(rng: np.random.Generator) -> Placement:
    """Draw how a view is placed.

    Parameters
    ----------
    rng : numpy.random.Generator

    Returns
    -------
    Placement
    """
    choice = rng.random()
    angle = rng.normal(0, 5) if choice < 0.75 else 90 * int(rng.integers(1, 4))
    angle = rng.uniform(0, 360) if choice > 0.9 else angle
    length, cut = OBJECT * log_uniform(rng, 0.88, 1.04), np.zeros(4)
    if rng.random() < 0.08:
        length *= rng.uniform(1.1, 1.7)
        cut[:] = _CLEARANCE
    wrong = rng.random() < 0.2
    return Placement(
        math.radians(angle),
        float(rng.choice([-1, 1])),
        length,
        rng.uniform(-3, 3, 2) if not cut.any() else rng.uniform(-20, 20, 2),
        cut,
        rng.uniform(-2, 2) * wrong,
        rng.uniform(-1.5, 1.5, 2) * wrong,
    )


def finish_batch(draw: Draw, bank: Bank) -> Sample:
    """Light, place and photograph a batch.

    Parameters
    ----------
    draw : Draw
    bank : Bank
        Both on one device.

    Returns
    -------
    Sample
    """
    draw, lit = _repeated(draw, lit_pictures(draw.views, draw.recipes, bank))
    layers, known, cover = _placed(draw.views, lit, draw.placements)
    diffuse, gloss, shading, normal, depth = layers.split([3, 3, 3, 3, 1], dim=1)
    normal = functional.normalize(_turned(normal, draw.placements), dim=1)
    mask = _mistaken(cover, draw.placements)
    gain = exposed(diffuse + gloss, known, draw.cameras["exposure"])
    ground = _background(lit, draw.recipes)[..., None, None] * torch.ones_like(diffuse)
    light = torch.where(known > 0, diffuse + gloss, ground)
    photo = photographed(light * gain, known, draw.cameras) * mask
    seen = (diffuse + gloss) * gain
    limit = torch.where(draw.cameras["clips"] > 0, 1.0, math.inf)[:, None, None, None]
    ratio = torch.log(torch.minimum(seen, limit).clamp(min=_LEAST)) - torch.log(
        (diffuse * gain).clamp(min=_LEAST)
    )
    mean = (photo.mean(1, keepdim=True) * mask).sum((1, 2, 3)) / mask.sum((1, 2, 3)).clamp(min=1)
    brightness = torch.log(gain.flatten() / mean.clamp(min=1e-6))
    count, place = _lamps(draw)
    return Sample(
        photo,
        mask,
        known * mask,
        normal,
        ratio.clamp(0, _MOST_RATIO),
        torch.log(shading.clamp(min=_LEAST)) + brightness[:, None, None, None],
        _edges(depth, known),
        _light_of(lit, brightness, draw.placements),
        count,
        place,
        draw.recipes["kind"],
    )


def _repeated(draw: Draw, lit: LitViews) -> tuple[Draw, LitViews]:
    """Each view as often as photos are taken of it."""
    count = len(draw.views.index)
    which = torch.arange(count, device=draw.views.index.device).repeat_interleave(PHOTOS)
    recipes = {name: part[which] for name, part in draw.recipes.items()}
    again = {name: part[which] for name, part in vars(lit).items()}
    return replace(draw, views=draw.views.chosen(which), recipes=recipes), LitViews(**again)


def _placed(
    views: ViewBatch, lit: LitViews, placements: dict[str, torch.Tensor]
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Layers (B, 13, side, side) of what is seen, where it is known, and the share covered."""
    rows = [lit.diffuse, lit.specular, lit.shading, views.normal, views.position[..., 2:]]
    values = torch.cat([*rows, torch.ones_like(views.thickness)[..., None]], dim=-1)
    batch, _, channels = values.shape
    canvas = torch.zeros(batch, SIDE * SIDE + 1, channels, device=values.device)
    canvas.scatter_(1, views.index[..., None].expand(-1, -1, channels), values)
    picture = canvas[:, :-1].mT.reshape(batch, channels, SIDE, SIDE)
    found = functional.grid_sample(picture, _grid(picture[:, -1], placements), align_corners=False)
    cover = found[:, -1:]
    known = (cover > 0.5).float() * _frame(placements)
    return found[:, :-1] / cover.clamp(min=0.25), known, cover


def _grid(cover: torch.Tensor, placements: dict[str, torch.Tensor]) -> torch.Tensor:
    """Where each pixel of the network's frame lies in the view, for `grid_sample`."""
    angle, mirror = placements["angle"], placements["mirror"]
    inverse = _turn(-angle)
    inverse = torch.stack([inverse[..., 0] * mirror[:, None], inverse[..., 1]], dim=-1)
    down = torch.tensor([1.0, -1], device=cover.device)  # between y up and rows
    inverse = down[:, None] * inverse * down
    across = torch.linspace(-1, 1, SIDE, device=cover.device)
    y, x = torch.meshgrid(across, across, indexing="ij")
    inside = torch.stack([x, y], dim=-1).reshape(1, -1, 2)
    turned = inside @ torch.linalg.inv(inverse).mT
    outside = (cover.flatten(1) <= 0)[..., None]
    low = turned.masked_fill(outside, 9).amin(1)
    high = turned.masked_fill(outside, -9).amax(1)
    scale = (high - low).amax(1) / 2 * (OUTPUT / placements["length"])
    middle = (((low + high) / 2)[:, None] @ inverse.mT)[:, 0]
    pixels = (torch.arange(OUTPUT, device=cover.device) + 0.5) * (2 / OUTPUT) - 1
    rows, columns = torch.meshgrid(pixels, pixels, indexing="ij")
    frame = torch.stack([columns, rows], dim=-1).reshape(1, -1, 2)
    frame = frame - placements["shift"][:, None] * (2 / OUTPUT)
    found = (frame @ inverse.mT) * scale[:, None, None] + middle[:, None]
    return found.reshape(-1, OUTPUT, OUTPUT, 2)


def _frame(placements: dict[str, torch.Tensor]) -> torch.Tensor:
    """1 (B, 1, side, side) inside the photo's frame."""
    pixels = torch.arange(OUTPUT, device=placements["cut"].device) + 0.5
    cut = placements["cut"][:, :, None]
    columns = (pixels > cut[:, 0]) & (pixels < OUTPUT - cut[:, 2])
    rows = (pixels > cut[:, 1]) & (pixels < OUTPUT - cut[:, 3])
    return (rows[:, None, :, None] & columns[:, None, None, :]).float()


def _turn(angle: torch.Tensor) -> torch.Tensor:
    """Rotations (B, 2, 2) by angles, counter-clockwise."""
    c, s = torch.cos(angle), torch.sin(angle)
    return torch.stack([torch.stack([c, -s], -1), torch.stack([s, c], -1)], -2)


def _turned(normal: torch.Tensor, placements: dict[str, torch.Tensor]) -> torch.Tensor:
    """Normals (B, 3, H, W) turned and mirrored with the picture."""
    across = torch.einsum("bij,bjhw->bihw", _turn(placements["angle"]), normal[:, :2])
    mirror = placements["mirror"][:, None, None, None]
    return torch.cat([across[:, :1] * mirror, across[:, 1:], normal[:, 2:]], dim=1)


def _mistaken(cover: torch.Tensor, placements: dict[str, torch.Tensor]) -> torch.Tensor:
    """The mask as somebody would give it: shifted, too large or too small by a pixel or two."""
    error, shift = placements["mask_error"], placements["mask_shift"]
    theta = torch.eye(2, 3, device=cover.device).repeat(len(cover), 1, 1)
    theta[:, :, 2] = shift * (2 / OUTPUT)
    grid = functional.affine_grid(theta, list(cover.shape), align_corners=False)
    moved = functional.grid_sample(cover, grid, align_corners=False)
    wide = functional.max_pool2d(moved, 5, 1, 2)
    narrow = -functional.max_pool2d(-moved, 5, 1, 2)
    share = (error.abs() / 2)[:, None, None, None]
    target = torch.where(error[:, None, None, None] > 0, wide, narrow)
    return (torch.lerp(moved, target, share) > 0.5).float() * _frame(placements)


def _background(lit: LitViews, recipes: dict[str, torch.Tensor]) -> torch.Tensor:
    """A colour (B, 3) behind the object, from black to as bright as its brightest parts."""
    level = (recipes["shifts"][:, 0, :1] * 2).clamp(0, 2)
    return level * lit.diffuse.mean(1)


def _lamps(draw: Draw) -> tuple[torch.Tensor, torch.Tensor]:
    """How many lamps count (B,), and the place (B,) of the strongest in `PLACES`, or -1."""
    power = draw.recipes["power"].mean(-1)
    picked = draw.recipes["lamp"][..., None].expand(-1, -1, 3)
    toward = draw.views.directions.gather(1, picked)
    lamps = draw.recipes["lamp"][:, None].expand(-1, draw.views.normal.shape[1], -1)
    light = power * draw.views.reached.gather(2, lamps).float().mean(1) / 255
    ambient = draw.recipes["ambient"].mean(-1)
    counts = light > _LEAST_LAMP * light.sum(1, keepdim=True).clamp(min=1e-6)
    counts &= light > 0.1 * _LEAST_LIT * ambient[:, None]
    number = counts.sum(1).clamp(max=2) * (draw.recipes["given"] == 0)
    best = light.argmax(1)
    strongest = toward[torch.arange(len(best), device=best.device), best]
    across = torch.einsum("bij,bj->bi", _turn(draw.placements["angle"]), strongest[:, :2])
    across = across * torch.stack(
        [draw.placements["mirror"], torch.ones_like(draw.placements["mirror"])], -1
    )
    strongest = torch.cat([across, strongest[:, 2:]], -1)
    places = torch.tensor(PLACES, dtype=strongest.dtype, device=strongest.device)
    nearest = (strongest @ places.T).argmax(1)
    return number, torch.where(number > 0, nearest, -1)


def _light_of(
    lit: LitViews, brightness: torch.Tensor, placements: dict[str, torch.Tensor]
) -> torch.Tensor:
    """Coefficients (B, 27) of the light in the network's frame, for a photo of mean light 1."""
    angle, mirror = placements["angle"], placements["mirror"]
    probe = functional.normalize(
        torch.tensor(PLACES, dtype=torch.float32, device=angle.device), dim=-1
    )
    back = torch.stack(
        [
            probe[None, :, 0] * mirror[:, None],
            probe[None, :, 1].expand_as(mirror[:, None] * probe[None, :, 1]),
        ],
        -1,
    ) @ _turn(angle)
    came = torch.cat([back, probe[None, :, 2:].expand(len(angle), -1, -1)], -1)
    values = basis_of(came) @ lit.coefficients
    found = torch.linalg.pinv(basis_of(probe)) @ values
    found[:, 0] += brightness[:, None] * math.sqrt(4 * math.pi)
    return found.mT.flatten(1)


def _edges(depth: torch.Tensor, known: torch.Tensor) -> torch.Tensor:
    """1 (B, 1, H, W) where the depth of neighbours on the object jumps."""
    low = -functional.max_pool2d(torch.where(known > 0, -depth, -9.0), 3, 1, 1)
    high = functional.max_pool2d(torch.where(known > 0, depth, -9.0), 3, 1, 1)
    step = (high - low) * (known > 0)
    return (step > _EDGE).float()
