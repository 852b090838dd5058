"""Procedural environments: rooms, skies and studios, drawn from a seed.

Equation: radiance (rows, 2 rows, 3) in the layout of `isc_core.shading.environment_map`; 1 is about
a white wall. A room is a box with the object inside: each direction meets a wall, and what hangs,
stands or shines there is a rectangle on it. Outdoors a sky that brightens toward the horizon and
the sun lie above hills, houses or trees and the ground. In a studio softboxes shine in the dark.
All are drawn three times as fine and averaged over each pixel's solid angle, so that a small lamp
keeps its light.

Limits: no parallax, no light from wall to wall.
"""

import numpy as np
from scipy.ndimage import gaussian_filter1d

from isc_core.shading.environment_map import directions, resampled

_FINER = 3


def procedural_room(rng: np.random.Generator, rows: int = 32) -> np.ndarray:
    """Draw a room with windows, ceiling panels and objects on its walls.

    Parameters
    ----------
    rng : numpy.random.Generator
    rows : int

    Returns
    -------
    (rows, 2 rows, 3) ndarray of float32
        Linear radiance, > 0.
    """
    toward = directions(rows * _FINER)
    half = rng.uniform((1.5, 1.0, 1.5), (5, 2.0, 5))
    eye = half * rng.uniform((-0.7, -0.5, -0.7), (0.7, 0.2, 0.7))
    reach = (np.copysign(half, toward) - eye) / np.where(np.abs(toward) < 1e-9, 1e-9, toward)
    axis = reach.argmin(-1)
    place = (eye + toward * reach.min(-1)[..., None]) / half
    night, walls = rng.random() < 0.3, rng.uniform(0.15, 1) * _hue(rng, 0.2)
    windows = set(rng.permutation(4)[: rng.integers(0 if night else 1, 3)].tolist())
    radiance = np.empty(toward.shape)
    for number, (k, side) in enumerate([(0, -1), (0, 1), (2, -1), (2, 1)]):
        on = (axis == k) & (place[..., k] * side > 0)
        across, up = place[on][:, 2 - k], place[on][:, 1]
        radiance[on] = _wall(rng, across, up, walls, number in windows and not night)
    for side, paint in ((1, _ceiling), (-1, _floor)):
        on = (axis == 1) & (place[..., 1] * side > 0)
        radiance[on] = paint(rng, place[on][:, 0], place[on][:, 2])
    return _finished(radiance, rows)


def procedural_sky(rng: np.random.Generator, rows: int = 32) -> np.ndarray:
    """Draw an outdoor scene: clear, cloudy or overcast, at noon or in the evening.

    Parameters
    ----------
    rng : numpy.random.Generator
    rows : int

    Returns
    -------
    (rows, 2 rows, 3) ndarray of float32
        Linear radiance, > 0.
    """
    toward = directions(rows * _FINER)
    up = toward[..., 1]
    cover = rng.choice([0.0, rng.uniform(0.2, 0.8), 1.0])
    evening = float(rng.random() < 0.35) * rng.uniform(0.3, 1)
    zenith = np.array([0.25, 0.5, 1.1]) * rng.uniform(0.5, 1.3)
    low = np.array([0.9, 1.0, 1.15]) * (1 - evening) + np.array([1.9, 0.9, 0.4]) * evening
    share = np.clip(up, 0, 1)[..., None] ** rng.uniform(0.3, 0.7)
    sky = low * (1 - share) + zenith * share
    clouds = np.clip((_clouds(rng, toward) + 2.2 * cover - 1.1) * 1.5, 0, 1)[..., None]
    grey = rng.uniform(0.6, 1.4) * (1 + 0.4 * up[..., None])
    sky = sky * (1 - clouds) + grey * clouds
    if cover < 1:
        sky = sky + _sun(rng, toward, evening)
    return _finished(
        np.where(up[..., None] > 0, _skyline(rng, toward, sky), _ground(rng, up)), rows
    )


