"""Values of the objective that are known to 9 digits, on a photo and with priors that are not the
project's own.
"""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.sirfs.reference_priors import reference_priors
from isc_core.datasets import mit_berkeley as datasets
from isc_core.shading.occluding_contour import occluding_contour
from isc_core.sirfs.illumination import light_cost, unstack
from isc_core.sirfs.numpy_engine import NumpyEngine
from isc_core.sirfs.problem import PAIR_OFFSETS, Problem
from isc_core.sirfs.settings import published_weights
from isc_core.sirfs.solver import Engine
from isc_core.sirfs.surface import pair_slices

PRINTED = 1e-8
NAMES = ("curvature", "contour", "slant", "smoothness", "parsimony", "absolute", "light")
# (illumination, state): total, the terms above, |dZ|, dZ(50, 60), |dL| of all but the light term
CHECKS = {
    ("natural", 1): (
        49.21362892,
        (0.0237090591, 1.70923656, 0.01, 28.098953, 12.6173318, 6.00749707, 0.746901488),
        0.0335166201,
        0,
        1.46300823,
    ),
    ("natural", 2): (
        49.6612299,
        (0.301337263, 1.39110934, 0.24863463, 28.4843277, 13.1115487, 6.12427232, 0),
        0.0914578545,
        -0.000144372996,
        7.95807954,
    ),
    ("laboratory", 1): (
        54.28776693,
        (0.0344550017, 2.41724871, 0.023784, 25.4157121, 16.758321, 6.24337138, 3.39487472),
        0.0474001133,
        0,
        1.32802184,
    ),
    ("laboratory", 2): (
        52.1012658,
        (0.436668995, 1.96734457, 0.591352603, 25.6264649, 17.2617083, 6.21772646, 0),
        0.0826272502,
        0.000233971798,
        8.68703323,
    ),
}
COUNTS = {"natural": (32620, 386127, 597), "laboratory": (33475, 396779, 597)}


def apple(shared: Path, illumination: str) -> Problem:
    if not (shared / "data" / "mit_berkeley_train").is_dir():
        pytest.skip(
            "needs the research data in ../shared, which is not distributed with the project"
        )
    photo = datasets.load_object(
        shared / "data" / "mit_berkeley_train", "apple", illumination, "diffuse"
    )
    log_image = np.where(
        photo.valid[..., None], np.log(np.where(photo.image > 0, photo.image, 1)), 0
    )
    priors = reference_priors(shared / "anchors" / "sirfs_reference_priors.npz", illumination)
    contour = occluding_contour(photo.mask, drop_near_edge=True)
    return Problem(
        log_image, photo.valid, photo.mask, contour, priors, published_weights(illumination, 3)
    )


def engine_of(name: str, problem: Problem) -> Engine:
    if name == "numpy":
        return NumpyEngine(problem)
    return pytest.importorskip(
        "isc_core.sirfs.numba_engine", reason="needs numba", exc_type=ImportError
    ).NumbaEngine(problem, np.float64)


def as_printed(value: float) -> object:
    """Equal to 1e-8 relative, or to half a unit of the last of nine or ten printed digits."""
    return pytest.approx(value, rel=PRINTED, abs=1e-15)


@pytest.mark.parametrize("illumination", COUNTS)
def test_sizes(shared: Path, illumination: str) -> None:
    problem = apple(shared, illumination)
    assert problem.valid.shape == (222, 267)
    pairs = 0
    for offset in PAIR_OFFSETS:
        p, q = pair_slices(*offset)
        pairs += int((problem.valid[p] & problem.valid[q]).sum())
    assert (int(problem.valid.sum()), pairs, len(problem.contour.rows)) == COUNTS[illumination]


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["numpy", "numba"])
@pytest.mark.parametrize(("illumination", "state"), CHECKS)
def test_every_term_and_gradient(shared: Path, illumination: str, state: int, engine: str) -> None:
    problem = apple(shared, illumination)
    rows, columns = np.mgrid[:222, :267]
    height, light = np.zeros((222, 267)), np.zeros((9, 3))
    if state == 2:
        height, light = (
            20 * np.sin(rows / 15) * np.cos(columns / 20),
            unstack(problem.priors.light.mean, 3),
        )
    total, terms, norm, at_pixel, light_norm = CHECKS[illumination, state]
    result = engine_of(engine, problem).evaluate(height, light)
    for name, value in zip(NAMES, terms, strict=True):
        assert getattr(result.terms, name) == as_printed(value), name
    assert result.terms.total == as_printed(total)
    assert np.linalg.norm(result.height_gradient) == as_printed(norm)
    assert result.height_gradient[50, 60] == as_printed(at_pixel)
    without_prior = (
        result.light_gradient - light_cost(light, problem.priors.light, problem.weights.light)[1]
    )
    assert np.linalg.norm(without_prior) == as_printed(light_norm)
