"""Runs from end to end, with the workers in this process: made, skipped and failed images, and the
contents of the output folder.
"""

import csv
import itertools
import json
import re
from collections import Counter
from pathlib import Path

import fsspec
import pytest
from filelock import FileLock
from markupsafe import escape

from isc_core.batch import engine
from isc_core.batch import run_batch as run_module
from isc_core.batch.engine import WorkerOptions
from isc_core.batch.item import DONE, FAILED, SKIPPED, ImageJob, ImageRecipe
from isc_core.batch.journal import Journal, JournalEntry
from isc_core.batch.run_batch import run_batch
from isc_core.batch.summary import PAGE
from isc_core.decomposition.pipeline import decompose
from isc_core.decomposition.settings import Settings
from isc_core.errors import Cancelled, InputError
from isc_core.io.limits import Limits
from isc_core.photo import read_photo
from isc_core.progress import Monitor
from isc_core.result_files.result_folder import DECOMPOSITION_FILES, load, save
from tests.batch.conftest import HERE, QUICK, batch, rows
from tests.batch.tasks import obedient
from tests.core.command_line import ball_codes, write_image


def files_of(folder: Path) -> dict[str, bytes]:
    """Of a result, without the one that holds seconds."""
    names = (name for name in DECOMPOSITION_FILES if name != "decomposition.json")
    return {name: (folder / name).read_bytes() for name in names}


@pytest.mark.slow
def test_good_images_are_decomposed_and_the_bad_one_is_reported(
    made: Path, first_run: Path, tmp_path: Path
) -> None:
    assert {path.name for path in made.iterdir() if path.is_dir()} == {
        "one",
        "two",
        "three",
        "thumbnails",
        ".isc-batch",
    }
    assert load(made / "one").provenance.input["name"] == "one.png"
    failures = rows(made / "failures.jsonl")
    assert [(row["name"], row["image"]) for row in failures] == [
        ("bad", str(first_run / "photos" / "bad.png"))
    ]
    assert "damaged" in str(failures[0]["reason"])
    save(
        decompose(read_photo(first_run / "photos" / "two.png"), QUICK.settings, name="two.png"),
        tmp_path / "alone",
    )
    assert files_of(made / "two") == files_of(tmp_path / "alone"), (
        "a batch makes what isc decompose makes"
    )


@pytest.mark.slow
def test_the_summary_shows_all_in_the_inputs_order(made: Path) -> None:
    told = rows(made / "summary.jsonl")
    assert [(row["name"], row["status"]) for row in told] == [
        ("bad", FAILED),
        ("one", DONE),
        ("three", DONE),
        ("two", DONE),
    ]
    with (made / "summary.csv").open(newline="") as file:
        assert [row["name"] for row in csv.DictReader(file)] == ["bad", "one", "three", "two"]
    page = (made / "summary.html").read_text()
    assert "4 results: 3 done, 0 skipped, 1 failed" in page
    for name in ("one", "two", "three"):
        assert f'src="thumbnails/{name}.jpg"' in page
        assert (made / "thumbnails" / f"{name}.jpg").read_bytes().startswith(b"\xff\xd8")


@pytest.mark.slow
def test_complete_results_are_skipped_and_changed_photos_repeated(made: Path, photos: Path) -> None:
    before = {name: (made / name).stat().st_ino for name in ("one", "two", "three")}
    write_image(photos / "two.png", ball_codes(13.0))
    (made / "three" / "mesh.glb").unlink()
    assert run_batch(batch(photos, output=made)) == Counter({SKIPPED: 1, DONE: 2, FAILED: 1})
    after = {name: (made / name).stat().st_ino for name in before}
    assert [name for name in before if before[name] == after[name]] == ["one"]


@pytest.mark.slow
def test_a_mask_settings_and_priors_count_and_threads_do_not(made: Path, photos: Path) -> None:
    (photos / "bad.png").unlink()
    worker_options = WorkerOptions(workers=2, threads=2, memory="0", processes=False)
    assert run_batch(batch(photos, output=made, worker_options=worker_options)) == Counter(
        {SKIPPED: 3}
    )
    codes = ball_codes(12.0)
    write_image(photos / "one_mask.png", (codes.max(axis=2) > 0).astype("uint8") * 255)
    assert run_batch(batch(photos, output=made)) == Counter({SKIPPED: 2, DONE: 1})
    other = ImageRecipe(Settings(model="retinex", engine="numpy", illumination="laboratory"))
    assert run_batch(batch(photos / "two.png", output=made, recipe=other)) == Counter({DONE: 1})