def studio(rng: np.random.Generator, rows: int = 32) -> np.ndarray:
    """Draw one to five softboxes, strips or round lamps on a dark ground, most above a table.

    Parameters
    ----------
    rng : numpy.random.Generator
    rows : int

    Returns
    -------
    (rows, 2 rows, 3) ndarray of float32
        Linear radiance, > 0.
    """
    toward = directions(rows * _FINER)
    up = toward[..., 1:2]
    dark = np.exp(rng.uniform(np.log(0.005), np.log(0.3)))
    radiance = dark * _hue(rng, 0.1) * (1 + rng.uniform(0, 0.9) * up)
    if rng.random() < 0.6:
        table = np.exp(rng.uniform(np.log(0.03), np.log(1))) * _hue(rng, 0.2)
        radiance = np.where(up < rng.uniform(-0.5, -0.05), table, radiance)
    for _ in range(int(rng.integers(1, 6))):
        lit = _softbox(rng, toward)[..., None]
        lamp = np.exp(rng.uniform(np.log(3), np.log(60))) * _hue(rng, 0.12)
        radiance = np.where(lit > 0, lamp * lit, radiance)
    return _finished(radiance, rows)


def _finished(radiance: np.ndarray, rows: int) -> np.ndarray:
    return np.asarray(resampled(np.maximum(radiance, 1e-3), rows), np.float32)


def _hue(rng: np.random.Generator, strength: float) -> np.ndarray:
    """A colour (3,) of mean 1."""
    values = np.exp(strength * rng.normal(size=3))
    return np.asarray(values / values.mean())


def _box(
    rng: np.random.Generator, u: np.ndarray, v: np.ndarray, low: float, high: float
) -> np.ndarray:
    """Whether u, v in [-1, 1] lie in a rectangle with sides of `low` to `high`."""
    middle, half = rng.uniform(-0.85, 0.85, 2), rng.uniform(low, high, 2) / 2
    return np.asarray((np.abs(u - middle[0]) < half[0]) & (np.abs(v - middle[1]) < half[1]))


def _wall(
    rng: np.random.Generator, u: np.ndarray, v: np.ndarray, colour: np.ndarray, window: bool
) -> np.ndarray:
    radiance = rng.uniform(0.5, 1.3) * colour * (1 + rng.uniform(0, 0.4) * v[:, None])
    for _ in range(int(rng.integers(0, 7))):  # pictures, shelves
        radiance[_box(rng, u, v, 0.1, 0.7)] = rng.uniform(0.03, 1) * _hue(rng, 0.5)
    for _ in range(int(rng.integers(0, 4))):  # furniture that stands on the floor
        middle, width, top = rng.uniform(-0.9, 0.9), rng.uniform(0.1, 0.5), rng.uniform(-0.7, 0.4)
        standing = (np.abs(u - middle) < width) & (v < top)
        radiance[standing] = rng.uniform(0.03, 0.6) * _hue(rng, 0.5)
    if rng.random() < 0.2:  # a door to a darker or brighter place
        door = (np.abs(u - rng.uniform(-0.8, 0.8)) < 0.2) & (v < 0.5)
        radiance[door] = np.exp(rng.normal(-1, 1)) * _hue(rng, 0.2)
    if window:
        _add_windows(rng, u, v, radiance, colour)
    return radiance


def _add_windows(
    rng: np.random.Generator, u: np.ndarray, v: np.ndarray, radiance: np.ndarray, colour: np.ndarray
) -> None:
    level, bars = np.exp(rng.uniform(np.log(4), np.log(60))), rng.uniform(0.15, 0.6)
    horizon, below = rng.uniform(-0.5, 0.2), rng.uniform(0.1, 0.6) * _hue(rng, 0.3)
    outside = level * np.where(v[:, None] > horizon, _hue(rng, 0.15), below)
    frame = (np.mod(u / bars, 1) < 0.1) | (np.mod(v / bars, 1) < 0.1)
    shown = np.where(frame[:, None], 0.5 * colour, outside)
    for _ in range(int(rng.integers(1, 4))):
        pane = _box(rng, u, v, 0.3, 1.2)
        radiance[pane] = shown[pane]


