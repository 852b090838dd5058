"""The random layout of composites, for a batch.

Problem: photos show no object, one in front of or beside others, several side by side, or a pile.

`targets` makes compound objects, and objects that the frame cuts.

Limits: a scene of one object has others only in its background, at most half as long, or cut by
its frame.
"""

from dataclasses import dataclass

import numpy as np
import torch

from isc_core.networks.mask_network import Count

from ..world.random_draws import log_uniforms
from ..world.tensor_batch import TensorBatch
from .difficulty import SIMPLE, Difficulty
from .ingredients import LENGTH, SIDE
from .targets import MOST_PARTS, Parts, cut_by_frame, draw_parts

SHARES = (0.17, 0.58, 0.25)  # of scenes without an object, with one, with several
MAX_OBJECTS = 8  # objects of a scene
_REFERENCE = 0.2  # of the frame: in scenes without a target, objects are at most half as long
_PILES = 0.35  # share of piles among scenes with several objects
_OTHERS = (0.42, 0.2, 0.16, 0.12, 0.1)  # shares of scenes with 0 to 4 other objects
_SHAPES = np.array([(1, 0.75), (0.75, 1), (1, 1), (1, 2 / 3), (2 / 3, 1), (1, 0.5625)])
_FAT = 0.4  # parts of compound objects are not among the thinnest cut-outs
_SAME_LIGHT = 0.5  # share of compound objects whose parts are about equally bright
_GRIDS = np.array([(2, 1), (3, 1), (2, 2), (1, 2), (2, 1)])  # columns, rows


@dataclass(frozen=True, eq=False)
class Scenes(TensorBatch):
    """Random variables of the scenes of a batch.

    Attributes
    ----------
    shape : (B, 2) tensor
        Width and height of a photo, relative to the longer one.
    level : (B,) tensor
        Mean light of the background.
    count : (B,) int64 tensor
        Values of `Count`.
    """

    shape: torch.Tensor
    level: torch.Tensor
    count: torch.Tensor


@dataclass(frozen=True, eq=False)
class PastedObjects(TensorBatch):
    """The pasted objects of a batch: by photo, from the back to the front.

    Attributes
    ----------
    photo, layer : (N,) int64 tensor
        Index of the photo, and number of objects behind this one in it.
    target : (N,) bool tensor
        Whether the mask without hints contains it: the parts of a compound object, or all of
        several objects.
    cutout : (N,) tensor
        Index as a fraction of the number of cut-outs, in [0, 1).
    length : (N,) tensor
        Longer side, pixels of a frame of `SIDE`.
    angle : (N,) tensor
        Radians.
    mirror : (N,) tensor
        -1 or 1.
    place : (N, 2) tensor
        Centre, right and down from that of the frame, in units of half its side.
    gain : (N, 3) tensor
        Mean light.
    shear : (N, 2) tensor
        k_x and k_y of the cast shadow, see `pasting`.
    contact : (N, 2) tensor
        Offset of the contact shadow, in units of `place`.
    strength : (N, 2) tensor
        Of the cast shadow and of the contact shadow, 0 to 1.
    blur : (N,) int64 tensor
        Number of box filters of the shadows, 0 to 3.
    stretch : (N,) tensor
        Factor along the first axis of the cut-out; the second has its inverse.
    channels : (N, 3) int64 tensor
        Channels of the cut-out that become red, green and blue.
    """

    photo: torch.Tensor
    layer: torch.Tensor
    target: torch.Tensor
    cutout: torch.Tensor
    length: torch.Tensor
    angle: torch.Tensor
    mirror: torch.Tensor
    place: torch.Tensor
    gain: torch.Tensor
    shear: torch.Tensor
    contact: torch.Tensor
    strength: torch.Tensor
    blur: torch.Tensor
    stretch: torch.Tensor
    channels: torch.Tensor

    @property
    def to_cutout(self) -> torch.Tensor:
        """The affine maps (N, 2, 3) from the frame to the cut-outs, for `affine_grid`."""
        c, s = self.angle.cos(), self.angle.sin()
        across = self.mirror / self.stretch
        turn = torch.stack([across * c, across * s, -s * self.stretch, c * self.stretch], 1)
        turn = turn.view(-1, 2, 2) * (LENGTH / self.length)[:, None, None]
        return torch.cat([turn, -turn @ self.place[..., None]], 2)


