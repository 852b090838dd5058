"""Building a world: the same bytes however often it is interrupted, and bad input in one line."""

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mitsuba")

from isc_core.errors import Cancelled, InputError
from isc_core.progress import Monitor, ProgressEvent
from synth.scene.meshes import Mesh
from training.commands import world
from training.world import build
from training.world.bodies import Body, BodyFolders, Source
from training.world.files import CREDITS, VIEWS, Split, WorldSettings, read_views, views_in
from training.world.patterns import Atlas

SETTINGS = WorldSettings(seed=1, views=1, built=0, families=3)
NOWHERE = BodyFolders(None, None, None)


@dataclass(frozen=True)
class Reference:
    """A body, or what is wrong with it."""

    name: str
    content: Mesh | InputError | None

    def load(self) -> list[Body]:
        if isinstance(self.content, InputError):
            raise self.content
        return [] if self.content is None else [Body(self.name, Source.FAMILY, self.content)]


@pytest.fixture(autouse=True)
def few_patterns(monkeypatch: pytest.MonkeyPatch) -> None:
    def few(seed: int, count: int) -> Atlas:
        grey = np.random.default_rng(seed).integers(0, 256, (4, 8, 8)).astype(np.uint8)
        return Atlas(grey, np.arange(4).astype(np.uint8), np.ones(4, bool))

    monkeypatch.setattr(build, "make_atlas", few)


def options(*words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    world.declare(parser)
    return parser.parse_args(["build", *words])


def everything(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def triangle(corner: float) -> Mesh:
    vertices = np.array([[-1.0, 0, 0], [0, corner, 0], [1.0, 0, 0]])
    return Mesh(vertices, np.tile([0.0, 0, 1], (3, 1)), np.zeros((3, 2)), np.array([[0, 1, 2]]))


@pytest.mark.slow
def test_an_interrupted_build_ends_with_the_same_bytes(tmp_path: Path) -> None:
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    lines = build.build_world(whole, NOWHERE, SETTINGS, None, 1, Monitor())
    assert "3 views of 3 objects; 0 entries" in lines[0]
    views = [view for split in Split for view in views_in(whole, split)]
    assert len(views) == 3 and (whole / CREDITS).read_text().count("synth.shapes") == 3

    seen: list[ProgressEvent] = []
    stopped = Monitor(seen.append, lambda: any(one.stage == "bodies" for one in seen))
    with pytest.raises(Cancelled):
        build.build_world(parts, NOWHERE, SETTINGS, None, 1, stopped)
    written = everything(parts)
    assert any(name.startswith(VIEWS) for name in written) and CREDITS not in written
    # What an interruption took is made anew, as are views that somebody deleted.
    sorted((parts / VIEWS).glob("*.npz"))[0].unlink()
    build.build_world(parts, NOWHERE, SETTINGS, None, 1, Monitor())
    assert everything(parts) == everything(whole)

    before = everything(whole)
    build.build_world(whole, NOWHERE, SETTINGS, None, 1, Monitor())
    with pytest.raises(InputError, match="other settings"):
        world.run(options("-o", str(whole), "--seed", "2", "--built", "0"), Monitor())
    assert everything(whole) == before


def test_bodies_without_a_view_leave_their_reason(tmp_path: Path) -> None:
    cases = {
        "line": (triangle(0), "no side shows enough"),
        "none": (None, "no object passes the screening"),
        "bad": (InputError("bad.ply has no surface: choose another"), "bad.ply has no surface"),
    }
    for name, (content, reason) in cases.items():
        path = tmp_path / f"{name}.npz"
        build._build_one(path, Reference(name, content), SETTINGS, 0)  # type: ignore[arg-type]
        assert read_views(path) == (name, [])
        with np.load(path) as data:
            assert reason in str(data["reason"])


def test_the_number_of_a_reference_alone_decides_its_views(tmp_path: Path) -> None:
    body = Reference("flag", triangle(0.5))
    for name, number, seed in (("a", 4, 1), ("b", 4, 1), ("c", 5, 1), ("d", 4, 2)):
        settings = WorldSettings(seed, 1, 0, 3)
        path = tmp_path / name
        build._build_one(path, body, settings, number)  # type: ignore[arg-type]
    found = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert found["a"] == found["b"] and len(set(found.values())) == 3


@pytest.mark.parametrize(
    ("words", "match"),
    [
        (["--built", "0", "--families", "0"], "the list of objects is empty"),
        (["--views", "0"], "must be at least 1"),
        (["--workers", "0"], "must be at least 1"),
        (["--count", "0"], "the list of objects is empty"),
    ],
)
def test_builds_of_nothing_are_refused(tmp_path: Path, words: list[str], match: str) -> None:
    folder = tmp_path / "world"
    with pytest.raises(InputError, match=match) as caught:
        world.run(options("-o", str(folder), *words), Monitor())
    assert "\n" not in str(caught.value) and not folder.exists()


@pytest.mark.parametrize("source", ["--furniture", "--urdfs", "--scans"])
def test_folders_without_bodies_are_refused(tmp_path: Path, source: str) -> None:
    folder, empty = tmp_path / "world", tmp_path / "empty"
    empty.mkdir()
    for place in (empty, tmp_path / "absent"):
        with pytest.raises(InputError) as caught:
            world.run(options("-o", str(folder), source, str(place)), Monitor())
        assert str(place) in str(caught.value) and "\n" not in str(caught.value)
    assert not folder.exists()


def test_a_folder_with_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "letter.txt").write_text("dear")
    with pytest.raises(InputError, match="no world"):
        world.run(options("-o", str(tmp_path)), Monitor())
    assert everything(tmp_path) == {"letter.txt": b"dear"}
