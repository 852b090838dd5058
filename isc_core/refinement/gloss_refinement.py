"""`refine_gloss`: adapts a result's lobe to the positions of the photo's highlights, if that helps.

Method: lamps, lobe and a bounded change of the shape are fitted to four fifths of the specular
layer (`gloss_fit`). They are kept if

- the sum of F of `gloss_objective` and the reflectance terms of SIRFS is lower than without gloss
  and change of the shape, and the reflectance terms, to which the shape was fitted, increase by at
  most `_MAX_RISE`,
- they explain at least `_MIN_EXPLAINED` of the remaining fifth, and more than the initial lobe.

Then all pixels are fitted. Image and layers are unchanged. The light is replaced by the one whose
shading on the new normals is closest to the old shading, unless the user has given it; with shading
= exp(SH(normal)) and reflectance = diffuse / shading, every identity of a result holds.

Citation: M. Stone 1974, doi:10.1111/j.2517-6161.1974.tb00994.x; J. T. Barron, J. Malik 2015,
doi:10.1109/TPAMI.2014.2377712 (reflectance terms).

Limits: measured in docs/methods/refine.md. With a perspective camera, or an exact shape from the
user, the shape is not changed.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..decomposition.lobe import FittedLobe
from ..errors import InputError
from ..imaging.bounding_box import FramePart
from ..io.stage_cache import KeptStages
from ..numerics.linear import solve_linear
from ..progress import Monitor
from ..scene.decomposition import Decomposition
from ..scene.lobe_fit import CONVENTION, Interval, LobeFit, LobeFitOutcome, LobeLight
from ..scene.part_of_result import cut_result, placed_result
from ..scene.result_digest import result_digest
from ..shading.spherical_harmonics import real_sh
from .gloss_fit import GlossProblem, Minimiser, bumps_of, explained, fit_gloss, gloss_problem
from .gloss_note import NOTE, GlossOutcome, was_refined
from .gloss_objective import (
    ROUGHNESS_SPREAD,
    Gloss,
    GlossObjective,
    height_slopes,
    normals_from_slopes,
    rendered,
)
from .reflectance_terms import ReflectanceTerms, terms_of, with_diffuse
from .working_scale import WorkingScale, mirroring_normals, slopes_from_normals, working_scale

_MIN_EXPLAINED, _MAX_RISE = 0.25, 1.0
_STRENGTH_SPREAD, _OTHER_CONE = 0.34, 30.0  # from `lobe_fitting.recovered`; degrees
_MIN_ALPHA = 0.01
_LIGHT_RIDGE = 1e-3
_MARGIN = 64  # pixels around the object


@dataclass(frozen=True)
class GlossOptions:
    """Options of a refinement.

    Attributes
    ----------
    lamps : int
        Maximum number, 1 to 3.
    steps : int
        Maximum number of steps of the optimiser for each start, > 0.
    seed : int
        Of the random choice of the held-out blocks, >= 0.

    Raises
    ------
    InputError
        Outside these ranges.
    """

    lamps: int = 3
    steps: int = 80
    seed: int = 0

    def __post_init__(self) -> None:
        if not 1 <= self.lamps <= 3 or self.steps < 1 or self.seed < 0:
            raise InputError("lamps has to be 1 to 3, steps at least 1, seed at least 0")


@dataclass(frozen=True)
class GlossRefinement:
    """The outcome of a refinement.

    Attributes
    ----------
    result : Decomposition
        Refined, or the input.
    outcome : GlossOutcome
        Whether it was refined, or why not.
    lamps : int
        Number of lamps found; 0 where there is nothing to fit.
    before, after : float
        Share of the squared held-out specular light that the initial and the new lobe explain;
        negative if worse than no gloss.
    """

    result: Decomposition
    outcome: GlossOutcome
    lamps: int = 0
    before: float = 0.0
    after: float = 0.0

    @property
    def kept(self) -> bool:
        """Whether the result was refined."""
        return self.outcome is GlossOutcome.REFINED


def refine_gloss(
    d: Decomposition,
    options: GlossOptions | None = None,
    monitor: Monitor | None = None,
    kept: KeptStages | None = None,
) -> GlossRefinement:
    """Refine the gloss of a result.

    Parameters
    ----------
    d : Decomposition
    options : GlossOptions, optional
    monitor : Monitor, optional
    kept : KeptStages, optional
        Minima that an earlier run found, to which those of this one are added. They change the time
        only.

    Returns
    -------
    GlossRefinement
        If there is no specular light, or the new gloss does not explain held-out pixels better,
        `kept` is False, and the result is the input with a note in its settings.

    Raises
    ------
    InputError
        If the gloss of the result was already refined.
    Cancelled
        If the user cancels.
    """
    options, monitor = options or GlossOptions(), monitor or Monitor()
    _check(d)
    monitor.report("refining the gloss", 0.0)
    part = FramePart.around(d.mask, _MARGIN)
    done = _refinement(cut_result(d, part), options, monitor, kept)
    if not done.kept:
        return replace(done, result=replace(d, provenance=done.result.provenance))
    return replace(done, result=placed_result(done.result, part))


def _refinement(
    d: Decomposition, options: GlossOptions, monitor: Monitor, kept: KeptStages | None
) -> GlossRefinement:
    """The refinement of the object's part of a result."""
    fit = d.brdf
    if fit is None or fit.alpha is None or not fit.lights or not d.specular[d.mask].any():
        return _with_note(GlossRefinement(d, GlossOutcome.NO_HIGHLIGHT), options)
    work = working_scale(d)
    problem = gloss_problem(d, fit, work, options.seed)
    inputs = () if kept is None else (result_digest(d),)
    minimised = Minimiser(options.steps, kept, inputs)
    gloss = fit_gloss(problem, options.lamps, minimised, monitor.part(0.0, 0.7))
    start = work.reduced(fit.predicted.mean(axis=2), d.mask)[work.mask]
    before, after = explained(problem, gloss, start)
    done = GlossRefinement(d, GlossOutcome.NOT_BETTER, len(gloss.units), before, after)
    if after < _MIN_EXPLAINED or after <= before:
        return _with_note(done, options)
    if not _allowed(d, problem, gloss, _Reflectance.of(d, work)):
        return _with_note(replace(done, outcome=GlossOutcome.UNLIKELY_REFLECTANCE), options)
    x = gloss.packed()
    minimised(GlossObjective(problem.data, problem.bumps), x, monitor.part(0.7, 1))
    result = _refined(d, fit, problem, problem.unpacked(x))
    return _with_note(replace(done, result=result, outcome=GlossOutcome.REFINED), options)


