"""Every term's hand-written gradient against finite differences, both engines, colour and grey."""

from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest
from scipy import ndimage

from isc_core.scene.known_inputs import DepthObservation
from isc_core.shading.irradiance_basis import basis
from isc_core.shading.surface_stencils import normals
from isc_core.sirfs.numpy_engine import NumpyEngine
from isc_core.sirfs.priors.tabulated_potential import TabulatedPotential
from isc_core.sirfs.problem import Problem, Terms
from isc_core.sirfs.shading_term import ExpectedShading
from isc_core.sirfs.solver import Engine

from .small_problems import (
    blob,
    make_problem,
    only,
    random_state,
    some_normals,
    some_pixel_weight,
    some_shading,
    weights,
)

TERMS = (
    "smoothness",
    "parsimony",
    "absolute",
    "curvature",
    "slant",
    "contour",
    "light",
    "silhouette",
    "observation",
    "shading_only",
    "predicted_normals",
    "predicted_shading",
)
OF_HEIGHT = set(TERMS) - {"light"}
OF_LIGHT = {"smoothness", "parsimony", "absolute", "light", "shading_only", "predicted_shading"}
STEP = 1e-7

numba_only = pytest.mark.skipif(find_spec("numba") is None, reason="needs numba")


def make_engine(name: str, problem: Problem) -> Engine:
    if name == "numpy":
        return NumpyEngine(problem)
    from isc_core.sirfs.numba_engine import NumbaEngine

    return NumbaEngine(problem, np.float64)


def coarser(table: TabulatedPotential) -> TabulatedPotential:
    """Every hundredth node: cells so wide that a difference's two ends hardly ever lie in two of
    them.
    """
    return TabulatedPotential(table.low, 100 * table.step, table.values[::100])


def problem_of(term: str, channels: int) -> Problem:
    scene = blob((38, 45), channels)
    seen = None
    everything = term in ("all", "all, some weighted less")
    if term == "observation" or everything:
        rng = np.random.default_rng(8)
        heights = np.where(
            rng.random(scene.mask.shape) < 0.4,
            np.nan,
            scene.height + rng.normal(size=scene.mask.shape),
        )
        seen = DepthObservation(heights, sigma=1.5, weight=4.0)
    problem = make_problem(
        scene,
        weights(silhouette=2.0, predicted_normals=0.3, predicted_shading=0.7, balanced_colour=True)
        if everything
        else only(term),
        observation=seen,
        shading_only=term == "shading_only",
        holes=True,
        outline=term == "silhouette" or everything,
    )
    priors = problem.priors
    priors = replace(
        priors, curvature=coarser(priors.curvature), smoothness=coarser(priors.smoothness)
    )
    return replace(
        problem,
        priors=priors,
        pixel_weight=some_pixel_weight(scene.mask.shape) if "weighted" in term else None,
        predicted_normals=some_normals(problem.valid)
        if everything or term == "predicted_normals"
        else None,
        predicted_shading=some_shading(problem.valid, channels)
        if everything or term == "predicted_shading"
        else None,
    )


def directions(shape: tuple[int, int]) -> list[np.ndarray]:
    """White, smooth, and along the frame alone, where borders are replicated."""
    rng = np.random.default_rng(5)
    white, smooth = rng.normal(size=(2, *shape))
    frame = rng.normal(size=shape)
    frame[2:-2, 2:-2] = 0
    return [white, 5 * ndimage.gaussian_filter(smooth, 2.0), frame]


def difference(
    engine: Engine, height: np.ndarray, light: np.ndarray, dz: np.ndarray, dl: np.ndarray
) -> float:
    ends = [
        engine.evaluate(height + sign * STEP * dz, light + sign * STEP * dl).terms.total
        for sign in (1, -1)
    ]
    return (ends[0] - ends[1]) / (2 * STEP)


