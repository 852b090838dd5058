"""Texture coordinates of an unobserved rounded back.

Problem: in the projection, the sides of a solid are a fraction of a pixel wide. With the texture of
the pixels in front of them, they would show streaks.

Equation: the texture is folded at the outermost pixels back to the inside. On the ellipse across
the outline, of half width a (see `cross_section`), a point r pixels from the axis takes its texture
from r' pixels, by its angle phi on the ellipse:

    r' = a (w x + (1 - w) sin(90 deg x)),   x = phi / (90 deg + e),   sin e = sqrt(1 / a),

where phi is 90 deg on the outline, and e more at the outermost pixels, which are half a pixel from
it on average. On a sphere, w = 1 is the azimuthal equidistant projection, which does not stretch,
and w = 0 the orthographic one, in which the back is the mirror image of the front and the texture
at the outline is stretched infinitely. In between, colours extend behind the outline, and print
next to it is repeated farther behind: 30 deg behind the outline r' is .79 a instead of .67.

The outermost pixels of a photo often show a shadow, or are mixed with the background. So r' is
scaled by 1 - m / a: the sides begin m pixels inside the outline, .02 of the object's length, but at
most a / 4.

Citation: J. P. Snyder, "Map projections: a working manual", U.S. Geological Survey Professional
Paper 1395 (1987), doi:10.3133/pp1395, sections 20 and 25.

Limits: exact for ellipsoids of revolution and bars only. Texture behind the outline is stretched by
up to 1 / w and mirrored. Steep sides in front of the outline keep the photo's pixels. In narrow
notches texture may come from a pixel or two outside.
"""

import numpy as np

from .cross_section import CrossSection

_THINNEST = 3.0  # pixels: lower limit of a in e
_EVEN = 0.4  # w
_LEFT_OUT = 0.02  # m, of the object's longer side
_MOST_LEFT_OUT = 0.25  # of a


def folded_positions(
    u: np.ndarray,
    section: CrossSection,
    places: np.ndarray,
    pixels: np.ndarray,
    outline: np.ndarray,
) -> np.ndarray:
    """Return the texture positions of vertices behind the visible pixels.

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
    left_out = _LEFT_OUT * (np.ptp(pixels, axis=0).max() + 1)
    folded *= 1 - np.minimum(left_out / np.maximum(across, 1e-9), _MOST_LEFT_OUT)
    # On the axis, where the direction is only rounding error, the position is kept.
    length = np.maximum(np.maximum(np.hypot(*toward.T), radius), 1e-9)
    return np.asarray(places + ((radius - folded) / length)[:, None] * toward)
