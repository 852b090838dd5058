"""Training samples: lit views placed in the network's frame, photographed, with their targets.

Equation: a picture is turned by t, mirrored or not, scaled and moved; directions of the camera
frame are turned and mirrored with it, and so are harmonics: those of order m by m t. Log shading
and the light's constant are those of a photo whose mean light on the object is 1.

Limits: resampling is bilinear.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import torch
from torch.nn import functional

from isc_core.scene.light_estimate import PLACES

from .camera import CameraDraw, draw_camera, exposed, photographed
from .lighting import basis_of
from .lit_pictures import LitPictures, make_pictures
from .patterns import Atlas
from .pictures import Bank, stacked
from .random_draws import log_uniform
from .recipes import Shares, draw_recipe
from .tensor_batch import Pool, TensorBatch
from .view_batches import PreparedView, ViewStore
from .views import SIDE

OUTPUT = 128  # pixels of the network's input
OBJECT = 112  # longer side of an object as the network sees it
_CLEARANCE = (OUTPUT - OBJECT) // 2
_EDGE = 0.12  # of the picture's half side: a step in depth between neighbours that is an edge
_LEAST = 1e-4
_MOST_RATIO = 5.0  # of log ratios
_SPARSE = 2  # pixels: every second row and column says how large an object is

Alteration = Callable[[LitPictures], LitPictures]
"""A change of pictures before they are photographed; it returns new ones."""


@dataclass(frozen=True, eq=False)
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


@dataclass(frozen=True, eq=False)
class Draw:
    """All that is drawn for one batch.

    Attributes
    ----------
    chosen : (V,) int64 tensor
        Numbers of the views that are lit for this batch, on the CPU; V may be 0.
    recipes : dict of str to tensor
        The attributes of `Recipe`, stacked, one for each view; empty without views.
    shares : (B,) tensor
        Which pictures of the pool are photographed, see `Pool.picked`.
    cameras, placements : dict of str to tensor
        The attributes of `CameraDraw` and `Placement`, stacked, one for each photo.
    """

    chosen: torch.Tensor
    recipes: dict[str, torch.Tensor]
    shares: torch.Tensor
    cameras: dict[str, torch.Tensor]
    placements: dict[str, torch.Tensor]

    def __reduce__(self) -> tuple[Callable[..., "Draw"], tuple[Any, ...]]:
        # between processes, many small tensors travel slowly: each is a file of shared memory
        return _from_arrays, tuple(_as_arrays(part) for part in vars(self).values())

    def to(self, device: str) -> "Draw":
        """Return the draw on the device that lights it.

        Parameters
        ----------
        device : str

        Returns
        -------
        Draw
        """

        def moved(parts: dict[str, torch.Tensor]) -> dict[str, torch.Tensor]:
            return {name: part.to(device) for name, part in parts.items()}

        return Draw(
            self.chosen,
            moved(self.recipes),
            self.shares.to(device),
            moved(self.cameras),
            moved(self.placements),
        )


def _as_arrays(part: torch.Tensor | dict[str, torch.Tensor]) -> Any:
    if isinstance(part, torch.Tensor):
        return part.numpy()
    return {name: one.numpy() for name, one in part.items()}


def _from_arrays(*parts: Any) -> Draw:
    def tensors(part: Any) -> Any:
        if isinstance(part, dict):
            return {name: torch.from_numpy(one) for name, one in part.items()}
        return torch.from_numpy(part)

    return Draw(*map(tensors, parts))


@dataclass(frozen=True, eq=False)
class Sample(TensorBatch):
    """A batch of photos with their truth.

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
    views: Sequence[PreparedView],
    chosen: np.ndarray,
    photos: int,
    atlas: Atlas,
    environments: np.ndarray,
    rng: np.random.Generator,
    shares: Shares,
    plain_camera: bool = False,
) -> Draw:
    """Draw everything random of a batch.

    Parameters
    ----------
    views : sequence of PreparedView
    chosen : (V,) ndarray of int
        Those that are lit.
    photos : int
        To be taken of pictures in the pool.
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
    recipes = [
        draw_recipe(views[k].directions, views[k].up, atlas, environments, rng, shares)
        for k in chosen
    ]
    cameras = [draw_camera(rng, plain_camera) for _ in range(photos)]
    placements = [draw_placement(rng) for _ in range(photos)]
    return Draw(
        torch.from_numpy(chosen),
        stacked(recipes) if recipes else {},
        torch.from_numpy(rng.random(photos)),
        _attributes(cameras),
        _attributes(placements),
    )


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


class PhotoRenderer:
    """Lights what is drawn, and photographs a pool of what was lit.

    Lighting takes several times as long as photographing. A picture stays in the pool for pool size
    over fresh pictures batches and is photographed about photos over fresh pictures times, each
    time placed and taken differently.

    Parameters
    ----------
    bank : Bank
        On the device that lights.
    pool : int
        Pictures that are kept; at least as many as one batch lights.
    side : int
        Of the photos, pixels; a multiple of 32.
    alter : Alteration, optional
        Of the pictures of the pool.
    """

    def __init__(
        self,
        bank: Bank,
        pool: int,
        side: int = OUTPUT,
        alter: Alteration | None = None,
    ) -> None:
        self._bank, self._side, self._alter = bank, side, alter
        self._pool = Pool[LitPictures](pool)

    def __call__(self, draw: Draw, views: ViewStore) -> Sample:
        """Finish a batch.

        Parameters
        ----------
        draw : Draw
        views : ViewStore
            What `draw.chosen` counts; all on the device of the bank.

        Returns
        -------
        Sample
        """
        if len(draw.chosen):
            fresh = views.batch(draw.chosen)
            self._pool.exchange(make_pictures(fresh, draw.recipes, self._bank))
        pictures = self._pool.picked(draw.shares)
        if self._alter is not None:
            pictures = self._alter(pictures)
        return photograph(pictures, draw.cameras, draw.placements, self._side)


def photograph(
    pictures: LitPictures,
    cameras: dict[str, torch.Tensor],
    placements: dict[str, torch.Tensor],
    side: int = OUTPUT,
) -> Sample:
    """Place and photograph pictures.

    Parameters
    ----------
    pictures : LitPictures
    cameras, placements : dict of str to tensor
        One of each for each picture.
    side : int
        Of the photos, pixels; a multiple of 32.

    Returns
    -------
    Sample
    """
    layers, known, cover = _placed(pictures, placements, side)
    diffuse, gloss, shading, normal, depth = layers.split([3, 3, 3, 3, 1], dim=1)
    normal = _turned(normal, placements)
    # several times as fast as functional.normalize, which walks across the channels
    normal = normal * torch.rsqrt(normal.square().sum(1, keepdim=True).clamp(min=_LEAST**2))
    mask = _perturbed(cover, placements)
    gain = exposed(diffuse + gloss, known, cameras["exposure"])
    ground = pictures.ground[..., None, None] * torch.ones_like(diffuse)
    light = torch.where(known > 0, diffuse + gloss, ground)
    photo = photographed(light * gain, known, cameras) * mask
    limit = torch.where(cameras["clips"] > 0, 1.0, math.inf)[:, None, None, None]
    seen = torch.minimum((diffuse + gloss) * gain, limit)
    ratio = torch.log(seen.clamp(min=_LEAST)) - torch.log((diffuse * gain).clamp(min=_LEAST))
    mean = (photo.mean(1, keepdim=True) * mask).sum((1, 2, 3)) / mask.sum((1, 2, 3)).clamp(min=1)
    brightness = torch.log(gain.flatten() / mean.clamp(min=1e-6))
    return Sample(
        photo,
        mask,
        known * mask,
        normal,
        ratio.clamp(0, _MOST_RATIO),
        torch.log(shading.clamp(min=_LEAST)) + brightness[:, None, None, None],
        _edges(depth, known),
        _light_of(pictures.coefficients, brightness, placements),
        pictures.lamps,
        _place_of(pictures, placements),
        pictures.kind,
    )


def _placed(
    pictures: LitPictures, placements: dict[str, torch.Tensor], side: int
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Layers (B, 13, side, side) of what is seen, where it is known, and the share covered."""
    picture = torch.cat([pictures.layers, pictures.cover], dim=1).float()
    grid = _grid(picture[:, -1], pictures.aspect[:, None], placements, side)
    found = functional.grid_sample(picture, grid, align_corners=False)
    cover = found[:, -1:]
    known = (cover > 0.5).float() * _frame(placements, side)
    return found[:, :-1] / cover.clamp(min=0.25), known, cover


