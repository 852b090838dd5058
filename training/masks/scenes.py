"""The layout of composites, drawn for a whole batch at once.

Limits: a scene of one object has others only in its background or cut by its frame; they are at
most half as long.
"""

from dataclasses import dataclass

import numpy as np
import torch

from isc_core.networks.mask_network import Count

from ..world.random_draws import log_uniforms
from ..world.tensor_batch import TensorBatch
from .ingredients import LENGTH, SIDE

SHARES = (0.17, 0.58, 0.25)  # of scenes without an object, with one, with several
MOST = 8  # objects of a scene
_TINY = 0.2  # of the frame: objects of scenes without a target are at most half as long
_PILES = 0.35  # of scenes with several
_AROUND = (0.42, 0.2, 0.16, 0.12, 0.1)  # shares of scenes of 0 to 4 objects besides
_SHAPES = np.array([(1, 0.75), (0.75, 1), (1, 1), (1, 2 / 3), (2 / 3, 1), (1, 0.5625)])
_ROWS = np.array([(2, 1), (3, 1), (2, 2), (1, 2), (2, 1)])  # columns and rows of objects in order


@dataclass(frozen=True)
class Scenes(TensorBatch):
    """What the photos of a batch show.

    Attributes
    ----------
    shape : (B, 2) tensor
        Width and height of a photo over the longer one.
    level : (B,) tensor
        Mean light of the background.
    count : (B,) int64 tensor
        Of `Count`.
    """

    shape: torch.Tensor
    level: torch.Tensor
    count: torch.Tensor


@dataclass(frozen=True)
class PastedObjects(TensorBatch):
    """The pasted objects of a batch: photo by photo, from the back to the front.

    Attributes
    ----------
    photo, layer : (N,) int64 tensor
        Number of the photo, and number of objects behind this one in it.
    target : (N,) bool tensor
        Whether the mask without hints covers it.
    body : (N,) tensor
        Which it is, as a share of all bodies, in [0, 1).
    length : (N,) tensor
        Its longer side, pixels of a frame of `SIDE`.
    angle : (N,) tensor
        Radians.
    mirror : (N,) tensor
        -1 or 1.
    place : (N, 2) tensor
        Its middle, right and down from that of the frame, half the frame's side being 1.
    gain : (N, 3) tensor
        Its mean light.
    shear : (N, 2) tensor
        k_x and k_y of its cast shadow.
    touch : (N, 2) tensor
        By how much the shadow where it touches is moved, as `place`.
    strength : (N, 2) tensor
        Of the cast shadow and of that where it touches, 0 to 1.
    blur : (N,) int64 tensor
        Of its shadows, 0 to 3.
    stretch : (N,) tensor
        Factor along the picture's first axis; the other has its inverse.
    channels : (N, 3) int64 tensor
        Those of its picture that are shown as red, green and blue.
    """

    photo: torch.Tensor
    layer: torch.Tensor
    target: torch.Tensor
    body: torch.Tensor
    length: torch.Tensor
    angle: torch.Tensor
    mirror: torch.Tensor
    place: torch.Tensor
    gain: torch.Tensor
    shear: torch.Tensor
    touch: torch.Tensor
    strength: torch.Tensor
    blur: torch.Tensor
    stretch: torch.Tensor
    channels: torch.Tensor

    @property
    def to_body(self) -> torch.Tensor:
        """The affine maps (N, 2, 3) from the frame to the bodies' pictures, for `affine_grid`."""
        c, s = self.angle.cos(), self.angle.sin()
        across = self.mirror / self.stretch
        turn = torch.stack([across * c, across * s, -s * self.stretch, c * self.stretch], 1)
        turn = turn.view(-1, 2, 2) * (LENGTH / self.length)[:, None, None]
        return torch.cat([turn, -turn @ self.place[..., None]], 2)


@dataclass(frozen=True)
class _Places:
    """Up to MOST objects of each photo: (B, MOST) arrays; `place` has an axis more."""

    size: np.ndarray
    place: np.ndarray
    present: np.ndarray
    target: np.ndarray


def draw_scenes(
    rng: np.random.Generator, number: int, shares: tuple[float, ...] = SHARES
) -> tuple[Scenes, PastedObjects]:
    """Draw scenes.

    Parameters
    ----------
    rng : numpy.random.Generator
    number : int
        Of photos.
    shares : tuple of float
        Of scenes without an object, with one, with several.

    Returns
    -------
    scenes : Scenes
    objects : PastedObjects
        On the CPU.
    """
    shape = _SHAPES[rng.integers(len(_SHAPES), size=number)]
    level = 0.2 * np.exp(rng.normal(0, 0.5, number))
    count = rng.choice(len(shares), number, p=shares)
    few, many = _around(rng, shape, count == Count.ONE), _several(rng, shape)
    crowded = (count == Count.SEVERAL)[:, None]
    photo, layer = np.nonzero(np.where(crowded, many.present, few.present))

    def chosen(name: str) -> np.ndarray:
        one, other = (getattr(places, name)[photo, layer] for places in (few, many))
        which = crowded[photo, 0].reshape(-1, *[1] * (one.ndim - 1))
        return np.where(which, other, one)

    objects = _objects(rng, chosen("size"), level[photo])
    objects |= {"photo": photo, "layer": layer}
    objects |= {"target": chosen("target"), "place": chosen("place")}
    scenes = {"shape": shape, "level": level, "count": count}
    return Scenes.of(scenes), PastedObjects.of(objects)


