"""The solver on made scenes whose shape, light and albedo are known."""

import contextlib
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest
from scipy import ndimage

from isc_core.errors import Cancelled, InputError
from isc_core.numerics.lbfgs import LbfgsOptions
from isc_core.progress import Monitor, ProgressEvent
from isc_core.scene.known_inputs import DepthObservation
from isc_core.scene.normal_estimate import NormalEstimate
from isc_core.shading.spherical_harmonics import normal_from_reference
from isc_core.shading.surface_stencils import normals
from isc_core.sirfs.illumination import unstack
from isc_core.sirfs.normal_prior import normals_from_prediction
from isc_core.sirfs.numpy_engine import NumpyEngine
from isc_core.sirfs.priors.priors import SilhouetteProfile
from isc_core.sirfs.settings import Start
from isc_core.sirfs.silhouette import normals_from_silhouette
from isc_core.sirfs.solver import MAX_THREADS, SirfsResult, SolverOptions, solve, thread_count

from .small_problems import Scene, blob, make_problem, weights

needs_numba = pytest.mark.skipif(find_spec("numba") is None, reason="needs numba")
SHORT = LbfgsOptions(iterations=40)
QUICK = SolverOptions(threads=1, lbfgs=SHORT)


def shape_error(height: np.ndarray, scene: Scene) -> float:
    """Mean absolute error in pixels, less the constant that nobody can see."""
    away = (height - scene.height)[scene.mask]
    return float(np.abs(away - np.median(away)).mean())


def angle_error(height: np.ndarray, scene: Scene) -> float:
    """Mean angle between normals in degrees, two pixels and more from the rim."""
    inner = scene.mask.copy()
    for _ in range(2):
        inner[1:-1, 1:-1] &= inner[:-2, 1:-1] & inner[2:, 1:-1] & inner[1:-1, :-2] & inner[1:-1, 2:]
    cosine = (normals(height) * normals(scene.height)).sum(-1)[inner]
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean())


def hemisphere(size: int = 56, radius: float = 22.0) -> Scene:
    """A ball of one colour: what shape from shading is made for."""
    scene = blob((size, size), one_color=True)
    i, j = np.mgrid[:size, :size] - (size - 1) / 2
    mask = np.hypot(i, j) < radius
    height = np.sqrt(np.maximum(radius**2 - i * i - j * j, 0.3 * radius))
    from isc_core.shading.irradiance_basis import basis

    shading = np.exp(
        np.einsum("khw,kc->hwc", basis(*np.moveaxis(normals(height), -1, 0)), scene.light)
    )
    image = np.where(mask[..., None], shading * np.array([0.5, 0.4, 0.3]), 0)
    return Scene(image, mask, np.where(mask, height, 0), scene.light)


@pytest.mark.parametrize("engine", ["numpy", pytest.param("numba", marks=needs_numba)])
@pytest.mark.parametrize("channels", [3, 1])
def test_loss_falls_and_what_is_returned_belongs_together(engine: str, channels: int) -> None:
    scene = blob(channels=channels)
    problem = make_problem(scene)
    result = solve(problem, replace(QUICK, engine=engine, single=False))
    start = (
        NumpyEngine(problem)
        .evaluate(np.zeros(scene.mask.shape), np.zeros((9, channels)))
        .terms.total
    )
    assert result.terms.total < start - 1
    assert result.height.dtype == result.light.dtype == np.float64
    assert result.height.shape == scene.mask.shape and result.light.shape == (9, channels)
    again = NumpyEngine(problem).evaluate(result.height, result.light).terms
    for name, value in vars(again).items():
        assert getattr(result.terms, name) == pytest.approx(value, rel=1e-9, abs=1e-12), name
    assert 0 < result.iterations <= 40 and result.iterations < result.evaluations


@pytest.mark.slow
def test_solving_improves_on_flat() -> None:
    scene = blob()
    result = solve(make_problem(scene), replace(QUICK, lbfgs=LbfgsOptions()))
    assert result.converged
    assert angle_error(result.height, scene) < 0.6 * angle_error(np.zeros(scene.mask.shape), scene)


