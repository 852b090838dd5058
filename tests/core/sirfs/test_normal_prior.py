"""Predicted normals in SIRFS: their frame, and a ball that shading alone leaves open."""

from dataclasses import replace

import numpy as np
import pytest

from isc_core.scene.normal_estimate import NormalEstimate
from isc_core.shading.spherical_harmonics import normal_from_reference
from isc_core.shading.surface_stencils import normals
from isc_core.sirfs.normal_prior import normals_from_prediction, predicted_height
from isc_core.sirfs.priors.prior_file import shipped_prior_set
from isc_core.sirfs.recover import RecoverOptions, recover
from isc_core.sirfs.settings import isc_weights
from isc_core.sirfs.solver import SolverOptions
from tests.core.lit_balls import ball, under_lights


def test_the_field_is_in_the_reference_s_frame_and_goes_on_beyond_what_was_seen() -> None:
    normal, mask = ball()
    inner = mask.copy()
    inner[:, :40] = False
    seen = NormalEstimate(np.where(inner[..., None], normal, 0), np.where(inner, 0.2, 0))
    field = normals_from_prediction(seen, mask)
    assert field is not None and normals_from_prediction(None, mask) is None
    np.testing.assert_allclose(np.dstack([field.right, -field.down])[inner], normal[inner][:, :2])
    np.testing.assert_allclose(field.precision[mask], 25)
    assert not field.precision[~mask].any()


@pytest.mark.parametrize("block", [1, 2, 4])
def test_the_normals_of_a_ball_add_up_to_the_ball(block: int) -> None:
    normal, mask = ball()
    field = normals_from_prediction(NormalEstimate(normal, np.where(mask, 0.2, 0)), mask)
    assert field is not None
    height = predicted_height(field, mask, block) * block
    assert height.shape == tuple(-(-n // block) for n in mask.shape)
    assert np.isfinite(height).all()
    rows, columns = (np.arange(n) * block + (block - 1) / 2 for n in height.shape)
    radius, middle = (mask.shape[0] - 1) / 2 * 0.9, (mask.shape[0] - 1) / 2
    square = radius**2 - (rows[:, None] - middle) ** 2 - (columns - middle) ** 2
    true = np.sqrt(np.maximum(square, 0))
    inner = true > 0.6 * radius
    assert np.ptp((height - true)[inner]) < 0.1 * np.ptp(true[inner])


def test_uncertainty_does_not_flatten_the_shape() -> None:
    """The mean of uncertain normals is short; its direction counts, and its deviation."""
    normal, mask = ball()
    sure, unsure = (
        normals_from_prediction(NormalEstimate(k * normal, np.where(mask, s, 0)), mask)
        for k, s in ((1.0, 0.2), (0.5, 0.4))
    )
    assert sure is not None and unsure is not None
    np.testing.assert_allclose(unsure.down, sure.down, atol=1e-12)
    np.testing.assert_allclose(unsure.right, sure.right, atol=1e-12)
    np.testing.assert_allclose(unsure.precision, sure.precision / 4)


def test_normals_without_a_direction_are_flat() -> None:
    mask = np.ones((4, 4), bool)
    seen = NormalEstimate(np.zeros((4, 4, 3)), np.full((4, 4), 0.6))
    field = normals_from_prediction(seen, mask)
    assert field is not None
    assert not field.down.any() and not field.right.any()


def test_a_block_of_one_pixel_has_no_shape() -> None:
    mask = np.zeros((5, 7), bool)
    mask[2, 3] = True
    seen = NormalEstimate(np.where(mask[..., None], (0.6, 0, 0.8), 0), np.where(mask, 0.2, 0))
    field = normals_from_prediction(seen, mask)
    assert field is not None
    np.testing.assert_array_equal(predicted_height(field, mask, 2), np.zeros((3, 4)))


@pytest.mark.slow
def test_sirfs_takes_the_shape_that_was_seen() -> None:
    image, mask = under_lights((-0.7, 0.2, 0.6))
    normal, _ = ball()
    priors, usual = shipped_prior_set().priors("natural", 3), isc_weights("natural", 3)
    weights = replace(usual, predicted_normals=4.0)

    def error(seen: NormalEstimate | None) -> float:
        options = RecoverOptions(solve_size=96, solver=SolverOptions(threads=1))
        found = recover(image, mask, 1e-3, priors, weights, options, predicted_normals=seen)
        return float(
            np.degrees(
                np.arccos(
                    np.clip(
                        (normal_from_reference(normals(found.height)) * normal).sum(-1)[mask], -1, 1
                    )
                )
            ).mean()
        )

    flat = np.where(mask[..., None], np.array([0, 0, 1.0]), 0)
    right, wrong = (NormalEstimate(kind, np.where(mask, 0.1, 0)) for kind in (normal, flat))
    assert error(right) < 0.6 * error(None)
    assert error(wrong) > error(None)
