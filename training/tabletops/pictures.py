"""Rendered pictures of objects on tables, with the coverage by each object, and their files.

Equation: path tracing with up to three bounces; coverage is the share of a pixel's rays that meet
an object first.

Citation: J. T. Kajiya 1986, doi:10.1145/15922.15902.

Limits: light above twice white is stored as twice white.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from isc_core.errors import InputError
from isc_core.io.atomic import new_file
from isc_core.networks.mask_network import Count
from synth.scene.variant import load_mitsuba

from ..archives import open_archive
from .scenes import TabletopScene

SIDE = 192  # of a picture, pixels
RANDOM: Mapping[str, Any] = {"type": "independent"}  # rays of a pixel
CENTRES: Mapping[str, Any] = {"type": "stratified", "sample_count": 1, "jitter": False}
_RATIO = 0.75  # of the sides
_COVER_RAYS = 8  # of a pixel
_BOUNCES = 4  # path length
_BRIGHTEST = 2.0  # light of the code 255
_MIDDLE, _UPPER = 0.2, 0.7  # of white: median of the objects, a bright quantile of the picture
_UPPER_QUANTILE = 0.85
_LEAST, _MOST = 0.015, 0.75  # share of the picture that the objects cover
_LEAST_OF_EACH = 0.006  # the same, of each of several
_UNSEEN = 5e-4  # the same, of an object outside the picture
_SAME = 1e-3  # difference of equal depths, of the depth


@dataclass(frozen=True, eq=False)
class TabletopPicture:
    """A picture and its ground truth.

    Attributes
    ----------
    codes : (H, W, 3) uint8 ndarray
        255 sqrt(light / 2), light of white 1.
    covers : (H, W, N) uint8 ndarray
        Coverage by each of the objects in front, 255 for all of a pixel; N may be 0.
    scene : str
        Name of the file: its pictures show the same objects from elsewhere.
    """

    codes: np.ndarray
    covers: np.ndarray
    scene: str = ""

    @property
    def light(self) -> np.ndarray:
        """Linear light (H, W, 3), float32, at most 2."""
        return np.square(self.codes.astype(np.float32) / 255) * np.float32(_BRIGHTEST)

    @property
    def cover(self) -> np.ndarray:
        """Coverage (H, W) by all objects, float32, 0 to 1."""
        return np.minimum(self.covers.sum(axis=2, dtype=np.float32) / 255, np.float32(1))

    @property
    def count(self) -> Count:
        """How many objects are shown."""
        return Count(min(self.covers.shape[2], int(Count.SEVERAL)))


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
        Without those in which objects are too small, or fill nearly all, or do not stay outside.
    """
    mi = load_mitsuba()
    whole = mi.load_dict(scene.mitsuba)
    alone = [mi.load_dict({"type": "scene", one: scene.mitsuba[one]}) for one in scene.objects]
    found = []
    for k in range(len(scene.sensors)):
        camera = film_camera(scene, k, side)
        covers = _covers(whole, alone, camera, seed)
        if not shows_objects((covers > 0.5).mean(axis=(0, 1)), scene.count):
            continue
        light = path_traced(whole, camera, paths, seed + k)
        if np.isfinite(light).all():
            found.append(_picture(light, covers if scene.count != Count.NONE else covers[..., :0]))
    return found


def film_camera(
    scene: TabletopScene, number: int, side: int, sampler: Mapping[str, Any] = RANDOM
) -> Any:
    """Load one of a scene's cameras.

    Parameters
    ----------
    scene : TabletopScene
    number : int
        Of the camera.
    side : int
        Longer side of its pictures, pixels.
    sampler : mapping, optional
        For `mitsuba.load_dict`.

    Returns
    -------
    mitsuba.Sensor
    """
    size = (side, round(_RATIO * side))
    width, height = size if scene.landscape else size[::-1]
    film = {"type": "hdrfilm", "width": width, "height": height, "pixel_format": "rgb"}
    return load_mitsuba().load_dict(
        {
            **scene.sensors[number],
            "film": {**film, "rfilter": {"type": "box"}},
            "sampler": dict(sampler),
        }
    )