@dataclass(frozen=True)
class _Reflectance:
    """The reflectance terms of diffuse layers at the working scale."""

    terms: ReflectanceTerms
    gain: float
    work: WorkingScale

    @staticmethod
    def of(d: Decomposition, work: WorkingScale) -> "_Reflectance":
        return _Reflectance(*terms_of(d), work)

    def cost(self, diffuse: np.ndarray, shading: np.ndarray) -> float:
        """Of a diffuse layer (h, w, 3) and a shading (N, 3)."""
        mask = self.work.mask
        terms = with_diffuse(self.terms, diffuse, mask, self.gain)
        return terms.cost(self.gain * np.maximum(shading, 1e-9), mask.astype(float))[0]


def _check(d: Decomposition) -> None:
    if was_refined(d.provenance.settings):
        raise InputError(
            "the gloss of the result is refined already: give the one that isc decompose wrote"
        )


def _new_shading(d: Decomposition, problem: GlossProblem, gloss: Gloss) -> np.ndarray:
    """The shading (N, 3) of the changed shape at the working scale."""
    mask, shading = problem.work.mask, problem.work.shading[problem.work.mask]
    if problem.bumps is None:
        return shading
    old, new = (real_sh(normal[mask]) for normal in (problem.work.normal, problem.normal(gloss)))
    light = _new_light(d, new, old)
    change = np.einsum("nk,kc->nc", new, light) - np.einsum("nk,kc->nc", old, d.illumination)
    return np.asarray(shading * np.exp(change))


def _allowed(
    d: Decomposition, problem: GlossProblem, gloss: Gloss, reflectance: _Reflectance
) -> bool:
    """Whether the reflectance terms rise by at most `_MAX_RISE`, and F decreases by more."""
    objective, x, work = GlossObjective(problem.fitted, problem.bumps), gloss.packed(), problem.work
    before, after = (
        reflectance.cost(work.diffuse, shading)
        for shading in (work.shading[work.mask], _new_shading(d, problem, gloss))
    )
    decrease = objective.without_gloss() - objective(x, np.empty_like(x))
    return after - before < min(decrease, _MAX_RISE)


