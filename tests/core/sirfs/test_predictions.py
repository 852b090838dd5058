"""Predicted normals, shading and light on their way to the solver: cut, resampled, whitened, and
worth their while.
"""

from dataclasses import replace

import numpy as np
import pytest

from isc_core.decomposition.light_colour import solve_under_estimated_light
from isc_core.decomposition.models import DecompositionTask, SceneEstimate, Settings, SolveOptions
from isc_core.decomposition.models import solve as decompose
from isc_core.illuminant.illuminant import estimate_illuminant
from isc_core.numerics.lbfgs import LbfgsOptions
from isc_core.photo import Photo, PhotoSource
from isc_core.scene.light_coefficients_estimate import LightCoefficientsEstimate
from isc_core.scene.normal_estimate import NormalEstimate
from isc_core.scene.shading_estimate import ShadingEstimate
from isc_core.shading.spherical_harmonics import (
    light_from_reference,
    normal_from_reference,
    real_sh,
)
from isc_core.shading.surface_stencils import normals
from isc_core.sirfs.recover import Recovered, RecoverOptions, recover
from isc_core.sirfs.settings import (
    ISC_LABORATORY,
    ISC_NATURAL,
    PredictionWeights,
    Start,
    isc_weights,
)
from isc_core.sirfs.shading_term import expected_shading
from isc_core.sirfs.solver import SolverOptions
from tests.core.decomposition.test_light_colour import photo_of, seen_by, task_of
from tests.core.illuminant.test_illuminant import ALBEDOS, LIGHT

from .small_problems import Scene, blob, made_priors, weights

SOLVER = SolverOptions(threads=1, lbfgs=LbfgsOptions(iterations=40))


def shading_of(scene: Scene) -> np.ndarray:
    log_shading = real_sh(normal_from_reference(normals(scene.height))) @ light_from_reference(
        scene.light
    )
    return np.where(scene.mask[..., None], log_shading, 0)


def seen(scene: Scene, deviation: float = 0.05) -> ShadingEstimate:
    return ShadingEstimate(
        np.where(scene.mask[..., None], shading_of(scene) + 0.7, 0),
        np.where(scene.mask, deviation, 0),
    )


def run(scene: Scene, shading: ShadingEstimate | None, size: int = 0) -> Recovered:
    return recover(
        scene.image,
        scene.mask,
        1e-4,
        made_priors(scene.image.shape[2]),
        weights(predicted_shading=4.0),
        RecoverOptions(solve_size=size, margin=8, solver=SOLVER),
        predicted_shading=shading,
    )


def shading_error(scene: Scene, found: Recovered) -> float:
    """Deviation of the recovered log shading, without its brightness and colour."""
    have = real_sh(normal_from_reference(normals(found.height))) @ light_from_reference(found.light)
    off = (have - shading_of(scene))[scene.mask]
    return float((off - off.mean(axis=0)).std())


@pytest.mark.slow
@pytest.mark.parametrize("size", [0, 40])
def test_shading_that_was_seen_is_found(size: int) -> None:
    scene = blob((70, 76))
    assert shading_error(scene, run(scene, seen(scene), size)) < 0.75 * shading_error(
        scene, run(scene, None, size)
    )


def test_an_object_at_the_frame_and_a_prediction_with_holes() -> None:
    whole = blob((70, 76))
    part = (slice(0, 70), slice(25, 76))
    cut = Scene(whole.image[part], whole.mask[part], whole.height[part], whole.light)
    told = seen(cut)
    deviation = told.deviation.copy()
    deviation[30:34, 10:20] = 0
    found = run(cut, ShadingEstimate(told.log_shading, deviation), 40)
    assert shading_error(cut, found) < 0.75 * shading_error(cut, run(cut, None, 40))
    assert np.isfinite(found.height).all()


def test_expected_shading_of_a_prediction() -> None:
    scene = blob((30, 34))
    told = seen(scene, 1e-4)
    three, one = (expected_shading(told, channels) for channels in (3, 1))
    assert three is not None and one is not None
    assert three.mean.shape == (30, 34, 3) and one.mean.shape == (30, 34, 1)
    np.testing.assert_allclose(one.mean[..., 0], three.mean.mean(axis=-1))
    assert not three.precision[~scene.mask].any()
    assert three.precision.max() < 1 / 0.02**2  # nobody is that sure
    assert expected_shading(None, 3) is None


