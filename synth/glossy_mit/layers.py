"""The two layers of an object under each light: shading exactly as in the set, and the specular
layer.

Equation: shading = exp(SH(normal)) [+ P], specular = G(environment) [+ G(panel)], where
`isc_core.shading.environment_map` fits the environment to exp(SH), P is the panel's irradiance
divided by pi, and G the normalised Blinn-Phong lobe of strength 1 (see `gloss`). In the physical
variant `synth.rendering` renders both layers under environment and panel, with the object's own
shadows.

Limits: light from behind the object is unconstrained. The physical variant has the noise of its
samples, measured by `noise`.
"""

from dataclasses import dataclass, replace
from zlib import crc32

import numpy as np

from isc_core.progress import Monitor
from isc_core.shading.environment_map import environment_from_shading, shading_under
from isc_core.shading.spherical_harmonics import real_sh

from ..capture.truth import fit_light
from ..rendering import RenderOptions, light_surface
from ..scene.lights import EnvironmentLight, PanelLight, panel_toward_origin
from ..scene.materials import Material
from ..scene.surface import Surface
from ..scene.tracing import Tracer
from .gloss import environment_gloss, panel_layers
from .settings import GlossySettings
from .source import Source

_PANEL_DISTANCE = 4.0
_PANEL_ANGLES = (10.0, 20.0)  # range of its angular size, degrees
_TILTS = (8.0, 27.0)  # of normals that reflect it to the viewer, degrees from the view direction
_FEW = 0.02  # of the pixels
_PANEL_SHARE = 0.75  # of the mean shading under the set's own light
_ENVIRONMENT_ROWS = 32
_PROBES = 4096  # number of pixels that measure the environment's misfit, about


@dataclass(frozen=True, eq=False)
class Layers:
    """An object under one light.

    Attributes
    ----------
    shading, gloss : (N, 3) ndarray
        Shading, and the specular layer at strength 1.
    light : (9, 3) ndarray
        Log-shading coefficients: the set's own, or the best fit.
    light_residual : float
        RMS of shading minus exp(SH), relative to the RMS of shading.
    environment_residual : float
        RMS of the environment's shading minus the set's own, likewise.
    noise : float
        RMS standard error of the specular layer, relative to its RMS.
    panel : PanelLight or None
        The added panel.
    """

    shading: np.ndarray
    gloss: np.ndarray
    light: np.ndarray
    light_residual: float
    environment_residual: float
    noise: float
    panel: PanelLight | None


@dataclass(frozen=True, eq=False)
class _Part:
    """The contribution of one light: `shading`, `gloss` (N, 3), and the `variance` (N, 3) of the
    latter.
    """

    shading: np.ndarray
    gloss: np.ndarray
    variance: np.ndarray

    def plus(self, other: "_Part", gain: float) -> "_Part":
        """Both lights together, the other one `gain` times as bright."""
        return _Part(
            self.shading + gain * other.shading,
            self.gloss + gain * other.gloss,
            self.variance + gain**2 * other.variance,
        )

    @property
    def noise(self) -> float:
        return _relative_rms(np.sqrt(self.variance), self.gloss)


