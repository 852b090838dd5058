"""`isc validate` on small rendered scenes: its output, acceptance and rejection, and bad input."""

import json
import shlex
import shutil
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from isc_core.cli.main import main
from isc_core.errors import Cancelled
from isc_core.evaluation.metrics import Scores
from isc_core.io.exr import read_channels
from isc_core.progress import Monitor
from synth.dataset import reading
from synth.dataset.reading import SceneFacts
from synth.validation.checks import render_checks
from synth.validation.checks.render_checks import (
    RenderCheck,
    check_shading,
    needs_files,
    read_recipe,
)
from synth.validation.measurement.bounds import Bound, Verdict, read_bounds, write_bounds
from synth.validation.measurement.figures import CHAIN, all_figures
from synth.validation.measurement.measure import SceneResult, StageResult, ValidationOptions
from synth.validation.measurement.substitution import COMBINATIONS, ChainScores
from synth.validation.reporting import html as html_module
from synth.validation.reporting.cases import ValidationCase
from synth.validation.reporting.folder import FILES, write_report
from synth.validation.reporting.outcome import ValidationOutcome, all_budgets, to_json
from synth.validation.stages.registry import find_stages
from synth.validation.stages.types import StagePicture

pytest.importorskip("mitsuba", reason="rendered scenes need Mitsuba")

pytestmark = pytest.mark.slow  # they share a run

SCENES = 5
VOID = {"meta", "img", "rect", "line", "br"}
SEPARATION_ALONE = ("--stages", "separation", "--bounds", "none", "--renders", "0")


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("validate") / "scenes"
    chosen = [
        "--shapes",
        "superquadric",
        "--materials",
        "blinn_phong",
        "--albedos",
        "uniform,patches",
        "--lights",
        "directional,area",
    ]
    assert (
        main(
            [
                "synth",
                "-o",
                str(folder),
                "--count",
                str(SCENES),
                "--size",
                "24",
                "--samples",
                "8",
                *chosen,
                "--quiet",
            ]
        )
        == 0
    )
    return folder


def validate(dataset: Path, out: Path, *more: str) -> int:
    return main(["validate", str(dataset), "-o", str(out), "--quiet", *more])


