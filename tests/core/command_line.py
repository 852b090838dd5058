"""Helpers of the tests of the command: photos of a synthetic ball, and running a command."""

import os
import pty
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np

from isc_core.imaging.srgb import linear_to_srgb
from tests.core.ball_scene import ball

ROOT = Path(__file__).resolve().parents[2]


def ball_codes(radius: float = 20.0) -> np.ndarray:
    """A glossy ball on black, (H, W, 3) uint16 sRGB codes."""
    side = int(2 * radius + 12)
    scene = ball((side, side + 4), radius, (side / 2, side / 2 + 3))
    return np.rint(65535 * np.clip(linear_to_srgb(scene.image), 0, 1)).astype(np.uint16)


def write_image(path: Path, rgb: np.ndarray) -> Path:
    """Writes (H, W) or (H, W, 3) RGB codes in the format of the suffix of `path`."""
    assert cv2.imwrite(str(path), rgb[..., ::-1] if rgb.ndim == 3 else rgb)
    return path


def ball_photo(folder: Path, radius: float = 20.0) -> Path:
    """Writes the ball's photo, a 16-bit PNG, into `folder`."""
    return write_image(folder / "ball.png", ball_codes(radius))


def run_isc(*arguments: object, before: str = "") -> subprocess.CompletedProcess[str]:
    """Runs the command in a process of its own; `before` is Python that is run there first."""
    return subprocess.run(
        isc_command(*arguments, before=before),
        capture_output=True,
        text=True,
        cwd=ROOT,
        timeout=300,
        check=False,
    )


def isc_command(*arguments: object, before: str = "") -> list[str]:
    """The command line that runs `isc` after `before`."""
    words = [str(argument) for argument in arguments]
    if not before:
        return [sys.executable, "-m", "isc_core", *words]
    return [
        sys.executable,
        "-c",
        f"{before}\nimport sys\nfrom isc_core.cli.main import main\nsys.exit(main({words!r}))",
    ]


def through_terminal(*command: str) -> str:
    """What a command writes when its standard error is a terminal."""
    parent, child = pty.openpty()
    with subprocess.Popen(
        command, cwd=ROOT, stderr=child, env={**os.environ, "COLUMNS": "80"}
    ) as process:
        os.close(child)
        written = b""
        while True:
            try:
                block = os.read(parent, 4096)
            except OSError:  # Linux: the other end of the terminal is closed
                break
            if not block:
                break
            written += block
        process.wait(timeout=60)
    os.close(parent)
    return written.decode()
