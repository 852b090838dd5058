"""The slant of surfaces as a function of the distance from their silhouettes, measured on objects
of known shape: the profile of the `silhouette` term.

Equation: for every pixel with a known normal, u is its relative depth from the silhouette, and x, y
are the normal's components in the image plane along and across the outward direction. In each of
`BINS` bins of u: mean = E[x], spread^2 = (Var[x] + E[y^2]) / 2. Objects have equal weights.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..shading.surface_stencils import normals
from ..sirfs.priors.priors import SilhouetteProfile
from ..sirfs.silhouette import silhouette_coordinates

BINS = 16


@dataclass(frozen=True, eq=False)
class SilhouetteMoments:
    """Moments of one object.

    Attributes
    ----------
    sums : (4, BINS) ndarray
        Fraction of the object's pixels in each bin, and sums of x, x^2 and y^2 there over the
        number of pixels.
    """

    sums: np.ndarray

    @classmethod
    def of(cls, height: np.ndarray, mask: np.ndarray) -> "SilhouetteMoments":
        """Measure the moments of an object.

        Parameters
        ----------
        height : (H, W) ndarray
            Pixels toward the viewer, NaN where unknown.
        mask : (H, W) bool ndarray

        Returns
        -------
        SilhouetteMoments
        """
        u, down, right = silhouette_coordinates(mask)
        normal = normals(height)
        known = mask & np.isfinite(normal).all(axis=-1)
        along = (normal[..., 0] * down + normal[..., 1] * right)[known]
        across = (normal[..., 1] * down - normal[..., 0] * right)[known]
        which = np.minimum((u[known] * BINS).astype(int), BINS - 1)
        sums = [
            np.bincount(which, w, BINS) for w in (np.ones(len(which)), along, along**2, across**2)
        ]
        return cls(np.stack(sums) / max(len(which), 1))


def fit_silhouette(objects: Sequence[SilhouetteMoments]) -> SilhouetteProfile:
    """Fit the profile of all objects; empty bins are interpolated.

    Parameters
    ----------
    objects : sequence of SilhouetteMoments

    Returns
    -------
    SilhouetteProfile
    """
    count, along, along2, across2 = np.sum([o.sums for o in objects], axis=0)
    occupied = count > 0
    n = np.where(occupied, count, 1)
    mean = along / n
    variance = (along2 / n - mean**2 + across2 / n) / 2
    bins = np.arange(BINS)
    filled = (
        np.interp(bins, bins[occupied], v[occupied])
        for v in (mean, np.sqrt(np.maximum(variance, 1e-4)))
    )
    return SilhouetteProfile(*filled)
