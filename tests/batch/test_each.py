"""`isc batch --each`: a result, a row and a thumbnail for each object of a photo."""

import csv
import json
import shutil
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from isc_core.batch.item import DONE, FAILED, SKIPPED, ImageJob, Outcomes
from isc_core.batch.run_batch import run_batch
from isc_core.batch.work import process
from isc_core.cli.main import main
from isc_core.result_files.result_folder import DECOMPOSITION_FILES, load
from tests.batch.conftest import QUICK, batch, rows
from tests.core.command_line import ball_codes, write_image

EACH = replace(QUICK, each=True)


@pytest.fixture(scope="module")
def first_shelf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder `photos` with a photo of two balls on black and one of nothing, and what a run has
    made of them in `out`.
    """
    place = tmp_path_factory.mktemp("shelf")
    folder = place / "photos"
    folder.mkdir()
    ball = ball_codes(12.0)
    write_image(folder / "shelf.png", np.concatenate([ball, 0.8 * ball], axis=1).astype("uint16"))
    write_image(folder / "empty.png", np.full((40, 40, 3), 9000, "uint16"))
    done = run_batch(batch(folder, output=place / "out", recipe=EACH))
    assert done == Counter({DONE: 2, FAILED: 1})
    return place


@pytest.fixture
def shelf(first_shelf: Path, tmp_path: Path) -> Path:
    """The photos, to be changed at will."""
    return Path(shutil.copytree(first_shelf / "photos", tmp_path / "photos"))


@pytest.fixture
def out(first_shelf: Path, tmp_path: Path) -> Path:
    """The output of the first run, to be changed at will."""
    return Path(shutil.copytree(first_shelf / "out", tmp_path / "out"))


def test_each_object_has_a_result_a_row_and_a_thumbnail(out: Path) -> None:
    left, right = (load(out / "shelf" / number) for number in "12")
    columns = left.mask.shape[1]
    assert left.mask[:, : columns // 2].any() and not left.mask[:, columns // 2 :].any()
    assert not right.mask[:, : columns // 2].any() and right.mask.any()
    with (out / "summary.csv").open(newline="") as file:
        told = [(row["number"], row["name"], row["status"]) for row in csv.DictReader(file)]
    assert told == [("0", "empty", FAILED), ("1", "shelf/1", DONE), ("1", "shelf/2", DONE)]
    assert [row["name"] for row in rows(out / "summary.jsonl")] == ["empty", "shelf/1", "shelf/2"]
    assert [row["name"] for row in rows(out / "failures.jsonl")] == ["empty"]
    page = (out / "summary.html").read_text()
    assert "3 results: 2 done, 0 skipped, 1 failed" in page
    for number in "12":
        assert f'href="shelf/{number}/preview.png"' in page
        assert f'src="thumbnails/each/shelf/{number}.jpg"' in page
        assert (out / "thumbnails" / "each" / "shelf" / f"{number}.jpg").is_file()


def test_results_equal_those_of_isc_decompose(shelf: Path, out: Path, tmp_path: Path) -> None:
    words = ["decompose", shelf / "shelf.png", "--each", "--model", "retinex", "--engine", "numpy"]
    assert main([str(word) for word in (*words, "-o", tmp_path / "alone", "-q")]) == 0
    for place in ("1", "2"):
        for name in set(DECOMPOSITION_FILES) - {"decomposition.json"}:
            made = (out / "shelf" / place / name).read_bytes()
            assert made == (tmp_path / "alone" / place / name).read_bytes(), name


def test_what_is_finished_is_skipped_and_the_rest_is_made(shelf: Path, out: Path) -> None:
    given = batch(shelf / "shelf.png", output=out, recipe=EACH)
    (out / "thumbnails" / "each" / "shelf" / "1.jpg").unlink()
    assert run_batch(given) == Counter({SKIPPED: 2})
    assert (out / "thumbnails" / "each" / "shelf" / "1.jpg").is_file()
    (out / "shelf" / "2" / "mesh.glb").unlink()
    assert run_batch(given) == Counter({SKIPPED: 1, DONE: 1})


def test_an_object_that_fails_stops_no_other(shelf: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    (out / "shelf" / "1").mkdir(parents=True)
    (out / "shelf" / "1" / "diary.txt").write_text("mine")
    given = batch(shelf / "shelf.png", output=out, recipe=EACH)
    assert run_batch(given) == Counter({FAILED: 1, DONE: 1})
    assert [row["name"] for row in rows(out / "failures.jsonl")] == ["shelf/1"]
    assert (out / "shelf" / "1" / "diary.txt").read_text() == "mine"
    (out / "shelf" / "1" / "diary.txt").unlink()
    assert run_batch(given) == Counter({DONE: 1, SKIPPED: 1})


def test_an_object_of_one_colour_fails_as_it_does_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ball = ball_codes(12.0)
    disc = np.where(ball.max(-1, keepdims=True) > 0, 30000, 0) * np.ones(3, int)
    photo = write_image(tmp_path / "shelf.png", np.hstack([disc.astype("uint16"), ball]))
    alone = write_image(tmp_path / "alone.png", disc.astype("uint16"))
    words = ["--model", "retinex", "--engine", "numpy", "-q"]
    assert main(["decompose", str(alone), "-o", str(tmp_path / "alone"), *words]) == 2
    reason = "every pixel inside the mask is the same: there is nothing to recover"
    assert reason in capsys.readouterr().err
    out = tmp_path / "out"
    assert main(["decompose", str(photo), "--each", "-o", str(out), *words]) == 1
    assert f"object 1 of 2: {photo}: {reason}" in capsys.readouterr().err
    assert [path.name for path in out.iterdir()] == ["2"]
    given = batch(photo, output=tmp_path / "batch", recipe=EACH)
    assert run_batch(given) == Counter({FAILED: 1, DONE: 1})
    (failure,) = rows(tmp_path / "batch" / "failures.jsonl")
    assert failure["name"] == "shelf/1" and reason in str(failure["reason"])


def test_an_object_that_is_too_thin_stops_no_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ball = ball_codes(12.0)
    rod = np.zeros_like(ball)
    rod[4:-4, 10:16] = 30000 + 100 * np.arange(6)[:, None]
    photo = write_image(tmp_path / "shelf.png", np.hstack([rod, ball]))
    words = ["--model", "retinex", "--engine", "numpy", "-q", "-o", str(tmp_path / "out")]
    assert main(["decompose", str(photo), "--each", *words]) == 1
    assert "object 1 of 2" in (said := capsys.readouterr().err) and "at least 8" in said
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["2"]


def test_results_of_objects_that_are_no_longer_there_go(shelf: Path, out: Path) -> None:
    given = batch(shelf / "shelf.png", output=out, recipe=EACH)
    write_image(shelf / "shelf.png", ball_codes(12.0))
    assert run_batch(given) == Counter({DONE: 1})
    assert [path.name for path in (out / "shelf").iterdir()] == ["1"]
    assert len(list((out / "thumbnails" / "each" / "shelf").iterdir())) == 1


def test_results_beyond_one_that_failed_go_too(shelf: Path, out: Path) -> None:
    (out / "shelf" / "2").rename(out / "shelf" / "4")
    write_image(shelf / "shelf.png", ball_codes(12.0))
    assert run_batch(batch(shelf / "shelf.png", output=out, recipe=EACH)) == Counter({DONE: 1})
    assert [path.name for path in (out / "shelf").iterdir()] == ["1"]


def test_a_result_with_foreign_files_stays_and_is_reported(shelf: Path, out: Path) -> None:
    (out / "shelf" / "2" / "diary.txt").write_text("mine")
    write_image(shelf / "shelf.png", ball_codes(12.0))
    given = batch(shelf / "shelf.png", output=out, recipe=EACH)
    assert run_batch(given) == Counter({DONE: 1, FAILED: 1})
    (failure,) = rows(out / "failures.jsonl")
    assert failure["name"] == "shelf/2"
    assert "no longer shows this object" in str(failure["reason"])
    assert "diary.txt" in str(failure["reason"])
    (out / "shelf" / "2" / "diary.txt").unlink()
    assert run_batch(given) == Counter({SKIPPED: 1})
    assert [path.name for path in (out / "shelf").iterdir()] == ["1"]


def test_whole_photos_and_objects_do_not_replace_each_other(
    shelf: Path, out: Path, tmp_path: Path
) -> None:
    photo, whole = shelf / "shelf.png", tmp_path / "whole"
    assert run_batch(batch(photo, output=out)) == Counter({FAILED: 1})
    assert load(out / "shelf" / "2").mask.any()
    run_batch(batch(photo, output=whole))
    assert run_batch(batch(photo, output=whole, recipe=EACH)) == Counter({FAILED: 1})
    assert "leave out --each" in str(rows(whole / "failures.jsonl")[0]["reason"])


def test_a_manifest_sets_each_per_photo(shelf: Path, tmp_path: Path) -> None:
    lines = [{"image": "shelf.png", "each": True}, {"image": "shelf.png", "name": "both"}]
    (shelf / "list.jsonl").write_text("\n".join(map(json.dumps, lines)))
    out = tmp_path / "out"
    assert run_batch(batch(shelf / "list.jsonl", output=out)) == Counter({DONE: 3})
    assert [row["name"] for row in rows(out / "summary.jsonl")] == ["shelf/1", "shelf/2", "both"]


def test_what_a_killed_run_left_of_objects_is_tidied(shelf: Path, out: Path) -> None:
    given = batch(shelf / "shelf.png", output=out, recipe=EACH)
    (out / "shelf" / ".2.0123abcd.partial").mkdir()
    (out / "shelf" / "1").rename(out / "shelf" / ".1.0123abcd.old")
    assert run_batch(given) == Counter({SKIPPED: 2})
    assert sorted(path.name for path in (out / "shelf").iterdir()) == ["1", "2"]


def lost_at_the_second(job: ImageJob) -> Outcomes:
    """The work, after workers were lost at the second object."""
    record = job.plan.output / ".isc-batch" / "attempts" / "shelf 2"
    record.write_text(f"{job.plan.run}\n" * 3)
    return process(job)


def test_the_object_that_costs_workers_is_given_up_alone(shelf: Path, tmp_path: Path) -> None:
    given = batch(shelf / "shelf.png", output=tmp_path / "out", recipe=EACH)
    assert run_batch(given, task=lost_at_the_second) == Counter({DONE: 1, FAILED: 1})
    (failure,) = rows(tmp_path / "out" / "failures.jsonl")
    assert failure["name"] == "shelf/2" and "workers crashed" in str(failure["reason"])
