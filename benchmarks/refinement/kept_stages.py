"""What it costs and gains to keep the stages of `isc decompose --refine`.

  python -m benchmarks.refinement.kept_stages PHOTO ... [--max-size N] [--highlight-odds N]

Prints a line for each photo, in seconds of processor time: the decomposition; the refinement
without and with kept stages, and that with the stages of a complete one, medians of `_RUNS`; and
the digest of the result, which is part of the latter two. The last figure is the size of the stages
in kB.
"""

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.program import run_program
from isc_core.decomposition.pipeline import decompose
from isc_core.decomposition.settings import Settings
from isc_core.imaging.bounding_box import mask_box
from isc_core.io.checkpoint import Checkpoint
from isc_core.masking.finder import MaskSearch
from isc_core.photo import read_photo
from isc_core.refinement import refine_gloss
from isc_core.refinement.gloss_note import gloss_line
from isc_core.scene.decomposition import Decomposition
from isc_core.scene.result_digest import result_digest

_RUNS = 3


def times_of(d: Decomposition, folder: Path) -> tuple[float, float, float, float, float]:
    """Measure the refinement of a result.

    Parameters
    ----------
    d : Decomposition
    folder : Path
        Empty.

    Returns
    -------
    tuple of float
        Seconds without kept stages, with them, with those of a complete refinement, and of the
        digest; kB of the stages.
    """

    def keeping() -> None:
        Checkpoint(folder / "out").remove()
        refine_gloss(d, kept=Checkpoint(folder / "out"))

    plain, first = _seconds(lambda: refine_gloss(d)), _seconds(keeping)
    size = sum(file.stat().st_size for file in Checkpoint(folder / "out").folder.glob("*"))
    again = _seconds(lambda: refine_gloss(d, kept=Checkpoint(folder / "out")))
    return plain, first, again, _seconds(lambda: result_digest(d)), size / 1e3


def _seconds(work: Callable[[], object]) -> float:
    times = []
    for _ in range(_RUNS):
        began = time.process_time()
        work()
        times.append(time.process_time() - began)
    return statistics.median(times)


def main() -> None:
    """Measure the photos of the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("photos", nargs="+", type=Path, metavar="PHOTO")
    parser.add_argument("--max-size", type=int, default=Settings.max_size)
    parser.add_argument("--highlight-odds", type=float, default=Settings.highlight_odds)
    given = parser.parse_args()
    settings = Settings(max_size=given.max_size, highlight_odds=given.highlight_odds)
    for path in given.photos:
        photo = read_photo(path, finder=MaskSearch())
        began = time.process_time()
        d = decompose(photo, settings, name=path.name)
        decomposition = time.process_time() - began
        with tempfile.TemporaryDirectory() as folder:
            plain, first, again, digest, size = times_of(d, Path(folder))
        line = gloss_line(refine_gloss(d).result.provenance.settings)
        print(
            f"{path.name}, {max(mask_box(d.mask)[2:])} pixels: {decomposition:.1f} s, refinement "
            f"{plain:.2f}, {first:.2f}, {again:.2f}, digest {digest:.3f}, {size:.0f} kB; {line}",
            flush=True,
        )


if __name__ == "__main__":
    run_program(main)
