"""New highlights: a lobe on the recovered shape, under a light of one's choice.

Equation: specular' = (specular or 0) + k E/|E| f(n; l) max(0, n . l), the lobe f of `lobes.Lobe`, k
by `lobes.strength_of`.

Citation: J. F. Blinn 1977, doi:10.1145/563858.563893; H. Akbar 2016 (rendering highlights).

Limits: the shape is what shading tells, smooth where the paint is busy; so is the highlight. It is
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
    """The scene with a highlight of `lobe` under `light`, of which direction and colour count, on
    top of the present specular layer or instead of it. `lobe`: None for the fitted one, or the
    usual one. `level`: see `lobes.strength_of`; 0 adds none.

    Raises `InputError` for a light without light.
    """
    lobe = lobe or known_lobe(d) or Lobe()
    power = float(luminance(light.irradiance))
    if power <= 0:
        raise InputError("the light of the highlight is black: give it a colour")
    rendered = lobe_under(lobe, d.normal, replace(light, irradiance=light.irradiance / power))
    new = strength_of(d, lobe, rendered, level) * rendered
    facing = bool(rendered[d.mask].max() > 1e-3 * rendered.max()) if rendered.any() else False
    notes = (
        ()
        if facing
        else (
            "no part of the object mirrors this light to the viewer: there is no highlight to see",
        )
    )
    return edited(d, specular=np.where(replacing, 0, d.specular) + new, notes=notes)
