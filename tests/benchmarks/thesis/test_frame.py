"""`isc thesis`: what is written, kept, resumed, refused and cancelled, whatever the items hold."""

import csv
import json
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

pytest.importorskip("matplotlib")

from benchmarks.thesis.drawing.style import figure
from benchmarks.thesis.making import item_states, make_items
from benchmarks.thesis.measuring.context import WORK, Context
from benchmarks.thesis.registry import all_items, find_item
from benchmarks.thesis.report.claims import ABSTRACT, MDR_HEIGHT
from benchmarks.thesis.report.files import publish, write_item
from benchmarks.thesis.report.item import ClaimVerdict, Holds, ItemContent, ItemTable, ThesisItem
from benchmarks.thesis.report.pages import index_page
from benchmarks.thesis.report.records import is_complete, read_record
from isc_core.cli.main import main as isc
from isc_core.errors import Cancelled, InputError
from isc_core.progress import Monitor, ProgressEvent
from tests.core.command_line import ROOT, isc_command, run_isc

TABLE = ItemTable(
    ("image", "K", "error | x"), (("apple", 3, 1 / 3), ("pear", 4, 1e-7)), "Two rows."
)
VERDICT = ClaimVerdict(MDR_HEIGHT, "3.1 % on two images.", Holds.PARTLY, "Few images.")


def drawn(pictures: int = 1) -> ItemContent:
    figures = []
    for _ in range(pictures):
        made, axes = figure(1, 1, width=2.0, height=1.5)
        axes[0, 0].plot([0, 1], [0, 1])
        axes[0, 0].set_title("a title set by hand", fontsize=40)
        figures.append(made)
    return ItemContent((TABLE,), tuple(figures), "What one sees.", (VERDICT,))


def item(number: str = "9.1", make: object = lambda context: drawn()) -> ThesisItem:
    return ThesisItem("table", number, "A table", make)


def test_an_item_leaves_a_page_numbers_a_picture_and_a_record(tmp_path: Path) -> None:
    context = Context(tmp_path / "out", data=tmp_path, quick=True, seed=5)
    record = write_item(item(), drawn(2), context, 1.25)
    assert record.files == ("table-9.1.md", "table-9.1.csv", "table-9.1.png", "table-9.1-2.png")
    assert read_record(context.output, "table-9.1") == record and is_complete(
        context.output, "table-9.1", context.fingerprint
    )
    with (context.output / "table-9.1.csv").open(encoding="utf-8") as stream:
        assert list(csv.reader(stream)) == [
            list(TABLE.header),
            ["apple", "3", repr(1 / 3)],
            ["pear", "4", "1e-07"],
        ]
    assert cv2.imread(str(context.output / "table-9.1-2.png")).shape == (165, 220, 3)
    page = (context.output / "table-9.1.md").read_text(encoding="utf-8")
    for part in (
        "# Table 9.1: A table",
        MDR_HEIGHT,
        "3.1 % on two images.",
        "Holds: partly.",
        "(table-9.1-2.png)",
        "| apple | 3 | 0.3333 |",
    ):
        assert part in page
    assert (
        "`isc thesis table 9.1 --data ROOT --quick --seed 5`" in page
        and "error \\| x" in page.replace("error | x", "error \\| x")
    )
    assert str(tmp_path) not in page + (context.output / "records" / "table-9.1.json").read_text(
        encoding="utf-8"
    )
    assert {path.suffix for path in context.output.iterdir() if path.is_file()} == {
        ".md",
        ".csv",
        ".png",
    }


def test_a_table_without_a_figure_gets_a_picture_of_itself(tmp_path: Path) -> None:
    context = Context(tmp_path)
    record = write_item(item(), ItemContent((TABLE, TABLE)), context, 1.0)
    assert record.files == ("table-9.1.md", "table-9.1.csv", "table-9.1-2.csv", "table-9.1.png")
    picture = cv2.imread(str(tmp_path / "table-9.1.png"))
    assert picture.shape[1] >= 440 and 0.5 < (picture > 200).mean() < 1, "a page with letters on it"
    page = (tmp_path / "table-9.1.md").read_text(encoding="utf-8")
    assert (
        "![" not in page
        and "(table-9.1.png)" in page
        and "The thesis' abstract makes no claim about this." in page
    )


