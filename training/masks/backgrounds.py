"""Backgrounds of composites: crops of panoramas, tables before them, plain backdrops.

Problem: what stands behind a thing in a photo is a room, a street or a wood, a table with a pattern
before one of them, or a wall and a cloth of one colour.

Equation: a crop is the perspective picture of a camera in the panorama's middle: pixel (x, y) sees
along R (x tan(f / 2), y tan(f / 2), -1) for a field of view f and a turn R. A table is a plane
below the horizon row h: the pattern's coordinates at (x, y) are (x, 1) k / (y - h).

Limits: panoramas of 512 columns are soft in narrow crops.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import ndimage

from isc_core.imaging.srgb import linear_to_srgb
from isc_core.photo import read_linear

from ..world.environments import read_panoramas
from ..world.patterns import Atlas
from ..world.random_draws import log_uniform

SIDE = 160
_FILES = (".exr", ".hdr")
_PLAIN, _TABLE = 0.2, 0.45  # shares of backgrounds: plain ones; tables before crops or plain ones


@dataclass(frozen=True)
class Surroundings:
    """A panorama at the resolution of its file.

    Attributes
    ----------
    radiance : (rows, 2 rows, 3) float32 ndarray
        Linear.
    judged : bool
        Kept for judging.
    """

    radiance: np.ndarray
    judged: bool


def read_crops(folder: Path, seed: int) -> list[Surroundings]:
    """Read panoramas as they are, with the split of `read_panoramas`.

    Parameters
    ----------
    folder : Path
    seed : int
        Chooses which are judged.

    Returns
    -------
    list of Surroundings

    Raises
    ------
    InputError
        If there is none, or one cannot be used.
    """
    judged = {one.name: one.judged for one in read_panoramas(folder, seed)}
    files = sorted(path for path in folder.iterdir() if path.suffix.lower() in _FILES)
    return [Surroundings(read_linear(path, "linear"), judged[path.stem]) for path in files]


def background(
    panoramas: list[np.ndarray], atlas: Atlas, rng: np.random.Generator, side: int = SIDE
) -> np.ndarray:
    """Draw a background.

    Parameters
    ----------
    panoramas : list of (rows, 2 rows, 3) ndarray
    atlas : Atlas
    rng : numpy.random.Generator
    side : int
        Pixels.

    Returns
    -------
    (3, side, side) uint8 ndarray
        sRGB.
    """
    plain = rng.random() < _PLAIN
    light = backdrop(rng, side) if plain else crop(panoramas, rng, side)
    if rng.random() < _TABLE:
        light = before(light, atlas, rng)
    coded = linear_to_srgb(np.clip(light, 0, 1))
    return np.asarray(np.rint(255 * coded).clip(0, 255).transpose(2, 0, 1), np.uint8)


def crop(panoramas: list[np.ndarray], rng: np.random.Generator, side: int) -> np.ndarray:
    """Draw a perspective picture of one of several panoramas.

    Parameters
    ----------
    panoramas : list of (rows, 2 rows, 3) ndarray
    rng : numpy.random.Generator
    side : int

    Returns
    -------
    (side, side, 3) float32 ndarray
        Linear, exposed so that most of it is below 1.
    """
    panorama = panoramas[int(rng.integers(len(panoramas)))]
    rows = len(panorama)
    half = np.tan(np.radians(log_uniform(rng, 35, 105)) / 2)
    across = ((np.arange(side) + 0.5) * (2 / side) - 1) * half
    x, y = np.meshgrid(across, -across)
    rays = np.stack([x, y, -np.ones_like(x)], axis=-1)
    rays = rays @ (_turn(2, rng.normal(0, 5)) @ _turn(0, rng.normal(10, 18)))
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    polar = np.arccos(np.clip(rays[..., 1], -1, 1)) * (rows / np.pi) - 0.5
    turn = np.arctan2(rays[..., 0], -rays[..., 2]) + rng.uniform(0, 2 * np.pi)
    column = turn * (rows / np.pi) - 0.5
    at = [np.clip(polar, 0, rows - 1), column]
    picture = np.stack(
        [
            ndimage.map_coordinates(panorama[..., c], at, order=1, mode="grid-wrap")
            for c in range(3)
        ],
        axis=-1,
    )
    bright = np.quantile(picture.max(axis=-1), rng.uniform(0.6, 0.98))
    return np.asarray(picture * (rng.uniform(0.4, 1) / max(float(bright), 1e-6)), np.float32)


def _turn(axis: int, degrees: float) -> np.ndarray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    matrix = np.eye(3)
    one, other = (k for k in range(3) if k != axis)
    matrix[one, one] = matrix[other, other] = c
    matrix[one, other], matrix[other, one] = -s, s
    return matrix


def backdrop(rng: np.random.Generator, side: int) -> np.ndarray:
    """Draw a plain backdrop: one colour, with gradients of light, a vignette, a faint texture.

    Parameters
    ----------
    rng : numpy.random.Generator
    side : int

    Returns
    -------
    (side, side, 3) float32 ndarray
        Linear.
    """
    across = (np.arange(side) + 0.5) * (2 / side) - 1
    x, y = np.meshgrid(across, across)
    slope = rng.normal(0, 0.35, 2)
    log_light = slope[0] * x + slope[1] * y - rng.uniform(0, 0.4) * (x**2 + y**2)
    if rng.random() < 0.4:
        coarse = rng.normal(0, rng.uniform(0.02, 0.2), (side, side))
        log_light += ndimage.gaussian_filter(coarse, width := rng.uniform(0.5, 4)) * width
    return np.asarray(colour(rng) * np.exp(log_light)[..., None], np.float32)


def colour(rng: np.random.Generator) -> np.ndarray:
    """Draw a colour of a wall, a cloth or a table: mostly pale.

    Parameters
    ----------
    rng : numpy.random.Generator

    Returns
    -------
    (3,) ndarray
        Linear.
    """
    tint = rng.normal(0, 0.12 if rng.random() < 0.7 else 0.6, 3)
    return np.asarray(log_uniform(rng, 0.03, 0.9) * np.exp(tint - tint.mean()))


def before(light: np.ndarray, atlas: Atlas, rng: np.random.Generator) -> np.ndarray:
    """Put a table with a pattern, or of one colour, before a picture.

    Parameters
    ----------
    light : (side, side, 3) ndarray
        Linear.
    atlas : Atlas
    rng : numpy.random.Generator

    Returns
    -------
    (side, side, 3) float32 ndarray
    """
    side = len(light)
    horizon = rng.uniform(-2.5, 0.4) if rng.random() < 0.75 else rng.uniform(-8, -1)
    edge = max(rng.uniform(-0.1, 0.7), horizon + 0.15) if rng.random() < 0.7 else -2.0
    across = (np.arange(side) + 0.5) * (2 / side) - 1
    x, y = np.meshgrid(across, across)
    y = y + rng.normal(0, 0.05) * x
    away = np.maximum(y - horizon, 0.05)
    turn, scale = rng.uniform(0, 2 * np.pi), log_uniform(rng, 0.3, 4)
    u, v = x / away * scale, scale * 1.5 / away
    pattern = atlas.maps[int(rng.integers(len(atlas.maps)))].astype(np.float32) / 255
    size = len(pattern)
    at = [
        (np.sin(turn) * u + np.cos(turn) * v + rng.random()) * size,
        (np.cos(turn) * u - np.sin(turn) * v + rng.random()) * size,
    ]
    grey = ndimage.map_coordinates(
        ndimage.gaussian_filter(pattern, 0.3 * size / side * scale, mode="wrap"),
        at,
        order=1,
        mode="grid-wrap",
    )[..., None]
    first = colour(rng)
    second = first if rng.random() < 0.35 else first * np.exp(rng.normal(0, 0.5, 3))
    fall = np.exp(rng.normal(0, 0.3) * x + rng.normal(0.1, 0.25) * y)[..., None]
    table = (first + grey * (second - first)) * fall
    share = np.clip((y - edge) * side / 4, 0, 1)[..., None]
    return np.asarray(light + share * (table - light), np.float32)
