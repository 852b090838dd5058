"""The program that scores normals: stored normals, rows that are kept, its table."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("mitsuba")

from benchmarks.detail import recovered
from benchmarks.detail.body_rows import body_rows
from benchmarks.detail.rendering import DetailScene, SetKind
from benchmarks.detail.sets import bodies_in, read_truth, write_scene
from isc_core.errors import InputError

SIDE = 215


@pytest.fixture
def bodies(tmp_path: Path) -> Path:
    """A set of plates: with waves, without, with waves on its left half, with and without."""
    mask = np.zeros((SIDE, SIDE), bool)
    mask[10:-10, 10:-10] = True
    tilt = 0.2 * np.sin(2 * np.pi / 4 * np.arange(SIDE)) * np.ones((SIDE, 1)) * mask
    flat = np.dstack([0 * tilt, 0 * tilt, mask]).astype(np.float32)
    waves = np.dstack([np.sin(tilt), 0 * tilt, np.cos(tilt)]).astype(np.float32) * mask[..., None]
    codes = np.full((SIDE, SIDE, 3), 128, np.uint8)
    half = np.where(np.arange(SIDE)[:, None] < SIDE // 2, waves, flat)
    for kind, normal in zip(SetKind, (waves, flat, half, waves, flat), strict=True):
        write_scene(tmp_path, DetailScene(f"{kind}_00", codes, mask, normal, flat, {}))
    return tmp_path


def run(folder: Path, estimator: recovered.Estimator, key: str) -> list[dict[str, object]]:
    rows = folder / "rows.jsonl"
    measure = partial(recovered.score_body, estimator=estimator)
    return [dict(row) for row in body_rows(folder, rows, list(SetKind), 9, key, measure)]


def test_the_truth_is_complete_and_swapped_bodies_are_not(bodies: Path) -> None:
    truth = run(bodies, lambda _, known: known.normal, "truth")
    assert truth[0]["explained"] == pytest.approx([1, 1, 1], abs=1e-3)
    assert truth[1]["error"] == pytest.approx([0, 0, 0], abs=1e-9)
    waves = read_truth(bodies / "relief_00").normal
    always = run(bodies, lambda _, known: waves, "always the waves")
    for kind, line in zip(
        ("print", "drawn"), recovered.table(always).splitlines()[-2:], strict=True
    ):
        assert f"{kind}: invented" in line
        assert "| 1.000 (1.000 to 1.000)" in line


def test_rows_are_kept_and_those_of_another_key_are_not_used(bodies: Path) -> None:
    first = run(bodies, lambda _, known: known.normal, "a")

    def fails(body: Path, known: object) -> np.ndarray:
        raise AssertionError(body)

    assert run(bodies, fails, "a") == first
    with pytest.raises(AssertionError):
        run(bodies, fails, "b")


def test_stored_normals_are_scored_and_missing_ones_named(bodies: Path, tmp_path: Path) -> None:
    folder = tmp_path / "normals"
    folder.mkdir()
    np.save(folder / "relief_00.npy", read_truth(bodies / "relief_00").normal)
    estimate = recovered.stored_normals(folder)
    relief, printed = (bodies_in(bodies, kind)[0] for kind in (SetKind.RELIEF, SetKind.PRINT))
    truth = read_truth(relief)
    assert np.array_equal(estimate(relief, truth), truth.normal)
    with pytest.raises(InputError, match=r"print_00\.npy is missing"):
        estimate(printed, truth)


def test_a_folder_without_bodies_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="write it with"):
        bodies_in(tmp_path, SetKind.RELIEF)
