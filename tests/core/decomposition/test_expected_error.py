"""Expected errors: their formula, that they decrease only with evidence, and what follows from
them.
"""

from dataclasses import replace

import numpy as np
import pytest

from isc_core.decomposition.assumption_checks import confidence_factor
from isc_core.decomposition.expected_error import (
    CALIBRATION,
    HALF,
    Calibration,
    Evidence,
    confidence_of,
    with_expected_error,
)
from isc_core.networks.scene_network import ScenePrediction, predict_scene
from isc_core.photo import Photo, PhotoSource
from isc_core.scene.decomposition import Decomposition
from isc_core.scene.diagnostics import AssumptionWarning, Diagnostics, WarningKind
from isc_core.scene.normal_estimate import NormalEstimate
from tests.core.ball_scene import ball


def photo_of(d: Decomposition) -> Photo:
    size = d.mask.shape[1], d.mask.shape[0]
    source = PhotoSource("", size, 8, "linear", "")
    return Photo(d.image, d.mask, 1 / 255, np.zeros_like(d.mask), source)


@pytest.fixture(scope="module")
def scene() -> Decomposition:
    return ball()


@pytest.fixture(scope="module")
def seen(scene: Decomposition) -> ScenePrediction:
    return predict_scene(scene.image, scene.mask)


def test_squares_of_the_evidence_add_up() -> None:
    evidence = Evidence(*(np.array([value]) for value in (30.0, 40.0, 0.3, 0.4)))
    normal, reflectance = evidence.errors(Calibration(0, 1, 1, 1, 1))
    assert normal == pytest.approx(50) and reflectance == pytest.approx(0.5)
    assert evidence.errors(Calibration(120, 1, 1, 1, 1))[0] == pytest.approx(130)


@pytest.mark.parametrize("name", ["spread", "distance", "deviation", "shading_distance"])
def test_more_doubt_is_never_less_error(name: str) -> None:
    evidence = Evidence(*(np.full(50, value) for value in (20.0, 10.0, 0.2, 0.1)))
    before = evidence.errors()
    after = replace(evidence, **{name: np.linspace(getattr(evidence, name)[0], 90, 50)}).errors()
    assert all((new >= old).all() for new, old in zip(after, before, strict=True))
    assert any((np.diff(new) > 0).all() for new in after)


def test_the_angle_to_the_prediction_and_its_spread(
    scene: Decomposition, seen: ScenePrediction
) -> None:
    """A prediction of length cos 20 degrees that is 30 degrees off."""
    angle = np.radians(30)
    turn = np.array(
        [[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]]
    )
    axis = np.broadcast_to([0.0, 0.0, 1.0], scene.normal.shape)
    mean = np.cos(np.radians(20)) * axis @ turn.T
    told = replace(seen, normals=NormalEstimate(mean, seen.normals.deviation))
    evidence = Evidence.of(told, axis, scene.shading, scene.mask)
    np.testing.assert_allclose(evidence.spread, 20, atol=1e-6)
    np.testing.assert_allclose(evidence.distance, 30, atol=1e-6)


def test_brightness_of_the_shading_is_no_evidence(
    scene: Decomposition, seen: ScenePrediction
) -> None:
    plain, brighter = (
        Evidence.of(seen, scene.normal, gain * scene.shading, scene.mask) for gain in (1.0, 7.0)
    )
    np.testing.assert_allclose(plain.shading_distance, brighter.shading_distance, atol=1e-5)


def test_the_confidence_sorts_as_the_error_does(
    scene: Decomposition, seen: ScenePrediction
) -> None:
    found = with_expected_error(scene, seen, photo_of(scene))
    error = found.expected_error
    assert error is not None
    inside, confidence = error.normal[scene.mask], found.confidence[scene.mask]
    order = np.argsort(inside, kind="stable")
    assert (np.diff(confidence[order]) <= 0).all()
    assert ((confidence > 0) & (confidence < 1)).all()
    assert not found.confidence[~scene.mask].any() and not error.normal[~scene.mask].any()
    np.testing.assert_allclose(confidence, confidence_of(inside), rtol=1e-5)
    assert confidence_of(np.array(HALF)) == 0.5
    said = found.provenance.diagnostics.expected_error
    assert said is not None and said.normal == pytest.approx(inside.mean(), abs=1e-3)
    assert said.reflectance == pytest.approx(error.reflectance[scene.mask].mean(), abs=1e-3)
    assert inside.min() >= CALIBRATION.normal_floor


def test_violated_assumptions_lower_the_confidence_and_not_its_order(
    scene: Decomposition, seen: ScenePrediction
) -> None:
    warned = Diagnostics(warnings=(AssumptionWarning(WarningKind.SEVERAL_LIGHTS, 0.7),))
    assert confidence_factor(warned) == pytest.approx(0.3)
    assert confidence_factor(Diagnostics()) == 1
    doubtful = replace(scene, provenance=replace(scene.provenance, diagnostics=warned))
    plain, lower = (
        with_expected_error(d, seen, photo_of(scene)).confidence for d in (scene, doubtful)
    )
    np.testing.assert_allclose(lower, 0.3 * plain, rtol=1e-5)


def test_maps_of_another_size_have_the_errors_of_the_working_size(
    scene: Decomposition, seen: ScenePrediction
) -> None:
    large = ball((192, 240), 80.0, (88.5, 132.5))
    fine = with_expected_error(large, seen, photo_of(scene)).expected_error
    coarse = with_expected_error(scene, seen, photo_of(scene)).expected_error
    assert fine is not None and coarse is not None
    core = np.hypot(*(np.indices(scene.mask.shape) - np.array([44, 66])[:, None, None])) < 30
    blocks = fine.normal.reshape(96, 2, 120, 2).mean(axis=(1, 3))
    assert np.abs(blocks - coarse.normal)[core].mean() < 1
    assert fine.normal.shape == large.mask.shape and (fine.normal[large.mask] > 0).all()


def test_the_rim_of_larger_maps_is_compared_with_the_object(
    scene: Decomposition, seen: ScenePrediction
) -> None:
    large = ball((192, 240), 78.0, (88.5, 132.5))  # a little smaller than the mask of the photo
    fine = with_expected_error(large, seen, photo_of(scene)).expected_error
    assert fine is not None and fine.reflectance[large.mask].max() < 3


def test_normals_before_a_camera_are_the_evidence(
    scene: Decomposition, seen: ScenePrediction
) -> None:
    turned = replace(scene, normal=np.roll(scene.normal, 1, axis=-1))
    told = with_expected_error(turned, seen, photo_of(scene), scene.normal).expected_error
    plain = with_expected_error(scene, seen, photo_of(scene)).expected_error
    assert told is not None and plain is not None
    np.testing.assert_array_equal(told.normal, plain.normal)
