"""Processor time of the extension's worker for a photo that it has seen with another separator.

  python -m benchmarks.blender.second_run PHOTO MASK [--size 512] [--repeats 3]

Runs `isc decompose` as the worker does, on one core: first with an empty cache, then with another
separator, without and with that cache. Prints the medians, and the size of the cache.

Limits: processor time, so that other programs hardly change it, by some tenths of a second if they
use the memory.
"""

import argparse
import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.program import run_program

_FIRST, _SECOND = "isc", "yang_2010"


def processor_time(words: list[str]) -> float:
    """Run `isc` on one core.

    Parameters
    ----------
    words : list of str
        Arguments.

    Returns
    -------
    float
        Seconds of user and system time.
    """
    one = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "isc_core", *words, "--threads", "1", "--quiet"]
    subprocess.run(command, check=True, env=os.environ | one, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def main() -> None:
    """Measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("photo")
    parser.add_argument("mask")
    parser.add_argument("--size", default="512")
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    times: dict[str, list[float]] = {"first": [], "second": [], "second, with cache": []}
    with tempfile.TemporaryDirectory() as folder:
        cache, output = Path(folder) / "cache", str(Path(folder) / "result")
        words = ["decompose", options.photo, "--mask", options.mask, "--max-size", options.size]
        words += ["--arrays", "--texture-size", "photo", "-o", output, "--separator"]
        kept = ["--cache", str(cache)]
        for _ in range(options.repeats):
            shutil.rmtree(cache, ignore_errors=True)
            for name, more in zip(
                times, ([_FIRST, *kept], [_SECOND], [_SECOND, *kept]), strict=True
            ):
                times[name].append(processor_time([*words, *more]))
        size = sum(file.stat().st_size for file in cache.iterdir())
    for name, seconds in times.items():
        print(f"{name}: {statistics.median(seconds):.1f} s")
    print(f"cache: {size / 1e6:.1f} MB")


if __name__ == "__main__":
    run_program(main)
