"""The short part of benchmarks.faults: after any failure there is a whole output or what was there
before, and one line says why.
"""

import hashlib
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from benchmarks.faults import __main__ as faults
from benchmarks.faults.commands import COMMANDS, Command, leftovers, one_line, prepared, run, state
from benchmarks.faults.disk import broken_steps, read_only, reference, short_files, small_disks
from benchmarks.faults.listing import many_images
from benchmarks.faults.processes import at_once, changing, kill, wrong_clock
from isc_core.errors import InputError
from isc_core.exr import write_channels
from isc_core.photo import read_photo
from isc_core.pipeline import Settings, decompose

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="disks are made to fail as Linux has it"
)
DECOMPOSE, SEPARATE, _, MASK, _ = COMMANDS


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return prepared(tmp_path_factory.mktemp("inputs"))


@pytest.fixture
def place(tmp_path: Path) -> Path:
    return tmp_path / "place"


@pytest.mark.parametrize(
    ("command", "each"),
    [(MASK, 1), (SEPARATE, 5), (DECOMPOSE, 16)],
    ids=lambda value: getattr(value, "name", ""),
)
@pytest.mark.parametrize("earlier", [False, True], ids=["nothing there", "earlier output"])
def test_every_step_that_writes_may_fail(
    inputs: Path, place: Path, command: Command, each: int, earlier: bool
) -> None:
    whole = reference(command, inputs, place)
    found = broken_steps(command, inputs, place, whole, earlier, each)
    assert len(found) > 2 and not any(found), found


def test_the_breaker_breaks(inputs: Path, place: Path) -> None:
    """What is called whole after nothing failed is called wrong where something did."""
    whole = reference(MASK, inputs, place)
    assert state(MASK, place / MASK.output, whole) == "whole"
    (place / MASK.output).write_bytes(b"half")
    assert state(MASK, place / MASK.output, whole).startswith("WRONG")
    assert (
        leftovers(place) == []
        and one_line(1, "Traceback").startswith("WRONG")
        and not one_line(2, "isc: error: why\n")
    )


def test_files_that_may_not_grow(inputs: Path, place: Path) -> None:
    whole = reference(MASK, inputs, place)
    found = short_files(MASK, inputs, place, whole)
    assert len(found) > 10 and not any(found), found


@pytest.mark.parametrize("fault", [small_disks, read_only])
def test_disks_that_take_nothing(
    inputs: Path, place: Path, fault: Callable[..., list[str] | None]
) -> None:
    found = fault(MASK, inputs, place, reference(MASK, inputs, place))
    if found is None:
        pytest.skip("mounting needs rights that this user does not have")
    assert found and not any(found), found


@pytest.mark.parametrize("seed", [0, 1])
def test_a_kill(inputs: Path, place: Path, seed: int) -> None:
    assert kill(SEPARATE, inputs, place, reference(SEPARATE, inputs, place), seed) == ""


@pytest.mark.parametrize("number", [0, 1])
def test_two_at_once(inputs: Path, place: Path, number: int) -> None:
    assert at_once(MASK, inputs, place, reference(MASK, inputs, place), number) == ""


def test_a_clock_that_goes_back(inputs: Path, place: Path) -> None:
    assert wrong_clock(DECOMPOSE, inputs, place, reference(DECOMPOSE, inputs, place), 2) == ""


@pytest.mark.parametrize("kind", ["png", "exr", "npy"])
def test_a_photo_that_changes_all_the_while(inputs: Path, place: Path, kind: str) -> None:
    read, refused, wrong = changing(inputs, place, kind, 0.7)
    assert read + refused > 0 and not wrong, wrong