@dataclass(frozen=True, eq=False)
class _Places:
    """Objects of each photo: arrays (B, MAX_OBJECTS); `place` has a last axis of 2."""

    size: np.ndarray
    place: np.ndarray
    present: np.ndarray
    target: np.ndarray


def draw_scenes(
    rng: np.random.Generator,
    number: int,
    shares: tuple[float, ...] = SHARES,
    difficulty: Difficulty = SIMPLE,
) -> tuple[Scenes, PastedObjects]:
    """Draw scenes.

    Parameters
    ----------
    rng : numpy.random.Generator
    number : int
        Of photos.
    shares : tuple of float
        Of scenes with no object, one and several.
    difficulty : Difficulty
        Shares of compound targets, and of those that the frame cuts.

    Returns
    -------
    scenes : Scenes
    objects : PastedObjects
        On the CPU.
    """
    shape = _SHAPES[rng.integers(len(_SHAPES), size=number)]
    level = 0.2 * np.exp(rng.normal(0, 0.5, number))
    count = rng.choice(len(shares), number, p=shares)
    at_most_one = _one_or_none(rng, shape, count == Count.ONE, difficulty)
    several = _several(rng, shape)
    crowded = (count == Count.SEVERAL)[:, None]
    photo, layer = np.nonzero(np.where(crowded, several.present, at_most_one.present))

    def chosen(name: str) -> np.ndarray:
        one, other = (getattr(places, name)[photo, layer] for places in (at_most_one, several))
        which = crowded[photo, 0].reshape(-1, *[1] * (one.ndim - 1))
        return np.where(which, other, one)

    objects = _objects(rng, chosen("size"), level[photo])
    objects |= {"photo": photo, "layer": layer}
    objects |= {"target": chosen("target"), "place": chosen("place")}
    if difficulty.compound:
        _match_parts(rng, objects, count)
    scenes = {"shape": shape, "level": level, "count": count}
    return Scenes.of(scenes), PastedObjects.of(objects)


def _objects(
    rng: np.random.Generator, length: np.ndarray, level: np.ndarray
) -> dict[str, np.ndarray]:
    """All attributes that do not depend on the objects' places."""
    number = len(length)
    upright = rng.random(number) < 0.7
    brightness = level * np.exp(rng.normal(0.1, 0.6, number))
    fall = rng.uniform(0.12, 0.5, number) * rng.choice([-1, 1], number)
    contact = np.stack([rng.normal(0, 0.06, number), rng.uniform(0, 0.12, number)], 1)
    strength = rng.uniform((0.2, 0.1), (0.85, 0.7), (number, 2))
    return {
        "cutout": rng.random(number),
        "length": length,
        "angle": np.where(upright, rng.normal(0, 0.12, number), rng.uniform(0, 2 * np.pi, number)),
        "mirror": rng.choice([-1.0, 1.0], number),
        "gain": brightness[:, None] * np.exp(rng.normal(0, 0.1, (number, 3))),
        "shear": np.stack([rng.uniform(-1, 1, number), fall], 1),
        "contact": contact * (length / SIDE * 2)[:, None],
        "strength": strength * (rng.random((number, 2)) < (0.6, 0.7)),
        "blur": rng.integers(4, size=number),
        "stretch": np.ones(number),
        "channels": np.tile(np.arange(3), (number, 1)),
    }


def _match_parts(
    rng: np.random.Generator, objects: dict[str, np.ndarray], count: np.ndarray
) -> None:
    """Choose cut-outs and light of the parts of compound objects, in place."""
    photo = objects["photo"]
    part = objects["target"] & (count[photo] == Count.ONE)
    part &= np.bincount(photo[part], minlength=len(count))[photo] > 1
    first = np.full(len(count), -1)
    rows = np.flatnonzero(part)[::-1]
    first[photo[rows]] = rows
    same = part & (rng.random(len(count)) < _SAME_LIGHT)[photo]
    light = objects["gain"][first[photo]] * np.exp(rng.normal(0, 0.2, (len(photo), 1)))
    objects["gain"] = np.where(same[:, None], light, objects["gain"])
    objects["cutout"] = np.where(part, _FAT + (1 - _FAT) * objects["cutout"], objects["cutout"])


