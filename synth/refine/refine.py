"""`refine`: fits a light with the cast shadows of the recovered shape, if that improves the result.

Equation: see the package. The light is fitted at the working scale of the gloss (the object at most
192 pixels long), and its shading S = T E + I computed for every pixel. The light of the result is
the best fit L of log shading without shadows, visibility = (S - I) / exp(SH(normal; L)), indirect =
I, and reflectance = diffuse / S, so that every identity of a result holds.

Limits: see the package.
"""

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from isc_core.errors import InputError
from isc_core.imaging.bounding_box import FramePart
from isc_core.imaging.window import as_map
from isc_core.io.stage_cache import Arrays, KeptStages
from isc_core.numerics.lbfgs import LbfgsOptions, NumpyAlgebra, minimise
from isc_core.progress import Monitor
from isc_core.refinement.held_out import held_out_blocks, pixels_of
from isc_core.refinement.reflectance_terms import terms_of, with_diffuse
from isc_core.refinement.working_scale import WorkingScale, working_scale
from isc_core.scene.decomposition import Decomposition
from isc_core.shading.environment_map import environment_from_shading
from isc_core.shading.spherical_harmonics import real_sh

from ..capture.truth import fit_light
from ..scene.variant import load_mitsuba
from .held_out import BLOCK, EVERY, explains_better
from .kept_light import KeptLight
from .light_field import LightField
from .light_objective import LightObjective, shading_of
from .surface import Surface
from .transport import Transport, light_transport

_PIXELS = 20000  # of the result, whose transport is in memory at a time


@dataclass(frozen=True)
class RefineOptions:
    """Options of a refinement.

    Attributes
    ----------
    rows : int
        Of the environment, which is twice as wide; 8 to 32.
    strictness : float
        Weight r of the change of the light, > 0.
    steps : int
        Largest number of steps of the optimiser, > 0.
    seed : int
        Of the choice of the held-out blocks.

    Raises
    ------
    InputError
        Outside these ranges.
    """

    rows: int = 16
    strictness: float = 0.5
    steps: int = 60
    seed: int = 0

    def __post_init__(self) -> None:
        if not 8 <= self.rows <= 32 or not self.strictness > 0 or self.steps < 1 or self.seed < 0:
            raise InputError(
                "rows has to be 8 to 32, strictness above 0, steps at least 1, seed at least 0"
            )


@dataclass(frozen=True)
class Refinement:
    """The outcome of a refinement.

    Attributes
    ----------
    result : Decomposition
        Refined, or the start.
    kept : bool
        Whether it is refined.
    before, after : float
        The objective.
    """

    result: Decomposition
    kept: bool
    before: float
    after: float


def refine(
    d: Decomposition,
    options: RefineOptions | None = None,
    monitor: Monitor | None = None,
    part: FramePart | None = None,
    kept: KeptStages | None = None,
) -> Refinement:
    """Refine the light of a result.

    Parameters
    ----------
    d : Decomposition
    options : RefineOptions, optional
    monitor : Monitor, optional
    part : FramePart, optional
        The part of the frame that the maps of `d` are of; by default all of it. The result is of
        the same part.
    kept : KeptStages, optional
        What an earlier run has traced, fitted and rendered, to which the stages of this one are
        added. They change the time only.

    Returns
    -------
    Refinement
        `kept` is False, and the result is the start with a note in its settings, if the objective
        did not decrease or held-out pixels are not explained better.

    Raises
    ------
    InputError
        If the light is refined already, was given to the decomposition or is zero, or Mitsuba is
        missing.
    Cancelled
        If the user cancels.
    """
    options, monitor = options or RefineOptions(), monitor or Monitor()
    require_refinable(d)
    scale, surface = working_scale(d), Surface(d, part)
    points, stages = surface.points_at(scale), KeptLight.of(d, (options, part), kept)

    def traced() -> Arrays:
        return light_transport(surface, points, options.rows, monitor.part(0, 0.3)).traced()

    transport = Transport.restored(points, options.rows, stages("transport", traced))
    fit = fit_environment(d, scale, transport, options, monitor.part(0.3, 0.7), stages)
    improves = fit.after < fit.before and fit.explains_better
    note = {
        "kept": improves,
        "before": fit.before,
        "after": fit.after,
        "variant": str(load_mitsuba().variant()),
        **options.__dict__,
    }
    of_pixels = transport if scale.step == 1 else None  # the points of the scale are the pixels
    result, rendering = d, monitor.part(0.7, 1.0)
    if improves:
        result = _refined(d, surface, fit.radiance, of_pixels, rendering, stages)
    return Refinement(_noted(result, note), improves, fit.before, fit.after)


@dataclass(frozen=True, eq=False)
class EnvironmentFit:
    """An environment that was fitted to a result.

    Attributes
    ----------
    radiance : (J, 3) ndarray
    shading : (N, 3) ndarray
        Of the working scale's pixels.
    before, after : float
        The objective.
    explains_better : bool
        Whether it explains held-out pixels better than the start.
    """

    radiance: np.ndarray
    shading: np.ndarray
    before: float
    after: float
    explains_better: bool