def make_layers(
    source: Source, settings: GlossySettings, monitor: Monitor, tracer: Tracer | None = None
) -> dict[str, Layers]:
    """Compute the layers under each of `settings.LIGHTS`.

    Parameters
    ----------
    source : Source
        The object.
    settings : GlossySettings
        Exponent, samples and seed.
    monitor : Monitor
        Progress and cancellation.
    tracer : Tracer, optional
        The object, for the physical variant; without it there are no shadows.

    Returns
    -------
    dict of str to Layers
        By light.

    Raises
    ------
    InputError
        If the physical variant cannot be rendered on this machine.
    Cancelled
        If the user cancels.
    """
    surface = surface_of(source, settings.exponent)
    panel = _panel(surface, source.name, settings.seed)
    monitor.report(f"{source.name}: panel", 0.0)
    under_panel = _lit(surface, panel, settings, tracer, monitor.part(0, 0.3))
    made = {}
    for step, (name, light) in enumerate(source.lights.items()):
        monitor.report(f"{source.name}: {name} light", 0.3 + 0.35 * step)
        own = np.exp(real_sh(source.normal) @ light)
        environment = environment_from_shading(light, _ENVIRONMENT_ROWS)
        some = slice(None, None, max(1, len(own) // _PROBES))
        residual = _relative_rms(
            shading_under(environment, source.normal[some]) - own[some], own[some]
        )
        part = _lit(
            surface,
            EnvironmentLight(environment),
            settings,
            tracer,
            monitor.part(0.3 + 0.35 * step, 0.65 + 0.35 * step),
        )
        if tracer is None:
            made[name] = Layers(own, part.gloss, light, 0.0, residual, 0.0, None)
            part = _Part(own, part.gloss, part.variance)
        else:
            made[name] = _fitted(source, part, residual, None)
        gain = _PANEL_SHARE * float(own.mean()) / max(float(under_panel.shading.mean()), 1e-12)
        brighter = replace(panel, radiance=gain * panel.radiance)
        made[f"{name}-area"] = _fitted(source, part.plus(under_panel, gain), residual, brighter)
    return made


def surface_of(source: Source, exponent: float) -> Surface:
    """Return the object's points for the renderer, placed as by `synth.shapes.height_field`.

    Parameters
    ----------
    source : Source
        The object.
    exponent : float
        Of the specular lobe.

    Returns
    -------
    Surface
        Object units, the centre of the crop at 0.
    """
    (rows, columns), height = np.nonzero(source.mask), source.height[source.mask]
    down, across = source.mask.shape
    place = np.stack(
        [
            columns + 0.5 - across / 2,
            down / 2 - rows - 0.5,
            height - (height.min() + height.max()) / 2,
        ],
        -1,
    )
    view = np.broadcast_to(np.array([0.0, 0.0, 1.0]), place.shape)
    uv = np.full((len(place), 2), 0.5)
    return Surface(
        source.mask,
        place / source.pixels_per_unit,
        source.normal,
        view,
        uv,
        _material(exponent).at(uv),
    )


def _material(exponent: float) -> Material:
    return Material(np.ones((1, 1, 3)), "blinn_phong", gloss=exponent, strength=1.0)


def _lit(
    surface: Surface,
    light: EnvironmentLight | PanelLight,
    settings: GlossySettings,
    tracer: Tracer | None,
    monitor: Monitor,
) -> _Part:
    """The contribution of one light, traced if there is a tracer."""
    if tracer is not None:
        options = RenderOptions(samples=settings.samples, seed=settings.seed)
        lit = light_surface(
            surface, _material(settings.exponent), (light,), tracer, options, monitor
        )
        return _Part(lit.shading, lit.specular, lit.specular_variance)
    if isinstance(light, PanelLight):
        shading, gloss = panel_layers(light, surface.position, surface.normal, settings.exponent)
    else:
        shading, gloss = (
            np.zeros_like(surface.normal),
            environment_gloss(light.radiance, surface.normal, settings.exponent),
        )
    return _Part(shading, gloss, np.zeros_like(gloss))


def _fitted(source: Source, part: _Part, residual: float, panel: PanelLight | None) -> Layers:
    """Layers with coefficients fitted to their shading."""
    coefficients, misfit = fit_light(source.normal, part.shading)
    return Layers(part.shading, part.gloss, coefficients, misfit, residual, part.noise, panel)


def _panel(surface: Surface, name: str, seed: int) -> PanelLight:
    """A white panel that the object reflects toward the viewer, preferably on its upper side; drawn
    by seed and name.
    """
    rng = np.random.default_rng([seed, crc32(name.encode())])
    tilt = np.degrees(np.arccos(np.clip(surface.normal[:, 2], -1, 1)))
    usual = np.flatnonzero((tilt > _TILTS[0]) & (tilt < _TILTS[1]) & (surface.normal[:, 1] > 0))
    if len(usual) < _FEW * len(tilt):
        off = np.abs(tilt - np.mean(_TILTS))
        usual = np.flatnonzero(off <= np.quantile(off, _FEW))
    pick = int(rng.choice(usual))
    normal = surface.normal[pick]
    centre = surface.position[pick] + _PANEL_DISTANCE * (2 * normal[2] * normal - (0, 0, 1))
    sides = 2 * _PANEL_DISTANCE * np.tan(np.radians(rng.uniform(*_PANEL_ANGLES, 2)) / 2)
    return panel_toward_origin(tuple(centre), (sides[0], sides[1]), (1.0, 1.0, 1.0))


def _relative_rms(left: np.ndarray, whole: np.ndarray) -> float:
    return float(np.sqrt(np.square(left).mean() / max(float(np.square(whole).mean()), 1e-30)))
