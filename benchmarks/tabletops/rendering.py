"""Photos of objects on tables with the truth about them: mask, normals, and the diffuse layer.

Problem: composites and objects in a laboratory have neither a table that reflects light from below
and takes the light of half of the directions, nor a view from above by a short lens.

Equation: the scenes are those of `training.tabletops`. A ray through the centre of each pixel
decides whether it shows the object, and gives the normal there, turned toward the camera. The
scene is rendered twice, the second time with an object without specular reflection, whose diffuse
reflection is the same. The photo has 8 bits; its specular layer is its light minus the diffuse.

Citation: rough plastic: B. Walter et al. 2007, doi:10.2312/EGWR/EGSR07/195-206.

Limits: light that the table mirrors to the object from the object's own highlights counts as
specular. The paths are independent, so the specular layer has the noise of both.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from isc_core.imaging.srgb import srgb_codes, srgb_to_linear
from isc_core.photo import Photo, PhotoSource
from isc_core.photo.camera import Camera
from isc_core.shading.perspective import view_directions
from synth.scene.variant import load_mitsuba
from training.tabletops.pictures import (
    CENTRES,
    exposure,
    film_camera,
    first_hits,
    path_traced,
    shows_objects,
)
from training.tabletops.scenes import OBJECT, ONE_OBJECT, TabletopScene, TabletopScenes
from training.tabletops.sources import TabletopSources


@dataclass(frozen=True, eq=False)
class TabletopPhoto:
    """A photo and its ground truth.

    Attributes
    ----------
    photo : Photo
        With its camera.
    normal : (H, W, 3) ndarray
        Unit, camera frame (x right, y up, z toward the viewer), turned toward the camera; 0 outside
        the mask.
    diffuse : (H, W, 3) ndarray
        Linear light, at most that of the photo.
    glossy : bool
        Whether the object has a specular layer.
    """

    photo: Photo
    normal: np.ndarray
    diffuse: np.ndarray
    glossy: bool


def photographed(scene: TabletopScene, side: int, paths: int, seed: int) -> TabletopPhoto | None:
    """Render a scene as its first camera sees it.

    Parameters
    ----------
    scene : TabletopScene
        With one object.
    side : int
        Longer side of the photo, pixels.
    paths : int
        Of each pixel.
    seed : int

    Returns
    -------
    TabletopPhoto or None
        None where the object is too small, or fills nearly all.
    """
    mi, camera = load_mitsuba(), film_camera(scene, 0, side)
    width, height = (int(n) for n in camera.film().size())
    pixels = side / 2 / np.tan(np.radians(scene.sensors[0]["fov"] / 2))
    view = Camera.of_frame(float(pixels), (width, height))
    mask, normal = _mask_and_normals(scene, side, view)
    if not shows_objects(mask[..., None].mean(axis=(0, 1)), scene.count):
        return None
    matt = _without_gloss(scene.mitsuba[OBJECT])
    light, diffuse = (
        path_traced(mi.load_dict({**scene.mitsuba, OBJECT: one}), camera, paths, seed)
        for one in (scene.mitsuba[OBJECT], matt)
    )
    factor = exposure(light, mask)
    codes = srgb_codes((factor * light).astype(np.float32))
    image = srgb_to_linear(codes / 255).astype(np.float32)
    photo = Photo(
        image,
        mask,
        float(srgb_to_linear(1 / 255)),
        (codes == 255).any(axis=2),
        PhotoSource("", (width, height), 8, "srgb", "file"),
        camera=view,
    )
    glossy = matt != scene.mitsuba[OBJECT]
    return TabletopPhoto(photo, normal, np.minimum(factor * diffuse, image), glossy)


def photos_of(
    sources: TabletopSources, folder: Path, number: int, side: int, paths: int, seed: int
) -> Iterator[TabletopPhoto]:
    """Render scenes of one object until there are enough photos.

    Parameters
    ----------
    sources : TabletopSources
    folder : Path
        For the files of meshes.
    number : int
        Photos.
    side, paths : int
        As for `photographed`.
    seed : int
        Scene k depends on the seed and on k.

    Yields
    ------
    TabletopPhoto
    """
    made, k = 0, 0
    while made < number:
        # new ones for each scene: these would prefer the objects of earlier scenes
        scenes = TabletopScenes(sources, folder, cameras=1, shares=ONE_OBJECT)
        photo = photographed(scenes.draw(np.random.default_rng([seed, k])), side, paths, seed + k)
        if photo is not None:
            made += 1
            yield photo
        k += 1


def _without_gloss(shape: dict[str, Any]) -> dict[str, Any]:
    """The shape without specular reflection; the same where it has none."""
    side = shape["bsdf"]["side"]
    if side["type"] != "roughplastic":
        return shape
    matt = {**side, "specular_reflectance": {"type": "rgb", "value": 0.0}}
    return {**shape, "bsdf": {**shape["bsdf"], "side": matt}}


def _mask_and_normals(
    scene: TabletopScene, side: int, view: Camera
) -> tuple[np.ndarray, np.ndarray]:
    """Where (H, W) the object is seen first, and its normals (H, W, 3), camera frame."""
    mi, camera = load_mitsuba(), film_camera(scene, 0, side, CENTRES)
    seen = mi.load_dict({"type": "aov", "aovs": "t:depth,flat:geo_normal,smooth:sh_normal"})
    alone = {"type": "scene", OBJECT: scene.mitsuba[OBJECT]}
    hit, first = (
        np.array(mi.render(mi.load_dict(one), sensor=camera, integrator=seen, spp=1))[..., -7:]
        for one in (alone, scene.mitsuba)
    )
    mask = first_hits(hit[..., 0], first[..., 0])
    left, up, forward = np.array(scene.sensors[0]["to_world"].matrix)[:3, :3].T
    flat, smooth = (hit[..., k : k + 3] @ np.stack([-left, up, -forward], axis=1) for k in (1, 4))
    away = (flat * view_directions(view, (mask.shape[0], mask.shape[1]))).sum(axis=2) < 0
    return mask, np.where(mask[..., None], np.where(away[..., None], -smooth, smooth), 0)
