"""Predicted normals in SIRFS: their frame, and a ball that shading alone leaves open."""

from dataclasses import replace

import numpy as np
import pytest

from isc_core.scene.normal_estimate import NormalEstimate
from isc_core.shading.spherical_harmonics import normal_from_reference
from isc_core.shading.surface_stencils import normals
from isc_core.sirfs.normal_prior import normals_from_prediction
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