@pytest.mark.slow
@needs_numba
def test_the_engines_find_the_same_optimum() -> None:
    problem = make_problem(blob((48, 52)))
    full = LbfgsOptions()
    losses = [
        solve(
            problem, SolverOptions(engine=engine, single=single, threads=1, lbfgs=full)
        ).terms.total
        for engine, single in (("numpy", False), ("numba", False), ("numba", True))
    ]
    assert np.ptp(losses) < 0.005 * abs(losses[0])


def test_known_light_is_kept_exactly() -> None:
    scene = blob((84, 82))
    result = solve(make_problem(scene), QUICK, known_light=scene.light)
    np.testing.assert_array_equal(result.light, scene.light)
    assert angle_error(result.height, scene) < angle_error(np.zeros(scene.mask.shape), scene)


def test_known_shape_is_kept_exactly_and_its_light_is_found() -> None:
    scene = blob((84, 82))
    result = solve(make_problem(scene), replace(QUICK, single=False), known_height=scene.height)
    np.testing.assert_array_equal(result.height, scene.height)
    start = NumpyEngine(make_problem(scene)).evaluate(scene.height, np.zeros((9, 3))).terms.total
    assert result.terms.total < start
    # the light's constant part is shared with the albedo; how shading varies is not
    assert np.abs(result.light - scene.light)[1:].mean() < 0.5 * np.abs(scene.light[1:]).mean()


def test_when_all_is_known_it_is_only_evaluated() -> None:
    scene = blob((84, 82))
    problem = make_problem(scene)
    result = solve(
        problem, replace(QUICK, single=False), known_height=scene.height, known_light=scene.light
    )
    np.testing.assert_array_equal(result.height, scene.height)
    np.testing.assert_array_equal(result.light, scene.light)
    assert result.terms.total == pytest.approx(
        NumpyEngine(problem).evaluate(scene.height, scene.light).terms.total, rel=1e-9
    )
    assert result.converged and result.iterations == 0


@pytest.mark.slow
def test_shape_from_shading_finds_a_hemisphere() -> None:
    scene = hemisphere()
    problem = make_problem(scene, weights(slant=0.5), shading_only=True)
    result = solve(problem, replace(QUICK, lbfgs=LbfgsOptions()), known_light=scene.light)
    flat = np.zeros(scene.mask.shape)
    assert angle_error(result.height, scene) < 0.4 * angle_error(flat, scene)
    assert shape_error(result.height, scene) < 0.4 * shape_error(flat, scene)
    assert (
        result.terms.smoothness
        == result.terms.parsimony
        == result.terms.absolute
        == 0
        < result.terms.shading_only
    )


@pytest.mark.slow
def test_depth_with_holes_pulls_the_height() -> None:
    """What was seen is another shape than shading tells, 37 px nearer."""
    scene = blob()
    target = scene.height + 5 * np.sin(np.arange(72) / 12)
    seen = np.where(
        scene.mask & (np.random.default_rng(0).random(scene.mask.shape) < 0.5), target + 37, np.nan
    )
    hole = (slice(22, 28), slice(34, 40))
    seen[hole] = np.nan
    errors = []
    for weight in (0.0, 10.0, 1000.0):
        problem = make_problem(scene, observation=DepthObservation(seen, sigma=1.0, weight=weight))
        result = solve(problem, replace(QUICK, lbfgs=LbfgsOptions(iterations=150)))
        assert np.isfinite(result.height).all()
        errors.append(shape_error(result.height, replace(scene, height=target)))
    assert errors[1] < 0.5 * errors[0] and errors[2] < 0.5 * errors[1]
    assert np.abs((result.height - 37 - target)[hole]).mean() < 1.0


