"""The specular lobe of an edit, and its strength relative to the photo.

Strength: the radiometric scale of the photo is unknown, so the strength is relative to the photo
(`level`: the brightness of the lobe's centre at exponent 60, in units of the photo's white; other
exponents preserve the energy), or preserves the energy of the present specular layer.

Citation: J. F. Blinn 1977, doi:10.1145/563858.563893; B. Walter et al. 2007,
doi:10.2312/EGWR/EGSR07/195-206 (see `shading.brdf`).
"""

import numpy as np

from ..imaging.luminance import luminance, white_of
from ..scene.decomposition import Decomposition
from ..shading.brdf.model import check_range
from ..shading.brdf.roughness import exponent_from_alpha
from ..shading.lights import VIEW
from ..shading.lobe_rendering import Lobe
from ..shading.radiance import directional, radiance
from .edited import MOST_GAIN

_MAX_CENTRE = 2.0  # of the photo's white: limit of a lobe's centre when its energy is preserved


def known_lobe(d: Decomposition) -> Lobe | None:
    """Return the lobe fitted to the photo, or the widest one where only an upper bound is known.

    Parameters
    ----------
    d : Decomposition

    Returns
    -------
    Lobe or None
        None without a fit, or where the fit does not determine the roughness.
    """
    fit = d.brdf
    if fit is None or fit.alpha is None:
        return None
    alpha = float(np.clip(fit.alpha, 0.01, 1))
    return (
        Lobe(alpha=alpha)
        if fit.model.startswith("ggx")
        else Lobe(float(np.clip(exponent_from_alpha(alpha), 1, 1e5)))
    )


def strength_of(d: Decomposition, lobe: Lobe, unscaled: np.ndarray, level: float | None) -> float:
    """Return the factor of a rendered lobe.

    Parameters
    ----------
    d : Decomposition
    lobe : Lobe
    unscaled : (H, W, 3) ndarray
        The lobe of strength 1, rendered under a light of irradiance 1 across its beam.
    level : float or None
        Brightness relative to the photo's white, in [0, 1e6]. None preserves the energy of the
        present specular layer, with the lobe's centre limited to twice the white; without specular
        light it is 1.

    Returns
    -------
    float

    Raises
    ------
    InputError
        If `level` is out of range.
    """
    if level is not None:
        check_range("strength", level, 0, MOST_GAIN)
    white = white_of(d.image, d.mask)
    unit_level = white / _centre(Lobe())
    present, rendered = luminance(d.specular[d.mask]).sum(), luminance(unscaled[d.mask]).sum()
    if level is None and present > 0 and rendered > 0:
        return float(min(present / rendered, _MAX_CENTRE * white / _centre(lobe)))
    return unit_level * (1.0 if level is None else level)


def _centre(lobe: Lobe) -> float:
    """The radiance at the lobe's centre: light and view along the normal, irradiance 1."""
    return float(radiance(lobe.model, VIEW, VIEW, directional(VIEW, 1.0))[0])
