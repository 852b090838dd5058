"""Photos that violate the models' assumptions get a lower confidence and a warning."""

from dataclasses import replace

import numpy as np
import pytest

from isc_core.decomposition import assumption_checks
from isc_core.decomposition.assumption_checks import (
    check_photo,
    check_scene,
    share_in_blocks,
    with_warnings,
)
from isc_core.decomposition.models import SceneEstimate
from isc_core.networks.scene_classifier import GLASS, KINDS, LAMPS, MIRROR, ORDINARY
from isc_core.photo import Photo, PhotoSource
from isc_core.result_files.diagnostics_text import warning_text
from isc_core.scene.decomposition import Separation
from isc_core.scene.diagnostics import Diagnostics, WarningKind
from isc_core.scene.light_estimate import PLACES, LightEstimate

SIZE = 20
SURE, MIRRORED = (
    {ORDINARY: 0.9, MIRROR: 0.06, GLASS: 0.02, LAMPS: 0.02},
    {ORDINARY: 0.2, MIRROR: 0.4, GLASS: 0.3, LAMPS: 0.1},
)


def lit_by(several: float) -> LightEstimate:
    """One light or, with a probability of `several`, more."""
    return LightEstimate(
        0.0, 1 - several, several, np.full(len(PLACES), 1 / len(PLACES)), np.zeros(8), np.ones(8)
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
        (SURE, 0.7, []),
        (SURE | {LAMPS: 0.3}, 0.7, [WarningKind.SEVERAL_LIGHTS]),
        (MIRRORED | {LAMPS: 0.3}, 0.7, [WarningKind.MIRROR_OR_GLASS, WarningKind.SEVERAL_LIGHTS]),
        ({ORDINARY: 0.3, MIRROR: 0.0, GLASS: 0.0, LAMPS: 0.7}, 0.3, [WarningKind.SEVERAL_LIGHTS]),
        ({ORDINARY: 0.3, MIRROR: 0.0, GLASS: 0.0, LAMPS: 0.7}, 0.1, []),
        ({ORDINARY: 0.45, MIRROR: 0.25, GLASS: 0.3, LAMPS: 0.0}, 0.3, []),
    ],
)
def test_each_kind_has_its_line(
    kinds: dict[str, float], several: float, expected: list[WarningKind]
) -> None:
    found = check_scene(kinds, lit_by(several))
    assert [warning.kind for warning in found] == expected
    assert all(warning.value is not None and 0 < warning.value <= 1 for warning in found)


@pytest.mark.parametrize(
    ("kinds", "several", "left"),
    [
        (SURE, 0.2, 1),
        (MIRRORED, 0.2, 0.3),
        (MIRRORED | {ORDINARY: 0.001, LAMPS: 0.0}, 0.2, 0.1),
        (SURE | {LAMPS: 0.6}, 0.6, 0.4),
        (MIRRORED | {LAMPS: 0.5}, 0.5, 0.35),
    ],
)
def test_a_doubt_leaves_the_confidence_left_for_paint(
    monkeypatch: pytest.MonkeyPatch, kinds: dict[str, float], several: float, left: float
) -> None:
    monkeypatch.setattr(assumption_checks, "classify_scene", lambda image, mask: kinds)
    photo, answer = answered()
    found = with_warnings(photo, answer, lit_by(several))
    assert (
        found.diagnostics.converged
        and found.diagnostics.scene_classes == kinds
        and bool(found.diagnostics.warnings) == (left < 1)
    )
    np.testing.assert_allclose(found.split.confidence, left * answer.split.confidence, rtol=1e-3)
    np.testing.assert_array_equal(found.split.diffuse, answer.split.diffuse)


def test_the_status_tells_how_likely_each_kind_is() -> None:
    found = with_warnings(*answered(), lit_by(0.25)).diagnostics
    assert list(found.scene_classes) == list(KINDS)
    assert sum(found.scene_classes.values()) == pytest.approx(1, abs=1e-3)
    assert found.light_counts == {"none": 0.0, "one": 0.75, "several": 0.25}


def test_much_that_is_too_bright_is_said() -> None:
    photo, answer = answered()
    assert check_photo(photo) == ()
    clipped = photo.mask & (np.indices(photo.mask.shape)[0] > SIZE / 2)
    found = with_warnings(replace(photo, clipped=clipped), answer, lit_by(0.2))
    lines = [warning_text(warning) for warning in found.diagnostics.warnings]
    assert any("clipped" in line and "%" in line for line in lines)


def test_a_ragged_mask_is_said() -> None:
    photo, _ = answered()
    assert share_in_blocks(photo.mask) == 1
    speckled = photo.mask & (np.indices(photo.mask.shape).sum(0) % 2 == 0)
    assert share_in_blocks(speckled) == 0
    found = check_photo(replace(photo, mask=speckled))
    assert WarningKind.RAGGED_MASK in [warning.kind for warning in found]
