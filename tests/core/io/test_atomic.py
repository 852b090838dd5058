"""A result appears completely or not at all, and foreign files are never deleted."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from isc_core.errors import Cancelled, InputError
from isc_core.io.atomic import new_file, new_folder, require_writable

OURS = ("mark.json", "data.bin", "maps/one.bin")


def make(folder: Path, content: str = "new", *, fails: BaseException | None = None) -> None:
    """Writes a folder of ours; with `fails`, that happens half-way."""
    with new_folder(folder, OURS) as partial:
        (partial / "mark.json").write_text(content)
        if fails:
            raise fails
        (partial / "maps").mkdir()
        (partial / "maps" / "one.bin").write_text(content)


def everything(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*"))


def test_a_new_folder_appears_with_its_parents(tmp_path: Path) -> None:
    make(tmp_path / "a" / "b" / "out")
    assert everything(tmp_path / "a" / "b") == [
        "out",
        "out/maps",
        "out/maps/one.bin",
        "out/mark.json",
    ]


def test_the_final_name_does_not_exist_before_the_end(tmp_path: Path) -> None:
    with new_folder(tmp_path / "out", OURS) as partial:
        (partial / "mark.json").write_text("x")
        assert not (tmp_path / "out").exists()
        assert partial.parent == tmp_path  # a sibling: the last step is a rename on one disk
    assert (tmp_path / "out" / "mark.json").exists()


def test_the_folder_has_the_usual_permissions(tmp_path: Path) -> None:
    make(tmp_path / "out")
    (tmp_path / "usual").mkdir()
    assert (tmp_path / "out").stat().st_mode == (tmp_path / "usual").stat().st_mode


@pytest.mark.parametrize("stop", [KeyboardInterrupt, Cancelled, ValueError, SystemExit])
def test_an_interruption_leaves_nothing(tmp_path: Path, stop: type[BaseException]) -> None:
    with pytest.raises(stop):
        make(tmp_path / "a" / "out", "half", fails=stop())
    assert everything(tmp_path) == []


@pytest.mark.parametrize("stop", [KeyboardInterrupt, Cancelled])
def test_an_interruption_keeps_the_earlier_result(
    tmp_path: Path, stop: type[BaseException]
) -> None:
    make(tmp_path / "out", "old")
    with pytest.raises(stop):
        make(tmp_path / "out", "half", fails=stop())
    assert (tmp_path / "out" / "mark.json").read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_an_earlier_result_is_replaced_as_a_whole(tmp_path: Path) -> None:
    make(tmp_path / "out", "old")
    (tmp_path / "out" / "data.bin").write_text("only in the old one")
    (tmp_path / "out" / ".DS_Store").write_text("a file manager was here")
    make(tmp_path / "out", "new")
    assert everything(tmp_path) == ["out", "out/maps", "out/maps/one.bin", "out/mark.json"]
    assert (tmp_path / "out" / "mark.json").read_text() == "new"


def test_an_empty_folder_is_used(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    make(tmp_path / "out")
    assert (tmp_path / "out" / "mark.json").exists()


def test_a_link_to_a_folder_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    make(tmp_path / "link")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real" / "mark.json").exists()


@pytest.mark.parametrize("foreign", ["thesis.tex", "maps/mine.bin", "data.bin"])
def test_what_is_not_ours_is_refused_and_kept(tmp_path: Path, foreign: str) -> None:
    """Another file beside a result, one deep inside, and a folder that only shares a name with
    ours.
    """
    if foreign != "data.bin":
        make(tmp_path / "out", "old")
    (tmp_path / "out" / foreign).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / "out" / foreign).write_text("precious")
    before = everything(tmp_path)
    with pytest.raises(InputError, match="choose another folder"):
        make(tmp_path / "out")
    with pytest.raises(InputError, match="choose another folder"):
        require_writable(tmp_path / "out", OURS)
    assert everything(tmp_path) == before


def test_what_appears_meanwhile_is_kept(tmp_path: Path) -> None:
    (tmp_path / "else").mkdir()
    (tmp_path / "else" / "thesis.tex").write_text("precious")

    def meanwhile() -> None:
        with new_folder(tmp_path / "out", OURS) as partial:
            (partial / "mark.json").write_text("new")
            (tmp_path / "else").rename(tmp_path / "out")

    with pytest.raises(InputError, match="choose another folder"):
        meanwhile()
    assert everything(tmp_path) == ["out", "out/thesis.tex"]


def test_the_current_folder_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match="inside it"):
        make(Path())


@pytest.mark.parametrize("name", ["file", "file/out", "x" * 300, "nul\0byte"])
def test_an_impossible_place_is_one_clear_line(tmp_path: Path, name: str) -> None:
    (tmp_path / "file").write_text("precious")
    for attempt in (lambda: make(tmp_path / name), lambda: require_writable(tmp_path / name, OURS)):
        with pytest.raises(InputError) as caught:
            attempt()
        assert "\n" not in str(caught.value)
    assert everything(tmp_path) == ["file"]


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EACCES, errno.EROFS, errno.EIO])
def test_a_failing_disk_is_one_clear_line_and_leaves_nothing(tmp_path: Path, code: int) -> None:
    with pytest.raises(InputError, match="cannot write") as caught:
        make(tmp_path / "a" / "out", "half", fails=OSError(code, os.strerror(code)))
    assert "\n" not in str(caught.value)
    assert everything(tmp_path) == []


def test_a_failure_of_the_last_step_brings_the_earlier_result_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make(tmp_path / "out", "old")
    real, calls = os.replace, []

    def third_fails(source: Path, target: Path) -> None:
        """After the attempt to replace in one step and the moving aside."""
        calls.append(source)
        if len(calls) == 3:
            raise OSError(errno.EIO, "broken")
        real(source, target)

    def no_exchange(*arguments: object, **options: object) -> object:
        raise OSError("no C library")

    monkeypatch.setattr("ctypes.CDLL", no_exchange)
    monkeypatch.setattr(os, "replace", third_fails)
    with pytest.raises(InputError, match="broken"):
        make(tmp_path / "out", "new")
    assert everything(tmp_path) == ["out", "out/maps", "out/maps/one.bin", "out/mark.json"]
    assert (tmp_path / "out" / "mark.json").read_text() == "old"


def test_asking_whether_it_is_writable_leaves_no_trace(tmp_path: Path) -> None:
    require_writable(tmp_path / "a" / "b" / "out", OURS)
    assert everything(tmp_path) == []


@pytest.mark.skipif(sys.platform == "win32", reason="needs signals")
def test_ctrl_c_in_a_real_process_leaves_nothing(tmp_path: Path) -> None:
    script = (
        "import os, signal, sys\n"
        "from isc_core.io.atomic import new_folder\n"
        "with new_folder(sys.argv[1], ('mark.json',)) as partial:\n"
        "    (partial / 'mark.json').write_text('half')\n"
        "    os.kill(os.getpid(), signal.SIGINT)\n"
    )
    root = Path(__file__).resolve().parents[3]
    done = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path / "out")],
        cwd=root,
        capture_output=True,
        text=True,
        check=False,
    )
    assert "KeyboardInterrupt" in done.stderr
    assert everything(tmp_path) == []


def test_a_file_is_replaced_when_complete(tmp_path: Path) -> None:
    target = tmp_path / "a" / "table.json"

    def write(content: str, *, fails: bool = False) -> None:
        with new_file(target) as partial:
            partial.write_text(content)
            if fails:
                raise KeyboardInterrupt

    write("old")
    with pytest.raises(KeyboardInterrupt):
        write("half", fails=True)
    assert target.read_text() == "old"
    write("new")
    assert target.read_text() == "new"
    assert everything(tmp_path) == ["a", "a/table.json"]


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="choose a file"), new_file(tmp_path):
        pass
