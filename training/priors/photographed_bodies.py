"""Bodies of a world as objects to fit priors to: traced anew at the size at which SIRFS is solved,
painted, and photographed.

Problem: statistics are per pixel, so they hold at one size. The views of a world are smaller than
the solver's image, and their depth is too coarse for curvature.

Equation: a height in pixels is smooth between two neighbours if its step is near what their
normals say, |dz - (s_p + s_q) / 2| <= 1 + |s_p + s_q| / 4 with s the slopes along the step; the
curvature of a body is not measured across other steps. Reflectance is the paint as a camera sees
it: with blur, noise and JPEG, over the exposure.

Limits: bodies that the world makes itself (`built` and `family`), since the files of others are
not kept; paint is photographed in even light.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from isc_core.errors import InputError
from isc_core.prior_fitting.statistics import TrainingObject
from isc_core.sirfs.recover import SOLVE_SIZE
from synth.scene.meshes import Mesh
from synth.scene.tracing import Hits, Tracer

from ..world.bodies.sources import BodyFolders, BodyReference, body_names
from ..world.camera import draw_camera, exposed, photographed
from ..world.files import SETTINGS, Split, split_of
from ..world.patterns import Atlas
from ..world.pictures import Bank, material_of, stacked
from ..world.recipes import Shares, draw_recipe
from ..world.view_batches import ViewBatch
from ..world.views import DIRECTIONS, FILL, camera_rays, in_picture, random_side, spread_directions

SIDE = 16 * round(SOLVE_SIZE / FILL / 16)  # of a picture, whose object is about SOLVE_SIZE long
_WHITE = 0.98
_STEEPEST = 0.03  # cosine toward the viewer: steeper normals are those of the outline
_PAINT = Shares(kinds=(1, 0, 0))


@dataclass(frozen=True)
class Painter:
    """What bodies are painted with.

    Parameters
    ----------
    atlas : Atlas
    """

    atlas: Atlas

    def paint(self, hits: Hits, rng: np.random.Generator) -> np.ndarray:
        """Paint a body.

        Parameters
        ----------
        hits : Hits
            Of all pixels.
        rng : numpy.random.Generator

        Returns
        -------
        (N, 3) ndarray
            Linear albedo of the pixels that the body covers.
        """
        recipe = draw_recipe(
            spread_directions(rng), np.zeros(3), self.atlas, np.array([0]), rng, _PAINT
        )
        patterns = torch.from_numpy(self.atlas.maps[:, None]).float() / 255
        material = material_of(_as_batch(hits), stacked([recipe]), Bank(torch.zeros(0), patterns))
        return np.asarray(material.albedo[0].numpy())


def made_bodies(built: int, families: int, count: int, seed: int) -> list[BodyReference]:
    """Choose training bodies that a world makes itself.

    Parameters
    ----------
    built, families : int
        Numbers of the world's settings.
    count : int
    seed : int

    Returns
    -------
    list of BodyReference
    """
    folders = BodyFolders(None, None, None)
    listed = body_names(folders, seed, built, families)
    return [one for one in listed if split_of(one.name) is Split.TRAIN][:count]


def training_object(
    reference: BodyReference, painter: Painter, rng: np.random.Generator
) -> TrainingObject | None:
    """Trace, paint and photograph a body.

    Parameters
    ----------
    reference : BodyReference
    painter : Painter
    rng : numpy.random.Generator

    Returns
    -------
    TrainingObject or None
        None if the body cannot be made or covers too little.
    """
    try:
        bodies = reference.load()
    except InputError:
        return None
    if not bodies:
        return None
    hits = _traced(bodies[0].mesh, rng)
    mask = hits.valid.reshape(SIDE, SIDE)
    if mask.mean() < 0.05:
        return None
    height = np.where(hits.valid, hits.position[:, 2], np.nan).reshape(SIDE, SIDE) * (SIDE / 2)
    albedo = np.zeros((SIDE * SIDE, 3), np.float32)
    albedo[hits.valid] = painter.paint(hits, rng)
    reflectance, clipped = _photographed(albedo.reshape(SIDE, SIDE, 3), mask, rng)
    rough = height_steps(height, hits.normal.reshape(SIDE, SIDE, 3))
    return TrainingObject(
        reference.name,
        reflectance,
        mask & ~clipped,
        np.where(rough, np.nan, height),
        mask,
    )


def height_steps(height: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Find where a height jumps.

    Parameters
    ----------
    height : (H, W) ndarray
        Pixels toward the viewer, NaN off the body.
    normal : (H, W, 3) ndarray
        Unit, camera frame.

    Returns
    -------
    (H, W) ndarray of bool
        The pixels on both sides of each jump.
    """
    found = np.zeros(height.shape, bool)
    up = np.maximum(normal[..., 2], _STEEPEST)
    for axis, slope in ((0, normal[..., 1] / up), (1, -normal[..., 0] / up)):
        near, far = (np.take(height, _range(height, axis, k), axis) for k in (0, 1))
        expected = sum(np.take(slope, _range(height, axis, k), axis) for k in (0, 1))
        off = np.abs(far - near - expected / 2) > 1 + np.abs(expected) / 4
        for k in (0, 1):
            index = [slice(None), slice(None)]
            index[axis] = slice(k, height.shape[axis] - 1 + k)
            found[tuple(index)] |= off
    return found


def _range(height: np.ndarray, axis: int, start: int) -> np.ndarray:
    return np.arange(start, height.shape[axis] - 1 + start)


def _traced(mesh: Mesh, rng: np.random.Generator) -> Hits:
    placed = in_picture(mesh.rotated(random_side(rng)[0]), np.inf)
    origins, rays = camera_rays(SIDE, np.inf)
    return Tracer(placed).hits(origins, rays)


def _as_batch(hits: Hits) -> ViewBatch:
    """The pixels that a body covers, as far as paint needs them."""
    position, normal = (
        torch.from_numpy(part[hits.valid]).float()[None] for part in (hits.position, hits.normal)
    )
    count = position.shape[1]
    return ViewBatch(
        torch.zeros((1, count), dtype=torch.int64),
        normal,
        position,
        normal,
        torch.zeros((1, count)),
        torch.zeros((1, count, 0), dtype=torch.uint8),
        torch.zeros((1, DIRECTIONS, 3)),
        torch.ones((1, DIRECTIONS)),
    )


def _photographed(
    albedo: np.ndarray, mask: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """The albedo as a camera sees it, and where it is clipped."""
    camera = {
        name: torch.tensor([float(value)]) for name, value in draw_camera(rng).__dict__.items()
    }
    torch.manual_seed(int(rng.integers(2**31)))
    light = torch.from_numpy(albedo).permute(2, 0, 1)[None]
    known = torch.from_numpy(mask)[None, None].float()
    gain = exposed(light, known, camera["exposure"])
    photo = photographed(light * gain, known, camera)[0].permute(1, 2, 0).numpy()
    clipped = photo.max(axis=-1) >= _WHITE
    return np.where(mask[..., None], photo / float(gain), 0).astype(float), clipped


def read_settings(world: Path) -> tuple[int, int]:
    """Read how many bodies a world makes.

    Parameters
    ----------
    world : Path
        Folder of `isc world build`.

    Returns
    -------
    built, families : int

    Raises
    ------
    InputError
        If the folder is no world.
    """
    try:
        found = json.loads((world / SETTINGS).read_text(encoding="utf-8"))
        return int(found["built"]), int(found["families"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{world} is no world: give a folder of 'isc world build'") from error
