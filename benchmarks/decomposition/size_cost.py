"""What does a photo's size cost: seconds and memory of `isc decompose` at full detail.

  python -m benchmarks.decomposition.size_cost PHOTO [--megapixels M ...] [--frame F]
  [--threads N]

PHOTO, a masked photo, is enlarged until the object has M million pixels, and sensor noise of two
codes is added, so that the finest level has something to look at. With `--frame`, it is in the
middle of a grey frame of F megapixels of the same shape, as objects in photos by phones are. It is
decomposed with `--max-size 0 --detail 4096`. The table has the object's and the frame's megapixels,
the processor's seconds, those for each further megapixel of the object, the peak of memory, and its
bytes beyond 400 MB for each pixel of the object and of the frame.

Limits: processor time grows on a busy machine; an enlarged photo compresses better than a real one.
While EXR files are written, their content is in a memory file, which the peak leaves out.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from benchmarks.program import run_program
from isc_core.decomposition.settings import MOST_DETAIL
from isc_core.photo import read_photo

_MEGAPIXELS = (0.1, 0.4, 1.0, 2.0, 4.0, 8.0)
_NOISE, _GREY = 2.0, 128.0  # codes
_FIXED = 400e6  # bytes


def enlarged(
    photo: Path, megapixels: float, folder: Path, least_frame: float = 0.0
) -> tuple[Path, Path, float, float]:
    """Write an enlarged photo and its mask.

    Parameters
    ----------
    photo : Path
    megapixels : float
        Of the object.
    folder : Path
    least_frame : float, optional
        Megapixels to which the frame is extended.

    Returns
    -------
    photo, mask : Path
    inside, frame : float
        Megapixels of the object and of the frame.
    """
    mask = read_photo(photo).mask
    factor = float(np.sqrt(1e6 * megapixels / mask.sum()))
    with Image.open(photo) as picture:
        size = (round(factor * picture.width), round(factor * picture.height))
        large = np.asarray(picture.convert("RGB").resize(size, Image.Resampling.BICUBIC), float)
    cover = Image.fromarray(np.uint8(255) * mask).resize(size, Image.Resampling.BICUBIC)
    inside = np.asarray(cover) > 127
    around = max(0.0, np.sqrt(1e6 * least_frame / inside.size) - 1) / 2
    border = [(round(around * count),) * 2 for count in inside.shape]
    inside = np.pad(inside, border)
    large = np.where(inside[..., None], np.pad(large, (*border, (0, 0))), _GREY)
    grain = np.random.default_rng(0).normal(0, _NOISE, inside.shape)
    codes = np.clip(large + grain[..., None], 3, 255)
    if not least_frame:
        codes[~inside] = 0
    paths = folder / "photo.png", folder / "mask.png"
    Image.fromarray(np.rint(codes).astype(np.uint8)).save(paths[0])
    Image.fromarray(np.uint8(255) * inside).save(paths[1])
    return *paths, float(inside.sum()) / 1e6, inside.size / 1e6


def cost(photo: Path, mask: Path, output: Path, threads: int) -> tuple[float, float]:
    """Decompose a photo at its own size.

    Parameters
    ----------
    photo, mask, output : Path
    threads : int

    Returns
    -------
    seconds, peak : float
        Of the processor, and bytes.
    """
    command = [sys.executable, "-m", "isc_core", "decompose", str(photo), "--mask", str(mask)]
    command += ["--max-size", "0", "--detail", str(MOST_DETAIL), "-o", str(output)]
    command += ["--quiet", "--threads", str(threads)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"{' '.join(command)} failed")
    return used.ru_utime + used.ru_stime, 1024.0 * used.ru_maxrss


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("photo", type=Path, metavar="PHOTO")
    parser.add_argument("--megapixels", type=float, nargs="+", default=_MEGAPIXELS, metavar="M")
    parser.add_argument("--frame", type=float, default=0.0, metavar="F")
    parser.add_argument("--threads", type=int, default=0, help="0 (default) for all cores")
    given = parser.parse_args()
    titles = "object, MP", "frame, MP", "processor, s", "s a further MP", "peak, MB"
    print(f"| {' | '.join(titles)} | bytes a pixel of the object | of the frame |")
    print("|---" * 7 + "|")
    before: tuple[float, float] | None = None
    for megapixels in sorted(given.megapixels):
        with tempfile.TemporaryDirectory() as folder:
            photo, mask, inside, frame = enlarged(
                given.photo, megapixels, Path(folder), given.frame
            )
            seconds, peak = cost(photo, mask, Path(folder) / "result", given.threads)
        further = "" if before is None else f"{(seconds - before[1]) / (inside - before[0]):.1f}"
        before = inside, seconds
        sizes = (max(peak - _FIXED, 0) / (1e6 * area) for area in (inside, frame))
        values = f"{inside:.2f} | {frame:.2f} | {seconds:.1f} | {further} | {peak / 1e6:.0f}"
        print(f"| {values} | {' | '.join(f'{size:.0f}' for size in sizes)} |", flush=True)


if __name__ == "__main__":
    run_program(main)