def _ceiling(rng: np.random.Generator, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    radiance = np.broadcast_to(rng.uniform(0.3, 1.2) * _hue(rng, 0.06), (*u.shape, 3)).copy()
    lamp = np.exp(rng.uniform(np.log(6), np.log(80))) * _hue(rng, 0.15)
    if rng.random() < 0.3:  # panels in rows, as in offices
        pitch, fill = rng.uniform(0.3, 0.8, 2), rng.uniform(0.2, 0.6, 2)
        on = (np.mod(u / pitch[0], 1) < fill[0]) & (np.mod(v / pitch[1], 1) < fill[1])
        radiance[on] = lamp
    else:
        for _ in range(int(rng.integers(0, 4))):
            radiance[_box(rng, u, v, 0.08, 0.6)] = lamp * rng.uniform(0.5, 1.5)
    return radiance


def _floor(rng: np.random.Generator, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    radiance = np.broadcast_to(rng.uniform(0.05, 0.6) * _hue(rng, 0.3), (*u.shape, 3)).copy()
    for _ in range(int(rng.integers(0, 5))):  # rugs, the light of a window, objects
        radiance[_box(rng, u, v, 0.2, 1.0)] = np.exp(rng.normal(-1, 0.9)) * _hue(rng, 0.4)
    return radiance


def _clouds(rng: np.random.Generator, toward: np.ndarray) -> np.ndarray:
    """Sums of waves on a plane overhead, of mean 0 and deviation about 1/2."""
    plane = toward[..., (0, 2)] / np.maximum(toward[..., 1:2], 0.08)
    waves = np.zeros(toward.shape[:2])
    for octave in range(24):
        wave = rng.normal(size=2) * 2 ** (octave / 8)
        waves += np.sin(plane @ wave + rng.uniform(0, 2 * np.pi)) * 2 ** (-octave / 12)
    return np.asarray(waves / 4)


def _sun(rng: np.random.Generator, toward: np.ndarray, evening: float) -> np.ndarray:
    turn, up = rng.uniform(0, 2 * np.pi), rng.uniform(0.05, 0.3) if evening else rng.uniform(0.3, 1)
    flat = np.sqrt(1 - up * up)
    cosine = toward @ np.array([flat * np.sin(turn), up, flat * np.cos(turn)])
    wide = np.radians(rng.uniform(1.5, 5))
    power = rng.uniform(0.5, 4) / (2 * np.pi * (1 - np.cos(wide)))
    glow = rng.uniform(0, 2) * np.exp(-(1 - cosine) / rng.uniform(0.01, 0.08))
    colour = np.array([1.0, 0.95, 0.85]) ** (1 + 5 * evening)
    return np.asarray((power * (cosine > np.cos(wide)) + glow)[..., None] * colour)


def _skyline(rng: np.random.Generator, toward: np.ndarray, sky: np.ndarray) -> np.ndarray:
    """The sky behind houses or trees."""
    columns = toward.shape[1]
    profile = rng.uniform(-0.1, 0.25) + rng.uniform(0, 0.25) * rng.standard_normal(columns)
    if rng.random() < 0.5:
        wide = int(rng.integers(4, 24))
        profile = np.repeat(profile[: -(-columns // wide)], wide)[:columns]
    else:
        profile = gaussian_filter1d(profile * 2, rng.uniform(1, 8), mode="wrap")
    near = rng.uniform(0.03, 0.6) * _hue(rng, 0.35)
    shade = np.exp(0.5 * gaussian_filter1d(rng.standard_normal(columns), 2, mode="wrap"))
    there = (toward[..., 1] < profile)[..., None]
    return np.where(there, near * shade[None, :, None], sky)


def _ground(rng: np.random.Generator, up: np.ndarray) -> np.ndarray:
    ground = rng.uniform(0.05, 0.7) * _hue(rng, 0.3)
    return np.asarray(ground * (1 + rng.uniform(-0.4, 0.4) * up[..., None]))


def _softbox(rng: np.random.Generator, toward: np.ndarray) -> np.ndarray:
    """The share of a lamp's radiance (rows, 2 rows): a rectangle, strip or disc, some fading."""
    forward = rng.normal(size=3) + (0, 0.4, 0.4)
    forward /= np.linalg.norm(forward)
    right = np.cross(rng.normal(size=3) * 0.2 + (0, 1, 0), forward)
    right /= np.linalg.norm(right)
    depth = toward @ forward
    before = depth > 0.05
    x, y = (toward @ a / np.where(before, depth, 1) for a in (right, np.cross(forward, right)))
    half = np.exp(rng.uniform(np.log(0.05), np.log(0.7), 2))
    if rng.random() < 0.3:
        distance = np.hypot(x, y) / half[0]
    else:
        distance = np.maximum(np.abs(x) / half[0], np.abs(y) / half[1])
    fading = rng.uniform(0, 0.8) * float(rng.random() < 0.5)
    return np.where(before & (distance < 1), 1 - fading * np.clip(distance, 0, 1) ** 2, 0)
