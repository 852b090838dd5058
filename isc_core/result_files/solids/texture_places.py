"""Texture coordinates of a rounded back, which the photo does not show.

Problem: seen along the view, the sides of a body are a fraction of a pixel wide. With the texture
of the pixels in front of them they are streaks.

Equation: the texture folds at the outermost pixels and runs back inside. On the ellipse across the
outline, of half width a (see `cross_section`), a point r pixels from the axis takes its texture
from r' pixels, as far as its angle on the ellipse says:

    r' = a (w x + (1 - w) sin(90 deg x)),   x = phi / (90 deg + e),   sin e = sqrt(1 / a),

where phi is 90 deg on the outline, and e more at the outermost pixels, which are half a pixel from
it on average. On a ball, w = 1 is the azimuthal equidistant projection, which does not stretch, and
w = 0 the orthographic one, in which the back is the mirror image of the front and the texture at
the outline is stretched without end. In between, colours continue behind the outline, and what is
printed beside it comes back further behind: 30 deg behind the outline r' is .79 a instead of .67.

Citation: J. P. Snyder, "Map projections: a working manual", U.S. Geological Survey Professional
Paper 1395 (1987), doi:10.3133/pp1395, sections 20 and 25.

Limits: exact for ellipsoids of revolution and bars only. Texture behind the outline is up to 1 / w
times as long as in the photo, and what the photo shows comes back as its mirror image. Sides that
are steep in front of the outline keep the photo's pixels. In narrow notches texture may come from a
pixel or two outside.
"""

import numpy as np

from .cross_section import CrossSection

_THINNEST = 3.0  # pixels: the least a that e is taken for
_EVEN = 0.4  # w


def folded_places(
    u: np.ndarray,
    section: CrossSection,
    places: np.ndarray,
    pixels: np.ndarray,
    outline: np.ndarray,
) -> np.ndarray:
    """Return where vertices behind the visible pixels take their texture from.

    Parameters
    ----------
    u : (H, W) ndarray
        The membrane, 0 outside of the body.
    section : CrossSection
        Of `u`.
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
    toward, bend, across = section.at(rows, columns)
    depth = np.where(outline, 0, np.sqrt(2 * u[rows, columns] / bend))
    across = np.maximum(across, depth)
    radius = np.sqrt(across**2 - depth**2)
    whole = np.pi / 2 + np.arcsin(np.sqrt(1 / np.maximum(across, _THINNEST)))
    share = np.arctan2(radius, depth) / whole
    folded = across * (_EVEN * share + (1 - _EVEN) * np.sin(np.pi / 2 * share))
    # On the axis, where the direction is that of rounding errors, nothing moves.
    length = np.maximum(np.maximum(np.hypot(*toward.T), radius), 1e-9)
    return np.asarray(places + ((radius - folded) / length)[:, None] * toward)
