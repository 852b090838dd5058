"""The Blinn-Phong extension: the object's gloss made sharper, rougher or metallic.

Equations. Remapping needs no shape: under one light the specular layer is s = w c^p, so that an
exponent q makes of it, pixel by pixel,

    s' = g (q + 8) / (p + 8) s (m / w)^(q / p - 1),     m the pixel's largest channel, w the layer's
    brightest but for a few,

with the usual factor, which keeps the energy, and a gain g; for a wider lobe, q < p, m / w counts
as a quarter at least, or the edge at which the separated layer ends would be lifted with it.
Rendering draws the lobe anew on the recovered shape under the light that best explains the layer.
Metal has no body colour of its own: of the share M of metal the diffuse light goes, the highlight
takes the colour of the reflectance, and the surroundings are mirrored in that colour:

    diffuse' = (1 - M) diffuse,   specular' = s' (1 - M + M r / max r) + M r sum_w f(n, w) L(w)
    max(0, n . w).

Citation: J. F. Blinn 1977, doi:10.1145/563858.563893; H. Akbar 2016 (Blinn-Phong extension); for
metals, R. L. Cook, K. E. Torrance 1982, doi:10.1145/357290.357293.

Limits: remapping cannot spread a highlight beyond where some of it is, so a rougher look soon needs
rendering. The mirrored surroundings are those that the smooth shading tells.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..errors import InputError
from ..imaging.luminance import luminance, white_of
from ..lobe_fitting.light_direction import explain_specular
from ..scene.decomposition import Decomposition
from ..shading.brdf.model import check_range
from ..shading.environment_map import environment_from_shading
from ..shading.lights import DirectionalLight
from ..shading.lobe_rendering import USUAL_EXPONENT, Lobe, lobe_in, lobe_under
from .edited import MOST_GAIN, Edited, edited, light_color
from .lobes import known_lobe, strength_of

METHODS = ("remap", "render")
_SKY_ROWS = 16
# of the brightest: below, a separation finds less and less of a highlight, until it ends in an edge
_FOUND = 0.25
_CENTRE = 99.9  # percentile: the lobe's own centre, but for a few wrong pixels


@dataclass(frozen=True)
class Gloss:
    """`exponent`: the new lobe's, in [1, 1e5]; None for `sharper` > 0 times the present one's.
    `present`: the present lobe's, None for the fitted one. `gain` in [0, 1e6]: of the specular
    layer. `metal` in [0, 1]: the share of metal. `method`: "remap" or "render". Raises
    `InputError`.
    """

    exponent: float | None = None
    sharper: float = 1.0
    present: float | None = None
    gain: float = 1.0
    metal: float = 0.0
    method: str = "remap"

    def __post_init__(self) -> None:
        for name in ("exponent", "present"):
            if getattr(self, name) is not None:
                check_range(name, getattr(self, name), 1, 1e5)
        check_range("sharper", self.sharper, 1e-3, 1e3)
        check_range("gain", self.gain, 0, MOST_GAIN)
        check_range("metal", self.metal, 0, 1)
        if self.method not in METHODS:
            raise InputError(
                f'unknown method "{self.method}" of gloss: choose {" or ".join(METHODS)}'
            )


def change_gloss(d: Decomposition, gloss: Gloss, light: DirectionalLight | None = None) -> Edited:
    """The scene with another gloss.

    `light`: to render under; None for the one that best explains the specular layer.
    """
    notes: list[str] = []
    same = gloss.exponent is None and gloss.sharper == 1 and gloss.method == "remap"
    specular = d.specular if same else _new_lobe(d, gloss, light, notes)
    if gloss.gain != 1:
        specular = specular * gloss.gain
    if gloss.metal == 0:
        return edited(d, specular=specular, notes=tuple(notes))
    paint = np.maximum(d.reflectance, 0)
    seen = paint * light_color(d)
    tint = seen / np.maximum(seen.max(-1, keepdims=True), 1e-6)
    sky = environment_from_shading(d.illumination, _SKY_ROWS)
    lobe = Lobe(gloss.exponent or gloss.present or USUAL_EXPONENT)
    mirrored = np.zeros_like(d.image)
    mirrored[d.mask] = paint[d.mask] * lobe_in(lobe, d.normal[d.mask], sky)
    metallic = specular * (1 - gloss.metal + gloss.metal * tint) + gloss.metal * mirrored
    return edited(d, (1 - gloss.metal) * d.diffuse, metallic, tuple(notes))


def remapped(specular: np.ndarray, mask: np.ndarray, present: float, exponent: float) -> np.ndarray:
    """The specular layer (H, W, 3) of a lobe of exponent `present`, as one of `exponent` would have
    it; unchanged where they are equal.
    """
    if exponent == present:
        return specular
    level = np.minimum(specular.max(-1, keepdims=True) / white_of(specular, mask, _CENTRE), 1)
    least = 1e-6 if exponent > present else _FOUND
    shape = np.where(level > 1e-6, np.maximum(level, least) ** (exponent / present - 1), 0)
    return specular * shape * ((exponent + 8) / (present + 8))


def _new_lobe(
    d: Decomposition, gloss: Gloss, light: DirectionalLight | None, notes: list[str]
) -> np.ndarray:
    """The specular layer of the exponent that is asked for."""
    if not d.specular[d.mask].any():
        notes.append(
            "the object has no specular light to change: isc edit RESULT highlight gives it some"
        )
        return d.specular
    known = known_lobe(d)
    present = gloss.present or (known.nearest_exponent if known is not None else None)
    asks_light = gloss.method == "render" and light is None
    fit = explain_specular(d) if present is None or asks_light else None
    if present is None and fit is not None and fit.determined:
        present = fit.exponent
    if present is None:
        notes.append(
            "no single light and lobe explain the specular layer: the present exponent is a guess"
        )
        present = USUAL_EXPONENT
    exponent = gloss.exponent or min(max(present * gloss.sharper, 1.0), 1e5)
    under = light or (fit.light if fit is not None else None)
    if gloss.method == "remap" or under is None:
        return remapped(d.specular, d.mask, present, exponent)
    tone = replace(under, irradiance=under.irradiance / float(luminance(under.irradiance)))
    rendered = lobe_under(Lobe(exponent), d.normal, tone)
    return strength_of(d, Lobe(exponent), rendered, None) * rendered
