"""Processes that are killed, run at once, read files that change, or have a wrong clock."""

import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from isc_core.batch.item import ImageRecipe
from isc_core.batch.names import Names
from isc_core.batch.sources import Inputs
from isc_core.decomposition.pipeline import Settings, decompose
from isc_core.errors import InputError
from isc_core.io.exr import read_channels, write_channels
from isc_core.photo import read_photo
from isc_core.result_files.result_folder import load
from tests.faults.commands import (
    CAMPAIGN,
    COMMANDS,
    DECOMPOSE,
    MASK,
    NO_HARM,
    SEPARATE,
    Command,
    State,
    assert_refused,
    run,
)
from tests.faults.conftest import Trials

if not sys.platform.startswith("linux"):
    pytest.skip("needs the signals and file systems of Linux", allow_module_level=True)
TIMEOUT = 120
WRITING = (b"writing", b"mesh", b"preview", b"scene", b"rendering")
KILLS = list(product(COMMANDS, range(20)) if CAMPAIGN else product([SEPARATE], range(2)))
kinds = pytest.mark.parametrize("kind", ["png", "exr", "npy"])


@pytest.mark.slow
@pytest.mark.parametrize(("command", "seed"), KILLS)
def test_kill(trial: Trials, command: Command, seed: int) -> None:
    """At a random moment; every second time while it writes, every third over an earlier output."""
    rng = random.Random(f"{command.name} {seed}")
    this, earlier, writing = trial(command), seed % 3 == 0, seed % 2 == 0
    this.reset(earlier)
    process = subprocess.Popen(
        [*command.process(this.inputs, this.output), "--progress", "json"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    try:
        assert process.stdout is not None
        awaited = (*(WRITING if writing else (b"starting",)), b'"done"')
        next((line for line in process.stdout if any(word in line for word in awaited)), b"")
        deadline = time.monotonic() + rng.uniform(0, 0.6 if writing else 3.0)
        while process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.005)
    finally:
        process.kill()
        process.communicate(timeout=TIMEOUT)
    assert process.returncode in (0, -signal.SIGKILL)
    assert this.state() in ((State.COMPLETE,) if earlier else NO_HARM)
    this.assert_complete(*this.run())


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS if CAMPAIGN else [MASK], ids=lambda c: c.name)
@pytest.mark.parametrize("earlier", [False, True], ids=["nothing there", "earlier output"])
def test_two_runs_into_one_output_both_succeed(
    trial: Trials, command: Command, earlier: bool
) -> None:
    this = trial(command)
    this.place = this.place / "a" / "b"
    if earlier:
        assert this.run()[0] == 0
    words = command.process(this.inputs, this.output)
    pipes = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
    for _ in range(4 if CAMPAIGN else 1):
        both = [subprocess.Popen(words, **pipes) for _ in range(2)]
        errors = [process.communicate(timeout=TIMEOUT)[1] for process in both]
        assert [process.returncode for process in both] == [0, 0], errors
        this.assert_complete(0, str(errors))


@pytest.mark.parametrize("command", COMMANDS if CAMPAIGN else [DECOMPOSE], ids=lambda c: c.name)
@pytest.mark.parametrize("seed", range(4) if CAMPAIGN else [2])
def test_clock_that_goes_back(
    trial: Trials, monkeypatch: pytest.MonkeyPatch, command: Command, seed: int
) -> None:
    """The clock goes back at every reading; the inputs' times lie in the past or the future."""
    this = trial(command)
    inputs = this.place / "in"
    shutil.copytree(this.inputs, inputs)
    for path in inputs.rglob("*"):
        os.utime(path, (seed * 1e9, (5 - seed) * 1e9))
    now = [4e9 / (seed + 1)]

    def earlier() -> float:
        now[0] -= 1e6
        return now[0]

    monkeypatch.setattr("time.time", earlier)
    this.assert_complete(*this.run(inputs=inputs))
    if command is DECOMPOSE:
        assert min(load(this.output).provenance.timings.values()) >= 0


def two_photos(inputs: Path, place: Path, kind: str) -> list[Path]:
    """The two photos as files of one kind."""
    paths = [place / f"{name}.{kind}" for name in ("photo", "other")]
    for path in paths:
        source = inputs / path.with_suffix(".png").name
        image = read_photo(source).image
        if kind == "png":
            shutil.copyfile(source, path)
        elif kind == "exr":
            write_channels(path, {c: image[..., k] for k, c in enumerate("RGB")})
        else:
            np.save(path, image)
    return paths


def keep_changing(target: Path, contents: list[bytes], done: threading.Event) -> None:
    """Exchange a file, or rewrite it in place, until `done` is set."""
    rng, following = random.Random(target.suffix), target.with_name("next")
    while not done.is_set():
        content = rng.choice(contents)
        if rng.random() < 0.5:
            following.write_bytes(content)
            os.replace(following, target)
        else:
            with target.open("r+b") as file:
                file.truncate(rng.randrange(len(content)))
                file.write(content)
                file.truncate(len(content))
        time.sleep(rng.random() * 0.004)