def _refined(
    d: Decomposition,
    fit: LobeFit,
    problem: GlossProblem,
    gloss: Gloss,
) -> Decomposition:
    d = _reshaped(d, problem, gloss)
    light = rendered(gloss, mirroring_normals(d)[d.mask])
    colour = d.specular[d.mask].sum(axis=0, dtype=float)
    colour = colour / max(float(colour.mean()), 1e-300)
    new_reflectance = np.zeros_like(d.reflectance)
    new_reflectance[d.mask] = d.diffuse[d.mask] / d.shading[d.mask]
    return replace(d, reflectance=new_reflectance, brdf=_lobe(d, fit, gloss, light, colour))


def _reshaped(d: Decomposition, problem: GlossProblem, gloss: Gloss) -> Decomposition:
    """The result with its changed height, normals and shading."""
    if problem.bumps is None:
        return d
    box, mask = problem.work.box, d.mask
    change = bumps_of(problem.work, problem.work.step).height(gloss.bumps)
    height, width = mask[box].shape
    inside = mask[box]
    down, right = (slope[:height, :width] for slope in height_slopes(change))
    old_down, old_right = slopes_from_normals(d.normal[box].astype(float))
    normal, new_height = d.normal.copy(), d.height.astype(float)
    normal[box][inside] = normals_from_slopes(old_down + down, old_right + right)[inside]
    new_height[box] += change[:height, :width]
    new_height = np.where(mask, new_height - new_height[mask].min(), 0)
    shading = np.zeros_like(d.shading)
    basis = real_sh(normal[mask].astype(float))
    light = _new_light(d, basis, real_sh(d.normal[mask].astype(float)))
    shading[mask] = np.exp(np.einsum("nk,kc->nc", basis, light))
    if d.visibility is not None:
        shading *= d.visibility
    if d.indirect is not None:
        shading += d.indirect
    return replace(
        d, normal=normal, height=new_height.astype(np.float32), shading=shading, illumination=light
    )


def _new_light(d: Decomposition, basis: np.ndarray, old: np.ndarray) -> np.ndarray:
    """The light (9, 3) whose log shading on the new normals is closest to that of the result's
    light on the old ones; the same light if the user has given it.
    """
    light = d.illumination
    if "light" in d.provenance.known:
        return light
    target = np.einsum("nk,kc->nc", old, light)
    gram = np.einsum("nk,nl->kl", basis, basis) / len(basis)
    right = np.einsum("nk,nc->kc", basis, target) / len(basis)
    return solve_linear(gram + _LIGHT_RIDGE * np.eye(9), right + _LIGHT_RIDGE * light)


def _lobe(
    d: Decomposition, fit: LobeFit, gloss: Gloss, light: np.ndarray, colour: np.ndarray
) -> LobeFit:
    predicted = np.zeros_like(d.specular)
    predicted[d.mask] = light[:, None] * colour
    given = d.specular[d.mask].astype(float)
    remaining = float(np.square(given - predicted[d.mask]).sum())
    total = max(float(np.square(given).sum()), 1e-300)
    alpha, factor = gloss.alpha, float(np.exp(_STRENGTH_SPREAD))
    low = _MIN_ALPHA if fit.outcome.bounded else alpha * float(np.exp(-ROUGHNESS_SPREAD))
    high = alpha if fit.outcome.bounded else min(alpha * float(np.exp(ROUGHNESS_SPREAD)), 1.0)
    strengths = gloss.strengths
    lights = []
    for k in np.argsort(-strengths, kind="stable"):
        strength = strengths[k] * colour
        cone = fit.lights[0].cone if k == 0 else _OTHER_CONE
        interval = Interval(strength / factor, strength * factor)
        lights.append(LobeLight(gloss.units[k], cone, strength, interval))
    outcome = fit.outcome if fit.outcome.bounded else LobeFitOutcome.DETERMINED
    return LobeFit(
        CONVENTION["ggx"],
        outcome,
        alpha,
        Interval(low, high),
        tuple(lights),
        None,
        None,
        float(np.clip(1 - remaining / total, 0, 1)),
        predicted,
    )


def _with_note(done: GlossRefinement, options: GlossOptions) -> GlossRefinement:
    """The outcome with a note in the settings of its result, and the lobe in its diagnostics."""
    d = done.result
    note = {
        "outcome": str(done.outcome),
        "lamps": done.lamps,
        "held_out_before": done.before,
        "held_out_after": done.after,
        "seed": options.seed,
    }
    provenance = replace(d.provenance, settings={**d.provenance.settings, NOTE: note})
    if done.kept:
        diagnostics = replace(d.provenance.diagnostics, lobe=FittedLobe(d.brdf).diagnostics)
        provenance = replace(provenance, diagnostics=diagnostics)
    return replace(done, result=replace(d, provenance=provenance))