def _objects(
    rng: np.random.Generator, length: np.ndarray, level: np.ndarray
) -> dict[str, np.ndarray]:
    """All that does not depend on where objects stand."""
    number = len(length)
    upright = rng.random(number) < 0.7
    brightness = level * np.exp(rng.normal(0.1, 0.6, number))
    fall = rng.uniform(0.12, 0.5, number) * rng.choice([-1, 1], number)
    touch = np.stack([rng.normal(0, 0.06, number), rng.uniform(0, 0.12, number)], 1)
    strength = rng.uniform((0.2, 0.1), (0.85, 0.7), (number, 2))
    return {
        "body": rng.random(number),
        "length": length,
        "angle": np.where(upright, rng.normal(0, 0.12, number), rng.uniform(0, 2 * np.pi, number)),
        "mirror": rng.choice([-1.0, 1.0], number),
        "gain": brightness[:, None] * np.exp(rng.normal(0, 0.1, (number, 3))),
        "shear": np.stack([rng.uniform(-1, 1, number), fall], 1),
        "touch": touch * (length / SIDE * 2)[:, None],
        "strength": strength * (rng.random((number, 2)) < (0.6, 0.7)),
        "blur": rng.integers(4, size=number),
        "stretch": np.ones(number),
        "channels": np.tile(np.arange(3), (number, 1)),
    }


def _around(rng: np.random.Generator, shape: np.ndarray, single: np.ndarray) -> _Places:
    """Objects in the background or cut by the frame; in front of them the target, if it is one."""
    number, short = len(shape), SIDE * shape.min(axis=1)
    length = np.minimum(SIDE * log_uniforms(rng, 0.27, 0.95, number), 1.1 * short)
    shown = np.where(single, length, _TINY * SIDE)[:, None]
    small = shown * rng.uniform(0.15, 0.5, (number, MOST))
    inside = shape[:, None] * rng.uniform(-1, 1, (number, MOST, 2))
    large = np.minimum(
        short[:, None] * rng.uniform(0.2, 0.8, (number, MOST)),
        1.3 * np.maximum(shown, 0.3 * SIDE),
    )
    turn = rng.uniform(0, 2 * np.pi, (number, MOST))
    edge = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    edge /= np.abs(edge).max(axis=-1, keepdims=True)
    off = rng.uniform(0.1, 0.7, (number, MOST)) * large / SIDE
    cut = rng.random((number, MOST)) < 0.5
    size = np.where(cut, large, small)
    place = np.where(cut[..., None], edge * (shape[:, None] + off[..., None]), inside)
    others = rng.choice(len(_AROUND), number, p=_AROUND)
    rows = np.flatnonzero(single)
    size[rows, others[rows]] = length[rows]
    place[rows, others[rows]] = _middle(rng, shape, length)[rows]
    slots = np.arange(MOST)
    target = single[:, None] & (slots == others[:, None])
    return _Places(size, place, target | (slots < others[:, None]), target)


def _middle(rng: np.random.Generator, shape: np.ndarray, length: np.ndarray) -> np.ndarray:
    """Places of the targets: somewhere near the middle, seldom cut by the frame."""
    part = (length / SIDE)[:, None]
    place = np.maximum(shape - part, 0) * rng.normal(0, 0.4, shape.shape).clip(-1, 1)
    cut = rng.random((len(shape), 1)) < 0.15
    return np.asarray(place + cut * rng.normal(0, 0.35, shape.shape) * part)


def _several(rng: np.random.Generator, shape: np.ndarray) -> _Places:
    """Objects of similar size side by side, or in a pile."""
    number, slots = len(shape), np.arange(MOST)
    pile = rng.random(number) < _PILES
    spread = rng.uniform(0.4, 1, (number, 1, 1))
    piled = shape[:, None] * spread * rng.uniform(-1, 1, (number, MOST, 2))
    grid = _ROWS[rng.integers(len(_ROWS), size=number)]
    grid = np.where(shape[:, :1] < shape[:, 1:], grid[:, ::-1], grid)
    cell = 2 * shape / grid
    length = np.where(
        pile,
        SIDE * shape.min(axis=1) * log_uniforms(rng, 0.3, 0.7, number),
        SIDE / 2 * cell.min(axis=1) * rng.uniform(0.5, 0.95, number),
    )
    free = np.maximum(cell - 2 * (length / SIDE)[:, None], 0)[:, None] / 2
    column, row = slots % grid[:, :1], slots // grid[:, :1]
    ordered = (np.stack([column, row], axis=-1) + 0.5) * cell[:, None] - shape[:, None]
    ordered = ordered + free * rng.uniform(-1, 1, (number, MOST, 2))
    count = np.where(pile, rng.integers(5, MOST + 1, number), grid.prod(axis=1))
    present = slots < count[:, None]
    size = length[:, None] * rng.uniform(0.7, 1.05, (number, MOST))
    return _Places(size, np.where(pile[:, None, None], piled, ordered), present, present)
