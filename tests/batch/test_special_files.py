"""Loops of links, broken links, pipes and closed folders among the photos: each is one failure, and
the others are done.
"""

import json
import os
from collections import Counter
from pathlib import Path

import pytest

from isc_core.batch.item import DONE, FAILED
from isc_core.batch.run_batch import run_batch
from isc_core.cli.main import main
from isc_core.errors import InputError
from tests.batch.conftest import batch, rows

REASONS = {
    "loop": "loop.png: cannot be read: Too many levels of symbolic links",
    "dangling": "dangling.png: there is no such file",
    "pipe": "pipe.png is not a regular file: use an image file",
}


@pytest.fixture
def mixed(photos: Path) -> Path:
    """A folder of one good photo and three that cannot be read."""
    for name in ("two", "three", "bad"):
        (photos / f"{name}.png").unlink()
    (photos / "loop.png").symlink_to("loop.png")
    (photos / "dangling.png").symlink_to("absent.png")
    os.mkfifo(photos / "pipe.png")
    return photos


def reasons(output: Path) -> dict[str, str]:
    return {str(row["name"]): str(row["reason"]) for row in rows(output / "failures.jsonl")}


def as_list(folder: Path) -> Path:
    lines = [{"image": name} for name in sorted(os.listdir(folder))]
    (folder / "list.jsonl").write_text("".join(f"{json.dumps(line)}\n" for line in lines))
    return folder / "list.jsonl"


@pytest.mark.slow
@pytest.mark.parametrize("given", ["folder", "pattern", "manifest", "file URLs"])
def test_what_cannot_be_read_fails_alone(mixed: Path, tmp_path: Path, given: str) -> None:
    inputs: dict[str, tuple[object, ...]] = {
        "folder": (mixed,),
        "pattern": (mixed / "*.png",),
        "manifest": (as_list(mixed),),
        "file URLs": tuple(f"file://{mixed}/{name}.png" for name in ("one", "pipe")),
    }
    counts = run_batch(batch(*inputs[given], output=tmp_path / "out"))
    found = reasons(tmp_path / "out")
    expected = ("pipe",) if given == "file URLs" else tuple(REASONS)
    assert counts == Counter({DONE: 1, FAILED: len(expected)})
    assert set(found) == set(expected)
    for name in expected:
        assert found[name].endswith(REASONS[name])
    assert (tmp_path / "out" / "one" / "mesh.glb").is_file()


def test_a_mask_that_is_a_loop_fails_its_image(mixed: Path, tmp_path: Path) -> None:
    (mixed / "one_mask.png").symlink_to("one_mask.png")
    assert run_batch(batch(mixed / "one.png", output=tmp_path / "out")) == Counter({FAILED: 1})
    assert "one_mask.png: cannot be read: Too many levels" in reasons(tmp_path / "out")["one"]


def test_a_loop_in_the_place_of_a_folder(photos: Path, tmp_path: Path) -> None:
    loop = tmp_path / "loop"
    loop.symlink_to(loop.name)
    with pytest.raises(InputError, match="loop: no such photo, folder or manifest"):
        run_batch(batch(loop, output=tmp_path / "out"))
    with pytest.raises(InputError, match="loop cannot be listed: Too many levels"):
        run_batch(batch(photos, output=tmp_path / "out", masks=str(loop)))
    with pytest.raises(InputError, match="choose another folder"):
        run_batch(batch(photos, output=loop / "out"))
    assert not (tmp_path / "out").exists()


def test_a_folder_that_may_not_be_listed(
    photos: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    photos.chmod(0)
    if os.access(photos, os.R_OK):
        pytest.skip("the superuser can read every folder")
    code = main(["batch", str(photos), "-q", "-o", str(tmp_path / "out")])
    photos.chmod(0o700)
    error = capsys.readouterr().err
    assert (code, error) == (2, f"isc: error: {photos} cannot be listed: Permission denied\n")
    assert not (tmp_path / "out").exists()