class Page(HTMLParser):
    """A page whose tags are all closed; its links and its text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.links: list[str] = []
        self.words = ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.links += [
            value or "" for name, value in attrs if name in ("src", "href", "xlink:href", "data")
        ]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words += data


def test_a_whole_report(dataset: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "report"
    assert validate(dataset, out, "--scenes", "1", "--bounds", "none", "--renders", "1") == 0
    assert capsys.readouterr().out == ""
    assert sorted(path.name for path in out.iterdir()) == sorted(FILES)
    text = (out / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    assert (
        "http://" not in text
        and "https://" not in text
        and "url(" not in text
        and "script" not in page.tags
        and "link" not in page.tags
    )
    assert (
        all(link.startswith("data:image/png;base64,") for link in page.links)
        and len(page.links) >= 12
    )
    assert (
        "svg" in page.tags
        and "Error budget" in page.words
        and "The largest error source of the chain" in page.words
    )
    content = json.loads((out / "report.json").read_text(encoding="utf-8"))
    assert content["accepted"] and len(content["scenes"]) == 1 and len(content["budget"]) == 8
    for scene in content["scenes"]:
        assert set(scene["chain"]["swapped"]) == {
            "nothing",
            "diffuse",
            "shape",
            "light",
            "diffuse+shape",
            "diffuse+light",
            "shape+light",
            "diffuse+shape+light",
        }
    for found in content["budget"]:
        total = (
            sum(share["share"]["value"] for share in found["shares"].values())
            + found["rest"]["value"]
        )
        assert total == pytest.approx(1)
    assert [check["passed"] for check in content["checks"]] == [
        True
    ] * 3  # two identities, one render
    summary = (out / "summary.md").read_text(encoding="utf-8")
    assert "## Error budget" in summary and len(summary) < 8000


def test_bounds_that_are_kept_and_bounds_that_break(
    dataset: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, bounds = tmp_path / "report", tmp_path / "bounds.json"
    stage = ("--stages", "separation", "--renders", "0", "--separator", "shen_2013")
    assert validate(dataset, out, *stage, "--bounds", "none", "--update-bounds", str(bounds)) == 0
    assert validate(dataset, out, *stage, "--bounds", str(bounds)) == 0
    assert not (out / "evidence").exists()

    strict = [Bound("separation", "psnr_diffuse", "all", "all", 200.0), *read_bounds(bounds)]
    write_bounds(bounds, strict)
    capsys.readouterr()
    assert validate(dataset, out, *stage, "--bounds", str(bounds)) == 1
    told = capsys.readouterr().err
    assert "psnr_diffuse" in told and "200" in told and told.count("rejected") == 2
    content = json.loads((out / "report.json").read_text(encoding="utf-8"))
    assert not content["accepted"] and len(content["evidence"]) == 4
    for name in content["evidence"]:
        assert "diffuse.R" in read_channels(out / name)
    assert "Rejected" in Page((out / "report.html").read_text(encoding="utf-8")).words

    assert (
        validate(dataset, out, *stage, "--bounds", "none") == 0
    )  # replaces the report with its evidence
    assert sorted(path.name for path in out.iterdir()) == sorted(FILES)


def test_two_runs_measure_the_same_and_any_number_of_threads(dataset: Path, tmp_path: Path) -> None:
    found = []
    for name, threads in (("one", "1"), ("two", "2")):
        assert validate(dataset, tmp_path / name, *SEPARATION_ALONE, "--threads", threads) == 0
        content = json.loads((tmp_path / name / "report.json").read_text(encoding="utf-8"))
        found.append(
            (
                content["figures"],
                [scene["stages"]["separation"]["scores"] for scene in content["scenes"]],
            )
        )
    assert found[0] == found[1]


def test_a_split_and_a_drawn_sample(dataset: Path, tmp_path: Path) -> None:
    content = {}
    for name, more in (
        ("split", ("--split", "train")),
        ("drawn", ("--scenes", "3", "--seed", "4")),
    ):
        assert validate(dataset, tmp_path / name, *SEPARATION_ALONE, *more) == 0
        content[name] = json.loads((tmp_path / name / "report.json").read_text(encoding="utf-8"))
    assert {scene["facts"]["split"] for scene in content["split"]["scenes"]} == {"train"}
    assert len(content["drawn"]["scenes"]) == 3
    words = shlex.split(content["drawn"]["command"])
    assert words[0] == "isc" and main([*words[1:], "--quiet"]) == 0, "the command repeats the run"
    again = json.loads((tmp_path / "drawn" / "report.json").read_text(encoding="utf-8"))
    for name in ("figures", "checks", "command"):
        assert again[name] == content["drawn"][name]


def test_bad_input_is_refused_and_nothing_is_written(
    dataset: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("precious", encoding="utf-8")
    (tmp_path / "empty").mkdir()
    (tmp_path / "bad.json").write_text("{", encoding="utf-8")
    out = tmp_path / "out"
    wrong = [
        (tmp_path / "none such", out, ()),
        (tmp_path / "empty", out, ()),
        (dataset, tmp_path / "mine", ()),
        (dataset, dataset, ()),
        (dataset, out, ("--stages", "brdf")),
        (dataset, out, ("--split", "none such")),
        (dataset, out, ("--bounds", str(tmp_path / "none such.json"))),
        (dataset, out, ("--bounds", str(tmp_path / "bad.json"))),
        (dataset, out, ("--separator", "magic")),
        (dataset, out, ("--scenes", "-3")),
    ]
    for root, place, more in wrong:
        assert validate(root, place, *more) == 2, (root, place, more)
        told = capsys.readouterr().err
        assert told.startswith("isc: error: ") and told.count("\n") == 1
    assert not out.exists() and (dataset / "manifest.json").is_file()
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["thesis.txt"]


def test_a_damaged_scene_is_refused(
    dataset: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(dataset, copy)
    maps = next(copy.glob("*/*/maps.exr"))
    maps.write_bytes(maps.read_bytes()[:-100])
    assert validate(copy, tmp_path / "out", "--stages", "separation") == 2
    assert "maps.exr" in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_a_shading_that_is_wrong_by_a_few_per_cent_is_rejected_with_its_maps(
    dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = sorted(dataset.glob("*/*/scene.json"))[0].parent
    assert not needs_files(folder) and read_recipe(folder).name == folder.name
    assert check_shading(folder, 0.01).passed
    right = reading.read_truth

    def wrong(place: Path):
        truth = right(place)
        truth.shading[:, : truth.shading.shape[1] // 2] *= 1.1
        return truth

    monkeypatch.setattr(render_checks, "read_truth", wrong)
    found = check_shading(folder, 0.01)
    assert not found.passed and {"difference.R", "variance.G", "again.B"} <= set(found.maps)


def test_a_scene_with_interreflections_agrees_with_its_new_render(tmp_path: Path) -> None:
    """A white object would light its hollows more."""
    arguments = ["--count", "1", "--size", "24", "--samples", "32", "--bounces", "1"]
    chosen = ["--shapes", "height_field", "--materials", "lambert", "--lights", "sh"]
    assert main(["synth", "-o", str(tmp_path / "s"), *arguments, *chosen, "--quiet"]) == 0
    found = check_shading(next((tmp_path / "s").glob("*/*/scene.json")).parent, 0.01)
    assert found.passed, found.text


def test_text_from_outside_cannot_become_markup() -> None:
    evil = '<script>alert("x")</script>&'
    rng = np.random.default_rng(2)
    facts = SceneFacts(
        evil, evil, evil, evil, evil, evil, evil, evil, evil, 0.1, 500, 0, Path(evil)
    )

    def scores() -> Scores:
        return Scores(*rng.uniform(0.1, 1, 6))

    def scene(name: str) -> SceneResult:
        chain = ChainScores(tuple(scores() for _ in COMBINATIONS), scores(), scores(), 0.1)
        return SceneResult(
            replace(facts, albedo=name), (StageResult("sirfs", scores(), 1.0),), chain
        )

    scenes = tuple(scene(name) for name in (evil, "b", evil, "b"))
    options = ValidationOptions(stages=find_stages(("sirfs",)))
    figures, budgets = all_figures(options.stages, scenes, 0), all_budgets(scenes, 0)
    verdicts = (Verdict(Bound("sirfs", evil, evil, evil, 1.0), figures[0].interval, True),)
    outcome = ValidationOutcome(
        evil,
        evil,
        options,
        scenes,
        figures,
        budgets,
        (RenderCheck(evil, evil, 2.0, 1.0),),
        verdicts,
        (evil,),
    )
    text = html_module.page(
        outcome,
        [ValidationCase(CHAIN, "worst", evil, evil, (StagePicture(evil, np.zeros((4, 4, 3))),))],
        [evil],
    )
    page = Page(text)
    assert (
        "<script" not in text
        and text.count("&lt;script&gt;") > 10
        and page.words.count("<script>") > 10
    )
    assert (
        page.tags.count("rect") == 19 + 8
        and "Rejected: 1 of 1 bounds violated, 1 of 1 data checks failed." in page.words
    )
    assert (
        json.loads(json.dumps(to_json(outcome, [evil]), allow_nan=False))["scenes"][0]["facts"][
            "name"
        ]
        == evil
    )


def test_a_cancelled_report_leaves_nothing(tmp_path: Path) -> None:
    outcome = ValidationOutcome("d", "c", ValidationOptions(), (), (), (), (), ())
    with pytest.raises(Cancelled):
        write_report(outcome, tmp_path / "out", Monitor(cancelled=lambda: True))
    assert list(tmp_path.iterdir()) == []


def test_help_names_every_option(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["validate", "--help"]) == 0
    told = capsys.readouterr().out
    for option in (
        "--split",
        "--scenes",
        "--stages",
        "--separator",
        "--illumination",
        "--seed",
        "--bounds",
        "--update-bounds",
        "--threads",
    ):
        assert option in told