def _one_or_none(
    rng: np.random.Generator, shape: np.ndarray, single: np.ndarray, difficulty: Difficulty
) -> _Places:
    """Objects in the background or cut by the frame; the target, if there is one, in front."""
    number, short = len(shape), SIDE * shape.min(axis=1)
    length = np.minimum(SIDE * log_uniforms(rng, 0.27, 0.95, number), 1.1 * short)
    shown = np.where(single, length, _REFERENCE * SIDE)[:, None]
    small = shown * rng.uniform(0.15, 0.5, (number, MAX_OBJECTS))
    inside = shape[:, None] * rng.uniform(-1, 1, (number, MAX_OBJECTS, 2))
    large = np.minimum(
        short[:, None] * rng.uniform(0.2, 0.8, (number, MAX_OBJECTS)),
        1.3 * np.maximum(shown, 0.3 * SIDE),
    )
    turn = rng.uniform(0, 2 * np.pi, (number, MAX_OBJECTS))
    edge = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    edge /= np.abs(edge).max(axis=-1, keepdims=True)
    off = rng.uniform(0.1, 0.7, (number, MAX_OBJECTS)) * large / SIDE
    cut = rng.random((number, MAX_OBJECTS)) < 0.5
    size = np.where(cut, large, small)
    place = np.where(cut[..., None], edge * (shape[:, None] + off[..., None]), inside)
    others = rng.choice(len(_OTHERS), number, p=_OTHERS)
    rows = np.flatnonzero(single)
    middle = _middle(rng, shape, length)
    if difficulty.cut:
        replaced = rng.random(number) < difficulty.cut
        drawn = cut_by_frame(rng, shape, SIDE)
        length = np.where(replaced, drawn[0], length)
        middle = np.where(replaced[:, None], drawn[1], middle)
    size[rows, others[rows]] = length[rows]
    place[rows, others[rows]] = middle[rows]
    slots, parts = np.arange(MAX_OBJECTS), np.ones(number, int)
    if difficulty.compound:
        drawn_parts = draw_parts(rng, number)
        compound = single & (rng.random(number) < difficulty.compound)
        parts = np.where(compound, np.minimum(drawn_parts.number, MAX_OBJECTS - others), 1)
        _place_parts(size, place, np.where(compound, parts, 0), others, drawn_parts)
    target = single[:, None] & (slots >= others[:, None]) & (slots < (others + parts)[:, None])
    return _Places(size, place, target | (slots < others[:, None]), target)


def _place_parts(
    size: np.ndarray, place: np.ndarray, number: np.ndarray, first: np.ndarray, parts: Parts
) -> None:
    """Replace the objects (B, MAX_OBJECTS) at index `first` by `number` parts each, in place."""
    rows = np.arange(len(size))
    length, middle = size[rows, first], place[rows, first]
    for k in range(MOST_PARTS):
        some = rows[k < number]
        at = (some, first[some] + k)
        size[at] = length[some] * parts.length[some, k]
        place[at] = middle[some] + parts.place[some, k] * (length[some] / SIDE)[:, None]


def _middle(rng: np.random.Generator, shape: np.ndarray, length: np.ndarray) -> np.ndarray:
    """Places of the targets: near the middle, rarely cut by the frame."""
    part = (length / SIDE)[:, None]
    place = np.maximum(shape - part, 0) * rng.normal(0, 0.4, shape.shape).clip(-1, 1)
    cut = rng.random((len(shape), 1)) < 0.15
    return np.asarray(place + cut * rng.normal(0, 0.35, shape.shape) * part)


def _several(rng: np.random.Generator, shape: np.ndarray) -> _Places:
    """Objects of similar size side by side, or in a pile."""
    number, slots = len(shape), np.arange(MAX_OBJECTS)
    pile = rng.random(number) < _PILES
    spread = rng.uniform(0.4, 1, (number, 1, 1))
    piled = shape[:, None] * spread * rng.uniform(-1, 1, (number, MAX_OBJECTS, 2))
    grid = _GRIDS[rng.integers(len(_GRIDS), size=number)]
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
    ordered = ordered + free * rng.uniform(-1, 1, (number, MAX_OBJECTS, 2))
    count = np.where(pile, rng.integers(5, MAX_OBJECTS + 1, number), grid.prod(axis=1))
    present = slots < count[:, None]
    size = length[:, None] * rng.uniform(0.7, 1.05, (number, MAX_OBJECTS))
    return _Places(size, np.where(pile[:, None, None], piled, ordered), present, present)