@pytest.mark.parametrize("engine", ["numpy", "numba"])
@pytest.mark.parametrize("weight", [-1000.0, -1e30])
def test_heights_that_grow_without_limit_crash_nothing(engine: str, weight: float) -> None:
    """Their curvature became NaN, which the kernels looked up in a table."""
    if engine == "numba" and find_spec("numba") is None:
        pytest.skip("needs Numba")
    scene = blob()
    seen = np.where(scene.mask, scene.height, np.nan)
    problem = make_problem(scene, observation=DepthObservation(seen, sigma=1.0, weight=weight))
    with np.errstate(all="ignore"), contextlib.suppress(InputError):
        assert np.isfinite(solve(problem, SolverOptions(engine=engine)).height).all()


def test_observed_depth_beyond_all_numbers_is_refused() -> None:
    scene = blob()
    seen = np.where(scene.mask, scene.height * 1e200, np.nan)
    problem = make_problem(scene, observation=DepthObservation(seen))
    with np.errstate(all="ignore"), pytest.raises(InputError, match="check the known inputs"):
        solve(problem, QUICK)


def test_cancel_ends_it_at_once() -> None:
    calls = []

    def cancelled() -> bool:
        calls.append(0)
        return len(calls) > 3

    with pytest.raises(Cancelled):
        solve(make_problem(blob()), QUICK, monitor=Monitor(cancelled=cancelled))
    assert len(calls) == 4


def test_cancel_before_the_start_evaluates_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise AssertionError("evaluated after the user had cancelled")

    monkeypatch.setattr(NumpyEngine, "evaluate", fail)
    with pytest.raises(Cancelled):
        solve(
            make_problem(blob()),
            replace(QUICK, engine="numpy"),
            monitor=Monitor(cancelled=lambda: True),
        )


@pytest.mark.parametrize("size", [(60, 60), (90, 84), (170, 165)])
def test_progress_rises_from_0_to_1(size: tuple[int, int]) -> None:
    seen: list[ProgressEvent] = []
    few = LbfgsOptions(iterations=6)
    options = SolverOptions(threads=1, lbfgs=few)
    solve(
        make_problem(blob(size)),
        options,
        monitor=Monitor(seen.append),
    )
    fractions = [event.fraction for event in seen]
    assert len(fractions) >= 7
    assert fractions == sorted(fractions)
    assert fractions[0] >= 0 and fractions[-1] <= 1
    assert "loss" in seen[-1].detail


@pytest.mark.parametrize("levels", [1, 2, 3])
def test_any_number_of_levels_goes_with_any_size(levels: int) -> None:
    result = solve(make_problem(blob((90, 84))), replace(QUICK, levels=levels))
    assert np.isfinite(result.height).all()


@pytest.mark.parametrize("name", ["known_height", "known_light"])
def test_what_is_known_must_be_numbers(name: str) -> None:
    scene = blob()
    known = {
        "known_height": np.where(scene.mask, scene.height, np.nan),
        "known_light": np.full((9, 3), np.nan),
    }
    with pytest.raises(InputError, match="holes"):
        solve(make_problem(scene), **{name: known[name]})  # type: ignore[arg-type]


def test_unknown_engine_is_one_clear_line() -> None:
    with pytest.raises(InputError, match="choose auto, numba or numpy"):
        solve(make_problem(blob()), SolverOptions(engine="gpu"))


def test_any_number_of_threads_may_be_asked_for() -> None:
    assert thread_count(SolverOptions(threads=3)) == 3
    assert thread_count(SolverOptions()) >= 1
    assert thread_count(SolverOptions(threads=10**9)) == MAX_THREADS


def test_it_begins_with_the_dome_and_light_that_the_settings_ask_for() -> None:
    scene = hemisphere()
    profile = SilhouetteProfile(np.array([0.7, 0.5, 0.3, 0.1]), np.full(4, 0.3))
    plain = make_problem(scene)
    field = normals_from_silhouette(scene.mask, profile)
    plain = replace(plain, silhouette=field)
    unmoved = SolverOptions(threads=1, single=False, lbfgs=LbfgsOptions(iterations=0))
    flat = solve(plain, unmoved)
    assert not flat.height.any() and np.abs(flat.light).max() < 1e-12
    begun = solve(
        replace(plain, weights=replace(plain.weights, starts=(Start(dome=0.5, light=0.5),))),
        unmoved,
    )
    inner = ndimage.binary_erosion(scene.mask, iterations=4)
    np.testing.assert_allclose(
        begun.height[inner], field.dome[inner] / 2, atol=0.15 * begun.height.max()
    )
    np.testing.assert_allclose(begun.light, unstack(plain.priors.light.offset, 3) / 2, atol=1e-9)
    seen = replace(
        plain,
        weights=replace(plain.weights, starts=(Start(dome=1),)),
        observation=DepthObservation(scene.height),
    )
    assert not solve(seen, unmoved).height.any(), "what was seen decides, not the outline"


