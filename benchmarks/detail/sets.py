"""Write the measured sets: photos of bodies with relief, of smooth ones with print, and of others.

  python -m benchmarks.detail.sets FOLDER --panoramas DIR --part validation|lights|test
  [--camera good|phone] [--count N]

FOLDER gets `relief_NN`, `print_NN`, `mixed_NN`, `parts_NN` and `drawn_NN` (`rendering.SetKind`),
each with `photo.png` (the mask in alpha) and `truth.npz`. What is there already is kept. Methods
are chosen on `validation` and `lights`, figures reported on `test`. Half of the panoramas kept from
learning light the bodies of `validation`, half those of `test`; all others light the bodies of
`validation` once more in `lights`.
"""

import argparse
import json
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np
from PIL import Image

from isc_core.errors import InputError
from isc_core.io.atomic import new_folder
from training.world.environments import read_panoramas

from .cameras import Camera
from .rendering import DetailScene, SetKind, render

COUNT = 30
PHOTO, TRUTH, FACTS = "photo.png", "truth.npz", "facts.json"
_FILES = (TRUTH, PHOTO, FACTS)
_UNIT = 32767  # components of normals are stored in 16 bits


class Part(StrEnum):
    """What a set is for."""

    VALIDATION = "validation"
    LIGHTS = "lights"
    TEST = "test"


_SEEDS = {Part.VALIDATION: 0, Part.LIGHTS: 0, Part.TEST: 1}


@dataclass(frozen=True, eq=False)
class Truth:
    """What is known of a photo.

    Attributes
    ----------
    normal : (H, W, 3) float32 ndarray
        Unit, camera frame (x right, y up, z toward the viewer); 0 outside the mask.
    smooth : (H, W, 3) float32 ndarray
        Those of the body without relief.
    mask : (H, W) ndarray of bool
    """

    normal: np.ndarray
    smooth: np.ndarray
    mask: np.ndarray


def bodies_in(folder: Path, kind: SetKind) -> list[Path]:
    """List the bodies of a set.

    Parameters
    ----------
    folder : Path
    kind : SetKind

    Returns
    -------
    list of Path
        Folders, in order.

    Raises
    ------
    InputError
        If there is none.
    """
    found = sorted(path.parent for path in folder.glob(f"{kind}_*/{TRUTH}"))
    if not found:
        raise InputError(f"{folder} has no {kind}_*/{TRUTH}: write it with benchmarks.detail.sets")
    return found


def read_truth(body: Path) -> Truth:
    """Read the truth of a body.

    Parameters
    ----------
    body : Path
        Its folder.

    Returns
    -------
    Truth
    """
    with np.load(body / TRUTH, allow_pickle=False) as stored:
        mask = stored["mask"]
        pictures = []
        for name in ("normal", "smooth"):
            picture = np.zeros((*mask.shape, 3), np.float32)
            values = stored[name].astype(np.float32)
            picture[mask] = values / np.linalg.norm(values, axis=1, keepdims=True)
            pictures.append(picture)
    return Truth(pictures[0], pictures[1], mask)


def write_scene(folder: Path, scene: DetailScene) -> None:
    """Write a body.

    Parameters
    ----------
    folder : Path
        Of the set.
    scene : DetailScene

    Raises
    ------
    InputError
        If it cannot be written.
    """
    normals = {"normal": scene.normal, "smooth": scene.smooth}
    coded = {name: np.rint(_UNIT * p[scene.mask]).astype(np.int16) for name, p in normals.items()}
    with new_folder(folder / scene.name, _FILES) as partial:
        np.savez(partial / TRUTH, mask=scene.mask, **coded)
        alpha = np.where(scene.mask, 255, 0).astype(np.uint8)
        Image.fromarray(np.dstack([scene.codes, alpha])).save(partial / PHOTO)
        (partial / FACTS).write_text(json.dumps(scene.facts, indent=1), encoding="utf-8")


def write_set(
    folder: Path,
    panoramas: Path,
    part: Part,
    count: int = COUNT,
    camera: Camera = Camera.GOOD,
) -> Iterator[str]:
    """Write the bodies of a set that are not there yet.

    Parameters
    ----------
    folder : Path
    panoramas : Path
    part : Part
    count : int, optional
        Bodies of each kind.
    camera : Camera, optional

    Yields
    ------
    str
        The name of each body written.

    Raises
    ------
    InputError
        If the panoramas cannot be used or the folder cannot be written.
    """
    kept = part != Part.LIGHTS
    rooms = [one.radiance for one in read_panoramas(panoramas) if one.held_out == kept]
    if kept:
        rooms = rooms[part == Part.TEST :: 2]
    for number in range(count):
        for kind in SetKind:
            if (folder / f"{kind}_{number:02d}" / TRUTH).exists():
                continue
            scene = render(kind, _SEEDS[part], number, rooms, camera=camera)
            write_scene(folder, scene)
            yield scene.name


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    parser.add_argument("--panoramas", type=Path, required=True, metavar="DIR")
    parser.add_argument("--part", type=Part, required=True, choices=list(Part))
    parser.add_argument("--camera", type=Camera, default=Camera.GOOD, choices=list(Camera))
    parser.add_argument("--count", type=int, default=COUNT, help="default: %(default)s")
    given = parser.parse_args()
    names = write_set(given.folder, given.panoramas, given.part, given.count, given.camera)
    try:
        for name in names:
            print(name, flush=True)
    except InputError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