@pytest.mark.parametrize("channels", [3, 1])
@pytest.mark.parametrize("engine", ["numpy", pytest.param("numba", marks=numba_only)])
@pytest.mark.parametrize("term", [*TERMS, "all", "all, some weighted less"])
def test_gradient_is_the_slope(term: str, engine: str, channels: int) -> None:
    problem = problem_of(term, channels)
    shape: tuple[int, int] = problem.valid.shape  # type: ignore[assignment]
    height, light = random_state(shape, channels, 11)
    of_term = make_engine(engine, problem)
    result = of_term.evaluate(height, light)
    d_height, d_light = result.height_gradient.copy(), result.light_gradient.copy()
    if term in TERMS:
        others = {name: value for name, value in vars(result.terms).items() if name != term}
        assert getattr(result.terms, term) > 0 or term in ("parsimony", "absolute")
        assert not any(others.values())
    flat_light, flat_height = np.zeros_like(light), np.zeros(shape)
    for dz in directions(shape):
        slope = float((d_height * dz).sum())
        size = float(np.linalg.norm(d_height * dz))
        assert difference(of_term, height, light, dz, flat_light) == pytest.approx(
            slope, rel=1e-5, abs=1e-5 * size + 1e-12
        )
    if term in OF_HEIGHT:
        assert np.abs(d_height).max() > 1e-7
    rng = np.random.default_rng(6)
    for _ in range(3):
        dl = rng.normal(size=light.shape)
        slope = float((d_light * dl).sum())
        size = float(np.linalg.norm(d_light * dl))
        assert difference(of_term, height, light, flat_height, dl) == pytest.approx(
            slope, rel=1e-5, abs=1e-5 * size + 1e-9
        )
    assert (np.abs(d_light).max() > 1e-5) == (term in OF_LIGHT or term not in TERMS)


@pytest.mark.parametrize("shading_only", [False, True])
@pytest.mark.parametrize("engine", ["numpy", pytest.param("numba", marks=numba_only)])
def test_what_trust_means(engine: str, shading_only: bool) -> None:
    """None is 1; half of it everywhere asks half as much of pairs and nothing else; 0 leaves a
    pixel's reflectance out.
    """
    problem = make_problem(blob((30, 34)), shading_only=shading_only)
    height, light = random_state((30, 34), 3, 4)
    doubtful = some_pixel_weight((30, 34)) == 0

    def terms(pixel_weight: np.ndarray | None, valid: np.ndarray = problem.valid) -> Terms:
        return (
            make_engine(engine, replace(problem, pixel_weight=pixel_weight, valid=valid))
            .evaluate(height, light)
            .terms
        )

    whole, half = terms(None), terms(np.full((30, 34), 0.5))
    assert terms(np.ones((30, 34))) == whole
    for name in ("parsimony", "absolute", "shading_only", "curvature", "contour"):
        assert getattr(half, name) == pytest.approx(getattr(whole, name), rel=1e-9), name
    assert half.smoothness == pytest.approx(whole.smoothness / 4, rel=1e-9)
    less, without = terms(np.where(doubtful, 0, 1.0)), terms(None, problem.valid & ~doubtful)
    for name in ("smoothness", "parsimony", "absolute", "shading_only"):
        assert getattr(less, name) == pytest.approx(getattr(without, name), rel=1e-9), name
    assert less.curvature == whole.curvature


@pytest.mark.parametrize("balanced", [False, True])
@pytest.mark.parametrize("engine", ["numpy", pytest.param("numba", marks=numba_only)])
def test_expected_shading_leaves_brightness_open(engine: str, balanced: bool) -> None:
    """The shading of the state itself costs nothing at any brightness; other colours cost in
    photos of balanced colours.
    """
    chosen = replace(only("predicted_shading"), balanced_colour=balanced)
    problem = make_problem(blob((30, 34)), chosen)
    height, light = random_state((30, 34), 3, 4)
    down, right, toward = np.moveaxis(normals(height), -1, 0)
    shading = np.einsum("khw,kc->hwc", basis(down, right, toward), light)
    precision = some_shading(problem.valid, 3).precision

    def cost(added: np.ndarray) -> float:
        expected = ExpectedShading(shading + added, precision)
        of_term = make_engine(engine, replace(problem, predicted_shading=expected))
        return of_term.evaluate(height, light).terms.predicted_shading

    assert cost(np.zeros(3)) == pytest.approx(0, abs=1e-20)
    assert cost(np.full(3, 1.7)) == pytest.approx(0, abs=1e-20)
    coloured = cost(np.array([0.2, 0.0, -0.2]))
    assert coloured > 0.01 if balanced else coloured == pytest.approx(0, abs=1e-20)
    assert cost(np.linspace(-0.5, 0.5, 34)[:, None]) > 0.01


@pytest.mark.parametrize("engine", ["numpy", pytest.param("numba", marks=numba_only)])
def test_where_nothing_is_expected_no_shading_costs(engine: str) -> None:
    problem = make_problem(blob((30, 34)), weights(predicted_shading=1.0))
    height, light = random_state((30, 34), 3, 4)
    nothing = replace(some_shading(problem.valid, 3), precision=np.zeros(problem.valid.shape))
    without = make_engine(engine, problem).evaluate(height, light)
    with_it = make_engine(engine, replace(problem, predicted_shading=nothing)).evaluate(
        height, light
    )
    assert with_it.terms == without.terms
    np.testing.assert_array_equal(with_it.height_gradient, without.height_gradient)
    np.testing.assert_array_equal(with_it.light_gradient, without.light_gradient)
