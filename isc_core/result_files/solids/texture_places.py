"""Texture coordinates of a rounded back, which the photo does not show.

Problem: seen along the view, the sides of a body are a fraction of a pixel wide. With the texture
of the pixels in front of them they are streaks.

Equation: the texture folds at the outermost pixels and runs back inside. With u the membrane whose
root is the depth (`body`), and c = -d^2 u / dg^2 along its gradient g, limited to 2 (a ball) to 4
(a bar), a point is r = |g| / c pixels from the axis, on an ellipse of half widths

    a = sqrt(2 u / c + r^2)  across,   b = sqrt(c / 2) a  in depth.

It takes its texture from the place that is as far from the axis as its angle on the ellipse says:

    r' = a phi / (90 deg + e),   tan phi = r / sqrt(2 u / c),   sin e = sqrt(2 / a),

where phi is 90 deg on the outline, and e more at the outermost pixels, which are one pixel from
where u ends. On a ball this is the azimuthal equidistant projection of the back.

Citation: J. P. Snyder, "Map projections: a working manual", U.S. Geological Survey Professional
Paper 1395 (1987), doi:10.3133/pp1395, section 25.

Limits: exact for ellipsoids of revolution and bars only. In the middle of the back the texture is
1.6 times as large as in the photo, and what the photo shows comes back as its mirror image. Sides
that are steep in front of the outline keep the photo's pixels. In narrow notches texture may come
from a pixel or two outside.
"""

import numpy as np

from .smoothing import smoothed_within, surrounded

_BALL, _BAR = 2.0, 4.0  # -d^2 u / dg^2
_THINNEST = 3.0  # pixels: the least a that e is taken for
_SMOOTH = 6  # passes


def folded_places(
    u: np.ndarray, places: np.ndarray, pixels: np.ndarray, outline: np.ndarray
) -> np.ndarray:
    """Return where vertices behind the visible pixels take their texture from.

    Parameters
    ----------
    u : (H, W) ndarray
        The membrane, 0 outside of the body.
    places : (V, 2) ndarray
        Row and column of each vertex.
    pixels : (V, 2) ndarray of int
        The nearest pixel inside.
    outline : (V,) bool ndarray
        Vertices of the outline; the others lie on the back.

    Returns
    -------
    (V, 2) ndarray
        Row and column.
    """
    rows, columns = pixels.T
    toward, bend = (plane[rows, columns] for plane in _axis(u))
    radius = np.hypot(*toward.T)
    across = np.sqrt(2 * u[rows, columns] / bend + radius**2)
    depth = np.where(outline, 0, np.sqrt(2 * u[rows, columns] / bend))
    angle = np.pi / 2 + np.arcsin(np.sqrt(2 / np.maximum(across, _THINNEST)))
    folded = across * np.arctan2(radius, depth) / angle
    share = np.where(radius > 1e-9, 1 - folded / np.maximum(radius, 1e-9), 0)
    return np.asarray(places + share[:, None] * toward)


def _axis(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """From each pixel to the axis, (H, W, 2), and the limited bend c, (H, W).

    Derivatives are those of pixels with all neighbours inside; smoothed, and continued to the rest.
    """
    at = np.pad(u, 1)

    def near(down: int, right: int) -> np.ndarray:
        return np.asarray(at[1 + down : len(at) - 1 + down, 1 + right : at.shape[1] - 1 + right])

    sides = [near(*side) for side in ((1, 0), (-1, 0), (0, 1), (0, -1))]
    down, right = (sides[0] - sides[1]) / 2, (sides[2] - sides[3]) / 2
    twist = (near(1, 1) - near(1, -1) - near(-1, 1) + near(-1, -1)) / 4
    along = (
        down**2 * (sides[0] + sides[1] - 2 * u)
        + 2 * down * right * twist
        + right**2 * (sides[2] + sides[3] - 2 * u)
    )
    known = surrounded(u > 0)
    down, right, along, square = smoothed_within(
        (down, right, along, down**2 + right**2), known, _SMOOTH
    )
    bend = np.clip(-along / np.maximum(square, 1e-9), _BALL, _BAR)
    return np.stack([down, right], -1) / bend[..., None], bend
