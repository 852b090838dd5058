"""The commands under test, and how a complete output is recognised."""

import contextlib
import hashlib
import io
import json
import os
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np

from isc_core.cli.main import main
from isc_core.imaging.srgb import linear_to_srgb
from isc_core.io.decoders.png import write_png
from isc_core.photo import Raster
from isc_core.photo.grabcut import write_mask
from tests.properties.photos import MadePhoto

# The campaign runs every command at every step; the normal test run takes a sample.
CAMPAIGN = os.environ.get("ISC_TEST_PROFILE") == "campaign"
VARYING = ("timings", "seconds", "created", "parameters")  # differ between equal runs


class State(Enum):
    """What stands under the final name."""

    ABSENT = "nothing"
    COMPLETE = "a complete output"
    SOME_SCENES = "some complete scenes"
    DAMAGED = "a damaged output"


NO_HARM = (State.ABSENT, State.SOME_SCENES, State.COMPLETE)


@dataclass(frozen=True)
class Command:
    """A command line of `isc`.

    Attributes
    ----------
    name : str
        The subcommand.
    options : str
        The other words; `{in}` is the folder of inputs.
    output : str
        Name of the output below the folder of outputs.
    resumes : bool
        Scenes that a killed run has finished stay.
    """

    name: str
    options: str
    output: str
    resumes: bool = False

    def words(self, inputs: Path, output: Path) -> list[str]:
        """The words of the command line."""
        options = [word.replace("{in}", str(inputs)) for word in self.options.split()]
        return [self.name, *options, "--quiet", "-o", str(output)]

    def process(self, inputs: Path, output: Path) -> list[str]:
        """The command line of a new process."""
        return [sys.executable, "-m", "isc_core", *self.words(inputs, output)]


PHOTO = "{in}/photo.png --mask {in}/mask.png"
SYNTH = "--count 2 --size 24 --samples 2 --bounces 1 --renderer arrays"
COMMANDS = DECOMPOSE, SEPARATE, EDIT, MASK, SCENES = (
    Command("decompose", f"{PHOTO} --model naive", "result"),
    Command("separate", f"{PHOTO} --method shen_2013", "layers"),
    Command("edit", "{in}/result relight --yaw 40", "edit"),
    Command("mask", "{in}/photo.png --box 3,3,58,58", "found.png"),
    Command("synth", SYNTH, "scenes", resumes=True),
)


def make_inputs(folder: Path) -> Path:
    """Write a photo, its mask, another photo of the same size, and a result."""
    for name, seed in (("photo", 3), ("other", 4)):
        made = MadePhoto("glossy", "disc", 64, 64, seed)
        light = made.light() * made.inside()[..., None]
        codes = np.rint(65535 * linear_to_srgb(np.clip(light, 0, 1))).astype(np.uint16)
        write_png(folder / f"{name}.png", Raster(codes, None, 65535, 16))
    write_mask(folder / "mask.png", made.inside())
    code, text = run(DECOMPOSE.words(folder, folder / "result"))
    assert code == 0, text
    return folder


def run(words: Sequence[str]) -> tuple[int, str]:
    """Run a command in this process; return its exit code and standard error."""
    error = io.StringIO()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(error):
        code = main(list(words))
    return code, error.getvalue()


def digests(output: Path) -> dict[str, str]:
    """SHA-256 of each file of an output, without temporary siblings and varying fields."""
    if output.is_file():
        return {output.name: _digest(output)}
    found = {}
    for path in output.rglob("*"):
        name = path.relative_to(output).as_posix()
        if path.is_file() and "/." not in f"/{name}":
            found[name] = _digest(path)
    return found


def _digest(path: Path) -> str:
    data = path.read_bytes()
    if path.suffix == ".json":
        content = json.loads(data)
        kept = {key: value for key, value in content.items() if key not in VARYING}
        data = json.dumps(kept, sort_keys=True).encode()
    return hashlib.sha256(data).hexdigest()


def leftovers(folder: Path) -> list[str]:
    """Temporary siblings in a folder."""
    return sorted(os.path.relpath(path, folder) for path in folder.rglob(".*"))


def assert_refused(code: int, text: str) -> None:
    """Assert exit code 2 and one line of explanation."""
    assert (code, text.count("\n")) == (2, 1) and text.startswith("isc: error: "), (code, text)


@dataclass
class Trial:
    """A command in a scratch folder.

    Attributes
    ----------
    command : Command
        The command.
    inputs, place : Path
        The folder of inputs, the folder of outputs.
    complete : dict of str to str
        The digests of a complete output.
    """

    command: Command
    inputs: Path
    place: Path
    complete: dict[str, str]

    @property
    def output(self) -> Path:
        """The output below `place`."""
        return self.place / self.command.output

    def reset(self, earlier: bool = False) -> None:
        """Empty the folder of outputs; with `earlier`, put a complete output there."""
        shutil.rmtree(self.place, ignore_errors=True)
        self.place.mkdir(parents=True)
        if earlier:
            assert self.run()[0] == 0

    def run(self, output: Path | None = None, inputs: Path | None = None) -> tuple[int, str]:
        """Run the command; return its exit code and standard error."""
        return run(self.command.words(inputs or self.inputs, output or self.output))

    def state(self, output: Path | None = None) -> State:
        """What stands at `output`."""
        output = output or self.output
        if not output.exists():
            return State.ABSENT
        found = digests(output)
        if found == self.complete:
            return State.COMPLETE
        # A data set grows scene by scene; its manifest is rewritten.
        scenes = {name: digest for name, digest in found.items() if "/" in name}
        folders = {name.rpartition("/")[0] for name in scenes}
        due = {n: d for n, d in self.complete.items() if n.rpartition("/")[0] in folders}
        whole = self.command.resumes and scenes == due
        return State.SOME_SCENES if whole else State.DAMAGED

    def assert_complete(self, code: int, text: str) -> None:
        """Assert success, a complete output and no leftovers."""
        assert (code, self.state(), leftovers(self.place)) == (0, State.COMPLETE, []), text

    def assert_no_harm(self, code: int, text: str, earlier: bool) -> None:
        """Assert a complete output, or a refusal that left what was there; then run once more."""
        state = self.state()
        if code == 0:
            assert state is State.COMPLETE, text
        else:
            assert_refused(code, text)
            assert state in ((State.COMPLETE,) if earlier else NO_HARM), state
        assert leftovers(self.place) == []
        self.assert_complete(*self.run())
