"""The confidence of a mask and its features."""

import numpy as np
import pytest

from isc_core.masking.confidence import (
    confidence_features,
    confidence_of,
    features_of_replacement,
    features_without_object,
)
from isc_core.masking.crops import CropPrediction
from isc_core.networks.mask_network import FEATURES

COUNTS = np.array([0.05, 0.9, 0.05])


def prediction(inside: float, outside: float) -> CropPrediction:
    cover = np.full((20, 20), outside, np.float32)
    cover[5:15, 5:15] = inside
    return CropPrediction(cover, COUNTS)


def test_features_are_one_and_five_log_odds() -> None:
    certain = prediction(0.99, 0.01)
    features = confidence_features(certain, certain, certain.cover, False)
    assert features.shape == (FEATURES,) and features[0] == 1
    assert features[1] == pytest.approx(np.log(9)) == features[2]
    assert features[3] > 5, "both passes are equal"


def test_passes_that_differ_or_are_vague_have_lower_features() -> None:
    certain, vague = prediction(0.99, 0.01), prediction(0.6, 0.3)
    other = CropPrediction(np.roll(certain.cover, 8, axis=1), COUNTS)
    same = confidence_features(certain, certain, certain.cover, False)
    assert confidence_features(certain, other, certain.cover, False)[3] < same[3]
    assert (confidence_features(vague, vague, vague.cover, False)[4:] < same[4:]).all()
    assert (features_without_object(certain)[2:] < same[2:]).all()


def test_touching_objects_and_several_paints_do_not_count_against_a_mask_in_one_piece() -> None:
    certain = CropPrediction(prediction(0.99, 0.01).cover, np.array([0.05, 0.15, 0.8]))
    apart, together = (
        confidence_features(certain, certain, certain.cover, whole) for whole in (False, True)
    )
    assert apart[1] == pytest.approx(np.log(0.15 / 0.85)) == apart[2]
    assert together[1] == pytest.approx(np.log(19)) == together[2]
    assert (apart[3:] == together[3:]).all()


def test_the_confidence_is_a_probability() -> None:
    weights = np.ones(FEATURES)
    assert confidence_of(np.zeros(FEATURES), weights) == 0.5
    assert confidence_of(np.full(FEATURES, 0.5), weights) > 0.9


def test_a_replacement_that_differs_lowers_the_overlap_alone() -> None:
    certain = prediction(0.99, 0.01)
    features = confidence_features(certain, certain, certain.cover, False)
    same = (certain.cover > 0.5).astype(np.float32)
    other = np.roll(same, 8, axis=1)
    assert features_of_replacement(features, certain.cover, certain.cover) == pytest.approx(
        features
    )
    overlaps = [features_of_replacement(features, certain.cover, one)[3] for one in (same, other)]
    assert features[3] >= overlaps[0] > overlaps[1]
    assert features_of_replacement(features, certain.cover, other)[4:] == pytest.approx(
        features[4:]
    )
