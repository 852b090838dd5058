"""What makes a mask sure."""

import numpy as np
import pytest

from isc_core.masking.evidence import (
    confidence_of,
    evidence_of,
    no_evidence,
    of_another_mask,
)
from isc_core.masking.frames import PartPrediction
from isc_core.networks.mask_network import EVIDENCE

COUNTS = np.array([0.05, 0.9, 0.05])


def look(inside: float, outside: float) -> PartPrediction:
    cover = np.full((20, 20), outside, np.float32)
    cover[5:15, 5:15] = inside
    return PartPrediction(cover, COUNTS)


def test_evidence_is_one_and_five_log_odds() -> None:
    sure = look(0.99, 0.01)
    evidence = evidence_of(sure, sure, sure.cover)
    assert evidence.shape == (EVIDENCE,) and evidence[0] == 1
    assert evidence[1] == pytest.approx(np.log(9)) == evidence[2]
    assert evidence[3] > 5, "both looks are the same"


def test_masks_that_differ_or_that_are_vague_have_less_evidence() -> None:
    sure, vague = look(0.99, 0.01), look(0.6, 0.3)
    other = PartPrediction(np.roll(sure.cover, 8, axis=1), COUNTS)
    same = evidence_of(sure, sure, sure.cover)
    assert evidence_of(sure, other, sure.cover)[3] < same[3]
    assert (evidence_of(vague, vague, vague.cover)[4:] < same[4:]).all()
    assert (no_evidence(sure)[2:] < same[2:]).all()


def test_the_confidence_is_a_probability() -> None:
    weights = np.ones(EVIDENCE)
    assert confidence_of(np.zeros(EVIDENCE), weights) == 0.5
    assert confidence_of(np.full(EVIDENCE, 0.5), weights) > 0.9


def test_another_mask_than_the_looks_is_less_sure() -> None:
    sure = look(0.99, 0.01)
    evidence = evidence_of(sure, sure, sure.cover)
    same = (sure.cover > 0.5).astype(np.float32)
    other = np.roll(same, 8, axis=1)
    assert of_another_mask(evidence, sure.cover, sure.cover) == pytest.approx(evidence)
    shares = [of_another_mask(evidence, sure.cover, one)[3] for one in (same, other)]
    assert evidence[3] >= shares[0] > shares[1]
    assert of_another_mask(evidence, sure.cover, other)[4:] == pytest.approx(evidence[4:])
