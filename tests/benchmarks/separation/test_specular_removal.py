"""The benchmark of separations: its figures at known answers, and its table on disk."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.separation import scores, specular_removal
from benchmarks.separation.scores import SeparationRow, measure, read_rows, source_code, write_rows
from benchmarks.separation.tables import tables
from isc_core import separation
from isc_core.datasets.highlight_set import SeparationTruth
from isc_core.errors import InputError
from isc_core.scene.decomposition import Separation
from tests.core.ball_scene import ball


def truth() -> SeparationTruth:
    d = ball()
    return SeparationTruth("ball", d.image, d.mask, d.diffuse, d.specular, np.zeros_like(d.mask))


def answer_with(monkeypatch: pytest.MonkeyPatch, share: float) -> None:
    """Make every method remove this share of the true highlights, with full confidence."""

    def separate(
        method: str, image: np.ndarray, mask: np.ndarray, clipped: np.ndarray, *, variant: str
    ) -> Separation:
        specular = np.float32(share) * ball().specular
        confidence = np.where(mask, 1 / (1 + ball().specular.mean(axis=2)), 0).astype(np.float32)
        return Separation(
            np.where(mask[..., None], image - specular, 0), specular, 0 * specular, confidence
        )

    monkeypatch.setattr(separation, "separate", separate)


def test_doing_nothing_is_one() -> None:
    row, split = measure("laboratory", truth(), "none", "improved")
    assert split is not None and row.refused == ""
    assert (row.mse_ratio, row.mse_inside, row.mse_outside) == (1, 1, 1)
    assert row.lmse_specular == pytest.approx(1) and row.change == 0
    assert row.removed == pytest.approx(0.2) and row.area == pytest.approx(0.5) and row.rank == 0


@pytest.mark.parametrize("share", [0.5, 0.9])
def test_what_is_left_counts_squared(monkeypatch: pytest.MonkeyPatch, share: float) -> None:
    answer_with(monkeypatch, share)
    row, _ = measure("laboratory", truth(), "shen_2013", "improved")
    for ratio in (row.mse_ratio, row.mse_inside, row.mse_outside, row.specular_ratio):
        assert ratio == pytest.approx((1 - share) ** 2, rel=1e-4)
    assert (
        row.lmse_specular == pytest.approx(0, abs=1e-9)
        and row.lmse_diffuse is not None
        and row.lmse_diffuse > 0
    )
    assert row.rank == pytest.approx(-1, abs=0.05)
    assert row.removed is not None and row.area is not None and row.removed > 0.9 and row.area < 0.1
    d = ball()
    rms = [np.sqrt(np.mean(layer[d.mask].astype(float) ** 2)) for layer in (d.specular, d.image)]
    assert row.change == pytest.approx(share * rms[0] / rms[1], rel=1e-5)


def test_a_refusal_is_a_row(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: object, **options: object) -> Separation:
        raise InputError("no colour")

    monkeypatch.setattr(separation, "separate", refuse)
    row, split = measure("laboratory", truth(), "shen_2013", "improved")
    assert split is None and row.refused == "no colour" and row.psnr is None
    assert "| shen_2013 | improved | refused |" in tables(
        [row]
    ) and "- shen_2013, ball: no colour" in tables([row])


def test_a_photo_without_highlights_has_no_truth_to_miss() -> None:
    d = truth()
    row, _ = measure(
        "clean", replace(d, image=d.diffuse, specular=0 * d.specular), "shen_2013", "improved"
    )
    assert row.change is not None and row.change > 0 and row.psnr is None
    assert f"| shen_2013 | improved | {100 * row.change:.2f} | {100 * row.change:.2f} |" in tables(
        [row]
    )


def test_the_gain_is_one_less_the_geometric_mean_of_ratios() -> None:
    def row(method: str, image: str, diffuse: float, specular: float) -> SeparationRow:
        return SeparationRow(
            "laboratory",
            image,
            method,
            "improved",
            psnr=30,
            mse_ratio=diffuse,
            specular_ratio=specular,
            lmse_diffuse=1,
            lmse_specular=1,
        )

    rows = [
        row("sparse_coding", "apple", 0.2, 0.5),
        row("sparse_coding", "paper1", 0.9, 0.5),
        row("sparse_coding", "phone", 9, 9),
    ]
    rows += [
        row("tan_2005", "apple", 0.8, 1),
        row("tan_2005", "paper1", 0.9, 1),
        row("tan_2005", "phone", 1, 1),
    ]
    assert (
        "| tan_2005 | improved | 2 (apple, teabag2, paper1, animals, cups) | 50.0 % | 50.0 % | 0.0 "
        "% | 0.0 % |" in tables(rows)
    )
    assert "Sparse Coding against" not in tables(rows[3:])


def test_rows_come_back_from_disk(tmp_path: Path) -> None:
    rows = [
        measure("laboratory", truth(), "none", "improved")[0],
        SeparationRow("clean", "b, c", "tan_2005", "paper", "12ab", refused='says "no"'),
    ]
    write_rows(tmp_path / "rows.csv", rows)
    found = read_rows(tmp_path / "rows.csv")
    assert list(found) == [row.key for row in rows]
    assert found[rows[1].key] == rows[1]
    assert found[rows[0].key].psnr == pytest.approx(rows[0].psnr, rel=1e-5)
    assert tables(list(found.values())) == tables(rows)
    (tmp_path / "rows.csv").write_text("other,columns\n1,2\n")
    assert read_rows(tmp_path / "rows.csv") == {} == read_rows(tmp_path / "nothing.csv")


@pytest.mark.slow
def test_a_run_is_taken_up_where_it_was_left(
    shared: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    measured: list[str] = []

    def counted(
        group: str, photo: SeparationTruth, method: str, variant: str
    ) -> tuple[SeparationRow, Separation | None]:
        measured.append(method)
        return measure(group, photo, method, variant)

    monkeypatch.setattr(specular_removal, "measure", counted)
    command = [
        "it",
        "--data",
        str(shared / "data"),
        "-o",
        str(tmp_path),
        "--images",
        "animals",
        "--variants",
        "improved",
    ]
    for methods, expected in (
        ("none", ["none"]),
        ("shen_2013", ["shen_2013"]),
        ("none,shen_2013", []),
    ):
        measured.clear()
        monkeypatch.setattr(sys, "argv", [*command, "--methods", methods])
        specular_removal.main()
        assert measured == expected
    assert (tmp_path / "sheets" / "shen_zheng-animals.png").is_file()
    assert "| none | improved | 30.57 / 0.979 / 0.948 |" in (tmp_path / "tables.md").read_text()
    monkeypatch.setattr(
        specular_removal,
        "source_code",
        lambda method: "changed" if method == "shen_2013" else source_code(method),
    )
    specular_removal.main()
    assert measured == ["shen_2013"]
    capsys.readouterr()


def test_the_source_of_every_method_has_its_mark() -> None:
    marks = [scores.source_code(method) for method in separation.METHODS]
    assert len(set(marks)) == len(marks) and all(len(mark) == 8 for mark in marks)


@pytest.mark.parametrize("file", ["thresholding/otsu.py", "networks/data/weights.npz"])
def test_a_change_of_what_methods_use_changes_the_mark(tmp_path: Path, file: str) -> None:
    (tmp_path / file).parent.mkdir(parents=True)
    (tmp_path / file).write_text("before")
    before = scores._shared_code(tmp_path)
    (tmp_path / file).write_text("after")
    scores._shared_code.cache_clear()
    assert scores._shared_code(tmp_path) != before
