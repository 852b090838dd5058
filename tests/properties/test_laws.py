"""The laws of benchmarks.properties on a few drawn cases each, always the same; what a long run
found; and that laws can fail.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from benchmarks.properties import decomposition_laws, separation_laws, tool_laws
from benchmarks.properties.law import Law, Notes, threads
from benchmarks.properties.pictures import KINDS, MASKS, Picture
from benchmarks.properties.registry import LAWS
from benchmarks.properties.runner import Outcome, run, run_chunk, table
from isc_core.image_metrics import sparsification
from isc_core.separation import separate

SECONDS = 0.6  # for each law, on a quiet core


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_the_law_holds(law: Law) -> None:
    outcome = run_chunk(law, 0, int(np.clip(SECONDS / law.cost, 4, 25)))
    assert not outcome.failure, outcome.failure
    assert outcome.refused < outcome.examples, "everything was refused: nothing was tried"


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_picture_and_mask_can_be_made(kind: str) -> None:
    for mask in MASKS:
        for shape in ((1, 1), (2, 7), (16, 9)):
            picture = Picture(kind, mask, *shape, seed=3)
            light, inside = picture.light(), picture.inside()
            assert (
                light.shape == (*shape, 3)
                and light.dtype == np.float32
                and np.isfinite(light).all()
                and (light >= 0).all()
            )
            assert inside.shape == shape and inside.any() and picture.clipped().shape == shape


# --- what long runs found -------------------------------------------------------------------------


def test_the_network_gives_the_same_bytes_on_any_number_of_threads() -> None:
    """Matrix products of BLAS are split by threads, and rounded differently."""
    pytest.importorskip("threadpoolctl")
    picture = Picture("glossy", "disc", 96, 96, seed=0)
    splits = []
    for count in (1, 2, 3):
        with threads(count):
            splits.append(separate("network", picture.light(), picture.inside()).diffuse)
    assert np.array_equal(splits[0], splits[1]) and np.array_equal(splits[0], splits[2])


def test_no_error_is_left_when_every_pixel_is_dropped() -> None:
    """A cumulative sum over its own total can be more than 1 by its rounding."""
    for seed in range(40):
        error = np.random.default_rng(seed).random(15)
        left = sparsification(error, np.arange(15.0)).left
        assert left.min() >= 0 and left[-1] == pytest.approx(0, abs=1e-12)


# --- laws that cannot fail are none ---------------------------------------------------------------


def law(name: str) -> Law:
    return next(law for law in LAWS if law.name == name)


def brighter(split: Callable[..., Any]) -> Callable[..., Any]:
    def broken(*words: Any, **options: Any) -> Any:
        found = split(*words, **options)
        return replace(found, diffuse=found.diffuse + np.float32(1e-3))

    return broken


def drifting(function: Callable[..., Any]) -> Callable[..., Any]:
    """As a function whose answer differs from call to call."""
    calls = [0]

    def broken(*words: Any, **options: Any) -> Any:
        calls[0] += 1
        found = function(*words, **options)
        return replace(found, diffuse=found.diffuse * np.float32(1 - 0.4 * (calls[0] % 2)))

    return broken


@pytest.mark.parametrize(
    ("name", "module", "function", "breaks"),
    [
        ("separation sound", separation_laws, "separate", brighter),
        ("separation threads", separation_laws, "separate", drifting),
        ("separation padding", separation_laws, "separate", drifting),
        ("separation turned", separation_laws, "separate", drifting),
        ("separation scale", separation_laws, "separate", drifting),
        ("decomposition sound", decomposition_laws, "decompose", brighter),
        ("decomposition threads", decomposition_laws, "decompose", drifting),
        (
            "edits",
            tool_laws,
            "_edit",
            lambda edit: lambda *words: replace(edit(*words), image=edit(*words).image - 1e30),
        ),
        ("filling", tool_laws, "fill", lambda fill: lambda *words: 2 * fill(*words) + 1),
        ("metrics", tool_laws, "ssim", lambda ssim: lambda *words, **options: 1.5),
    ],
)
def test_the_law_can_fail(
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    module: Any,
    function: str,
    breaks: Callable[..., Any],
) -> None:
    monkeypatch.setattr(module, function, breaks(getattr(module, function)))
    assert run_chunk(law(name), 0, 4).failure


def test_warnings_of_numbers_are_failures() -> None:
    def warns(case: Picture, notes: Notes) -> None:
        np.log(np.zeros(case.rows))

    assert (
        "divide by zero"
        in run_chunk(replace(law("photos"), cases=law("light").cases, check=warns), 0, 2).failure
    )


def test_a_run_goes_on_where_it_was_stopped(tmp_path: Any) -> None:
    laws = [law("photos"), law("reflectance models")]
    first = run(laws[:1], 30, tmp_path)
    with (tmp_path / "chunks.jsonl").open("a") as file:
        file.write('{"law": "reflectance mo')  # killed while it wrote
    outcomes = run(laws, 30, tmp_path)
    assert outcomes[0] == first[0] and len(outcomes) == 2
    assert (
        isinstance(outcomes[1], Outcome)
        and "| photos |" in table(laws, outcomes)
        and "No law failed" in table(laws, outcomes)
    )
    assert len(run(laws, 30, tmp_path)) == 2
