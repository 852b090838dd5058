"""The rule that tells relief from paint: its fit on numbers whose answer is known."""

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("mitsuba")

from benchmarks.detail.relief_rule import SHARES, best_factor, left_out, logistic_weights


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


def test_the_factor_stops_where_too_much_is_invented() -> None:
    shares, probability = np.array(SHARES), np.array([0.8, 0.55])
    gained = (1 - (1 - shares / 1.5) ** 2)[:, None]
    rows = [
        {"explained": gained, "error": 0 * gained, "energy": np.ones_like(gained)},
        {"explained": gained, "error": 0.2 * shares[:, None] ** 2, "energy": 0 * gained},
    ]
    is_relief = np.array([True, False])
    factor, explained, invented = best_factor(rows, probability, is_relief)
    assert np.isclose(factor, 1.0) and 0.88 < explained[0] < 0.90 and invented[0] <= 0.0501
    rows[1]["error"] = 0 * gained
    factor, explained, invented = best_factor(rows, probability, is_relief)
    assert np.isclose(factor, 1.5) and explained[0] > 0.999 and invented[0] == 0
