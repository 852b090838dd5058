"""What was seen of the normals, as a prior of SIRFS' shape: heights that are known, and a ball that
shading alone leaves open.
"""

import numpy as np
import pytest

from isc_core.scene.normal_estimate import NormalEstimate
from isc_core.shading.spherical_harmonics import normal_from_reference
from isc_core.shading.surface_stencils import normals
from isc_core.sirfs.normal_prior import height_of_normals, normals_from_prediction
from isc_core.sirfs.priors.prior_file import shipped_prior_set
from isc_core.sirfs.recover import RecoverOptions, recover
from isc_core.sirfs.settings import isc_weights
from isc_core.sirfs.solver import SolverOptions
from tests.core.lit_balls import ball, under_lights


def paraboloid(rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    """A height (rows, columns), and its normals."""
    y, x = np.mgrid[:rows, :columns].astype(float)
    height = 0.002 * x**2 - 0.003 * y**2 + 0.001 * x * y + 0.2 * y
    right, down = 0.004 * x + 0.001 * y, -0.006 * y + 0.001 * x + 0.2
    normal = np.dstack([-right, down, np.ones((rows, columns))])
    return height, normal / np.linalg.norm(normal, axis=-1, keepdims=True)


@pytest.mark.parametrize("size", [(64, 64), (61, 93), (40, 7)])
def test_normals_of_a_height_give_it_back(size: tuple[int, int]) -> None:
    height, normal = paraboloid(*size)
    mask = np.ones(size, bool)
    mask[: size[0] // 3, : size[1] // 3] = False
    found = height_of_normals(normal, mask)
    assert not found[~mask].any() and found.min() == 0
    inner = mask.copy()
    inner[:6], inner[-6:], inner[:, :3], inner[:, -3:] = False, False, False, False
    off = (found - height)[inner]
    assert np.ptp(off) < 0.08 * np.ptp(height[inner]) + 0.6


def test_parts_that_are_not_joined_and_single_pixels_have_a_height() -> None:
    _, normal = paraboloid(40, 40)
    mask = np.zeros((40, 40), bool)
    mask[2:12, 2:12], mask[25:38, 20:38], mask[20, 3] = True, True, True
    assert np.isfinite(height_of_normals(normal, mask)).all()
    assert not height_of_normals(normal, np.zeros((40, 40), bool)).any()


def test_the_field_is_in_the_reference_s_frame_and_goes_on_beyond_what_was_seen() -> None:
    normal, mask = ball()
    inner = mask.copy()
    inner[:, :40] = False
    seen = NormalEstimate(np.where(inner[..., None], normal, 0), np.where(inner, 0.2, 0))
    field = normals_from_prediction(seen, mask)
    np.testing.assert_allclose(np.dstack([field.right, -field.down])[inner], normal[inner][:, :2])
    np.testing.assert_allclose(field.precision[mask], 25)
    assert not field.precision[~mask].any() and not field.dome[~mask].any()
    assert field.dome[75, 75] > 40  # of about 67


@pytest.mark.slow
def test_sirfs_takes_the_shape_that_was_seen() -> None:
    image, mask = under_lights((-0.7, 0.2, 0.6))
    normal, _ = ball()
    priors, weights = shipped_prior_set().priors("natural", 3), isc_weights("natural", 3)

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