def _grid(
    cover: torch.Tensor, aspect: torch.Tensor, placements: dict[str, torch.Tensor], side: int
) -> torch.Tensor:
    """Where each pixel of the network's frame lies in the view, for `grid_sample`."""
    angle, mirror = placements["angle"], placements["mirror"]
    inverse = _turn(-angle)
    inverse = torch.stack([inverse[..., 0] * mirror[:, None], inverse[..., 1]], dim=-1)
    down = torch.tensor([1.0, -1], device=cover.device)  # between y up and rows
    inverse = down[:, None] * inverse * down
    cover = cover[:, ::_SPARSE, ::_SPARSE]
    across = torch.linspace(-1, 1, SIDE, device=cover.device)[::_SPARSE]
    y, x = torch.meshgrid(across, across, indexing="ij")
    inside = torch.stack([x, y], dim=-1).reshape(1, -1, 2)
    turned = (inside * aspect) @ torch.linalg.inv_ex(inverse).inverse.mT
    outside = (cover.flatten(1) <= 0)[..., None]
    low = turned.masked_fill(outside, 9).amin(1)
    high = turned.masked_fill(outside, -9).amax(1)
    scale = (high - low).amax(1) / 2 * (OUTPUT / placements["length"])
    middle = (((low + high) / 2)[:, None] @ inverse.mT)[:, 0]
    pixels = (torch.arange(side, device=cover.device) + 0.5) * (2 / side) - 1
    rows, columns = torch.meshgrid(pixels, pixels, indexing="ij")
    frame = torch.stack([columns, rows], dim=-1).reshape(1, -1, 2)
    frame = frame - placements["shift"][:, None] * (2 / OUTPUT)
    found = (frame @ inverse.mT) * scale[:, None, None] + middle[:, None]
    return (found / aspect).reshape(-1, side, side, 2)