def test_weights_follow_what_was_predicted() -> None:
    belief = PredictionWeights(1.5, 0.7, True, 1.0, (Start(light=1),), loss_tolerance=0.01)
    for illumination, usual in (("natural", ISC_NATURAL), ("laboratory", ISC_LABORATORY)):
        old = isc_weights(illumination, 3)
        assert old == usual
        alone, tolerance = belief.applied(old, normals=True, shading=False, light=False)
        assert (alone.predicted_normals, alone.starts) == (1.5, belief.starts)
        assert tolerance is None and alone.silhouette == old.silhouette
        full, tolerance = belief.applied(old, normals=True, shading=True, light=True)
        assert (full.predicted_normals, full.predicted_shading, tolerance) == (1.5, 0.7, 0.01)
        assert full.balanced_colour
        lit, tolerance = belief.applied(usual, normals=False, shading=False, light=True)
        assert (lit, tolerance) == (usual, None)
    two = (Start(dome=1, light=1), Start())
    both = replace(belief, starts=two).applied(old, normals=True, shading=False, light=True)[0]
    assert both.starts == two


@pytest.mark.slow
def test_a_task_hands_all_three_to_the_solver_in_both_lights() -> None:
    scene = blob((60, 64))
    size = (scene.mask.shape[1], scene.mask.shape[0])
    image = scene.image.astype(np.float32)
    photo = Photo(
        image, scene.mask, 1e-4, np.zeros_like(scene.mask), PhotoSource("", size, 16, "linear", "")
    )
    normal = normal_from_reference(normals(scene.height))
    told = {
        "normal_estimate": NormalEstimate(
            np.where(scene.mask[..., None], normal, 0), np.where(scene.mask, 0.05, 0)
        ),
        "shading_estimate": seen(scene),
        "light_coefficients": LightCoefficientsEstimate(
            light_from_reference(scene.light), 0.02 * np.eye(27)
        ),
    }
    options = SolveOptions(
        solve_size=0,
        fit_lobe=False,
        check_assumptions=False,
    )

    def error(illumination: str, **given: object) -> float:
        settings = Settings(
            "sirfs",
            illumination=illumination,
            threads=1,
            light_prior="dataset",
            shape_prior="silhouette",
        )
        task = DecompositionTask(photo, photo, settings, options=options)
        found = decompose(replace(task, **given))  # type: ignore[arg-type]
        have = normal_from_reference(normals(found.height))
        return float(
            np.degrees(np.arccos(np.clip((have * normal).sum(-1), -1, 1)))[scene.mask].mean()
        )

    for illumination in ("natural", "laboratory"):
        assert error(illumination, **told) < 0.7 * error(illumination)


@pytest.mark.slow
def test_predictions_are_whitened_with_the_photo() -> None:
    photo, tasks = photo_of(ALBEDOS, LIGHT), []

    def solver(task: DecompositionTask) -> SceneEstimate:
        tasks.append(task)
        return seen_by(task)

    colour = estimate_illuminant(photo.image, photo.mask).colour
    shape = photo.mask.shape
    told = replace(
        task_of(photo),
        shading_estimate=ShadingEstimate(np.zeros((*shape, 3)), np.where(photo.mask, 0.1, 0)),
        light_coefficients=LightCoefficientsEstimate(np.zeros((9, 3)), np.eye(27)),
    )
    solve_under_estimated_light(told, solver)
    shading, light = tasks[0].shading_estimate, tasks[0].light_coefficients
    assert shading is not None and light is not None
    np.testing.assert_allclose(
        shading.log_shading[photo.mask], np.tile(-np.log(colour), (photo.mask.sum(), 1))
    )
    assert not shading.log_shading[~photo.mask].any()
    np.testing.assert_allclose(real_sh(np.array([0, 0, 1.0])) @ light.mean, -np.log(colour))
