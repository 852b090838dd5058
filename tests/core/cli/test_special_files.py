"""Pipes, devices, folders and loops of links in the place of files: one clear line, at once."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from isc_core.cli.main import main
from isc_core.errors import InputError
from isc_core.io.limits import Limits
from isc_core.io.regular_files import read_regular
from tests.core.command_line import ball_photo

SECONDS = 30  # enough to load the libraries of any command

DECOMPOSE = "decompose {photo} --model naive -o {out}"
SEPARATE = "separate {photo} --method isc -o {out}"
EDIT = "edit {result}"
# The file that is none is {file}, with a suffix where one is needed.
COMMANDS = (
    "decompose {file} -o {out}",
    f"{DECOMPOSE} --mask {{file}}",
    f"{DECOMPOSE} --priors {{file}}",
    f"{DECOMPOSE} --shape {{file}}",
    f"{DECOMPOSE} --light {{file}}",
    f"{DECOMPOSE} --depth {{file}}",
    f"{DECOMPOSE} --config {{file}}",
    "separate {file} -o {out}",
    f"{SEPARATE} --mask {{file}}",
    f"{SEPARATE} --prior {{file}}",
    "mask {file} --box 1,1,20,20 -o {out}.png",
    f"{EDIT} relight --yaw 9 --photo {{file}} -o {{out}}",
    f"{EDIT} relight --yaw 9 --photo {{photo}} --mask {{file}} -o {{out}}",
    f"{EDIT} relight --light {{file}}.json -o {{out}}",
    f"{EDIT} relight --light {{file}}.npy -o {{out}}",
    f"{EDIT} recolour --hue 9 --region {{file}} -o {{out}}",
    "evaluate {folder} --dataset mit-berkeley --priors {file}",
    "batch {file}.csv -o {out}",
    "batch {file}.jsonl -o {out}",
    "batch file://{file}.csv -o {out}",
    "batch {photo} --priors {file} -o {out}",
    "synth --mesh {file}.obj -o {out}",
    "synth --height {file}.mat -o {out}",
    "synth --albedo-image {file} -o {out}",
    "validate {folder} --bounds {file} -o {out}",
)
FOLDERS_ARE_INPUTS = ("--shape", "--light", "--depth")
CASES = [
    (command, kind)
    for command in COMMANDS
    for kind in ("pipe", "device", "folder", "loop")
    if kind != "folder" or not any(f"{option} {{" in command for option in FOLDERS_ARE_INPUTS)
]


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The result of a quick decomposition, beside its photo."""
    folder = tmp_path_factory.mktemp("result")
    photo, output = ball_photo(folder), folder / "out"
    assert main(["decompose", str(photo), "--model", "naive", "-q", "-o", str(output)]) == 0
    return output


@pytest.fixture
def impatient() -> Iterator[None]:
    """Let the test fail where it would hang."""

    def stop(*_: object) -> None:
        pytest.fail(f"not finished within {SECONDS} s")

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(SECONDS)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def make(kind: str, path: Path) -> None:
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to(os.devnull)
    elif kind == "loop":
        path.symlink_to(path.name)
    else:
        path.mkdir()


def refusal(capfd: pytest.CaptureFixture[str], *words: object) -> str:
    """The message of a refused command."""
    capfd.readouterr()
    code = main([*map(str, words), "-q"])
    out, err = capfd.readouterr()
    assert (code, out) == (2, ""), (code, out, err)
    assert err.startswith("isc: error: ") and err.count("\n") == 1, err
    return err


@pytest.mark.usefixtures("impatient")
@pytest.mark.parametrize(("command", "kind"), CASES)
def test_only_regular_files_are_opened(
    tmp_path: Path, result: Path, capfd: pytest.CaptureFixture[str], command: str, kind: str
) -> None:
    if command.startswith("batch"):
        pytest.importorskip("distributed", reason="needs the extra `batch`")
    special = tmp_path / "special"
    words = command.format(
        photo=result.parent / "ball.png",
        result=result,
        folder=tmp_path,
        out=tmp_path / "out",
        file=special,
    ).split()
    named = next(word for word in words if "special" in word).removeprefix("file://")
    make(kind, Path(named))
    message = refusal(capfd, *words)
    assert named in message
    if kind != "loop":
        assert ("is a folder" if kind == "folder" else "is not a regular file: ") in message
    assert not list(tmp_path.glob("out*"))


@pytest.mark.usefixtures("impatient")
def test_nothing_is_written_through_a_loop_of_links(
    tmp_path: Path, result: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    loop, photo = tmp_path / "loop", result.parent / "ball.png"
    make("loop", loop)
    for words in (
        ("decompose", photo, "-o", loop / "x"),
        ("separate", photo, "-o", loop / "x"),
        ("mask", photo, "--box", "1,1,20,20", "-o", loop / "x.png"),
        ("edit", result, "relight", "--yaw", "9", "-o", loop / "x"),
        ("edit", loop / "x", "relight", "--yaw", "9", "-o", tmp_path / "out"),
        ("validate", loop / "x", "-o", tmp_path / "out"),
    ):
        assert str(loop) in refusal(capfd, *words)
    assert list(tmp_path.iterdir()) == [loop]


def test_the_size_is_known_before_a_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "long"
    with path.open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(InputError, match="1099.5 GB; the limit is 0.0 GB"):
        read_regular(path, Limits(max_bytes=100))


def test_a_missing_file_is_left_to_the_caller(tmp_path: Path) -> None:
    for name in ("absent", "null\0byte"):
        with pytest.raises(FileNotFoundError):
            read_regular(tmp_path / name)