def fit_environment(
    d: Decomposition,
    scale: WorkingScale,
    transport: Transport,
    options: RefineOptions,
    monitor: Monitor,
    stages: KeptLight | None = None,
) -> EnvironmentFit:
    """Fit an environment to the reflectance terms, better than the start or not.

    Parameters
    ----------
    d : Decomposition
    scale : WorkingScale
        Of the result.
    transport : Transport
        To the points of that scale.
    options : RefineOptions
    monitor : Monitor
    stages : KeptLight, optional
        Of an earlier run.

    Returns
    -------
    EnvironmentFit

    Raises
    ------
    Cancelled
        If the user cancels.
    """
    start = environment_from_shading(d.illumination, options.rows, viewer=d.viewer)
    field = LightField.around(np.maximum(start, 1e-4 * start.mean()))
    terms, gain = terms_of(d)
    mask = scale.mask
    terms = with_diffuse(terms, scale.diffuse, mask, gain)
    blocks = held_out_blocks(scale.shading.mean(axis=2), BLOCK, EVERY, options.seed, mask)
    weight = (mask & ~pixels_of(blocks, BLOCK, mask.shape)).astype(float)
    direct, indirect = gain * transport.shadowed, gain * transport.indirect
    objective = LightObjective(terms, field, direct, indirect, weight, options.strictness)
    old = gain * scale.shading[mask]

    def each(step: int, loss: float) -> None:
        monitor.report("fitting the light", min(step / options.steps, 1.0), f"loss {loss:.3f}")

    def minimum() -> Arrays:
        x, limits = (
            np.zeros(field.size),
            LbfgsOptions(iterations=options.steps, loss_tolerance=1e-4),
        )
        loss = minimise(objective, x, limits, NumpyAlgebra(), each).loss
        return {"x": x, "loss": np.array(loss)}

    found = (stages or KeptLight())("fit", minimum)
    radiance = field.radiance(found["x"])
    shading = shading_of(transport.shadowed, radiance, transport.indirect)
    return EnvironmentFit(
        radiance,
        shading,
        terms.cost(old, weight)[0],
        float(found["loss"]),
        explains_better(terms, blocks, old, gain * shading),
    )


def require_refinable(d: Decomposition) -> None:
    """Check that the light of a result can be refined.

    Parameters
    ----------
    d : Decomposition

    Raises
    ------
    InputError
        If it is refined already, was given to the decomposition, or is zero.
    """
    if d.visibility is not None:
        raise InputError(
            "the light of the result is refined already: give the result that isc decompose wrote"
        )
    if "light" in d.provenance.known:
        raise InputError(
            "the light of the result is exact, as it was given to isc decompose: leave out --light"
        )
    if not (d.shading[d.mask] > 0).all():
        raise InputError("the light of the result is zero somewhere: decompose the photo again")


def _refined(
    d: Decomposition,
    surface: Surface,
    radiance: np.ndarray,
    transport: Transport | None,
    monitor: Monitor,
    stages: KeptLight,
) -> Decomposition:
    """The result under a new light; `transport`: to its pixels, None if it is to be traced."""
    rows = int(np.sqrt(len(radiance) / 2))
    points, parts = surface.points(), []

    def rendered(part: slice) -> Arrays:
        found = (
            light_transport(surface, points[part], rows) if transport is None else transport[part]
        )
        open_sky, direct = (
            np.einsum("nj,jc->nc", each, radiance) for each in (found.unshadowed, found.shadowed)
        )
        return {"open_sky": open_sky, "direct": direct, "indirect": found.indirect}

    for first in range(0, len(points), _PIXELS):
        part = slice(first, first + _PIXELS)
        monitor.report("rendering the light", first / len(points))
        parts.append(stages(f"pixels from {first}", partial(rendered, part)))
    open_sky, direct, indirect = (
        np.concatenate([found[name] for found in parts])
        for name in ("open_sky", "direct", "indirect")
    )
    direct = np.maximum(direct, 1e-3 * direct.mean())
    normal = points.normal
    illumination, _ = fit_light(normal, np.maximum(open_sky, 1e-3 * open_sky.mean()))
    smooth = np.exp(np.einsum("nk,kc->nc", real_sh(normal), illumination))
    shading = direct + indirect
    return replace(
        d,
        shading=as_map(shading, d.mask, dtype=np.float32),
        reflectance=as_map(d.diffuse[d.mask] / shading, d.mask, dtype=np.float32),
        illumination=illumination,
        visibility=as_map(direct / smooth, d.mask, outside=1.0, dtype=np.float32),
        indirect=as_map(indirect, d.mask, dtype=np.float32),
        environment=radiance.reshape(rows, 2 * rows, 3).astype(np.float32),
    )


def _noted(d: Decomposition, note: dict[str, Any]) -> Decomposition:
    settings = {**d.provenance.settings, "refine": note}
    return replace(d, provenance=replace(d.provenance, settings=settings))
