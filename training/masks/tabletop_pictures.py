"""Render pictures of objects on tables, with the coverage by the object in front.

  python -m training.masks.tabletop_pictures WORLD --panoramas DIR [--count N] [--held-out]
  [--built N] [--furniture DIR] -o FOLDER

WORLD, a folder of `isc world build`, has the patterns. FOLDER receives one file a scene, with four
pictures of 192 pixels; an interrupted run continues. Objects and panoramas are those that networks
learn from, or with --held-out the others. `training.masks.mask_network --tabletops FOLDER` learns
from them; `benchmarks.decomposition.automatic_mask --tabletops FOLDER` measures masks on them.

Equation: path tracing with up to three bounces; coverage is the share of a pixel's rays that meet
the object first.

Citation: J. T. Kajiya 1986, doi:10.1145/15922.15902.

Limits: 32 paths a pixel leave noise; light above twice white is stored as twice white.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from isc_core.cli.interface.values import count
from isc_core.errors import InputError
from isc_core.io.atomic import new_file
from synth.scene.variant import load_mitsuba

from ..archives import open_archive
from ..world.bodies.sources import BodyFolders, body_names
from ..world.files import Split, read_patterns, split_of
from .ingredients import panoramas_in
from .tabletop_scenes import OBJECT, TabletopScene, TabletopScenes

SIDE, PATHS = 192, 32  # of a picture, pixels; of a pixel
_RATIO = 0.75  # of the sides
_LEAST_SIDE = 32
_COVER_RAYS = 8  # of a pixel
_BOUNCES = 4  # path length
_BRIGHTEST = 2.0  # light of the code 255
_MIDDLE, _UPPER = 0.2, 0.7  # of white: median of the object, a bright quantile of the picture
_UPPER_QUANTILE = 0.85
_LEAST, _MOST = 0.015, 0.75  # share of the picture that the object covers
_SAME = 1e-3  # of the depth


@dataclass(frozen=True)
class TabletopPicture:
    """A picture and its ground truth.

    Attributes
    ----------
    codes : (H, W, 3) uint8 ndarray
        255 sqrt(light / 2), light of white 1.
    cover : (H, W) uint8 ndarray
        Coverage by the object in front, 255 for all of a pixel.
    """

    codes: np.ndarray
    cover: np.ndarray

    @property
    def light(self) -> np.ndarray:
        """Linear light (H, W, 3), float32, at most 2."""
        return np.square(self.codes.astype(np.float32) / 255) * np.float32(_BRIGHTEST)


def rendered(scene: TabletopScene, side: int, paths: int, seed: int) -> list[TabletopPicture]:
    """Render the pictures of a scene.

    Parameters
    ----------
    scene : TabletopScene
    side : int
        Of the longer side, pixels.
    paths : int
        Of each pixel.
    seed : int

    Returns
    -------
    list of TabletopPicture
        Without those in which the object is too small or fills nearly all.
    """
    mi = load_mitsuba()
    whole = mi.load_dict({**scene.mitsuba, "integrator": {"type": "path", "max_depth": _BOUNCES}})
    alone = mi.load_dict({"type": "scene", OBJECT: scene.mitsuba[OBJECT]})
    size = (side, round(_RATIO * side))
    width, height = size if scene.landscape else size[::-1]
    film = {"type": "hdrfilm", "width": width, "height": height, "pixel_format": "rgb"}
    found = []
    for k, sensor in enumerate(scene.sensors):
        camera = mi.load_dict(
            {
                **sensor,
                "film": {**film, "rfilter": {"type": "box"}},
                "sampler": {"type": "independent"},
            }
        )
        cover = _cover(whole, alone, camera, seed)
        if not _LEAST < (cover > 0.5).mean() < _MOST:
            continue
        light = np.array(mi.render(whole, sensor=camera, spp=paths, seed=seed + k))
        if np.isfinite(light).all():
            found.append(_picture(light, cover))
    return found


def _cover(whole: Any, alone: Any, camera: Any, seed: int) -> np.ndarray:
    """The share (H, W) of rays that meet the object first: its depth is that of the scene."""
    mi = load_mitsuba()
    depth = mi.load_dict({"type": "aov", "aovs": "depth:depth"})
    total = 0.0
    for k in range(_COVER_RAYS):
        of_object, of_scene = (
            np.array(mi.render(scene, sensor=camera, integrator=depth, spp=1, seed=seed + k))[
                ..., -1
            ]
            for scene in (alone, whole)
        )
        seen = (of_object > 0) & (np.abs(of_object - of_scene) < _SAME * of_object)
        total = total + seen.astype(float)
    return np.asarray(total / _COVER_RAYS)


def _picture(light: np.ndarray, cover: np.ndarray) -> TabletopPicture:
    middle = float(np.median(light[cover > 0.5].mean(axis=1))) / _MIDDLE
    upper = float(np.quantile(light.mean(axis=2), _UPPER_QUANTILE)) / _UPPER
    shares = np.clip(light / max(middle, upper, 1e-6) / _BRIGHTEST, 0, 1)
    return TabletopPicture(
        np.rint(255 * np.sqrt(shares)).astype(np.uint8), np.rint(255 * cover).astype(np.uint8)
    )


def write_pictures(path: Path, pictures: list[TabletopPicture]) -> None:
    """Write the pictures of a scene, which may be none.

    Parameters
    ----------
    path : Path
    pictures : list of TabletopPicture
    """
    arrays = {f"codes_{k}": one.codes for k, one in enumerate(pictures)}
    arrays |= {f"cover_{k}": one.cover for k, one in enumerate(pictures)}
    with new_file(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, number=np.array(len(pictures)), **arrays)


def read_pictures(folder: Path) -> Iterator[TabletopPicture]:
    """Read all pictures of a folder, in the order of their scenes.

    Parameters
    ----------
    folder : Path

    Yields
    ------
    TabletopPicture

    Raises
    ------
    InputError
        If there is none, or a file is damaged.
    """
    paths = sorted(folder.glob("*.npz"))
    if not paths:
        raise InputError(
            f"{folder} has no pictures: make them by python -m training.masks.tabletop_pictures"
        )
    for path in paths:
        with open_archive(path, "a file of pictures", "delete it and render again") as arrays:
            found = [
                TabletopPicture(arrays[f"codes_{k}"], arrays[f"cover_{k}"])
                for k in range(int(arrays["number"]))
            ]
        yield from found


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
        pictures = rendered(scenes.draw(np.random.default_rng([seed, k])), size, PATHS, seed + k)
        write_pictures(path, pictures)
        made += len(pictures)
    return made


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
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
    wanted = Split.UNSEEN_BODY if given.held_out else Split.TRAIN
    try:
        listed = body_names(BodyFolders(given.furniture, None, None), given.seed, given.built, 0)
        references = [one for one in listed if split_of(one.name) == wanted]
        if not references:
            raise InputError("no object is left: raise --built, or name a folder by --furniture")
        panoramas = list(panoramas_in(given.panoramas, 0, held_out=given.held_out))
        atlas = read_patterns(given.world)
        given.output.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory() as folder:
            scenes = TabletopScenes(references, panoramas, atlas, Path(folder))
            made = render_folder(scenes, given.output, given.count, given.seed, given.size)
    except InputError as error:
        parser.error(str(error))
    print(f"{given.output}: {made} pictures rendered")


if __name__ == "__main__":
    main()
