"""The upper bound of an object's specular level that its photo implies under the recovered light.

Problem: a fitted lobe's level is uncertain (see `specular_level`), yet a renderer uses it as it is:
under the recovered environment map the whole object mirrors that map, with specular light that the
photo need not contain. Every file of a result carries the level of `bounded_specular`.

Equation: the specular layer under the environment map is level s(n(x)), s being what the lobe of
plastic mirrors of the map toward the viewer. The photo is at least as bright, so that level <= min
over c of I_c(x) / s_c(n(x)) at every pixel x. The 5th percentile is taken: normals and silhouettes
are uncertain.

Citation: B. Walter et al. 2007, doi:10.2312/EGWR/EGSR07/195-206 (the lobe, see `shading.brdf.ggx`).

Limits: a bound, no estimate: pale albedo allows nearly any level. Renderers conserve energy: above
a level of 1 their specular layer grows less toward grazing angles than the equation predicts.
"""

from dataclasses import replace

import numpy as np

from ..imaging.row_blocks import row_blocks
from ..scene.decomposition import Decomposition
from ..shading.brdf.ggx import F0, Ggx
from ..shading.brdf.roughness import alpha_from_blender
from .specular_level import SpecularFit, SpecularSource, fitted_specular

_ROWS = 16  # of the environment map: the lobe of a smooth map is smooth
_SHARE = 5.0  # percentile
_NARROWEST = 0.05  # alpha: narrower lobes mirror a smooth map alike


def bounded_specular(d: Decomposition) -> SpecularFit:
    """Convert a lobe fit to a renderer's terms, with the level limited to its upper bound.

    Parameters
    ----------
    d : Decomposition
        The decomposition; its light is the environment map.

    Returns
    -------
    SpecularFit
        As `fitted_specular`, with the level lowered where necessary.
    """
    gloss = fitted_specular(d)
    if not gloss.specular or gloss.roughness is None:
        return gloss
    from ..shading.environment_map import recovered_environment

    environment = recovered_environment(d.illumination, _ROWS, viewer=d.viewer)
    most = specular_upper_bound(d, gloss.roughness, environment)
    return (
        gloss
        if gloss.specular <= most
        else replace(gloss, specular=most, specular_source=SpecularSource.LOWERED)
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
        Radiance that lights the object, rows >= 16.

    Returns
    -------
    float
        1 is plastic; infinite under a black environment map.
    """
    from ..shading.environment_map import resampled
    from ..shading.mirrored_environment import MirroredEnvironment

    lobe = Ggx(max(float(alpha_from_blender(roughness)), _NARROWEST), F0)
    mirrored, view = MirroredEnvironment(lobe, resampled(environment, _ROWS)), d.view
    room = list[np.ndarray]()
    for block in row_blocks(d.mask.shape):
        inside = d.mask[block.rows]
        seen, normal = d.image[block.rows][inside], d.normal[block.rows][inside].astype(float)
        toward = view if view.ndim == 1 else view[block.rows][inside]
        layer = mirrored.toward(normal, toward)
        # A channel of zero carries no information: cameras clip colours outside their gamut there.
        lit = (layer > 1e-9) & (seen > 0)
        room.append(np.divide(seen, layer, out=np.full(layer.shape, np.inf), where=lit).min(-1))
    # infinite values cannot be interpolated
    return float(np.percentile(np.concatenate(room), _SHARE, method="lower"))
