"""Fixtures of the tests of batches: a few tiny photos, and runs in this process."""

import json
import shutil
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest

from isc_core.batch.engine import WorkerOptions
from isc_core.batch.item import DONE, FAILED, ImageRecipe
from isc_core.batch.run_batch import Batch, run_batch
from isc_core.decomposition.settings import Settings
from tests.core.command_line import ball_codes, write_image

QUICK = ImageRecipe(Settings(model="retinex", engine="numpy"))
HERE = WorkerOptions(
    workers=1, threads=1, memory="0", processes=False
)  # threads of this process: a second less, and its memory:// is theirs


@pytest.fixture(scope="session")
def first_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder `photos` of three balls and a file that is no photo, and what a run has made of them
    in `out`.
    """
    place = tmp_path_factory.mktemp("batch")
    folder = place / "photos"
    folder.mkdir()
    codes = ball_codes(12.0).astype(float)
    for name, gain in (("one", 1.0), ("two", 0.8), ("three", 0.6)):
        write_image(folder / f"{name}.png", (gain * codes).astype("uint16"))
    (folder / "bad.png").write_bytes((folder / "one.png").read_bytes()[:200])
    assert run_batch(batch(folder, output=place / "out")) == Counter({DONE: 3, FAILED: 1})
    return place


@pytest.fixture
def photos(first_run: Path, tmp_path: Path) -> Path:
    """The photos, to be changed at will."""
    return Path(shutil.copytree(first_run / "photos", tmp_path / "photos"))


@pytest.fixture
def made(first_run: Path, tmp_path: Path) -> Path:
    """The output of the first run, to be changed at will."""
    return Path(shutil.copytree(first_run / "out", tmp_path / "out"))


def batch(*inputs: object, output: Path, **changes: object) -> Batch:
    """A quick batch in this process."""
    return replace(
        Batch([str(text) for text in inputs], output, recipe=QUICK, worker_options=HERE), **changes
    )


def rows(path: Path) -> list[dict[str, object]]:
    """Of a file of JSON lines."""
    return [json.loads(line) for line in path.read_text().splitlines()]
