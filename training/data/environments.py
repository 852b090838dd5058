"""Procedural environment maps, detailed enough for mirror reflections.

Equation: radiance (rows, 2 rows, 3) in the layout of `isc_core.shading.environment_map`; 1 is about
the radiance of a white wall. A room is a box around the object: every direction meets a wall, whose
reflectance and pictures are rectangles. Outdoors, the sky brightens toward the horizon; below it
lie houses or trees and the ground. A studio is a dark backdrop with softboxes. Clutter follows the
dead-leaves model: discs and rectangles of all sizes, their number falling as size^-2, each in front
of the last, which gives the statistics of natural images.

Citation: A. B. Lee, D. Mumford, J. Huang, "Occlusion models for natural images", IJCV 41 (2001),
doi:10.1023/A:1011109015675.

Limits: no parallax: the content of a room is painted on its walls.
"""

import numpy as np
from scipy.ndimage import gaussian_filter, gaussian_filter1d

from isc_core.shading.environment_map import directions
from synth.albedos.fields import fractal_noise, smooth_noise

ENVIRONMENTS = ("room", "outdoors", "studio", "clutter")
ROWS = 128
_TEXELS = 256


def make_environment(name: str, rng: np.random.Generator) -> np.ndarray:
    """Draw an environment map.

    Parameters
    ----------
    name : str
        One of `ENVIRONMENTS`.
    rng : np.random.Generator
        Draws the layout and colours.

    Returns
    -------
    (ROWS, 2 ROWS, 3) ndarray
        Radiance, float32, > 0.
    """
    radiance = {"room": _room, "outdoors": _outdoors, "studio": _studio, "clutter": _clutter}[name](
        rng, directions(ROWS)
    )
    return np.maximum(radiance, 1e-3).astype(np.float32)


def _texture(rng: np.random.Generator, u: np.ndarray, v: np.ndarray, contrast: float) -> np.ndarray:
    """A factor around 1 at u, v (texture units, any shape): clouds, grain, tiles or boards."""
    kind = rng.integers(4)
    if kind < 2:
        field = fractal_noise(rng, _TEXELS, 3.0) if kind else smooth_noise(rng, _TEXELS, 8)
    else:
        cells = np.floor(
            np.stack(
                np.meshgrid(
                    np.arange(_TEXELS) / 32, np.arange(_TEXELS) / (32 if kind == 2 else 128)
                )
            )
        )
        field = (
            np.where((cells.sum(0) % 2) > 0, 1.0, -1.0)
            if rng.random() < 0.5
            else rng.standard_normal((8, 8))[tuple(cells.astype(int))]
        )
    rows, columns = (np.mod(np.floor(place * _TEXELS).astype(int), _TEXELS) for place in (v, u))
    return np.exp(contrast * field)[rows, columns][..., None]


def _colour(rng: np.random.Generator, strength: float) -> np.ndarray:
    """A colour (3,) of mean 1; `strength` 0 is grey, 1 any colour."""
    values = np.exp(strength * rng.normal(0, 1, 3))
    return values / values.mean()


def _rectangles(
    rng: np.random.Generator, u: np.ndarray, v: np.ndarray, count: int, low: float, high: float
) -> list[np.ndarray]:
    """Masks of `count` rectangles in [-1, 1]^2, with sides from `low` to `high`."""
    found = []
    for _ in range(count):
        middle, half = rng.uniform(-0.8, 0.8, 2), rng.uniform(low, high, 2) / 2
        found.append((np.abs(u - middle[0]) < half[0]) & (np.abs(v - middle[1]) < half[1]))
    return found


def _room(rng: np.random.Generator, toward: np.ndarray) -> np.ndarray:
    half = rng.uniform([1.2, 0.8, 1.2], [4, 1.8, 4])
    eye = rng.uniform(-0.6, 0.6, 3) * half
    steps = (np.sign(toward) * half - eye) / np.where(np.abs(toward) < 1e-9, 1e-9, toward)
    axis = steps.argmin(-1)
    place = (eye + toward * steps.min(-1)[..., None]) / half
    out = np.zeros(toward.shape)
    window_walls = rng.permutation([(0, -1), (0, 1), (2, -1), (2, 1)])[
        : rng.integers(1, 3)
    ].tolist()
    wall_colour = rng.uniform(0.2, 0.9) * _colour(rng, 0.15)
    for k in range(3):
        for side in (-1, 1):
            on = (axis == k) & (place[..., k] * side > 0)
            u, v = (place[on][:, j] for j in range(3) if j != k)
            if k == 0:
                u, v = v, u
            if k == 1:
                out[on] = _ceiling(rng, u, v) if side > 0 else _floor(rng, u, v)
            else:
                out[on] = _wall(rng, u, v, wall_colour, [k, side] in window_walls)
    return out


