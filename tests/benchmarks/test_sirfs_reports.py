"""Reports of the benchmarks of SIRFS: what a figure is relative to, and how certain it is."""

import argparse
from pathlib import Path

import numpy as np
import pytest

from benchmarks.sirfs import soft_terms
from benchmarks.sirfs.starts import _standard_error


def test_repetitions_of_an_object_do_not_make_a_mean_more_certain() -> None:
    ratios, objects = np.array([-0.2, 0.1, 0.3, 0.0]), ["cup", "frog", "sun", "box"]
    once = _standard_error(ratios, objects)
    assert once == f"{ratios.std(ddof=1) / 2:.3f}"
    assert _standard_error(np.repeat(ratios, 4), np.repeat(objects, 4).tolist()) == once
    assert _standard_error(ratios[:2], ["cup", "cup"]) == "-"


def test_no_prediction_is_solved_even_if_it_is_not_asked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """All ways are reported relative to it."""
    for name in ("collect_statistics", "read_training_objects", "load_natural_lights"):
        monkeypatch.setattr(soft_terms, name, lambda *given: {})
    monkeypatch.setattr(soft_terms, "fit_priors", lambda *given: None)
    given = argparse.Namespace(
        data=Path(), names="cup1", ways="1:1:1", lights="natural", noises=2, degrees=18.0,
        shading=0.15, light=0.3, domes="", weights=None, solve_as=None,
    )  # fmt: skip
    assert [job.way for job in soft_terms.jobs(given)] == ["-:-:-", "1:1:1", "1:1:1"]
