"""Elliptical cross sections of a rounded solid near its outline.

Problem: the membrane u of a solid (see `solid_mesh`) ends at pixels, so that it has their steps
close to the outline. Where the surface turns away from the viewer, a step of one pixel is many
pixels deep.

Equation: along its gradient g, u has the second derivative -c, limited to c = 2 (a ball) to 4 (a
bar). So u is c / 2 (a^2 - r^2) at r = |g| / c pixels from the axis, with

    a^2 = |g|^2 / c^2 + 2 u / c,

and sqrt(u) an ellipse of half widths a across and sqrt(c / 2) a in depth. c and a change slowly;
they are means over some pixels with the weight u^2, which is largest far inside. Up to two pixels
inside of the outline, u is computed from the distance s to its end:

    u = c / 2 (a^2 - (a - s)^2),   s = 1/2 + logit(v) / 1.7,

with v the smoothed coverage, which falls from the inside to the outside as the integral of a normal
distribution with a standard deviation of one pixel.

Citation: the logistic function for that integral: S. R. Bowling et al., "A logistic approximation
to the cumulative normal distribution", Journal of Industrial Engineering and Management 2 (2009),
doi:10.3926/jiem.2009.v2n1.p114-127.

Limits: exact for ellipsoids of revolution and bars only.
"""

from dataclasses import dataclass

import numpy as np

from ...filters.morphology import eroded
from .membrane import block_sums
from .smoothing import binomial

_BALL, _BAR = 2.0, 4.0  # c
_SMOOTH = 4  # passes over blocks of 2 x 2 pixels
_LOGIT = 1.702
_BEYOND = 0.5  # pixels from the outline to where u ends
_SURE, _DEEP = 0.87, 0.97  # v up to which s is taken from the coverage alone, and from which from u
_FACTOR = 2.0  # largest change of u


@dataclass(frozen=True, eq=False)
class CrossSection:
    """Ellipses across the outline, for blocks of 2 x 2 pixels.

    Attributes
    ----------
    planes : (h, w, 4) ndarray
        From the pixel to the axis, rows and columns; c; a^2.
    """

    planes: np.ndarray

    def at(self, rows: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the ellipses of pixels.

        Parameters
        ----------
        rows, columns : (N,) ndarray of int

        Returns
        -------
        toward : (N, 2) ndarray
            To the axis.
        bend : (N,) ndarray
            c.
        across : (N,) ndarray
            a.
        """
        found = np.zeros((len(rows), 4))
        (row, down), (column, right) = (
            _between(values, size)
            for values, size in zip((rows, columns), self.planes.shape, strict=False)
        )
        for below, one in ((0, 1 - down), (1, down)):
            for beside, other in ((0, 1 - right), (1, right)):
                found += (one * other)[:, None] * self.planes[row + below, column + beside]
        return found[:, :2], found[:, 2], np.sqrt(found[:, 3])


def _between(values: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """The block before each pixel, and the weight of the next one."""
    place = np.clip((values + 0.5) / 2 - 0.5, 0, size - 1)
    first = np.minimum(place.astype(np.int64), size - 2)
    return first, place - first


def cross_section(u: np.ndarray) -> CrossSection:
    """Find the ellipses of a membrane.

    Parameters
    ----------
    u : (H, W) ndarray
        The membrane, 0 outside of the solid.

    Returns
    -------
    CrossSection
    """
    means = block_sums(u) / 4
    at = np.pad(means, 1)

    def near(down: int, right: int) -> np.ndarray:
        return np.asarray(at[1 + down : len(at) - 1 + down, 1 + right : at.shape[1] - 1 + right])

    # Derivatives per pixel: half of the differences between blocks, and a quarter.
    sides = [near(*side) for side in ((1, 0), (-1, 0), (0, 1), (0, -1))]
    down, right = (sides[0] - sides[1]) / 4, (sides[2] - sides[3]) / 4
    twist = (near(1, 1) - near(1, -1) - near(-1, 1) + near(-1, -1)) / 16
    along = (
        down**2 * (sides[0] + sides[1] - 2 * means) / 4
        + 2 * down * right * twist
        + right**2 * (sides[2] + sides[3] - 2 * means) / 4
    )
    weight = np.where(eroded(block_sums(u > 0) == 4), means**2, 0)
    total = binomial(weight, _SMOOTH)
    reached = total > 0
    total[~reached] = 1
    down, right, along, steep, level = (
        np.where(reached, binomial(weight * part, _SMOOTH) / total, part)
        for part in (down, right, along, down**2 + right**2, means)
    )
    bend = np.clip(-along / np.maximum(steep, 1e-9), _BALL, _BAR)
    square = steep / bend**2 + 2 * level / bend
    return CrossSection(np.stack([down / bend, right / bend, bend, square], -1))


def with_subpixel_outline(u: np.ndarray, smooth: np.ndarray, section: CrossSection) -> np.ndarray:
    """Let a membrane end at the outline rather than in the steps of the pixels.

    Parameters
    ----------
    u : (H, W) ndarray
        The membrane, 0 outside of the solid.
    smooth : (H, W) ndarray
        Coverage whose contour at one half is the outline, see `outline.smooth_cover`.
    section : CrossSection
        Of `u`.

    Returns
    -------
    (H, W) ndarray
    """
    rows, columns = np.nonzero((u > 0) & (smooth < _DEEP))
    _, bend, across = section.at(rows, columns)
    cover, before = np.maximum(smooth[rows, columns], 0.5), u[rows, columns]
    inward = np.minimum(_BEYOND + np.log(cover / (1 - cover)) / _LOGIT, across)
    found = np.clip(bend * inward * (across - inward / 2), before / _FACTOR, before * _FACTOR)
    ended = u.copy()
    ended[rows, columns] += outline_weights(cover) * (found - before)
    return ended


def outline_weights(smooth: np.ndarray) -> np.ndarray:
    """Return weights of pixels near the outline: 1 up to one pixel inside of it, 0 from two.

    Parameters
    ----------
    smooth : ndarray
        The smoothed coverage.

    Returns
    -------
    ndarray
    """
    return np.asarray(np.clip((_DEEP - smooth) / (_DEEP - _SURE), 0, 1))
