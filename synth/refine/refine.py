"""`refine`: fits a light with the cast shadows of the recovered shape, if that improves the result.

Equation: see the package. With the new shading S = T E, the light of the result is the best fit L
of log shading without shadows, visibility = S / exp(SH(normal; L)), and reflectance = diffuse / S,
so that every identity of a result holds.

Limits: see the package.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from isc_core.errors import InputError
from isc_core.numerics.lbfgs import LbfgsOptions, NumpyAlgebra, minimise
from isc_core.progress import Monitor
from isc_core.refinement.held_out import held_out_blocks, pixels_of
from isc_core.refinement.reflectance_terms import terms_of
from isc_core.scene.decomposition import Decomposition
from isc_core.shading.environment_map import environment_from_shading
from isc_core.shading.spherical_harmonics import real_sh

from ..capture.truth import fit_light
from ..scene.variant import load_mitsuba
from .held_out import BLOCK, EVERY, explains_better
from .light_field import LightField
from .light_objective import LightObjective, shading_of
from .transport import Transport, light_transport


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
    d: Decomposition, options: RefineOptions | None = None, monitor: Monitor | None = None
) -> Refinement:
    """Refine the light of a result.

    Parameters
    ----------
    d : Decomposition
    options : RefineOptions, optional
    monitor : Monitor, optional

    Returns
    -------
    Refinement
        `kept` is False, and the result is the start with a note in its settings, if the objective
        did not decrease or held-out pixels are not explained better.

    Raises
    ------
    InputError
        If the result is refined already, its light is zero, or Mitsuba is missing.
    Cancelled
        If the user cancels.
    """
    options, monitor = options or RefineOptions(), monitor or Monitor()
    _check(d)
    transport = light_transport(d, options.rows, monitor.part(0, 0.3))
    fit = fit_environment(d, transport, options, monitor.part(0.3, 1.0))
    kept = fit.after < fit.before and fit.explains_better
    note = {
        "kept": kept,
        "before": fit.before,
        "after": fit.after,
        "variant": str(load_mitsuba().variant()),
        **options.__dict__,
    }
    result = _refined(d, transport, fit.radiance, fit.shading) if kept else d
    return Refinement(_noted(result, note), kept, fit.before, fit.after)


@dataclass(frozen=True)
class EnvironmentFit:
    """An environment that was fitted to a result.

    Attributes
    ----------
    radiance : (J, 3) ndarray
    shading : (N, 3) ndarray
        Of the mask's pixels.
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
    d: Decomposition, transport: Transport, options: RefineOptions, monitor: Monitor
) -> EnvironmentFit:
    """Fit an environment to the reflectance terms, better than the start or not.

    Parameters
    ----------
    d : Decomposition
    transport : Transport
        Of its shape.
    options : RefineOptions
    monitor : Monitor

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
    blocks = held_out_blocks(d.shading.mean(axis=2), BLOCK, EVERY, options.seed, d.mask)
    weight = (d.mask & ~pixels_of(blocks, BLOCK, d.mask.shape)).astype(float)
    objective = LightObjective(terms, field, gain * transport.shadowed, weight, options.strictness)
    x, old = np.zeros(field.size), gain * d.shading[d.mask].astype(float)

    def each(step: int, loss: float) -> None:
        monitor.report("fitting the light", min(step / options.steps, 1.0), f"loss {loss:.3f}")

    limits = LbfgsOptions(iterations=options.steps, loss_tolerance=1e-4)
    after = minimise(objective, x, limits, NumpyAlgebra(), each).loss
    radiance = field.radiance(x)
    shading = shading_of(transport.shadowed, radiance)
    return EnvironmentFit(
        radiance,
        shading,
        terms.cost(old, weight)[0],
        after,
        explains_better(terms, blocks, old, gain * shading),
    )


def _check(d: Decomposition) -> None:
    if d.visibility is not None:
        raise InputError("the result is refined already: give the one that isc decompose wrote")
    if not (d.shading[d.mask] > 0).all():
        raise InputError("the light of the result is zero somewhere: decompose the photo again")


def _refined(
    d: Decomposition, transport: Transport, radiance: np.ndarray, shading: np.ndarray
) -> Decomposition:
    normal = d.normal[d.mask].astype(float)
    illumination, _ = fit_light(normal, shading_of(transport.unshadowed, radiance))
    smooth = np.exp(np.einsum("nk,kc->nc", real_sh(normal), illumination))
    visibility = np.ones(d.shading.shape, np.float32)
    visibility[d.mask] = shading / smooth
    new_shading = np.zeros_like(d.shading)
    new_shading[d.mask] = shading
    reflectance = np.zeros_like(d.reflectance)
    reflectance[d.mask] = d.diffuse[d.mask] / new_shading[d.mask]
    rows = int(np.sqrt(len(radiance) / 2))
    return replace(
        d,
        shading=new_shading,
        reflectance=reflectance,
        illumination=illumination,
        visibility=visibility,
        environment=radiance.reshape(rows, 2 * rows, 3).astype(np.float32),
    )


def _noted(d: Decomposition, note: dict[str, Any]) -> Decomposition:
    settings = {**d.provenance.settings, "refine": note}
    return replace(d, provenance=replace(d.provenance, settings=settings))