def test_it_begins_with_the_shape_that_predicted_normals_add_up_to() -> None:
    scene = hemisphere()
    plain = make_problem(scene)
    normal = normal_from_reference(normals(scene.height))
    told = NormalEstimate(np.where(scene.mask[..., None], normal, 0), np.where(scene.mask, 0.1, 0))
    problem = replace(
        plain,
        predicted_normals=normals_from_prediction(told, scene.mask),
        weights=replace(plain.weights, starts=(Start(dome=1, predicted=True),)),
    )
    unmoved = SolverOptions(threads=1, single=False, lbfgs=LbfgsOptions(iterations=0))
    inner = ndimage.binary_erosion(scene.mask, iterations=4)
    off = (solve(problem, unmoved).height - scene.height)[inner]
    assert np.ptp(off) < 0.15 * np.ptp(scene.height[inner])
    measured = replace(problem, observation=DepthObservation(scene.height))
    assert not solve(measured, unmoved).height.any(), "what was measured decides"


@pytest.mark.slow
def test_of_several_starts_the_one_that_leads_deeper_goes_on() -> None:
    """A light far from any likely one is a bad start; which of the starts stands first does not
    matter.
    """
    problem = make_problem(hemisphere())
    good, bad = Start(), Start(light=40)
    options = SolverOptions(threads=1, single=False, lbfgs=LbfgsOptions(evaluations=60))

    def lowest(*starts: Start) -> SirfsResult:
        return solve(replace(problem, weights=replace(problem.weights, starts=starts)), options)

    alone, both, turned = lowest(good), lowest(bad, good), lowest(good, bad)
    assert lowest(bad).terms.total > 1.5 * alone.terms.total
    assert both.terms.total <= alone.terms.total
    np.testing.assert_array_equal(both.height, turned.height)
    assert lowest(good, good).evaluations == alone.evaluations, "the same start is not tried twice"


@pytest.mark.slow
def test_the_start_that_goes_on_ends_where_it_would_have_ended_alone() -> None:
    """However far it had got when it was chosen: in the middle of its way, or at its end."""
    problem = make_problem(hemisphere())
    good, bad = Start(), Start(light=40)
    for tolerance in (1e-4, 0.5):
        options = SolverOptions(
            threads=1, single=False, lbfgs=LbfgsOptions(loss_tolerance=tolerance, evaluations=150)
        )
        alone, chosen = (
            solve(replace(problem, weights=replace(problem.weights, starts=s)), options)
            for s in ((good,), (good, bad))
        )
        np.testing.assert_array_equal(chosen.height, alone.height)
        np.testing.assert_array_equal(chosen.light, alone.light)
        assert (chosen.terms, chosen.reason) == (alone.terms, alone.reason)


@pytest.mark.slow
def test_trying_starts_can_be_cancelled_and_does_not_pretend_to_advance() -> None:
    problem = make_problem(hemisphere())
    problem = replace(problem, weights=replace(problem.weights, starts=(Start(), Start(light=1))))
    seen: list[ProgressEvent] = []
    solve(
        problem,
        SolverOptions(threads=1),
        monitor=Monitor(seen.append),
    )
    shares = [event.fraction for event in seen]
    losses = [float(event.detail.split()[-1]) for event in seen if "loss" in event.detail]
    assert shares == sorted(shares)
    assert losses == sorted(losses, reverse=True), "the reported loss is the lowest so far"
    with pytest.raises(Cancelled):
        solve(problem, SolverOptions(threads=1), monitor=Monitor(cancelled=lambda: True))
