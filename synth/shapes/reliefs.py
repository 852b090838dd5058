"""Random height fields as closed slabs: crumpled paper, folded cloth, carved reliefs, quilts.

Equation: paper, sums of |triangle waves| in random directions, bent by a smooth field; cloth, waves
whose phase a smooth field bends; relief, smooth steps at level sets of a smooth field on a slightly
domed plate; quilt, cushions |sin u sin v|^(1/2), rounded at their seams.

Citation: see `synth.shapes.fields`; K. Perlin, "An image synthesizer", Computer Graphics 19(3)
(1985), doi:10.1145/325165.325247 (phase bent by noise).

Limits: sheets do not overhang; the back repeats the front, `_THICKNESS` behind it.
"""

import numpy as np
from scipy.ndimage import gaussian_filter

from ..scene.meshes import Mesh, grid_faces, vertex_normals
from .fields import smooth_field
from .posing import posed

_CELLS = 180
_THICKNESS = 0.04
STYLES = ("paper", "cloth", "relief", "quilt")


def relief(rng: np.random.Generator) -> Mesh:
    """Make a relief of a random style, posed nearly upright before the viewer.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    Mesh
        Centred; the larger extent in the picture is 2 object units.
    """
    x, y = np.meshgrid(
        np.linspace(-1, 1, _CELLS + 1), np.linspace(1, -1, _CELLS + 1) * rng.uniform(0.65, 1)
    )
    place = np.stack([x, y], -1)
    style = str(rng.choice(STYLES))
    height = relief_height(place, rng, style)
    if style in ("paper", "cloth"):  # soft sheets have no straight edges
        place = place + 0.04 * np.stack([smooth_field(place, rng, 0.5) for _ in range(2)], -1)
    return posed(slab(place, height), rng, (-20, 20), 25, 8)


def relief_height(place: np.ndarray, rng: np.random.Generator, style: str) -> np.ndarray:
    """Return the heights of a random relief.

    Parameters
    ----------
    place : (H, W, 2) ndarray
        Positions in [-1, 1]^2.
    rng : numpy.random.Generator
        Random numbers.
    style : str
        One of `STYLES`.

    Returns
    -------
    (H, W) ndarray
        Heights toward the viewer.
    """
    bend = np.stack([smooth_field(place, rng, 0.35) for _ in range(2)], -1)
    low = 0.1 * smooth_field(place, rng, 0.25)
    if style == "paper":
        return low + _creases(place + 0.12 * bend, rng)
    if style == "cloth":
        return low + _folds(place + 0.1 * bend, rng)
    dome = -rng.uniform(0.05, 0.2) * (place**2).sum(-1)
    if style == "quilt":
        turn, count = rng.uniform(0, np.pi), rng.uniform(1.5, 3) * np.pi
        u, v = (
            np.cos(turn + a) * place[..., 0] + np.sin(turn + a) * place[..., 1]
            for a in (0, np.pi / 2)
        )
        waves = (np.sin(count * u) ** 2 + 0.03) * (np.sin(count * v) ** 2 + 0.03)
        return dome + rng.uniform(0.3, 0.7) / count * waves**0.25 + 0.3 * low
    level = smooth_field(place, rng, rng.uniform(0.5, 0.9))
    steps = sum(np.tanh((level - at) * 7) for at in rng.uniform(-1, 1, int(rng.integers(1, 4))))
    return dome + rng.uniform(0.03, 0.06) * steps + 0.02 * level


def _creases(place: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Facets between straight creases, their edges rounded within a cell or two."""
    height = np.zeros(place.shape[:-1])
    for turn, frequency in zip(rng.uniform(0, np.pi, 9), rng.uniform(0.35, 1.1, 9), strict=True):
        along = (
            place[..., 0] * np.cos(turn) + place[..., 1] * np.sin(turn)
        ) * frequency + rng.uniform()
        height += 0.12 / frequency * np.abs(along - np.round(along))
    return gaussian_filter(height, rng.uniform(1, 3))


def _folds(place: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Long waves in about one direction, with finer ones on top."""
    turn = rng.uniform(0, np.pi)
    along = place[..., 0] * np.cos(turn) + place[..., 1] * np.sin(turn)
    height = np.zeros(along.shape)
    for octave in range(3):
        frequency = rng.uniform(0.8, 1.4) * 2**octave
        phase = 2 * np.pi * frequency * along + 2 * smooth_field(place, rng, 0.25)
        strong = 1 / (1 + np.exp(-2 * smooth_field(place, rng, 0.4)))
        height += 0.09 / 2**octave * np.sin(phase) * strong
    return height


def slab(place: np.ndarray, height: np.ndarray) -> Mesh:
    """Make a closed slab from a height field.

    Parameters
    ----------
    place : (H, W, 2) ndarray
        Positions; rows run down, columns to the right.
    height : (H, W) ndarray
        Heights of the front; the back is parallel to it.

    Returns
    -------
    Mesh
        The slab.
    """
    rows, columns = height.shape
    front = np.concatenate([place, height[..., None]], -1).reshape(-1, 3)
    faces = grid_faces(rows, columns)
    number = np.arange(rows * columns).reshape(rows, columns)
    rim = np.concatenate([number[:-1, 0], number[-1, :-1], number[:0:-1, -1], number[0, :0:-1]])
    after, back = np.roll(rim, -1), rows * columns
    low = rim + back
    walls = np.concatenate(
        [np.stack([rim, low, after], -1), np.stack([after, low, np.roll(low, -1)], -1)]
    )
    every = np.concatenate([faces, faces[:, ::-1] + back, walls])
    vertices = np.concatenate([front, front - (0, 0, _THICKNESS)])
    # The walls have their own vertices, to keep the front's edge sharp.
    own = np.concatenate([rim, low])
    lookup = np.zeros(len(vertices), int)
    lookup[own] = np.arange(len(own)) + len(vertices)
    every[-len(walls) :] = lookup[walls]
    vertices = np.concatenate([vertices, vertices[own]])
    low_uv, high_uv = place.reshape(-1, 2).min(0), place.reshape(-1, 2).max(0)
    uv = 0.5 + (vertices[:, :2] - (low_uv + high_uv) / 2) / (high_uv - low_uv).max() * (1, -1)
    return Mesh(vertices, vertex_normals(vertices, every), np.clip(uv, 0, 1), every)
