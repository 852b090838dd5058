"""The Blinn-Phong extension: sharper, broader or metallic highlights.

Equations. Remapping needs no shape: under one light the specular layer is s = w c^p, so that an
exponent q changes it, pixel by pixel, into

    s' = g (q + 8) / (p + 8) s (m / w)^(q / p - 1),

with m the pixel's largest channel, w the layer's white, the usual energy-preserving factor and a
gain g. For a wider lobe, q < p, m / w is clamped to at least a quarter, because otherwise the edge
of the separated layer would be amplified, too. Rendering renders a new lobe on the recovered shape
under the light that best explains the layer. Metals have no diffuse reflection: for the share M of
metal the diffuse light vanishes, the highlight takes the colour of the reflectance, and the
environment is reflected in that colour, by the new lobe f:

    diffuse' = (1 - M) diffuse,
    specular' = s' (1 - M + M r / max r) + M r sum_w f(n, w) L(w) max(0, n . w).

Citation: J. F. Blinn 1977, doi:10.1145/563858.563893; H. Akbar 2016 (Blinn-Phong extension); for
metals, R. L. Cook, K. E. Torrance 1982, doi:10.1145/357290.357293.

Limits: remapping cannot spread a highlight beyond its present pixels, so a much rougher surface
needs rendering. The reflected environment is the one recovered from the smooth shading.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..errors import InputError
from ..imaging.luminance import luminance, white_of
from ..lobe_fitting.light_direction import DirectionEstimate, explain_specular
from ..scene.decomposition import Decomposition
from ..shading.brdf.model import check_range
from ..shading.environment_map import environment_from_shading
from ..shading.lights import DirectionalLight
from ..shading.lobe_rendering import DEFAULT_EXPONENT, Lobe, lobe_in_environment, lobe_under
from .edited import MOST_GAIN, Edited, edited, light_color
from .lobes import known_lobe, strength_of

METHODS = ("remap", "render")
_ENVIRONMENT_ROWS = 16
# of the brightest: below, a separation recovers a shrinking share of a highlight, ending in an edge
_RECOVERED = 0.25
_CENTRE = 99.9  # percentile: the lobe's centre, robust to a few outliers


@dataclass(frozen=True)
class Gloss:
    """A change of gloss. Raises `InputError` outside these ranges.

    Attributes
    ----------
    exponent : float or None
        Of the new lobe, in [1, 1e5]; None for `sharper` times the present one.
    sharper : float
        Factor of the present exponent, greater than 0.
    present : float or None
        Exponent of the present lobe; None for the fitted one.
    gain : float
        Of the specular layer, in [0, 1e6].
    metal : float
        Share of metal, in [0, 1].
    method : str
        "remap" or "render".
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
    """Return the scene with another gloss.

    Parameters
    ----------
    d : Decomposition
    gloss : Gloss
    light : DirectionalLight, optional
        The light to render with; by default the one that best explains the specular layer.

    Returns
    -------
    Edited

    Raises
    ------
    InputError
        If the gloss is to be rendered in a light that is black.
    """
    notes: list[str] = []
    same = gloss.exponent is None and gloss.sharper == 1 and gloss.method == "remap"
    if same and gloss.metal == 0:
        return edited(d, specular=d.specular if gloss.gain == 1 else d.specular * gloss.gain)
    fit = _explained(d, gloss, light)
    present, exponent = _exponents(d, gloss, fit, notes)
    specular = d.specular
    if not same:
        specular = _new_lobe(d, gloss, (present, exponent), light, fit, notes)
    if gloss.gain != 1:
        specular = specular * gloss.gain
    if gloss.metal == 0:
        return edited(d, specular=specular, notes=tuple(notes))
    reflectance = np.maximum(d.reflectance, 0)
    tinted = reflectance * light_color(d)
    tint = tinted / np.maximum(tinted.max(-1, keepdims=True), 1e-6)
    environment = environment_from_shading(d.illumination, _ENVIRONMENT_ROWS, viewer=d.viewer)
    reflected = np.zeros_like(d.image)
    reflected[d.mask] = reflectance[d.mask] * lobe_in_environment(
        Lobe(exponent), d.normal[d.mask], environment, d.view_inside
    )
    metallic = specular * (1 - gloss.metal + gloss.metal * tint) + gloss.metal * reflected
    return edited(d, (1 - gloss.metal) * d.diffuse, metallic, tuple(notes))


def remapped(specular: np.ndarray, mask: np.ndarray, present: float, exponent: float) -> np.ndarray:
    """Remap a specular layer to another Blinn-Phong exponent.

    Parameters
    ----------
    specular : (H, W, 3) ndarray
    mask : (H, W) bool ndarray
    present, exponent : float
        Old and new exponent; if equal, the layer is unchanged.

    Returns
    -------
    (H, W, 3) ndarray
    """
    if exponent == present:
        return specular
    level = np.minimum(specular.max(-1, keepdims=True) / white_of(specular, mask, _CENTRE), 1)
    least = 1e-6 if exponent > present else _RECOVERED
    shape = np.where(level > 1e-6, np.maximum(level, least) ** (exponent / present - 1), 0)
    return specular * shape * ((exponent + 8) / (present + 8))


def _explained(
    d: Decomposition, gloss: Gloss, light: DirectionalLight | None
) -> DirectionEstimate | None:
    """The light and the exponent that explain the specular layer, if one of them is needed."""
    unknown = gloss.present is None and known_lobe(d) is None
    needs_light = gloss.method == "render" and light is None
    return explain_specular(d) if unknown or needs_light else None


def _exponents(
    d: Decomposition, gloss: Gloss, fit: DirectionEstimate | None, notes: list[str]
) -> tuple[float, float]:
    """The present exponent and the new one."""
    fitted = known_lobe(d)
    present = gloss.present or (fitted.nearest_exponent if fitted is not None else None)
    if present is None and fit is not None and fit.determined:
        present = fit.exponent
    if present is None:
        if d.specular[d.mask].any():
            notes.append(
                "no single light and lobe explain the specular layer: the current exponent is a "
                "guess"
            )
        present = DEFAULT_EXPONENT
    return present, gloss.exponent or min(max(present * gloss.sharper, 1.0), 1e5)


def _new_lobe(
    d: Decomposition,
    gloss: Gloss,
    exponents: tuple[float, float],
    light: DirectionalLight | None,
    fit: DirectionEstimate | None,
    notes: list[str],
) -> np.ndarray:
    """The specular layer at the requested exponent; `exponents` are the present and the new one."""
    if not d.specular[d.mask].any():
        notes.append(
            "the object has no specular light to change: isc edit RESULT highlight adds some"
        )
        return d.specular
    if light is not None and not light.irradiance.any():
        raise InputError("the light is black: give one that shines, or none for that of the photo")
    found = fit is not None and fit.light.irradiance.any()  # black where no light explains anything
    used_light = light or (fit.light if fit is not None and found else None)
    if gloss.method == "render" and used_light is None:
        notes.append(
            "no single light explains the specular layer: its highlights are changed in place"
        )
    if gloss.method == "remap" or used_light is None:
        return remapped(d.specular, d.mask, *exponents)
    unit_light = replace(
        used_light, irradiance=used_light.irradiance / float(luminance(used_light.irradiance))
    )
    lobe = Lobe(exponents[1])
    rendered = lobe_under(lobe, d.normal, unit_light, d.view)
    return strength_of(d, lobe, rendered, None) * rendered