@pytest.mark.slow
@kinds
def test_photo_that_keeps_changing(inputs: Path, tmp_path: Path, kind: str) -> None:
    """Each reading is refused, or gives the pixels of one version with its checksum."""
    files, target, output = (
        two_photos(inputs, tmp_path, kind),
        tmp_path / f"c.{kind}",
        tmp_path / "out",
    )
    known = {photo.original.sha256: photo.image for photo in map(read_photo, files)}
    contents = [path.read_bytes() for path in files]
    target.write_bytes(contents[0])
    words = ["separate", str(target), "--method", "none", "--quiet", "-o", str(output)]
    done, runs = threading.Event(), 0
    thread = threading.Thread(target=keep_changing, args=(target, contents, done))
    thread.start()
    end = time.monotonic() + (30 if CAMPAIGN else 0.7)
    try:
        while time.monotonic() < end:
            runs += 1
            code, text = run(words)
            if code:
                assert_refused(code, text)
                continue
            layers = read_channels(output / "separation.exr")
            image = np.stack([layers[f"image.{c}"] for c in "RGB"], -1)
            assert any(np.array_equal(image, other) for other in known.values())
            try:
                photo = read_photo(target)
            except InputError:
                continue
            assert np.array_equal(photo.image, known[photo.original.sha256])
    finally:
        done.set()
        thread.join()
    assert runs


@kinds
def test_checksum_is_of_the_bytes_that_were_decoded(
    inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    """The file is exchanged as soon as it was read: nothing may read it again."""
    images = [read_photo(inputs / f"{name}.png").image for name in ("photo", "other")]
    paths = two_photos(inputs, tmp_path, kind)
    first, second = (path.read_bytes() for path in paths)
    real = Path.read_bytes

    def exchanged(path: Path) -> bytes:
        data = real(path)
        if path == paths[0]:
            path.write_bytes(second)
        return data

    monkeypatch.setattr(Path, "read_bytes", exchanged)
    photo = read_photo(paths[0])
    assert first != second and photo.original.sha256 == hashlib.sha256(first).hexdigest()
    assert np.allclose(photo.image, images[0], atol=1e-6)
    assert not np.allclose(photo.image, images[1], atol=1e-2)


def test_edit_of_a_photo_that_changes_is_refused(
    inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The photo is read twice: as radiance, and as stored values."""
    photo, output = tmp_path / "photo.png", tmp_path / "out"
    photo.write_bytes((inputs / "photo.png").read_bytes())
    other = (inputs / "other.png").read_bytes()

    def exchanged(*args: object, **kwargs: object) -> object:
        found = read_photo(*args, **kwargs)
        photo.write_bytes(other)
        return found

    monkeypatch.setattr("isc_core.cli.interface.result_photo.read_photo", exchanged)
    given = ["--photo", str(photo), "--mask", str(inputs / "mask.png"), "--quiet"]
    code, text = run(["edit", str(inputs / "result"), "relight", *given, "-o", str(output)])
    assert_refused(code, text)
    assert "changed while it was read" in text and not output.exists()


def test_black_photo_is_refused(inputs: Path) -> None:
    photo = read_photo(inputs / "photo.png")
    black = type(photo)(0 * photo.image, photo.mask, 0.0, photo.clipped, photo.original)
    for model in ("naive", "sirfs"):
        with pytest.raises(InputError, match="black inside the mask"):
            decompose(black, Settings(model))


def test_few_bright_pixels_have_a_step(tmp_path: Path) -> None:
    """The 99.9th percentile is black, and its logarithm has no floor."""
    image = np.zeros((60, 60, 3), np.float32)
    image[30, 30] = [0.5, 0.25, 0.125]
    np.save(tmp_path / "spark.npy", np.concatenate([image, np.ones((60, 60, 1), np.float32)], -1))
    np.save(tmp_path / "mask.npy", np.ones((60, 60), bool))
    assert read_photo(tmp_path / "spark.npy", tmp_path / "mask.npy").code_value > 0


def test_folder_of_many_images(tmp_path: Path) -> None:
    """Hidden and other files among them."""
    pytest.importorskip("distributed")
    count = 10_000 if CAMPAIGN else 300
    for number in range(count):
        (tmp_path / f"image {number:06}.png").touch()
    for name in (".hidden.png", "letter.txt", "image 000003_mask.png"):
        (tmp_path / name).touch()
    items = Inputs([str(tmp_path)], None, ImageRecipe())
    names = Names(items)
    given = [names.name(item) for item in items]
    assert len(given) == len(set(given)) == count and None not in given
    assert len([item.mask for item in items if item.mask]) == 1