def test_files_of_an_earlier_run_do_not_stay_beside_the_new_ones(tmp_path: Path) -> None:
    context = Context(tmp_path)
    write_item(item(), drawn(2), context, 1.0)
    write_item(item(), drawn(1), context, 1.0)
    assert not (tmp_path / "table-9.1-2.png").exists() and (tmp_path / "table-9.1.png").is_file()


def test_cells_fit_their_header() -> None:
    with pytest.raises(ValueError, match="cells"):
        ItemTable(("a", "b"), ((1,),))


def test_rows_are_computed_once_and_only_for_the_same_run(tmp_path: Path) -> None:
    calls: list[int] = []

    def compute() -> list[dict[str, object]]:
        calls.append(len(calls))
        return [{"call": len(calls), "value": 0.1, "none": None}, {"call": len(calls), "text": "ü"}]

    context = Context(tmp_path)
    first = context.rows("key", compute)
    assert first[0] == {"call": 1, "value": 0.1, "none": None} and context.rows(
        "key", compute
    ) == first == Context(tmp_path).rows("key", compute)
    assert len(calls) == 1
    for other in (
        replace(context, seed=1),
        replace(context, quick=True),
        replace(context, fresh_since=4e9),
    ):
        other.rows("key", compute)
    context.rows("another key", compute)
    assert len(calls) == 5
    next((tmp_path / WORK / "rows").glob("another-key-*")).write_text(
        '{"call": 1', encoding="utf-8"
    )
    context.rows("another key", compute)
    assert len(calls) == 6, "a damaged file has to be computed anew"


def test_rows_are_not_begun_after_cancellation(tmp_path: Path) -> None:
    context = Context(tmp_path, monitor=Monitor(cancelled=lambda: True))
    with pytest.raises(Cancelled):
        context.rows("key", lambda: pytest.fail("it computed"))
    assert not list(tmp_path.rglob("*.jsonl"))


@pytest.mark.slow
def test_a_failing_item_does_not_stop_the_others_and_is_named(tmp_path: Path) -> None:
    def fails(context: Context) -> ItemContent:
        raise InputError("no data for this one")

    wanted = [item("9.1"), item("9.2", fails), item("9.3")]
    outcome = make_items(wanted, Context(tmp_path))
    assert (outcome.made, outcome.kept, outcome.failed) == (
        2,
        0,
        (("table 9.2", "no data for this one"),),
    )
    again = make_items(wanted, Context(tmp_path))
    assert (again.made, again.kept) == (0, 2), "what is complete must not be made again"
    assert make_items(wanted, Context(tmp_path), again=True).made == 2
    assert make_items(wanted, Context(tmp_path, seed=1)).made == 2, "another seed is another result"
    with pytest.raises(InputError, match="no data for this one"):
        make_items([item("9.2", fails)], Context(tmp_path))


@pytest.mark.slow
def test_a_cancelled_run_keeps_complete_items_and_continues(tmp_path: Path) -> None:
    made: list[str] = []
    stop = {"after": 2}

    def makes(number: str) -> ThesisItem:
        def make(context: Context) -> ItemContent:
            made.append(number)
            context.monitor.report("half of it", 0.5)
            return drawn()

        return item(number, make)

    wanted = [makes(number) for number in ("9.1", "9.2", "9.3")]
    with pytest.raises(Cancelled):
        make_items(
            wanted, Context(tmp_path, monitor=Monitor(cancelled=lambda: len(made) >= stop["after"]))
        )
    assert sorted(path.name for path in tmp_path.glob("table*")) == [
        "table-9.1.csv",
        "table-9.1.md",
        "table-9.1.png",
    ]
    assert not list(tmp_path.rglob("*.partial"))
    made.clear()
    outcome = make_items(wanted, Context(tmp_path))
    assert made == ["9.2", "9.3"] and (outcome.made, outcome.kept) == (2, 1)