def test_what_a_killed_run_left_is_tidied(made: Path, photos: Path) -> None:
    (made / ".one.0123abcd.partial").mkdir()
    (made / ".one.0123abcd.partial" / "maps.exr").write_bytes(b"half")
    (made / "two").rename(made / ".two.0123abcd.old")
    (made / ".isc-batch" / "attempts" / "three").write_text("another run\n" * 5)
    assert run_batch(batch(photos, output=made)) == Counter({SKIPPED: 3, FAILED: 1})
    assert (
        not list(made.glob(".*.partial"))
        + list(made.glob(".*.old"))
        + list((made / ".isc-batch" / "attempts").iterdir())
    )


def test_two_runs_into_one_folder(made: Path, photos: Path) -> None:
    with FileLock(made / ".isc-batch" / "lock"), pytest.raises(InputError, match="another run"):
        run_batch(batch(photos, output=made))
    assert run_batch(batch(photos, output=made))[SKIPPED] == 3


def test_a_run_that_cannot_begin_keeps_the_summary_of_the_run_before(
    made: Path, photos: Path
) -> None:
    names = ("failures.jsonl", "summary.html", "summary.csv", "summary.jsonl")
    before = {name: (made / name).read_bytes() for name in names}
    assert before["failures.jsonl"]
    nowhere = WorkerOptions(scheduler="nowhere")
    with pytest.raises(InputError, match="cannot be reached"):
        run_batch(batch(photos, output=made, worker_options=nowhere))
    assert {name: (made / name).read_bytes() for name in names} == before


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("name", ["owner", "run", "journal.jsonl"])
def test_a_full_disk_is_named_with_its_remedy(tmp_path: Path, name: str) -> None:
    (tmp_path / "good.png").touch()
    private = tmp_path / "out" / ".isc-batch"
    private.mkdir(parents=True)
    (private / name).symlink_to("/dev/full")
    with pytest.raises(InputError, match=r"cannot write .*\.isc-batch.*: no space is left.*free"):
        run_batch(batch(tmp_path / "good.png", output=tmp_path / "out"), task=obedient)
    assert not (private / "owner").exists()


def test_foreign_files_are_never_replaced(photos: Path, tmp_path: Path) -> None:
    output = tmp_path / "out"
    (output / "one").mkdir(parents=True)
    (output / "one" / "diary.txt").write_text("mine")
    assert run_batch(batch(photos / "one.png", output=output)) == Counter({FAILED: 1})
    assert (output / "one" / "diary.txt").read_text() == "mine"
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "summary.html").write_text("mine")
    with pytest.raises(InputError, match="not written by a batch"):
        run_batch(batch(photos, output=tmp_path / "other"))


