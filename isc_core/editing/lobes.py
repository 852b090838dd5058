"""The lobe that an edit renders, and what it sends to the viewer under any of the edits' lights.

Equation: radiance(n) = sum over lights of f_r(n, v, l) max(0, n . l) E, with the viewer along z. It
depends on the normal alone, so under an environment of many samples it is rendered for a table of
normals, in the stereographic plane (x, y) / (1 + z), and looked up there.

Strength: a lobe has none that a photo's unit could tell. It is given relative to the photo
(`level`: how bright the lobe's centre would be at exponent 60, in units of the photo's white; other
exponents keep the energy), or such that the present specular layer's energy stays.

Citation: J. F. Blinn 1977, doi:10.1145/563858.563893; B. Walter et al. 2007,
doi:10.2312/EGWR/EGSR07/195-206 (see `brdf`).

Limits: no shadows, no light between parts of the surface.
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

_TOO_BRIGHT = 2.0  # of the photo's white: kept energy never asks for more at a lobe's centre


def known_lobe(d: Decomposition) -> Lobe | None:
    """The lobe that was fitted to the photo, the widest that it can be where only that is known;
    None where there is no fit or it says nothing of the roughness.
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
    """The factor for `unscaled` (H, W, 3), the lobe of strength 1 as rendered under a light of
    irradiance 1 across its beam.

    `level` in [0, 1e6]: brightness relative to the photo's white, see the module; None keeps the
    energy of the present specular layer, as far as that does not make the lobe's centre brighter
    than twice the white, and is level 1 where there is none. Raises `InputError`.
    """
    if level is not None:
        check_range("strength", level, 0, MOST_GAIN)
    white = white_of(d.image, d.mask)
    unit_level = white / _centre(Lobe())
    present, rendered = luminance(d.specular[d.mask]).sum(), luminance(unscaled[d.mask]).sum()
    if level is None and present > 0 and rendered > 0:
        return float(min(present / rendered, _TOO_BRIGHT * white / _centre(lobe)))
    return unit_level * (1.0 if level is None else level)


def _centre(lobe: Lobe) -> float:
    """The radiance of the lobe's centre, light and view along the normal, irradiance 1."""
    return float(radiance(lobe.model, VIEW, VIEW, directional(VIEW, 1.0))[0])
