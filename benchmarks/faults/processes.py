"""Processes that are killed, that run at once, that read files while these change, whose clock goes
wrong.
"""

import contextlib
import os
import random
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from unittest import mock

import numpy as np

from isc_core.exr import read_channels, write_channels
from isc_core.photo import read_photo
from isc_core.result_folder import load

from .commands import Command, leftovers, one_line, run, state
from .disk import fresh

_SECONDS = 120
_SAFE = ("whole", "nothing", "some scenes, each whole")


def kill(command: Command, inputs: Path, place: Path, whole: dict[str, str], seed: int) -> str:
    """Kills the command by force at a random moment, in every other round while it writes, over an
    earlier output in every third; then runs it once more. "" if nothing was wrong, else what was.
    """
    rng = random.Random(f"{command.name} {seed}")
    output, earlier = place / command.output, seed % 3 == 0
    fresh(place)
    if earlier:
        run(command.line(inputs, output))
    process = subprocess.Popen(
        [*command.process(inputs, output), "--progress", "json"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    try:
        _await(process, rng, writing=seed % 2 == 0)
    finally:
        process.send_signal(signal.SIGKILL)
        process.communicate(timeout=_SECONDS)
    seen = state(command, output, whole)
    if seen not in (("whole",) if earlier else _SAFE):
        return f"WRONG: after a kill {seen}"
    code, _, text = run(command.line(inputs, output))
    if code or state(command, output, whole) != "whole" or leftovers(place):
        return f"WRONG: the next run: exit {code}, {state(command, output, whole)}, left {leftovers(place)}, {text[-200:]!r}"
    return ""


def _await(process: "subprocess.Popen[bytes]", rng: random.Random, writing: bool) -> None:
    """Until a random moment of the work, or of its writing; less where the process has ended."""
    assert process.stdout is not None
    words = (b"writing", b"mesh", b"preview", b"scene", b"rendering") if writing else (b"starting",)
    for line in process.stdout:
        if any(word in line for word in words) or b'"done"' in line:
            break
    deadline = time.monotonic() + rng.uniform(0, 0.6 if writing else 3.0)
    while process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.005)


def at_once(command: Command, inputs: Path, place: Path, whole: dict[str, str], number: int) -> str:
    """Two processes write one output at the same time, whose parents lack or where an earlier one
    stands: both succeed.
    """
    fresh(place)
    output = place / "a" / "b" / command.output
    if number % 2:
        run(command.line(inputs, output))
    both = [
        subprocess.Popen(
            command.process(inputs, output),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )
        for _ in range(2)
    ]
    said = [process.communicate(timeout=_SECONDS)[1].decode() for process in both]
    codes = [process.returncode for process in both]
    seen = state(command, output, whole)
    if codes != [0, 0] or seen != "whole" or leftovers(place):
        return f"WRONG: exits {codes}, {seen}, left {leftovers(place)}, {said}"
    return ""


@contextlib.contextmanager
def _wrong_clock(seed: int) -> Iterator[None]:
    """The wall clock goes back with every look at it."""
    now = [4e9 / (seed + 1)]

    def earlier() -> float:
        now[0] -= 1e6
        return now[0]

    with mock.patch("time.time", earlier):
        yield


def wrong_clock(
    command: Command, inputs: Path, place: Path, whole: dict[str, str], seed: int
) -> str:
    """The clock goes back while the command works, and the inputs' times lie in the past or in the
    future: the same output.
    """
    fresh(place)
    copy, output = place / "in", place / "out" / command.output
    shutil.copytree(inputs, copy)
    for path in copy.rglob("*"):
        os.utime(path, (seed * 1e9, (5 - seed) * 1e9))
    with _wrong_clock(seed):
        code, _, text = run(command.line(copy, output))
    if code or state(command, output, whole) != "whole":
        return f"WRONG: exit {code}, {state(command, output, whole)}, {text[-200:]!r}"
    times = (
        []
        if command.name != "decompose"
        else [v for v in load(output).provenance.timings.values() if v < 0]
    )
    return f"WRONG: seconds below 0: {times}" if times else ""


def changing(inputs: Path, place: Path, kind: str, seconds: float) -> tuple[int, int, list[str]]:
    """A photo is exchanged for another, rewritten in place and cut short all the while it is read,
    as `kind` of file ("png", "exr", "npy"): how often it was read, how often refused, and what was
    wrong. A reading is right if its sum is that of one of the two files and its pixels are that
    file's.
    """
    fresh(place)
    files = _versions(inputs, place, kind)
    known = {photo.original.sha256: photo.image for photo in map(read_photo, files)}
    contents = [path.read_bytes() for path in files]
    target, done = place / f"changing.{kind}", threading.Event()
    target.write_bytes(contents[0])

    def change() -> None:
        rng = random.Random(kind)
        while not done.is_set():
            content = rng.choice(contents)
            if rng.random() < 0.5:
                (place / "next").write_bytes(content)
                os.replace(place / "next", target)
            else:
                with target.open("r+b") as file:
                    file.truncate(rng.randrange(len(content)))
                    file.write(content)
                    file.truncate(len(content))
            time.sleep(rng.random() * 0.004)

    read = refused = 0
    wrong: list[str] = []
    thread = threading.Thread(target=change)
    thread.start()
    end = time.monotonic() + seconds
    try:
        while time.monotonic() < end:
            code, _, text = run(
                ["separate", str(target), "--method", "none", "--quiet", "-o", str(place / "out")]
            )
            if code:
                refused += 1
                wrong += [trouble] if (trouble := one_line(code, text)) else []
                continue
            read += 1
            layers = read_channels(place / "out" / "separation.exr")
            image = np.stack([layers[f"image.{c}"] for c in "RGB"], -1)
            if not any(np.array_equal(image, other) for other in known.values()):
                wrong.append("WRONG: pixels of neither file")
            try:
                photo = read_photo(target)
            except ValueError:
                continue
            if photo.original.sha256 not in known or not np.array_equal(
                photo.image, known[photo.original.sha256]
            ):
                wrong.append("WRONG: the sum recorded is not that of the pixels")
    finally:
        done.set()
        thread.join()
    return read, refused, wrong


def _versions(inputs: Path, place: Path, kind: str) -> list[Path]:
    """The two photos as files of one kind."""
    paths = []
    for name in ("photo", "other"):
        path = place / f"{name}.{kind}"
        image = read_photo(inputs / f"{name}.png").image
        if kind == "png":
            shutil.copyfile(inputs / f"{name}.png", path)
        elif kind == "exr":
            write_channels(path, {c: image[..., k] for k, c in enumerate("RGB")})
        else:
            np.save(path, image)
        paths.append(path)
    return paths
