"""How glossy an object can be at most, given what its photo shows of the sky.

Problem: a fitted lobe's level is uncertain (see `gloss`), yet a renderer takes it at its word:
under the recovered sky it mirrors that sky all over the object, as a sheen that the photo need not
have. `shown_gloss` is the gloss that every file of a result carries.

Equation: sheen(x) = level s(n(x)), s what the lobe of plastic mirrors of the sky toward the viewer.
The photo is at least as bright, so that level <= min over c of I_c(x) / s_c(n(x)) at every pixel x.
The 5th percentile is taken: normals and outlines are uncertain.

Citation: B. Walter et al. 2007, doi:10.2312/EGWR/EGSR07/195-206 (the lobe, see `shading.brdf.ggx`).

Limits: a bound, no estimate: pale paint has room for nearly any gloss. Renderers mirror no more
than all: above a level of 1 their sheen grows less toward grazing angles than the equation says.
"""

from dataclasses import replace

import numpy as np

from ..scene.decomposition import Decomposition
from ..shading.brdf.ggx import F0
from ..shading.brdf.roughness import alpha_from_blender
from ..shading.environment_map import environment_from_shading, resampled
from ..shading.lobe_rendering import Lobe, lobe_in_environment
from .specular_level import LOWERED, Gloss, gloss_of

_ROWS = 16  # of the sky: a lobe of a smooth one is smooth
_SHARE = 5.0  # percentile
_NARROWEST = 0.05  # alpha: what is narrower mirrors a smooth sky alike


def shown_gloss(d: Decomposition) -> Gloss:
    """The fitted gloss, its level lowered to what the photo has room for under the recovered light."""
    gloss = gloss_of(d)
    if not gloss.specular or gloss.roughness is None:
        return gloss
    most = specular_upper_bound(d, gloss.roughness, environment_from_shading(d.illumination, _ROWS))
    return (
        gloss if gloss.specular <= most else replace(gloss, specular=most, specular_source=LOWERED)
    )


def specular_upper_bound(d: Decomposition, roughness: float, sky: np.ndarray) -> float:
    """The largest specular level, 1 being plastic, whose sheen the photo has room for; infinite
    under a black sky.

    `roughness`: Blender's, in [0, 1]. `sky`: (rows, 2 rows, 3) radiance as the object is lit by it,
    rows >= 16.
    """
    lobe = Lobe(alpha=max(float(alpha_from_blender(roughness)), _NARROWEST), f0=F0)
    sheen = lobe_in_environment(lobe, d.normal[d.mask].astype(float), resampled(sky, _ROWS))
    seen = d.image[d.mask]
    # A channel of zero tells nothing: cameras cut there what their colours cannot hold.
    room = np.divide(
        seen, sheen, out=np.full(sheen.shape, np.inf), where=(sheen > 1e-9) & (seen > 0)
    )
    return float(
        np.percentile(room.min(-1), _SHARE, method="lower")
    )  # infinite values cannot be interpolated