@pytest.mark.slow
def test_a_manifest_gives_names_masks_and_options(photos: Path, tmp_path: Path) -> None:
    lines = [
        {"image": "photos/one.png", "name": "small", "options": {"max_size": 16}},
        {"image": "photos/one.png", "name": "whole"},
        {"image": "photos/none.png"},
        {"image": "photos/two.png", "mask": "photos/none.png"},
        {"image": "photos/one.png", "name": "whole"},
    ]
    (tmp_path / "list.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    counts = run_batch(batch(tmp_path / "list.jsonl", output=tmp_path / "out"))
    assert counts == Counter({DONE: 2, FAILED: 2, SKIPPED: 1})
    small, whole = (load(tmp_path / "out" / name) for name in ("small", "whole"))
    assert small.mask.sum() < 0.5 * whole.mask.sum()
    reasons = {
        str(row["name"]): str(row["reason"]) for row in rows(tmp_path / "out" / "failures.jsonl")
    }
    assert all("none.png: there is no such file" in reason for reason in reasons.values())


def test_a_bad_manifest_is_refused_before_any_work(photos: Path, tmp_path: Path) -> None:
    (tmp_path / "list.jsonl").write_text(
        '{"image": "photos/one.png"}\n{"image": "photos/two.png", "name": "../../x"}\n'
    )
    with pytest.raises(InputError, match="line 2"):
        run_batch(batch(tmp_path / "list.jsonl", output=tmp_path / "out"))
    assert not (tmp_path / "out" / "one").exists()
    (tmp_path / "empty.csv").write_text("image\n")
    with pytest.raises(InputError, match="names no image"):
        run_batch(batch(tmp_path / "empty.csv", output=tmp_path / "out"))


def test_patterns_folders_of_masks_and_missing_files(photos: Path, tmp_path: Path) -> None:
    (photos / "bad.png").unlink()
    masks = tmp_path / "masks"
    masks.mkdir()
    for name in ("one", "two"):
        write_image(masks / f"{name}.png", (ball_codes(12.0).max(axis=2) > 0).astype("uint8") * 255)
    assert run_batch(
        batch(tmp_path / "ph*" / "t?o.png", output=tmp_path / "out", masks=str(masks))
    ) == Counter({DONE: 1})
    assert load(tmp_path / "out" / "two").provenance.input["mask_from"] == "file"
    with pytest.raises(InputError, match="has no mask for three.png"):
        run_batch(batch(photos, output=tmp_path / "out", masks=str(masks)))
    for missing in (tmp_path / "nowhere", tmp_path / "*.jpg", masks / "x.png"):
        with pytest.raises(InputError, match="no such photo"):
            run_batch(batch(missing, output=tmp_path / "none"))
        assert not (tmp_path / "none").exists()


def test_inputs_of_an_object_store(photos: Path, tmp_path: Path) -> None:
    store = fsspec.filesystem("memory")
    for path in (photos / "one.png", photos / "bad.png"):
        store.pipe(f"/catalogue/{path.name}", path.read_bytes())
    limits = Limits(max_bytes=10_000_000)
    counts = run_batch(batch("memory://catalogue", output=tmp_path / "out", limits=limits))
    assert counts == Counter({DONE: 1, FAILED: 1})
    reason = str(rows(tmp_path / "out" / "failures.jsonl")[0]["reason"])
    assert reason.startswith("memory://catalogue/bad.png: "), (
        "the name of a temporary copy helps nobody"
    )
    assert not list((tmp_path / "out" / ".isc-batch").glob("fetched/*"))
    manifest = b'{"image": "one.png"}\n{"image": "none.png"}\n'
    store.pipe("/catalogue/list.jsonl", manifest)
    assert run_batch(batch("memory://catalogue/list.jsonl", output=tmp_path / "out"))[SKIPPED] == 1
    small = Limits(max_bytes=100)
    assert run_batch(
        batch("memory://catalogue/o*.png", output=tmp_path / "small", limits=small)
    ) == Counter({FAILED: 1})
    assert "too large" in str(rows(tmp_path / "small" / "failures.jsonl")[0]["reason"])
    store.rm("/catalogue", recursive=True)


@pytest.mark.parametrize("served", [False, True])
def test_the_dashboard_is_named_where_it_is_served(
    photos: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, served: bool
) -> None:
    """Its pages need Bokeh."""
    monkeypatch.setattr(engine, "find_spec", lambda name: name if served else None)
    told: list[str] = []
    run_batch(batch(photos / "bad.png", output=tmp_path / "out"), announce=told.append)
    assert len(told) == 1
    assert re.fullmatch(r"1 image; Dask's dashboard: http://\S+" if served else "1 image", told[0])


def test_more_pixels_than_allowed(photos: Path, tmp_path: Path) -> None:
    assert run_batch(
        batch(photos / "one.png", output=tmp_path / "out", limits=Limits(max_pixels=100))
    ) == Counter({FAILED: 1})
    assert "--max-pixels" in str(rows(tmp_path / "out" / "failures.jsonl")[0]["reason"])


def test_an_internal_error_is_reported_and_stops_nothing(tmp_path: Path) -> None:
    for name in ("fault", "full", "good"):
        (tmp_path / f"{name}.png").touch()
    counts = run_batch(batch(tmp_path / "*.png", output=tmp_path / "out"), task=obedient)
    assert counts == Counter({DONE: 1, FAILED: 2})
    reasons = {
        str(row["name"]): str(row["reason"]) for row in rows(tmp_path / "out" / "failures.jsonl")
    }
    assert (
        reasons["fault"]
        == "internal error, please report it: ZeroDivisionError: a fault of two lines"
    )
    assert "memory" in reasons["full"]


def test_a_step_that_checks_the_clock_is_stopped(tmp_path: Path) -> None:
    (tmp_path / "poll.png").touch()
    plan = batch(tmp_path / "poll.png", output=tmp_path / "out", timeout=0.2)
    assert run_batch(plan, task=obedient) == Counter({FAILED: 1})
    assert (
        rows(tmp_path / "out" / "failures.jsonl")[0]["reason"]
        == "exceeded --timeout 0.2 s, in the stage: polling"
    )


@pytest.mark.slow
def test_a_cancelled_run_keeps_complete_results(photos: Path, tmp_path: Path) -> None:
    output = tmp_path / "out"
    asked = Monitor(cancelled=lambda: (output / "one").exists())
    with pytest.raises(Cancelled):
        run_batch(batch(photos, output=output), asked)
    assert "not reached" in (output / "summary.html").read_text()
    assert run_batch(batch(photos, output=output))[SKIPPED] >= 1


def test_names_of_files_are_escaped(tmp_path: Path) -> None:
    folder = tmp_path / "photos"
    folder.mkdir()
    for name in (
        '<img src=x onerror="alert(1)">.png',
        "=cmd.png",
        "-rf.png",
        "..png.png",
        "a\nb.png",
    ):
        (folder / name).write_bytes(b"no photo")
    assert run_batch(batch(folder, output=tmp_path / "out"))[FAILED] == 4, (
        "hidden files are none of ours"
    )
    page = (tmp_path / "out" / "summary.html").read_text()
    assert "<img src=x" not in page
    assert str(escape('<img src=x onerror="alert(1)">')) in page
    assert {path.parent for path in (tmp_path / "out").rglob("*")} <= {
        tmp_path / "out",
        *(tmp_path / "out").rglob("*"),
    }


def test_many_images_have_several_pages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "photos"
    folder.mkdir()
    for number in range(7):
        (folder / f"{number}.png").touch()
    monkeypatch.setattr("isc_core.batch.summary.PAGE", 3)
    assert run_batch(batch(folder, output=tmp_path / "out"), task=obedient) == Counter({DONE: 7})
    pages = ["summary.html", "summary-pages/2.html", "summary-pages/3.html"]
    assert [(tmp_path / "out" / page).read_text().count("<figure>") for page in pages] == [3, 3, 1]
    assert (
        '<a href="../summary.html">1</a>'
        in (tmp_path / "out" / "summary-pages" / "2.html").read_text()
    )
    assert len(rows(tmp_path / "out" / "summary.jsonl")) == 7
    assert PAGE > 100


def test_a_stream_is_worked_off_in_a_window(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The scheduler holds few tasks at a time, however long the manifest is."""
    (tmp_path / "list.csv").write_text(
        "image\n" + "".join(f"{number}.png\n" for number in range(60))
    )
    taken, ended, ahead = itertools.count(), itertools.count(), []

    class CountedJob(ImageJob):
        def __init__(self, *arguments: object) -> None:
            super().__init__(*arguments)
            next(taken)

    class Counted(Journal):
        def add(self, *entries: JournalEntry) -> None:
            super().add(*entries)
            next(ended)
            ahead.append(int(repr(taken)[6:-1]) - int(repr(ended)[6:-1]))

    monkeypatch.setattr(run_module, "ImageJob", CountedJob)
    monkeypatch.setattr(run_module, "Journal", Counted)
    assert run_batch(
        batch(tmp_path / "list.csv", output=tmp_path / "out", worker_options=HERE), task=obedient
    ) == Counter({DONE: 60})
    assert max(ahead) <= 4
