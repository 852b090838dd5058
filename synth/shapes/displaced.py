"""Displaced spheres: pebbles, potatoes, pumpkins, dented and crumpled balls.

Equation: the radius in the direction d is exp(h(d)), h a sum of smooth random functions, of creases
-|f|, and of ribs.

Citation: R. L. Cook, "Shade trees", Computer Graphics 18(3) (1984), doi:10.1145/800031.808602
(displacement).

Limits: star-shaped: nothing overhangs as seen from the centre. Normals are those of the mesh.
"""

import numpy as np

from ..scene.meshes import Mesh, vertex_normals
from .fields import ridged, smooth_field
from .posing import posed
from .sphere_grid import sphere_grid
from .texture_coordinates import from_directions

STYLES = ("gentle", "lumpy", "dented", "crumpled", "wrinkled", "ribbed")


def displaced(rng: np.random.Generator) -> Mesh:
    """Make a displaced sphere of a random style, posed.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    Mesh
        Centred; the larger extent in the picture is 2 object units.
    """
    directions, faces = sphere_grid()
    height = displacement(directions, rng, str(rng.choice(STYLES)))
    vertices = directions * np.exp(height)[:, None] * (1, rng.uniform(0.75, 1.1), 1)
    return posed(
        Mesh(vertices, vertex_normals(vertices, faces), from_directions(directions), faces),
        rng,
        (5, 30),
        30,
        10,
    )


def displacement(directions: np.ndarray, rng: np.random.Generator, style: str) -> np.ndarray:
    """Return the logarithm of the radius in some directions.

    Parameters
    ----------
    directions : (N, 3) ndarray
        Unit directions.
    rng : numpy.random.Generator
        Random numbers.
    style : str
        One of `STYLES`.

    Returns
    -------
    (N,) ndarray
        log(radius).
    """
    broad = 0.1 * smooth_field(directions, rng, 0.25)
    if style == "gentle":
        return broad + rng.uniform(0.06, 0.14) * smooth_field(
            directions, rng, rng.uniform(0.3, 0.5)
        )
    if style == "lumpy":
        return broad + rng.uniform(0.035, 0.07) * smooth_field(
            directions, rng, rng.uniform(0.7, 1.3)
        )
    if style == "dented":
        return broad + _dents(directions, rng, int(rng.integers(6, 25)))
    if style == "crumpled":
        scales = rng.uniform(0.35, 0.5) * 1.6 ** np.arange(4)
        return 0.6 * broad + sum(
            0.05 / (1 + i) * ridged(smooth_field(directions, rng, f), 6)
            for i, f in enumerate(scales)
        )
    if style == "wrinkled":
        warp = directions + 0.12 * np.stack(
            [smooth_field(directions, rng, 0.6) for _ in range(3)], -1
        )
        stretched = warp * np.where(np.arange(3) == rng.integers(3), 2.5, 0.7)
        return (
            broad
            + 0.018 * smooth_field(stretched, rng, 1.1)
            + 0.03 * ridged(smooth_field(warp, rng, 0.5), 5)
        )
    return 0.4 * broad + _ribs(directions, rng)


def _dents(directions: np.ndarray, rng: np.random.Generator, count: int) -> np.ndarray:
    """Round hollows, each a Gaussian of its own width."""
    places = rng.normal(size=(count, 3))
    places /= np.linalg.norm(places, axis=1, keepdims=True)
    width = rng.uniform(0.12, 0.3, count)
    bells = np.exp((directions @ places.T - 1) / width**2)
    return -(bells * (0.35 * width * rng.uniform(0.3, 1, count))).sum(1)


def _ribs(directions: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Ribs from pole to pole with a hollow at both ends, as on a pumpkin."""
    count, depth = int(rng.integers(5, 13)), rng.uniform(0.03, 0.08)
    x, y, z = directions.T
    belly = np.hypot(x, z)
    turn = np.arctan2(x, z) + rng.uniform(0, np.pi) + 0.15 * smooth_field(directions, rng, 0.3)
    ribs = np.hypot(np.cos(count / 2 * turn), 0.2) - 1
    return depth * ribs * belly**2 / (belly**2 + 0.05) - rng.uniform(0.1, 0.35) * np.exp(
        -((belly / 0.35) ** 2)
    ) * np.abs(y)
