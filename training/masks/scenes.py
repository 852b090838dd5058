"""What stands where in a composite.

Limits: a scene of one thing has others only in its background or cut by its frame; they are at
most half as long.
"""

import math
from dataclasses import dataclass

import numpy as np

from isc_core.networks.mask_network import Count

from ..world.random_draws import log_uniform
from .ingredients import SIDE

MEANT = int(Count.ONE)
SHARES = (0.17, 0.58, 0.25)  # of scenes without a thing, with one, with several
_TINY = 0.2  # of the frame: things half as long may stand where there is none to be found
_HEAPS = 0.35  # of scenes with several
_SHAPES = ((1, 0.75), (0.75, 1), (1, 1), (1, 2 / 3), (2 / 3, 1), (1, 0.5625))


@dataclass(frozen=True)
class Thing:
    """A body in a scene.

    Attributes
    ----------
    body : int
    length : float
        Its longer side, pixels of a frame of `SIDE`.
    angle : float
        Radians.
    mirror : float
        -1 or 1.
    place : (2,) ndarray
        Its middle, right and down from that of the frame, half the frame's side being 1.
    gain : (3,) ndarray
        Its mean light.
    shear : tuple of float
        k_x and k_y of its cast shadow.
    touch : (2,) ndarray
        By how much the shadow where it touches is moved, as `place`.
    strength : tuple of float
        Of the cast shadow and of that where it touches, 0 to 1.
    blur : int
        Of its shadows, 0 to 3.
    stretch : tuple of float
        Factors along the picture's axes.
    channels : tuple of int
        Those of its picture that are shown as red, green and blue.
    """

    body: int
    length: float
    angle: float
    mirror: float
    place: np.ndarray
    gain: np.ndarray
    shear: tuple[float, float]
    touch: np.ndarray
    strength: tuple[float, float]
    blur: int
    stretch: tuple[float, float] = (1.0, 1.0)
    channels: tuple[int, ...] = (0, 1, 2)


@dataclass(frozen=True)
class Scene:
    """What a photo shows.

    Attributes
    ----------
    shape : tuple of float
        Width and height of the photo over the longer one.
    level : float
        Mean light of the background.
    things : list of Thing
        From the back to the front.
    meant : list of int
        Those that a mask without hints covers.
    count : int
        Of `Count`.
    """

    shape: tuple[float, float]
    level: float
    things: list[Thing]
    meant: list[int]
    count: int


def draw_scene(rng: np.random.Generator, bodies: int, shares: tuple[float, ...] = SHARES) -> Scene:
    """Draw a scene.

    Parameters
    ----------
    rng : numpy.random.Generator
    bodies : int
        How many there are to choose from.
    shares : tuple of float
        Of scenes without a thing, with one, with several.

    Returns
    -------
    Scene
    """
    shape = _SHAPES[int(rng.integers(len(_SHAPES)))]
    short = SIDE * min(shape)
    level = 0.2 * math.exp(rng.normal(0, 0.5))
    count = int(rng.choice(len(shares), p=shares))
    things, meant = list[Thing](), list[int]()
    if count == Count.SEVERAL:
        things = _several(rng, bodies, np.array(shape), short, level)
        meant = list(range(len(things)))
    else:
        length = min(SIDE * log_uniform(rng, 0.27, 0.95), 1.1 * short)
        shown = length if count == Count.ONE else _TINY * SIDE
        things = _around(rng, bodies, np.array(shape), shown, level)
        if count == Count.ONE:
            meant = [len(things)]
            things.append(_thing(rng, bodies, length, _middle(rng, shape, length), level))
    return Scene(shape, level, things, meant, count)


def _thing(
    rng: np.random.Generator, bodies: int, length: float, place: np.ndarray, level: float
) -> Thing:
    upright = rng.random() < 0.7
    fall = rng.uniform(0.12, 0.5) * (1 if rng.random() < 0.5 else -1)
    brightness = level * math.exp(rng.normal(0.1, 0.6))
    cast = rng.uniform(0.2, 0.85) if rng.random() < 0.6 else 0.0
    touching = rng.uniform(0.1, 0.7) if rng.random() < 0.7 else 0.0
    size = length / SIDE
    return Thing(
        int(rng.integers(bodies)),
        length,
        rng.normal(0, 0.12) if upright else rng.uniform(0, 2 * math.pi),
        float(rng.choice([-1, 1])),
        place,
        brightness * np.exp(rng.normal(0, 0.1, 3)),
        (rng.uniform(-1, 1), fall),
        np.array([rng.normal(0, 0.06), rng.uniform(0, 0.12)]) * size * 2,
        (cast, touching),
        int(rng.integers(4)),
    )


def _middle(rng: np.random.Generator, shape: tuple[float, float], length: float) -> np.ndarray:
    """A place of the thing that is meant: somewhere near the middle, seldom cut by the frame."""
    free = np.maximum(np.array(shape) - length / SIDE, 0)
    place = free * rng.normal(0, 0.4, 2).clip(-1, 1)
    if rng.random() < 0.15:
        place = place + rng.normal(0, 0.35, 2) * length / SIDE
    return place


def _around(
    rng: np.random.Generator, bodies: int, shape: np.ndarray, length: float, level: float
) -> list[Thing]:
    """Things of the background, and such as the frame cuts, before which one of a length stands."""
    found = []
    for _ in range(int(rng.choice([0, 1, 2, 3, 4], p=[0.42, 0.2, 0.16, 0.12, 0.1]))):
        if rng.random() < 0.5:
            size = length * rng.uniform(0.15, 0.5)
            place = shape * rng.uniform(-1, 1, 2)
        else:
            size = min(SIDE * min(shape) * rng.uniform(0.2, 0.8), 1.3 * max(length, 0.3 * SIDE))
            turn = rng.uniform(0, 2 * math.pi)
            edge = np.array([math.cos(turn), math.sin(turn)])
            edge = edge / np.abs(edge).max()
            place = edge * (shape + rng.uniform(0.1, 0.7) * size / SIDE)
        found.append(_thing(rng, bodies, size, place, level))
    return found


def _several(
    rng: np.random.Generator, bodies: int, shape: np.ndarray, short: float, level: float
) -> list[Thing]:
    """Things of similar size side by side, or a heap of them."""
    if rng.random() < _HEAPS:
        length = short * log_uniform(rng, 0.3, 0.7)
        spread = rng.uniform(0.4, 1)
        places = shape * spread * rng.uniform(-1, 1, (int(rng.integers(5, 9)), 2))
    else:
        columns, rows = ((2, 1), (3, 1), (2, 2), (1, 2), (2, 1))[int(rng.integers(5))]
        if shape[0] < shape[1]:
            columns, rows = rows, columns
        cell = 2 * shape / [columns, rows]
        length = SIDE / 2 * min(cell) * rng.uniform(0.5, 0.95)
        grid = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), -1).reshape(-1, 2)
        free = np.maximum(cell - 2 * length / SIDE, 0) / 2
        places = (grid + 0.5) * cell - shape + free * rng.uniform(-1, 1, (len(grid), 2))
    sizes = length * rng.uniform(0.7, 1.05, len(places))
    return [
        _thing(rng, bodies, size, place, level) for size, place in zip(sizes, places, strict=True)
    ]
