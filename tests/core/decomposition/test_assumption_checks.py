"""Photos that violate the models' assumptions get a warning, and some a lower confidence."""

from dataclasses import replace

import numpy as np
import pytest

from isc_core.decomposition.assumption_checks import (
    check_photo,
    check_scene,
    share_in_blocks,
    with_warnings,
)
from isc_core.decomposition.models import SceneEstimate
from isc_core.networks.scene_network import Kind, ScenePrediction
from isc_core.photo import Photo, PhotoSource
from isc_core.result_files.diagnostics_text import warning_text
from isc_core.scene.decomposition import Separation
from isc_core.scene.diagnostics import Diagnostics, WarningKind
from isc_core.scene.light_coefficients_estimate import LightCoefficientsEstimate
from isc_core.scene.light_estimate import PLACES
from isc_core.scene.normal_estimate import NormalEstimate
from isc_core.scene.shading_estimate import ShadingEstimate

SIZE = 20
SURE, MIRRORED = (0.92, 0.06, 0.02), (0.3, 0.4, 0.3)  # probabilities of `Kind`


def told(kinds: tuple[float, float, float], several: float) -> ScenePrediction:
    """A prediction of the network: one lamp or, with a probability of `several`, more."""
    maps, flat = np.zeros((SIZE, SIZE, 3)), np.zeros((SIZE, SIZE))
    return ScenePrediction(
        NormalEstimate(maps, flat),
        maps,
        flat,
        ShadingEstimate(maps, flat),
        LightCoefficientsEstimate(np.zeros((9, 3)), np.eye(27)),
        np.array([0, 1 - several, several]),
        np.full(len(PLACES), 1 / len(PLACES)),
        np.array(kinds),
        flat,
    )


def answered() -> tuple[Photo, SceneEstimate]:
    """A grey square and an answer to it, of confidence .8."""
    mask = np.zeros((SIZE, SIZE), bool)
    mask[3:-3, 4:-4] = True
    grey = np.where(mask[..., None], 0.5, 0).astype(np.float32) * np.ones(3, np.float32)
    split = Separation(grey, 0 * grey, 0 * grey, np.where(mask, 0.8, 0).astype(np.float32))
    source = PhotoSource("0" * 64, mask.shape, 12, "linear", "file")
    photo = Photo(grey, mask, 1 / 4095, np.zeros(mask.shape, bool), source)
    return photo, SceneEstimate(
        split, np.zeros(mask.shape), np.zeros((9, 3)), Diagnostics(converged=True)
    )


@pytest.mark.parametrize(
    ("kinds", "several", "expected"),
    [
        (SURE, 0.2, []),
        (MIRRORED, 0.2, [WarningKind.MIRROR_OR_GLASS]),
        (SURE, 0.8, [WarningKind.SEVERAL_LIGHTS]),
        (MIRRORED, 0.8, [WarningKind.MIRROR_OR_GLASS, WarningKind.SEVERAL_LIGHTS]),
        ((0.55, 0.25, 0.2), 0.5, []),
    ],
)
def test_each_kind_has_its_threshold(
    kinds: tuple[float, float, float], several: float, expected: list[WarningKind]
) -> None:
    found = check_scene(told(kinds, several))
    assert [warning.kind for warning in found] == expected
    assert all(warning.value is not None and 0 < warning.value <= 1 for warning in found)


@pytest.mark.parametrize(
    ("kinds", "several", "left"),
    [
        (SURE, 0.2, 1),
        (MIRRORED, 0.2, 1),
        (SURE, 0.7, 0.3),
        (SURE, 0.99, 0.1),
        (MIRRORED, 0.65, 0.35),
    ],
)
def test_several_lamps_lower_the_confidence_and_a_probable_mirror_does_not(
    kinds: tuple[float, float, float], several: float, left: float
) -> None:
    photo, answer = answered()
    found = with_warnings(photo, answer, told(kinds, several))
    assert found.diagnostics.converged and bool(found.diagnostics.warnings) == (
        kinds == MIRRORED or left < 1
    )
    np.testing.assert_allclose(found.split.confidence, left * answer.split.confidence, rtol=1e-3)
    np.testing.assert_array_equal(found.split.diffuse, answer.split.diffuse)


def test_the_status_has_all_probabilities() -> None:
    found = with_warnings(*answered(), told(MIRRORED, 0.25)).diagnostics
    assert found.scene_classes == dict(zip(map(str, Kind), MIRRORED, strict=True))
    assert found.light_counts == {"none": 0.0, "one": 0.75, "several": 0.25}
    assert found.several_lights == 0.25


def test_much_that_is_too_bright_is_said() -> None:
    photo, answer = answered()
    assert check_photo(photo) == ()
    clipped = photo.mask & (np.indices(photo.mask.shape)[0] > SIZE / 2)
    found = with_warnings(replace(photo, clipped=clipped), answer, told(SURE, 0.2))
    lines = [warning_text(warning) for warning in found.diagnostics.warnings]
    assert any("clipped" in line and "%" in line for line in lines)


def test_a_ragged_mask_is_said() -> None:
    photo, _ = answered()
    assert share_in_blocks(photo.mask) == 1
    speckled = photo.mask & (np.indices(photo.mask.shape).sum(0) % 2 == 0)
    assert share_in_blocks(speckled) == 0
    found = check_photo(replace(photo, mask=speckled))
    assert WarningKind.RAGGED_MASK in [warning.kind for warning in found]
