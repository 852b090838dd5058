"""New highlights: a specular lobe rendered on the recovered shape under a chosen light.

Equation: specular' = (specular or 0) + k E/|E| f(n; l) max(0, n . l), with the lobe f of
`shading.lobe_rendering.Lobe` and k by `lobes.strength_of`.

Citation: J. F. Blinn 1977, doi:10.1145/563858.563893; H. Akbar 2016 (rendering highlights).

Limits: where texture is strong, the recovered shape is smooth, and so is the highlight. It is
clipped where the picture is.
"""

from dataclasses import replace

import numpy as np

from ..errors import InputError
from ..imaging.luminance import luminance
from ..scene.decomposition import Decomposition
from ..shading.lights import DirectionalLight
from ..shading.lobe_rendering import Lobe, lobe_under
from .edited import Edited, edited
from .lobes import known_lobe, strength_of


def add_highlight(
    d: Decomposition,
    light: DirectionalLight,
    lobe: Lobe | None = None,
    *,
    level: float | None = None,
    replacing: bool = False,
) -> Edited:
    """Return the scene with a highlight that is added to the specular layer or replaces it.

    Parameters
    ----------
    d : Decomposition
    light : DirectionalLight
        Only its direction and colour are used.
    lobe : Lobe, optional
        By default the fitted one, or a standard one.
    level : float, optional
        See `lobes.strength_of`; 0 adds none.
    replacing : bool
        Remove the present specular layer.

    Returns
    -------
    Edited

    Raises
    ------
    InputError
        If the light is black.
    """
    lobe = lobe or known_lobe(d) or Lobe()
    power = float(luminance(light.irradiance))
    if power <= 0:
        raise InputError("the light of the highlight is black: give it a colour")
    unit_light = replace(light, irradiance=light.irradiance / power)
    rendered = lobe_under(lobe, d.normal, unit_light, d.view)
    new = strength_of(d, lobe, rendered, level) * rendered
    facing = bool(rendered[d.mask].max() > 1e-3 * rendered.max()) if rendered.any() else False
    notes = (
        ()
        if facing
        else (
            "no part of the object reflects this light to the viewer: the highlight is not visible",
        )
    )
    return edited(d, specular=np.where(replacing, 0, d.specular) + new, notes=notes)