def test_progress_names_the_item_and_only_grows(tmp_path: Path) -> None:
    heard: list[ProgressEvent] = []

    def make(context: Context) -> ItemContent:
        for step in range(4):
            context.monitor.report("step", step / 4)
        return drawn()

    make_items(
        [item("9.1", make), item("9.2", make)],
        Context(tmp_path, monitor=Monitor(heard.append)),
    )
    shares = [event.fraction for event in heard]
    assert shares == sorted(shares) and shares[0] >= 0 and shares[-1] <= 1
    assert heard[0].stage == "table 9.1 (1 of 2)" and re.fullmatch(
        r"table 9\.2 \(2 of 2\): step, \d+ s left", str(heard[-1])
    )


def test_the_index_has_every_claim_and_every_item(tmp_path: Path) -> None:
    record = write_item(item(), drawn(), Context(tmp_path), 1.0)
    illustration = ThesisItem("figure", "9.9", "An illustration", None, "nothing is computed in it")
    text = index_page([item(), item("9.2"), illustration], {"table-9.1": record})
    assert all(claim in text for claim in ABSTRACT)
    assert f"| {MDR_HEIGHT} | 3.1 % on two images. | partly | [table 9.1](table-9.1.md) |" in text
    assert (
        "[9.1](table-9.1.md)" in text
        and "9.2 | A table | not made yet" in text
        and "not regenerable: nothing is computed in it" in text
    )
    assert "glossy-mit" in text and "1 of 3 items are available, 1 of them without `--data`" in text
    other = write_item(item("9.2"), drawn(), Context(tmp_path, tmp_path, quick=True, seed=3), 1.0)
    text = index_page([item(), item("9.2")], {"table-9.1": record, "table-9.2": other})
    assert "1 of them without `--data`" in text and "1 of them by a quick run" in text
    assert "they come from 2 runs" in text


def test_a_damaged_record_counts_as_none(tmp_path: Path) -> None:
    write_item(item(), drawn(), Context(tmp_path), 1.0)
    path = tmp_path / "records" / "table-9.1.json"
    for content in (
        "{",
        "[]",
        json.dumps({"schema_version": 2}),
        json.dumps({"schema_version": 99}),
    ):
        path.write_text(content, encoding="utf-8")
        assert read_record(tmp_path, "table-9.1") is None
    assert "not made" in next(iter(item_states([item()], tmp_path)))


def test_all_numbers_of_the_thesis_are_listed() -> None:
    tables = {*(f"2.{n}" for n in range(1, 4)), *(f"4.{n}" for n in range(1, 23))}
    figures = {
        f"{chapter}.{n}"
        for chapter, last in ((1, 5), (2, 5), (3, 12), (4, 51))
        for n in range(1, last + 1)
    }
    assert {one.number for one in all_items() if one.kind == "table"} == tables
    assert {one.number for one in all_items() if one.kind == "figure"} == figures
    assert {one.name for one in all_items() if one.make is None} == {"figure-1.1", "figure-3.1"}
    assert all(one.reason for one in all_items() if one.make is None)


@pytest.mark.parametrize(
    ("number", "nearest"), [("4.23", "4.22, 4.21, 4.20"), ("3.1", "2.1, 4.1"), ("cat", "")]
)
def test_an_unknown_number_names_the_nearest(number: str, nearest: str) -> None:
    with pytest.raises(
        InputError, match=f"there is no table '{number}'; the nearest are {re.escape(nearest)}"
    ):
        find_item("table", number)


Refusal = Callable[..., str]


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str]) -> Refusal:
    """Runs `isc thesis`, which has to refuse, and gives its complaint."""

    def run(*arguments: object) -> str:
        code = isc(["thesis", *map(str, arguments)])
        said = capsys.readouterr()
        assert code == 2 and said.out == ""
        return said.err

    return run


def test_mistakes_are_one_line_and_write_nothing(tmp_path: Path, refused: Refusal) -> None:
    output = tmp_path / "out"
    (tmp_path / "empty").mkdir()
    assert "the nearest are" in refused("table", "4.99", "-o", output)
    assert "holds no known data set" in refused(
        "figure", "3.5", "--data", tmp_path / "empty", "-o", output
    )
    assert "is not a folder" in refused(
        "figure", "3.5", "--data", tmp_path / "absent", "-o", output
    )
    assert "cannot be regenerated" in refused("figure", "1.1", "-o", output)
    assert "choose a subcommand" in refused()
    assert not output.exists()


