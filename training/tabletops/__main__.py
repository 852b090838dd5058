"""Render pictures of objects on tables, with the coverage by each object.

  python -m training.tabletops WORLD --panoramas DIR [--count N] [--held-out]
  [--built N] [--furniture DIR] -o FOLDER

WORLD, a folder of `isc world build`, has the patterns. FOLDER receives one file a scene, with four
pictures of 192 pixels; an interrupted run continues. Objects and panoramas are those that networks
learn from, or with --held-out the others. `training.masks.mask_network --tabletops FOLDER` learns
from them; `benchmarks.decomposition.automatic_mask --tabletops FOLDER` measures masks on them.
"""

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from isc_core.cli.interface.values import count
from isc_core.errors import InputError

from .pictures import SIDE, rendered, write_pictures
from .scenes import TabletopScenes
from .sources import TabletopSources

_LEAST_SIDE = 32
_PATHS = 32  # of a pixel


def render_folder(scenes: TabletopScenes, folder: Path, number: int, seed: int, size: int) -> int:
    """Render scenes into a folder that may hold some of them already.

    Parameters
    ----------
    scenes : TabletopScenes
    folder : Path
    number : int
        Of scenes.
    seed : int
        Scene k depends on the seed, k, and the objects of scenes before it in the same run.
    size : int
        Longer side of a picture, pixels.

    Returns
    -------
    int
        Number of pictures rendered.
    """
    made = 0
    for k in range(number):
        path = folder / f"{k:05d}.npz"
        if path.exists():
            continue
        pictures = rendered(scenes.draw(np.random.default_rng([seed, k])), size, _PATHS, seed + k)
        write_pictures(path, pictures)
        made += len(pictures)
    return made


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m training.tabletops",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("world", type=Path, metavar="WORLD", help="folder of isc world build")
    add("--panoramas", type=Path, required=True, metavar="DIR", help="panoramas")
    add("--count", type=count, default=1000, help="scenes (default: %(default)s)")
    add("--held-out", action="store_true", help="objects and panoramas that no network learns from")
    add("--built", type=count, default=4000, help="objects built (default: %(default)s)")
    add("--furniture", type=Path, metavar="DIR", help="folder of Sweet Home 3D catalogues (.sh3f)")
    add("--size", type=count, default=SIDE, help="longer side, pixels (default: %(default)s)")
    add("--seed", type=count, default=0, help="default: %(default)s")
    add("-o", "--output", type=Path, required=True, metavar="FOLDER", help="where to write")
    given = parser.parse_args()
    if given.size < _LEAST_SIDE:
        parser.error(f"--size {given.size}: pictures have {_LEAST_SIDE} pixels or more")
    try:
        sources = TabletopSources.read(
            given.world, given.panoramas, given.built, given.furniture, given.seed, given.held_out
        )
        given.output.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory() as folder:
            scenes = TabletopScenes(sources, Path(folder))
            made = render_folder(scenes, given.output, given.count, given.seed, given.size)
    except InputError as error:
        parser.error(str(error))
    print(f"{given.output}: {made} pictures rendered")


if __name__ == "__main__":
    main()
