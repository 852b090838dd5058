"""Predictions of the scene network are added to a task once, and only if they are used."""

from dataclasses import replace

import numpy as np
import pytest

from isc_core.decomposition.predictions import with_predictions
from isc_core.decomposition.settings import Illumination, LightPrior, ShapePrior
from isc_core.decomposition.task import DecompositionTask, SolveOptions
from isc_core.photo import Photo, PhotoSource
from isc_core.scene.known_inputs import SceneConstraints
from isc_core.scene.light_coefficients_estimate import LightCoefficientsEstimate
from isc_core.scene.normal_estimate import NormalEstimate
from isc_core.scene.shading_estimate import ShadingEstimate
from tests.core.decomposition.test_light_colour import task_of

SHAPE = (40, 48)


@pytest.fixture
def task() -> DecompositionTask:
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    mask = ((y - 20) / 16) ** 2 + ((x - 24) / 20) ** 2 < 1
    image = (0.3 + 0.01 * x[..., None] * np.ones(3)).astype(np.float32) * mask[..., None]
    source = PhotoSource("", (SHAPE[1], SHAPE[0]), 16, "linear", "")
    one = task_of(Photo(image, mask, 1e-4, np.zeros(SHAPE, bool), source))
    alone = SolveOptions(fit_lobe=False, check_assumptions=False)
    return replace(one, settings=replace(one.settings, model="sirfs"), options=alone)


def with_settings(task: DecompositionTask, **changed: str) -> DecompositionTask:
    return replace(task, settings=replace(task.settings, **changed))  # type: ignore[arg-type]


@pytest.mark.parametrize("illumination", list(Illumination))
def test_everything_is_predicted_in_both_lights(task: DecompositionTask, illumination: str) -> None:
    task = with_settings(
        task,
        illumination=illumination,
        shape_prior=ShapePrior.PREDICTED,
        light_prior=LightPrior.PREDICTED,
    )
    seen = with_predictions(task)
    assert seen.normal_estimate is not None and seen.shading_estimate is not None
    assert seen.light_coefficients is not None
    assert seen.normal_estimate.normal.shape == (*SHAPE, 3)
    assert "predict scene" in task.clock.seconds
    assert with_predictions(seen) is seen


def test_settings_exclude_predictions(task: DecompositionTask) -> None:
    neither = with_settings(task, shape_prior=ShapePrior.SILHOUETTE, light_prior=LightPrior.DATASET)
    assert with_predictions(neither) is neither
    light = with_predictions(with_settings(neither, light_prior=LightPrior.PREDICTED))
    assert light.normal_estimate is None and light.light_coefficients is not None
    shape = with_predictions(with_settings(neither, shape_prior=ShapePrior.PREDICTED))
    assert shape.normal_estimate is not None
    assert shape.light_coefficients is None and shape.shading_estimate is None


def test_what_is_given_or_known_is_not_predicted(task: DecompositionTask) -> None:
    task = with_settings(task, shape_prior=ShapePrior.PREDICTED, light_prior=LightPrior.PREDICTED)
    known = replace(task, known=SceneConstraints(depth=np.zeros(SHAPE)))
    assert with_predictions(known).normal_estimate is None
    given = replace(
        task,
        normal_estimate=NormalEstimate(np.zeros((*SHAPE, 3)), np.zeros(SHAPE)),
        shading_estimate=ShadingEstimate(np.zeros((*SHAPE, 3)), np.zeros(SHAPE)),
    )
    seen = with_predictions(given)
    assert seen.normal_estimate is given.normal_estimate
    assert seen.shading_estimate is given.shading_estimate
    assert seen.light_coefficients is not None
    everything = replace(
        given, light_coefficients=LightCoefficientsEstimate(np.zeros((9, 3)), np.eye(27))
    )
    assert with_predictions(everything) is everything


def test_what_else_needs_the_network_gets_its_answer(task: DecompositionTask) -> None:
    none = with_settings(task, shape_prior=ShapePrior.SILHOUETTE, light_prior=LightPrior.DATASET)
    for other in (
        replace(none, options=replace(none.options, check_assumptions=True)),
        replace(none, options=replace(none.options, fit_lobe=True)),
        with_settings(none, model="joint"),
    ):
        seen = with_predictions(other)
        assert seen.prediction is not None
        assert seen.normal_estimate is None and seen.light_coefficients is None