def test_missing_libraries_are_named_with_the_remedy(
    tmp_path: Path, refused: Refusal, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    assert "pip install 'mitsuba>=" in refused("figure", "1.4", "--quick", "-o", tmp_path / "out")
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert "needs matplotlib: install with `pip install 'matplotlib>=" in refused("list")


@pytest.mark.slow
def test_the_other_commands_need_no_matplotlib() -> None:
    done = run_isc(
        "separate",
        "--help",
        before="import sys; sys.modules.update(matplotlib=None, skimage=None, mitsuba=None)",
    )
    assert done.returncode == 0


@pytest.mark.slow
def test_an_interrupt_exits_with_130_and_the_same_command_continues(tmp_path: Path) -> None:
    arguments = ("thesis", "table", "4.2", "--quick", "-o", tmp_path / "out")
    process = subprocess.Popen(
        isc_command(*arguments), cwd=ROOT, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stderr is not None
    for line in process.stderr:
        if "ClonalG on camera, 3" in line:
            process.send_signal(signal.SIGINT)
    assert process.wait(120) == 130
    kept = list((tmp_path / "out").rglob("*.jsonl"))
    assert (
        kept
        and not list((tmp_path / "out").glob("table-*"))
        and not list(tmp_path.rglob("*.partial"))
    )


def test_published_are_the_index_the_tables_pages_and_a_sheet_per_chapter(tmp_path: Path) -> None:
    source, target = Context(tmp_path / "out"), tmp_path / "docs"
    items_made = (item(), ThesisItem("figure", "8.1", "A figure", lambda context: drawn()))
    for one in items_made:
        write_item(one, drawn(), source, 1.0)
    publish(source.output, target, items_made)
    assert {path.name for path in target.iterdir()} == {
        "README.md",
        "table-9.1.md",
        "chapter-8.jpg",
    }
    for page in target.glob("*.md"):
        text = page.read_text(encoding="utf-8")
        links = re.findall(r"\]\(([^)#]+)", text)
        assert all((target / link).exists() for link in links), f"{page.name}: {links}"
    sheet = cv2.imread(str(target / "chapter-8.jpg"))
    assert sheet.shape[1] > 300 and np.ptp(sheet) > 240  # JPEG rounds white and black
    with pytest.raises(InputError, match="has no items"):
        publish(tmp_path / "empty", target, items_made)


def test_an_item_without_its_files_is_neither_listed_as_made_nor_published(tmp_path: Path) -> None:
    source, target = Context(tmp_path / "out"), tmp_path / "docs"
    items_made = (item(), ThesisItem("figure", "8.1", "A figure", lambda context: drawn()))
    for one in items_made:
        write_item(one, drawn(), source, 1.0)
    with pytest.raises(InputError, match="publish to another folder"):
        publish(source.output, tmp_path / "docs" / ".." / "out", items_made)
    (source.output / "figure-8.1.png").unlink()
    assert "figure 8.1   not made" in list(item_states(items_made, source.output))[-1]
    publish(source.output, target, items_made)
    index = (target / "README.md").read_text(encoding="utf-8")
    assert "chapter-8.jpg" not in index and "1 of 2 items are available" in index
    (source.output / "table-9.1.md").unlink()
    with pytest.raises(InputError, match="has no items"):
        publish(source.output, target, items_made)


def test_a_run_in_which_all_is_complete_writes_the_index_anew(tmp_path: Path) -> None:
    make_items([item()], Context(tmp_path))
    (tmp_path / "README.md").unlink()
    assert make_items([item()], Context(tmp_path)).kept == 1
    assert (tmp_path / "README.md").is_file()


def test_a_run_with_failed_items_ends_with_1_and_names_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fails(context: Context) -> ItemContent:
        raise InputError("too few images")

    items_made = (item("9.1"), item("9.2", fails))
    monkeypatch.setattr("benchmarks.thesis.registry.all_items", lambda: items_made)
    monkeypatch.setattr("benchmarks.thesis.making.all_items", lambda: items_made)
    assert isc(["thesis", "all", "-q", "-o", str(tmp_path)]) == 1
    assert "table 9.2 was not made: too few images" in capsys.readouterr().err
    assert (tmp_path / "table-9.1.md").is_file()
