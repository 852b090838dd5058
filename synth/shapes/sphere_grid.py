"""A sphere without poles: the six sides of a cube, each a square grid, projected outward. All
star-shaped surfaces are built on it.

Equation: a side's coordinate t in [-1, 1] becomes tan(pi / 4 t) before the point is normalised, so
that cells are nearly equal.

Citation: C. Ronchi, R. Iacono, P. S. Paolucci, "The cubed sphere", Journal of Computational Physics
124 (1996), doi:10.1006/jcph.1996.0047.

Limits: cells at the cube's corners are half as large as in the middle of a side.
"""

from functools import cache

import numpy as np

# Along a side: 130 thousand triangles of about 3 pixels if the object is 480 pixels wide.
CELLS = 104


@cache
def sphere_grid(cells: int = CELLS) -> tuple[np.ndarray, np.ndarray]:
    """Return the grid. The arrays are shared and read-only.

    Parameters
    ----------
    cells : int, optional
        Cells along a side of the cube.

    Returns
    -------
    vertices : (N, 3) ndarray
        Unit vectors, each only once.
    faces : (M, 3) ndarray
        Triangles, counter-clockwise from outside; closed.
    """
    steps = np.arange(cells + 1)
    number = np.full((cells + 1,) * 3, -1)
    for axis in range(3):
        for side in (0, cells):
            number[(slice(None),) * axis + (side,)] = 0
    surface = np.argwhere(number == 0)
    number[tuple(surface.T)] = np.arange(len(surface))
    places = np.tan(np.pi / 4 * (2 * steps / cells - 1))[surface]
    vertices = places / np.linalg.norm(places, axis=1, keepdims=True)
    faces = np.concatenate([_side(number, axis, side) for axis in range(3) for side in (0, cells)])
    vertices.flags.writeable = faces.flags.writeable = False
    return vertices, faces


def _side(number: np.ndarray, axis: int, side: int) -> np.ndarray:
    """The triangles of one side of the cube."""
    grid = np.take(number, side, axis)
    grid = grid if (side > 0) == (axis != 1) else grid.T
    a, b, c, d = (
        grid[:-1, :-1].ravel(),
        grid[1:, :-1].ravel(),
        grid[1:, 1:].ravel(),
        grid[:-1, 1:].ravel(),
    )
    return np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
