"""What the tests of batches share: a few tiny photos, and runs without processes of their own."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from isc_core.batch.engine import Crew
from isc_core.batch.item import Recipe
from isc_core.batch.run import Batch
from isc_core.models.settings import Settings
from tests.core.command_line import ball_codes, write_image

QUICK = Recipe(Settings(model="retinex", engine="numpy"))
HERE = Crew(workers=1, threads=1, memory="0", processes=False)  # threads of this process: a second less, and its memory:// is theirs


@pytest.fixture
def photos(tmp_path: Path) -> Path:
    """A folder of three balls and a file that is no photo."""
    folder = tmp_path / "photos"
    folder.mkdir()
    codes = ball_codes(12.0).astype(float)
    for name, gain in (("one", 1.0), ("two", 0.8), ("three", 0.6)):
        write_image(folder / f"{name}.png", (gain * codes).astype("uint16"))
    (folder / "bad.png").write_bytes(b"\x89PNG\r\n\x1a\n and nothing more")
    return folder


def batch(*inputs: object, output: Path, **changes: object) -> Batch:
    """A quick batch in this process."""
    return replace(Batch([str(text) for text in inputs], output, recipe=QUICK, crew=HERE), **changes)


def rows(path: Path) -> list[dict[str, object]]:
    """Of a file of JSON lines."""
    return [json.loads(line) for line in path.read_text().splitlines()]