@pytest.mark.parametrize("kind", ["png", "exr", "npy"])
def test_the_sum_is_of_the_bytes_that_were_used(
    inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    """The file is exchanged as soon as it was read: nothing may look at it again."""
    images = [read_photo(inputs / f"{name}.png").image for name in ("photo", "other")]
    paths = [tmp_path / f"{name}.{kind}" for name in ("photo", "other")]
    for path, image in zip(paths, images, strict=True):
        if kind == "exr":
            write_channels(path, {c: image[..., k] for k, c in enumerate("RGB")})
        elif kind == "npy":
            np.save(path, image)
        else:
            path.write_bytes((inputs / path.name).read_bytes())
    first, second = (path.read_bytes() for path in paths)
    real = Path.read_bytes

    def exchanged(path: Path) -> bytes:
        data = real(path)
        if path == paths[0]:
            path.write_bytes(second)
        return data

    monkeypatch.setattr(Path, "read_bytes", exchanged)
    photo = read_photo(paths[0])
    assert (
        photo.original.sha256
        == hashlib.sha256(first).hexdigest()
        != hashlib.sha256(second).hexdigest()
    )
    assert np.allclose(photo.image, images[0], atol=1e-6) and not np.allclose(
        photo.image, images[1], atol=1e-2
    )


def test_an_edit_of_a_photo_that_changes_is_refused(
    inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is read twice: as light, and as the values of its file."""
    photo = tmp_path / "photo.png"
    photo.write_bytes((inputs / "photo.png").read_bytes())
    real, other = read_photo, (inputs / "other.png").read_bytes()

    def exchanged(*words: object, **options: object) -> object:
        found = real(*words, **options)
        photo.write_bytes(other)
        return found

    monkeypatch.setattr("isc_core.commands.edit.read_photo", exchanged)
    given = [
        "--photo",
        str(photo),
        "--mask",
        str(inputs / "mask.png"),
        "--quiet",
        "-o",
        str(tmp_path / "out"),
    ]
    code, _, text = run(["edit", str(inputs / "result"), "relight", *given])
    assert (
        not one_line(code, text)
        and "changed while it was read" in text
        and not (tmp_path / "out").exists()
    )


def test_a_black_photo_cannot_be_decomposed(inputs: Path) -> None:
    photo = read_photo(inputs / "photo.png")
    black = type(photo)(0 * photo.image, photo.mask, 0.0, photo.clipped, photo.original)
    for model in ("naive", "sirfs"):
        with pytest.raises(InputError, match="black inside the mask"):
            decompose(black, Settings(model))


def test_a_few_bright_pixels_have_a_step(tmp_path: Path) -> None:
    """Fewer than a thousandth of the object's: the 99.9th percentile is black, and its logarithm
    has no floor.
    """
    image = np.zeros((60, 60, 3), np.float32)
    image[30, 30] = [0.5, 0.25, 0.125]
    np.save(tmp_path / "spark.npy", np.concatenate([image, np.ones((60, 60, 1), np.float32)], -1))
    np.save(tmp_path / "mask.npy", np.ones((60, 60), bool))
    assert read_photo(tmp_path / "spark.npy", tmp_path / "mask.npy").code_value > 0


def test_many_images_of_one_folder(place: Path) -> None:
    pytest.importorskip("distributed")
    wrong, _ = many_images(place, 300)
    assert not any(wrong), wrong


def test_a_campaign_goes_on_where_it_was_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    done = tmp_path / "rows.jsonl"
    row = '{"key": "kill -9 | mask | 3", "runs": 1, "wrong": ["WRONG: half"], "note": ""}'
    done.write_text(f"{row}\n{row[:20]}")
    monkeypatch.setattr(sys, "argv", ["faults", "-o", str(tmp_path), "--only", "10,000"])
    pytest.importorskip("distributed")
    monkeypatch.setattr(
        faults, "many_images", lambda place, count: many_images(place, count // 100)
    )
    assert faults.main() == 1, "what was wrong before is still told"
    text = capsys.readouterr().out
    assert (
        "| kill -9 | mask | 1 | 1 |" in text
        and "| 10,000 images in one folder | batch | 1 | 0 |" in text
        and "WRONG: half" in text
    )
