"""The commands that are made to fail, and how a whole output is told from anything else."""

import contextlib
import hashlib
import io
import json
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from isc_core.cli import main
from isc_core.mask import write_mask
from isc_core.photo import Raster, linear_to_srgb, write_png

from ..properties.pictures import Picture

_PASSING = (
    "timings",
    "seconds",
    "created",
    "parameters",
)  # what differs between runs that are alike


@dataclass(frozen=True)
class Command:
    """`name`; `words` of the command line, `{in}` standing for the folder of inputs and `{out}` for
    the output; `output`: its name below the folder of outputs. `resumes`: what a killed run has
    finished stays, one folder a scene.
    """

    name: str
    words: tuple[str, ...]
    output: str
    resumes: bool = False

    def line(self, inputs: Path, output: Path) -> list[str]:
        """The words with their places filled in."""
        return [
            word.replace("{in}", str(inputs)).replace("{out}", str(output)) for word in self.words
        ]

    def process(self, inputs: Path, output: Path) -> list[str]:
        """The command line of a process of its own."""
        return [sys.executable, "-m", "isc_core", *self.line(inputs, output)]


_PHOTO = ("{in}/photo.png", "--mask", "{in}/mask.png")
COMMANDS = (
    Command(
        "decompose", ("decompose", *_PHOTO, "--model", "naive", "--quiet", "-o", "{out}"), "result"
    ),
    Command(
        "separate",
        ("separate", *_PHOTO, "--method", "shen_2013", "--quiet", "-o", "{out}"),
        "layers",
    ),
    Command(
        "edit", ("edit", "{in}/result", "relight", "--yaw", "40", "--quiet", "-o", "{out}"), "edit"
    ),
    Command(
        "mask",
        ("mask", "{in}/photo.png", "--box", "3,3,58,58", "--quiet", "-o", "{out}"),
        "found.png",
    ),
    Command(
        "synth",
        (
            "synth",
            "--count",
            "2",
            "--size",
            "24",
            "--samples",
            "2",
            "--bounces",
            "1",
            "--renderer",
            "arrays",
            "--quiet",
            "-o",
            "{out}",
        ),
        "scenes",
        resumes=True,
    ),
)


def prepared(folder: Path) -> Path:
    """The folder of inputs: a photo, its mask, another photo of the same size, a result.

    Made once.
    """
    inputs = folder / "in"
    if (inputs / "result" / "decomposition.json").is_file():
        return inputs
    inputs.mkdir(parents=True, exist_ok=True)
    for name, seed in (("photo", 3), ("other", 4)):
        picture = Picture("glossy", "disc", 64, 64, seed)
        light = picture.light() * picture.inside()[..., None]
        codes = np.rint(65535 * linear_to_srgb(np.clip(light, 0, 1))).astype(np.uint16)
        write_png(inputs / f"{name}.png", Raster(codes, None, 65535, 16))
    write_mask(inputs / "mask.png", picture.inside())
    code, _, text = run(COMMANDS[0].line(inputs, inputs / "result"))
    if code:
        raise RuntimeError(text)
    return inputs


def run(words: Sequence[str]) -> tuple[int, str, str]:
    """Runs a command in this process: its exit code, and what it wrote."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(list(words))
    return code, out.getvalue(), err.getvalue()


def digests(output: Path) -> dict[str, str]:
    """The sum of each file of an output, without what differs between runs that are alike; without
    temporary siblings.
    """
    if output.is_file():
        return {output.name: _digest(output)}
    files = [
        path
        for path in output.rglob("*")
        if path.is_file() and "/." not in f"/{path.relative_to(output).as_posix()}"
    ]
    return {path.relative_to(output).as_posix(): _digest(path) for path in sorted(files)}


def _digest(path: Path) -> str:
    data = path.read_bytes()
    if path.suffix == ".json":
        content = json.loads(data)
        data = json.dumps(
            {key: value for key, value in content.items() if key not in _PASSING}, sort_keys=True
        ).encode()
    return hashlib.sha256(data).hexdigest()


def state(command: Command, output: Path, whole: dict[str, str]) -> str:
    """ "whole", "nothing", or what is wrong with the output in words."""
    if not output.exists():
        return "nothing"
    found = digests(output)
    if found == whole:
        return "whole"
    if command.resumes:  # a data set grows scene by scene, and its list is written anew
        scenes = {name: digest for name, digest in found.items() if "/" in name}
        folders = {name.rpartition("/")[0] for name in scenes}
        if all(whole.get(name) == digest for name, digest in scenes.items()) and all(
            name in scenes for name in whole if name.rpartition("/")[0] in folders
        ):
            return "some scenes, each whole"
    lacking, other = (
        sorted(whole.keys() - found.keys()),
        sorted(n for n in found if found[n] != whole.get(n)),
    )
    return f"WRONG: lacks {lacking[:3]}, differs in {other[:3]}"


def leftovers(folder: Path) -> list[str]:
    """Temporary siblings that lie about."""
    return sorted(os.path.relpath(path, folder) for path in folder.rglob(".*"))


def one_line(code: int, text: str) -> str:
    """ "" for a refusal as it should be: exit code 2, one line."""
    if code == 2 and text.count("\n") == 1 and text.startswith("isc: error: "):
        return ""
    return f"WRONG: exit {code}, said {text[-200:]!r}"