def _frame(placements: dict[str, torch.Tensor], side: int) -> torch.Tensor:
    """1 (B, 1, side, side) inside the photo's frame."""
    pixels = (torch.arange(side, device=placements["cut"].device) + 0.5) * (OUTPUT / side)
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


def _perturbed(cover: torch.Tensor, placements: dict[str, torch.Tensor]) -> torch.Tensor:
    """The mask with the errors of a user's: shifted, too large or too small by a pixel or two."""
    error, shift = placements["mask_error"], placements["mask_shift"]
    theta = torch.eye(2, 3, device=cover.device).repeat(len(cover), 1, 1)
    theta[:, :, 2] = shift * (2 / OUTPUT)
    grid = functional.affine_grid(theta, list(cover.shape), align_corners=False)
    moved = functional.grid_sample(cover, grid, align_corners=False)
    wide = functional.max_pool2d(moved, 5, 1, 2)
    narrow = -functional.max_pool2d(-moved, 5, 1, 2)
    share = (error.abs() / 2)[:, None, None, None]
    target = torch.where(error[:, None, None, None] > 0, wide, narrow)
    return (torch.lerp(moved, target, share) > 0.5).float() * _frame(placements, cover.shape[-1])


def _place_of(pictures: LitPictures, placements: dict[str, torch.Tensor]) -> torch.Tensor:
    """The place (B,) of the strongest lamp in `PLACES`, or -1."""
    strongest = _turned(pictures.strongest[..., None, None], placements)[..., 0, 0]
    places = torch.tensor(PLACES, dtype=strongest.dtype, device=strongest.device)
    nearest = (strongest @ places.T).argmax(1)
    return torch.where(pictures.lamps > 0, nearest, -1)


def _light_of(
    coefficients: torch.Tensor, brightness: torch.Tensor, placements: dict[str, torch.Tensor]
) -> torch.Tensor:
    """Coefficients (B, 27) of the light in the network's frame, for a photo of mean light 1."""
    angle, mirror = placements["angle"], placements["mirror"]
    probe = _probe().to(angle.device)
    back = torch.stack(
        [
            probe[None, :, 0] * mirror[:, None],
            probe[None, :, 1].expand_as(mirror[:, None] * probe[None, :, 1]),
        ],
        -1,
    ) @ _turn(angle)
    came = torch.cat([back, probe[None, :, 2:].expand(len(angle), -1, -1)], -1)
    values = basis_of(came) @ coefficients
    found = _probe_inverse().to(angle.device) @ values
    found[:, 0] += brightness[:, None] * math.sqrt(4 * math.pi)
    return found.mT.flatten(1)


@cache
def _probe() -> torch.Tensor:
    return functional.normalize(torch.tensor(PLACES, dtype=torch.float32), dim=-1)


@cache
def _probe_inverse() -> torch.Tensor:
    return torch.linalg.pinv(basis_of(_probe()))


def _edges(depth: torch.Tensor, known: torch.Tensor) -> torch.Tensor:
    """1 (B, 1, H, W) where the depth of neighbours on the object jumps."""
    low = -functional.max_pool2d(torch.where(known > 0, -depth, -9.0), 3, 1, 1)
    high = functional.max_pool2d(torch.where(known > 0, depth, -9.0), 3, 1, 1)
    step = (high - low) * (known > 0)
    return (step > _EDGE).float()