def _ceiling(rng: np.random.Generator, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    out = np.broadcast_to(rng.uniform(0.4, 1.2) * _colour(rng, 0.05), (*u.shape, 3)).copy()
    count = rng.integers(0, 4)
    for panel in _rectangles(rng, u, v, count, 0.1, 0.5):
        out[panel] = np.exp(rng.uniform(np.log(8), np.log(60))) * _colour(rng, 0.15)
    return out


def _floor(rng: np.random.Generator, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    out = rng.uniform(0.1, 0.6) * _colour(rng, 0.3) * _texture(rng, u, v, rng.uniform(0.05, 0.5))
    for thing in _rectangles(rng, u, v, rng.integers(0, 4), 0.2, 0.9):
        out[thing] = rng.uniform(0.05, 0.8) * _colour(rng, 0.5)
    return out


def _wall(
    rng: np.random.Generator, u: np.ndarray, v: np.ndarray, colour: np.ndarray, windows: bool
) -> np.ndarray:
    out = (
        rng.uniform(0.6, 1.2)
        * colour
        * _texture(rng, u, v, rng.uniform(0, 0.1))
        * (1 + 0.2 * v[:, None])
    )
    for thing in _rectangles(rng, u, v, rng.integers(1, 8), 0.1, 0.6):
        out[thing] = (
            rng.uniform(0.05, 1.0)
            * _colour(rng, 0.5)
            * _texture(rng, 2 * u, 2 * v, rng.uniform(0, 0.5))
        )[thing]
    for _ in range(int(rng.integers(0, 4))):  # furniture
        middle, width, top = rng.uniform(-0.9, 0.9), rng.uniform(0.1, 0.5), rng.uniform(-0.7, 0.3)
        out[(np.abs(u - middle) < width) & (v < top)] = rng.uniform(0.05, 0.5) * _colour(rng, 0.4)
    if windows:
        bars, level = rng.uniform(0.1, 0.4), np.exp(rng.uniform(np.log(4), np.log(40)))
        for pane in _rectangles(rng, u, v, rng.integers(1, 4), 0.3, 0.9):
            sky = (
                level
                * _colour(rng, 0.1)
                * np.where(v > rng.uniform(-0.4, 0.2), 1.0, rng.uniform(0.1, 0.6))[:, None]
            )
            frame = (np.mod(u / bars, 1) < 0.08) | (np.mod(v / bars, 1) < 0.08)
            out[pane] = np.where(frame[:, None], 0.4 * colour, sky)[pane]
    return out


def _outdoors(rng: np.random.Generator, toward: np.ndarray) -> np.ndarray:
    columns = toward.shape[1]
    height, turn = toward[..., 1], np.arange(columns)
    overcast = rng.random() < 0.4
    zenith = (
        np.array([1.0, 1.0, 1.05])
        if overcast
        else np.array([0.25, 0.5, 1.1]) * rng.uniform(0.7, 1.4)
    )
    horizon = rng.uniform(0.8, 1.6) * (
        np.ones(3) if rng.random() < 0.7 else np.array([1.5, 0.9, 0.5])
    )
    share = np.clip(height, 0, 1)[..., None] ** rng.uniform(0.3, 0.8)
    sky = horizon * (1 - share) + zenith * share
    clouds = np.clip(_texture_of_sky(rng, toward) - rng.uniform(-0.5, 1.5), 0, 1)[..., None]
    sky = sky * (1 - clouds) + rng.uniform(0.8, 1.6) * clouds
    if not overcast or rng.random() < 0.3:
        sky = _with_sun(rng, sky, toward)
    profile = rng.uniform(0, 0.25) + 0.1 * rng.standard_normal(columns)
    blocky = rng.random() < 0.5
    profile = (
        np.repeat(profile[::12], 12)[:columns]
        if blocky
        else gaussian_filter1d(profile, rng.uniform(1, 4), mode="wrap")
    )
    near = (
        rng.uniform(0.05, 0.4)
        * _colour(rng, 0.3)
        * _texture(rng, turn[None] / 40 + 0 * height, height, rng.uniform(0.1, 0.8))
    )
    flat = toward / np.minimum(height, -0.02)[..., None] / 4
    ground = (
        rng.uniform(0.1, 0.6)
        * _colour(rng, 0.3)
        * _texture(rng, flat[..., 0], flat[..., 2], rng.uniform(0.1, 0.5))
    )
    return np.where(
        (height < 0)[..., None], ground, np.where((height < profile[None])[..., None], near, sky)
    )


def _texture_of_sky(rng: np.random.Generator, toward: np.ndarray) -> np.ndarray:
    field = fractal_noise(rng, _TEXELS, 2.5)
    up = np.maximum(toward[..., 1], 0.05)
    rows, columns = (np.mod((toward[..., k] / up * 20).astype(int), _TEXELS) for k in (0, 2))
    return field[rows, columns]


def _with_sun(rng: np.random.Generator, sky: np.ndarray, toward: np.ndarray) -> np.ndarray:
    place = rng.normal(size=3) * (1, 0, 1) + (0, rng.uniform(0.3, 2), 0)
    place /= np.linalg.norm(place)
    wide = np.radians(rng.uniform(2, 5))
    power = rng.uniform(1, 5) / (2 * np.pi * (1 - np.cos(wide)))
    disc = (toward @ place > np.cos(wide))[..., None]
    glow = np.exp(-(1 - toward @ place) / 0.03)[..., None]
    return np.asarray(sky * (1 + glow) + disc * power * np.array([1.0, 0.95, 0.85]))


def _studio(rng: np.random.Generator, toward: np.ndarray) -> np.ndarray:
    height = toward[..., 1:2]
    out = (
        np.exp(rng.uniform(np.log(0.02), np.log(0.6)))
        * (1 + rng.uniform(0, 0.9) * height)
        * _colour(rng, 0.05)
    )
    if rng.random() < 0.6:  # a table
        table = rng.uniform(0.05, 0.8) * _colour(rng, 0.15)
        out = np.where(height < rng.uniform(-0.5, -0.1), table, out)
    for _ in range(int(rng.integers(2, 6))):
        forward = rng.normal(size=3) + (0, 0.3, 0.5)
        forward /= np.linalg.norm(forward)
        before, x, y = _on_plane(toward, forward, np.cross((0, 1, 0), forward))
        if rng.random() < 0.4:
            lit = before & (np.hypot(x, y) < rng.uniform(0.05, 0.5))
        else:
            lit = (
                before & (np.abs(x) < rng.uniform(0.05, 0.6)) & (np.abs(y) < rng.uniform(0.05, 0.6))
            )
        out = np.where(
            lit[..., None], np.exp(rng.uniform(np.log(2), np.log(40))) * _colour(rng, 0.05), out
        )
    return out


def _on_plane(
    toward: np.ndarray, forward: np.ndarray, across: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where directions (..., 3) meet the plane at distance 1 along the unit vector `forward`.

    Returns whether they do, and the coordinates there, x along `across`.
    """
    across = across / np.linalg.norm(across)
    depth = toward @ forward
    before = depth > 0.05
    x, y = (
        toward @ axis / np.where(before, depth, np.inf)
        for axis in (across, np.cross(forward, across))
    )
    return before, x, y


def _clutter(rng: np.random.Generator, toward: np.ndarray) -> np.ndarray:
    """Dead leaves, brighter above or below; some of them emit."""
    palette = rng.uniform(0.03, 1, (6, 3)) ** rng.uniform(0.8, 2)
    saturated = rng.uniform(0.05, 0.5)
    palette = (saturated * palette + (1 - saturated) * palette.mean(1, keepdims=True)) * np.exp(
        rng.normal(0, 0.15, 3)
    )
    out = palette[0] * np.ones(toward.shape)
    height, level = toward[..., 1:2], np.exp(rng.uniform(-0.5, 1.5))
    for size in np.sort(0.03 * rng.pareto(1.0, int(rng.integers(150, 500))) + 0.03)[::-1]:
        middle = rng.normal(size=3)
        middle /= np.linalg.norm(middle)
        before, x, y = _on_plane(toward, middle, np.cross(middle, rng.normal(size=3)))
        there = (
            (np.hypot(x, y) < size)
            if rng.random() < 0.5
            else (np.abs(x) < size) & (np.abs(y) < size * rng.uniform(0.2, 1))
        )
        colour = palette[rng.integers(6)] * np.exp(rng.normal(0, 0.25) + rng.normal(0, 0.07, 3))
        ends = (
            colour
            * (30 if size < 0.2 and rng.random() < 0.02 else 1)
            * rng.uniform(0.6, 1.4, 2)[:, None]
        )
        shade = np.clip(0.5 + x / (2 * size), 0, 1)[..., None]
        out = np.where((before & there)[..., None], ends[0] * shade + ends[1] * (1 - shade), out)
    return np.asarray(
        gaussian_filter(
            out * level**height,
            (rng.uniform(0, 1.2),) * 2 + (0,),
            mode=("nearest", "wrap", "nearest"),
        )
    )
