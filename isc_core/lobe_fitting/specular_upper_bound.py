"""The upper bound of an object's specular level implied by its photo under the recovered light.

Problem: a fitted lobe's level is uncertain (see `specular_level`), but a renderer uses it as given:
the whole object reflects the recovered environment map, with specular light that the photo may not
contain. All files of a result contain the level of `bounded_specular`.

Equation: the specular layer under the environment map is level s(n(x)), s being the reflection of
the map toward the viewer by the lobe of plastic. The photo is at least as bright, so that level <=
min over c of I_c(x) / s_c(n(x)) at every pixel x. The 5th percentile is taken: normals and
silhouettes are uncertain.

Citation: B. Walter et al. 2007, doi:10.2312/EGWR/EGSR07/195-206 (the lobe, see `shading.brdf.ggx`).

Limits: a bound, not an estimate: pale albedo allows nearly any level. Renderers conserve energy:
above a level of 1, their specular layer increases less toward grazing angles than in the equation.
"""

from dataclasses import replace

import numpy as np

from ..imaging.row_blocks import row_blocks
from ..scene.decomposition import Decomposition
from ..shading.brdf.ggx import F0, Ggx
from ..shading.brdf.roughness import alpha_from_blender
from .specular_level import SpecularFit, SpecularSource, fitted_specular

_ROWS = 16  # of the environment map: the lobe of a smooth map is smooth
_PERCENTILE = 5.0


def bounded_specular(d: Decomposition) -> SpecularFit:
    """Convert a lobe fit to the parameters of a renderer, with the level limited to its upper
    bound.

    Parameters
    ----------
    d : Decomposition
        The decomposition; its light is the environment map.

    Returns
    -------
    SpecularFit
        As `fitted_specular`, with the level lowered where necessary.
    """
    fit = fitted_specular(d)
    if not fit.specular or fit.roughness is None:
        return fit
    from ..shading.environment_map import recovered_environment

    environment = recovered_environment(d.illumination, _ROWS, viewer=d.viewer)
    bound = specular_upper_bound(d, fit.roughness, environment)
    return (
        fit
        if fit.specular <= bound
        else replace(fit, specular=bound, specular_source=SpecularSource.LOWERED)
    )


def specular_upper_bound(d: Decomposition, roughness: float, environment: np.ndarray) -> float:
    """Compute the largest specular level that the photo allows.

    Parameters
    ----------
    d : Decomposition
        The decomposition.
    roughness : float
        Blender's, in [0, 1].
    environment : (rows, 2 rows, 3) ndarray
        Radiance of the light, rows >= 16.

    Returns
    -------
    float
        1 is plastic; infinite under a black environment map.
    """
    from ..shading.environment_map import resampled
    from ..shading.mirrored_environment import MirroredEnvironment, narrowest_alpha

    # narrower lobes reflect a smooth map in the same way
    lobe = Ggx(max(float(alpha_from_blender(roughness)), narrowest_alpha(_ROWS)), F0)
    mirrored, view = MirroredEnvironment(lobe, resampled(environment, _ROWS)), d.view
    bounds = list[np.ndarray]()
    for block in row_blocks(d.mask.shape):
        inside = d.mask[block.rows]
        image, normal = d.image[block.rows][inside], d.normal[block.rows][inside].astype(float)
        toward = view if view.ndim == 1 else view[block.rows][inside]
        layer = mirrored.toward(normal, toward)
        # A channel of zero carries no information: cameras clip colours outside their gamut there.
        lit = (layer > 1e-9) & (image > 0)
        bounds.append(np.divide(image, layer, out=np.full(layer.shape, np.inf), where=lit).min(-1))
    # infinite values cannot be interpolated
    return float(np.percentile(np.concatenate(bounds), _PERCENTILE, method="lower"))