def path_traced(scene: Any, camera: Any, paths: int, seed: int) -> np.ndarray:
    """Render the light of a scene.

    Parameters
    ----------
    scene : mitsuba.Scene
    camera : mitsuba.Sensor
    paths : int
        Of each pixel.
    seed : int

    Returns
    -------
    (H, W, 3) ndarray
        Linear.
    """
    mi = load_mitsuba()
    integrator = mi.load_dict({"type": "path", "max_depth": _BOUNCES})
    return np.array(mi.render(scene, sensor=camera, integrator=integrator, spp=paths, seed=seed))


def shows_objects(shares: np.ndarray, count: Count) -> bool:
    """Return whether a picture shows its objects neither too small nor too large.

    Parameters
    ----------
    shares : (N,) ndarray
        Of its pixels that show each object.
    count : Count
        Of objects that it should show.

    Returns
    -------
    bool
    """
    if count == Count.NONE:
        return bool(shares.sum() < _UNSEEN)
    some = count == Count.ONE or bool((shares > _LEAST_OF_EACH).all())
    return some and bool(_LEAST < shares.sum() < _MOST)


def first_hits(of_object: np.ndarray, of_scene: np.ndarray) -> np.ndarray:
    """Return which rays meet an object first.

    Parameters
    ----------
    of_object, of_scene : (H, W) ndarray
        Depth of the object alone, 0 where a ray misses it, and of the whole scene.

    Returns
    -------
    (H, W) ndarray of bool
    """
    return (of_object > 0) & (np.abs(of_object - of_scene) < _SAME * of_object)


def exposure(light: np.ndarray, shown: np.ndarray) -> float:
    """Return the factor that exposes a picture.

    Parameters
    ----------
    light : (H, W, 3) ndarray
        Linear.
    shown : (H, W) ndarray of bool
        The objects.

    Returns
    -------
    float
    """
    upper = float(np.quantile(light.mean(axis=2), _UPPER_QUANTILE)) / _UPPER
    middle = float(np.median(light[shown].mean(axis=1))) / _MIDDLE if shown.any() else 0.0
    return 1 / max(middle, upper, 1e-6)


def _covers(whole: Any, alone: list[Any], camera: Any, seed: int) -> np.ndarray:
    """The shares (H, W, N) of rays that meet each object first: its depth is that of the scene."""
    mi = load_mitsuba()
    depth = mi.load_dict({"type": "aov", "aovs": "depth:depth"})
    total = 0.0
    for k in range(_COVER_RAYS):
        of_scene, *of_objects = (
            np.array(mi.render(scene, sensor=camera, integrator=depth, spp=1, seed=seed + k))[
                ..., -1
            ]
            for scene in (whole, *alone)
        )
        seen = [first_hits(one, of_scene) for one in of_objects]
        total = total + np.stack(seen, axis=-1).astype(float)
    return np.asarray(total / _COVER_RAYS)


def _picture(light: np.ndarray, covers: np.ndarray) -> TabletopPicture:
    factor = exposure(light, covers.sum(axis=2) > 0.5)
    shares = np.clip(light * factor / _BRIGHTEST, 0, 1)
    return TabletopPicture(
        np.rint(255 * np.sqrt(shares)).astype(np.uint8), np.rint(255 * covers).astype(np.uint8)
    )


def write_pictures(path: Path, pictures: list[TabletopPicture]) -> None:
    """Write the pictures of a scene, which may be none.

    Parameters
    ----------
    path : Path
    pictures : list of TabletopPicture
    """
    arrays = {f"codes_{k}": one.codes for k, one in enumerate(pictures)}
    arrays |= {f"covers_{k}": one.covers for k, one in enumerate(pictures)}
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
        raise InputError(f"{folder} has no pictures: make them by python -m training.tabletops")
    for path in paths:
        with open_archive(path, "a file of pictures", "delete it and render again") as arrays:
            found = [
                TabletopPicture(arrays[f"codes_{k}"], arrays[f"covers_{k}"], path.stem)
                for k in range(int(arrays["number"]))
            ]
        yield from found
