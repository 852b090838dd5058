"""The reflectance terms of SIRFS for a diffuse image and any shading.

Equation: g(log D - log S): smoothness, parsimony and absolute terms, dg/dS = -(dg/dA) / S.

Citation: J. T. Barron, J. Malik 2015, doi:10.1109/TPAMI.2014.2377712.

Limits: the diffuse image is assumed to be exact.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..decomposition.shape import desaturated, exposure_normalisation
from ..scene.decomposition import Decomposition
from ..sirfs.priors.prior_file import shipped_priors
from ..sirfs.priors.priors import Priors
from ..sirfs.reflectance import palette_cost, smoothness_cost
from ..sirfs.settings import Weights, isc_weights

_DARKEST = 1e-4  # of the diffuse image, where white is 1
_ILLUMINATIONS = ("photo", "natural", "laboratory")


@dataclass(frozen=True, eq=False)
class ReflectanceTerms:
    """The terms g of a diffuse image.

    Attributes
    ----------
    log_diffuse : (H, W, 3) ndarray
        0 outside the mask.
    mask : (H, W) ndarray of bool
    priors : Priors
        For three channels.
    weights : Weights
    """

    log_diffuse: np.ndarray
    mask: np.ndarray
    priors: Priors
    weights: Weights

    def log_reflectance(self, shading: np.ndarray) -> np.ndarray:
        """Return the log reflectance under a shading.

        Parameters
        ----------
        shading : (N, 3) ndarray
            Of the mask's pixels, > 0.

        Returns
        -------
        (H, W, 3) ndarray
        """
        result = np.zeros(self.log_diffuse.shape)
        result[self.mask] = self.log_diffuse[self.mask] - np.log(shading)
        return result

    def cost(self, shading: np.ndarray, pixel_weight: np.ndarray) -> tuple[float, np.ndarray]:
        """Compute g.

        Parameters
        ----------
        shading : (N, 3) ndarray
            Of the mask's pixels, > 0.
        pixel_weight : (H, W) ndarray

        Returns
        -------
        cost : float
        gradient : (N, 3) ndarray
            With respect to the shading.
        """
        values = self.log_reflectance(shading)
        smooth, d_smooth = smoothness_cost(
            values, pixel_weight, self.priors, self.weights.smoothness
        )
        parsimony, absolute, d_palette = palette_cost(
            values, pixel_weight, self.priors, self.weights
        )
        return smooth + parsimony + absolute, -(d_smooth + d_palette)[self.mask] / shading


def terms_of(d: Decomposition) -> tuple[ReflectanceTerms, float]:
    """Return the reflectance terms of a result's diffuse image, normalised to the exposure of
    photos.

    Parameters
    ----------
    d : Decomposition

    Returns
    -------
    terms : ReflectanceTerms
    gain : float
        Factor that normalises the result's light to that exposure.
    """
    illumination = str(d.provenance.settings.get("illumination", _ILLUMINATIONS[0]))
    illumination = illumination if illumination in _ILLUMINATIONS else _ILLUMINATIONS[0]
    gain = exposure_normalisation(d.image, d.mask)
    terms = ReflectanceTerms(
        np.zeros(d.diffuse.shape),
        d.mask,
        shipped_priors(illumination, 3),
        isc_weights(illumination, 3),
    )
    return with_diffuse(terms, d.diffuse, d.mask, gain), gain


def with_diffuse(
    terms: ReflectanceTerms, diffuse: np.ndarray, mask: np.ndarray, gain: float
) -> ReflectanceTerms:
    """Return the same terms for another diffuse image.

    Parameters
    ----------
    terms : ReflectanceTerms
    diffuse : (h, w, 3) ndarray
        Linear.
    mask : (h, w) ndarray of bool
    gain : float
        From `terms_of`.

    Returns
    -------
    ReflectanceTerms
    """
    light = np.maximum(gain * desaturated(diffuse.astype(float)), _DARKEST)
    return replace(terms, log_diffuse=np.where(mask[..., None], np.log(light), 0.0), mask=mask)
