"""The rule that tells relief from paint: its fit on numbers whose answer is known."""

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("mitsuba")

from benchmarks.detail.relief_rule import SHARES, figures, left_out, logistic_weights


def test_weights_of_a_known_boundary() -> None:
    rng = np.random.default_rng(0)
    features = rng.normal(size=(400, 2))
    is_relief = rng.random(400) < 1 / (1 + np.exp(-(0.5 + 2 * features[:, 0])))
    offset, first, second = logistic_weights(features, is_relief)
    assert abs(offset - 0.5) < 0.4 and abs(first - 2) < 0.5 and abs(second) < 0.4


def test_a_body_left_out_does_not_decide_about_itself() -> None:
    features = np.array([[0.0], [0.1], [1.0], [1.1], [0.05]])
    is_relief = np.array([False, False, True, True, True])
    assert left_out(features, is_relief)[4] < 0.5


def test_what_is_explained_and_invented_follows_from_the_added_shares() -> None:
    shares, probability = np.array(SHARES), np.array([0.45, 0.3, 0.6, 0.45])
    gained = (1 - (1 - shares) ** 2)[:, None]
    relief = {"explained": gained, "error": 0 * gained, "energy": 2 + 0 * gained}
    paint = {"explained": 0 * gained, "error": 0.2 * shares[:, None] ** 2, "energy": 0 * gained}
    rows = [relief, relief, paint, paint]
    is_relief = np.array([True, True, False, False])
    explained, invented = figures(rows, probability, is_relief)
    assert np.allclose(explained, (0.75 + 0) / 2)
    assert np.allclose(invented, (0.2 + 0.05) / 2 / 2)
