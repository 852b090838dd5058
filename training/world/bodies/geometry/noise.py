"""Smooth random functions of space, for displacement.

Equation: `noise` is a periodic cubic spline through random values on a 16 x 16 x 16 lattice, read
at places turned and shifted at random. `fractal` adds octaves, each of twice the frequency and
`gain` times the amplitude. `cells` is the distance to the nearest of random points and the gap to
the second nearest. `facets` is linear within the six tetrahedra of each cube of a lattice with
random values (Kuhn's triangulation: from the cube's low corner, along the axes in the order of the
coordinates), read at warped places: facets and sharp creases.

Citation: K. Perlin 1985, doi:10.1145/325165.325247; S. Worley 1996, doi:10.1145/237170.237267.

Limits: the lattice repeats after 16 / frequency units.
"""

import numpy as np
from scipy.ndimage import map_coordinates, spline_filter
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

_LATTICE = 16
_WARP = 0.3  # of facets, in their size: without it they repeat
_VALUES = 1.8  # deviation of the lattice's values; that of the spline between them is about 1.5


def noise(points: np.ndarray, frequency: float, rng: np.random.Generator) -> np.ndarray:
    """Return smooth noise at points.

    Parameters
    ----------
    points : (N, 3) ndarray
        Places.
    frequency : float
        Values of the lattice a unit of length.
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    (N,) ndarray
        Mean 0, deviation about 1.5.
    """
    lattice = rng.normal(0, _VALUES, (_LATTICE,) * 3)
    coefficients = spline_filter(lattice, mode="grid-wrap")
    turn = Rotation.random(random_state=int(rng.integers(2**31))).as_matrix()
    places = (points * frequency) @ turn.T + rng.uniform(0, _LATTICE, 3)
    return np.asarray(map_coordinates(coefficients, places.T, mode="grid-wrap", prefilter=False))


def fractal(
    points: np.ndarray, frequency: float, octaves: int, gain: float, rng: np.random.Generator
) -> np.ndarray:
    """Return noise of several scales at points.

    Parameters
    ----------
    points : (N, 3) ndarray
        Places.
    frequency : float
        Of the first octave.
    octaves : int
        Number of octaves.
    gain : float
        Amplitude of an octave relative to the one before.
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    (N,) ndarray
        Mean 0; the first octave has a deviation of about 1.5.
    """
    total = np.zeros(len(points))
    for k in range(octaves):
        total += gain**k * noise(points, frequency * 2**k, rng)
    return total


def cells(
    points: np.ndarray, spacing: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return distances to random points on a jittered lattice.

    Parameters
    ----------
    points : (N, 3) ndarray
        Places.
    spacing : float
        Of the lattice; at least a sixtieth of the places' extent.
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    nearest, gap : (N,) ndarray
        Distance to the nearest point, and how much farther the second nearest is; over `spacing`.
    """
    low, count = points.min(0) - spacing, np.ceil(np.ptp(points, axis=0) / spacing).astype(int) + 2
    corners = np.stack(np.meshgrid(*(np.arange(n) for n in count), indexing="ij"), -1)
    seeds = low + spacing * (corners.reshape(-1, 3) + rng.random((corners[..., 0].size, 3)))
    distance, _ = cKDTree(seeds).query(points, k=2)
    return distance[:, 0] / spacing, (distance[:, 1] - distance[:, 0]) / spacing


def facets(points: np.ndarray, spacing: float, rng: np.random.Generator) -> np.ndarray:
    """Return piecewise linear noise.

    Parameters
    ----------
    points : (N, 3) ndarray
        Places.
    spacing : float
        Size of the facets.
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    (N,) ndarray
        Mean 0; deviation 1 at the corners of the facets.
    """
    lattice = rng.normal(size=(_LATTICE,) * 3)
    turn = Rotation.random(random_state=int(rng.integers(2**31))).as_matrix()
    places = points / spacing
    warp = [_WARP * noise(places, 0.7, rng) for _ in range(3)]
    places = (places + np.stack(warp, -1)) @ turn.T + rng.uniform(0, _LATTICE, 3)
    corner = np.floor(places).astype(int)
    order = np.argsort(corner - places, axis=1)  # the axes, the largest remainder first
    rest = np.take_along_axis(places - corner, order, 1)
    value = lattice[tuple(corner.T % _LATTICE)]
    total = value * (1 - rest[:, 0])
    for k in range(3):
        corner[np.arange(len(corner)), order[:, k]] += 1
        weight = rest[:, k] - (rest[:, k + 1] if k < 2 else 0)
        total += weight * lattice[tuple(corner.T % _LATTICE)]
    return np.asarray(total)
