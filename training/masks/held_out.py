"""Composites of held-out objects and panoramas, at a higher resolution than the network's.

Problem: thresholds and errors of the mask network need photos with known masks, of objects and
backgrounds that no training run has used.

The objects and panoramas that every training run leaves out are halved: part A is for choosing
thresholds, part B is the test set. No object or panorama, as background or as light, is in both.
Masked photos of real objects, or photographs of cut-out things, can replace the rendered objects.

Limits: objects are rendered at 160 pixels and panoramas have 512 columns: both are blurred.
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from torch.nn.functional import pad

from isc_core.errors import InputError
from isc_core.networks.mask_network import Count
from isc_core.photo import read_photo

from ..networks.scene_batches import read_world
from ..tabletops.pictures import read_pictures
from ..world.backgrounds import panoramas_in
from ..world.camera import BLOCK
from ..world.files import Split, half_of
from .composites import CompositeDraws, Composites, as_photographed, draw_cameras
from .difficulty import SIMPLE, Difficulty
from .ingredients import cut_out, lit_cutouts
from .packs import Ingredients
from .photo_cutouts import Part, photo_cutouts, read_cut_photos

SIDE = 320  # pixels of a composite's longer side
_CUTOUT_SIDE = 256  # pixels
_BATCH = 8
_LEAST = 200  # pixels of a target
PARTS = (Part.CHOICE, Part.TEST)


@dataclass(frozen=True, eq=False)
class HeldOut:
    """A composite with its ground truth.

    Attributes
    ----------
    light : (H, W, 3) float32 ndarray
        Linear, 1 is white.
    cover : (H, W) float32 ndarray
        Coverage by the target; by all objects if there are several.
    count : Count
    scene : str
        Equal for photos of the same objects; empty if there is one photo of them.
    """

    light: np.ndarray
    cover: np.ndarray
    count: Count
    scene: str = ""


def held_out_ingredients(
    world: Path, panoramas: Path, part: str, photos: Path | None = None, seed: int = 0
) -> Ingredients:
    """Render held-out objects, and read held-out panoramas.

    Parameters
    ----------
    world, panoramas : Path
    part : {"A", "B"}
    photos : Path, optional
        Folder of masked photos to use in place of rendered objects.
    seed : int

    Returns
    -------
    Ingredients

    Raises
    ------
    InputError
        If a folder cannot be used.
    """
    half, rng = PARTS.index(part), np.random.default_rng([seed, 11, PARTS.index(part)])
    torch.manual_seed(seed)
    kept = panoramas_in(panoramas, held_out=True)[half::2]
    if not len(kept):
        raise InputError(
            f"{panoramas} has too few panoramas to hold one out for part {part}: twelve are enough"
        )
    found = read_world([world], panoramas, (Split.UNSEEN_BODY,), seed)
    if photos is not None:
        cutouts = [masked_cutout(path) for path in sorted(photos.glob("*.png"))]
    else:
        bodies = found.views[Split.UNSEEN_BODY]
        bodies[:] = [one for one in bodies if half_of(one.name) == half]
        if not bodies:
            raise InputError(f"{world} has no held-out bodies for part {part}: build more bodies")
        light = found.held_out_environments[half::2]  # in the order of `kept`
        cutouts = list(lit_cutouts(found, Split.UNSEEN_BODY, light, rng, _CUTOUT_SIDE))
    return Ingredients(np.stack(cutouts), kept, found.atlas.maps)


def held_out_cut_photos(
    ingredients: Ingredients, folder: Path, part: str, without: Collection[str] = ()
) -> Ingredients:
    """Replace rendered objects by photographs of cut-out things that no training run has seen.

    Parameters
    ----------
    ingredients : Ingredients
    folder : Path
        See `photo_cutouts`.
    part : {"A", "B"}
    without : collection of str
        Names of folders to leave out.

    Returns
    -------
    Ingredients

    Raises
    ------
    InputError
        If the folder cannot be used.
    """
    cutouts = photo_cutouts(read_cut_photos(folder, without), Part(part), _CUTOUT_SIDE)
    return replace(ingredients, cutouts=cutouts)


def masked_cutout(path: Path) -> np.ndarray:
    """Read a masked photo as a cut-out.

    Parameters
    ----------
    path : Path

    Returns
    -------
    (4, 256, 256) uint8 ndarray
        As in `Ingredients.cutouts`.
    """
    photo = read_photo(path)
    light = torch.from_numpy(photo.image).permute(2, 0, 1)[None]
    return next(cut_out(light, torch.from_numpy(photo.mask)[None, None].float(), _CUTOUT_SIDE))


def held_out_composites(
    ingredients: Ingredients,
    count: Count,
    number: int,
    seed: int,
    difficulty: Difficulty = SIMPLE,
) -> Iterator[HeldOut]:
    """Compose photos.

    Parameters
    ----------
    ingredients : Ingredients
    count : Count
        Of the objects in each photo.
    number : int
        Of photos.
    seed : int
    difficulty : Difficulty
        Shares of difficult photos.

    Yields
    ------
    HeldOut
    """
    shares = tuple(float(kind == count) for kind in Count)
    draw = CompositeDraws(_BATCH, hinted=0, shares=shares, difficulty=difficulty)
    compose = Composites(ingredients, draw, SIDE)
    rng, made = np.random.default_rng([seed, int(count)]), 0
    torch.manual_seed(seed)
    while made < number:
        batch = compose(rng)
        for k in range(min(_BATCH, number - made)):
            frame = batch.frame[k, 0].numpy() > 0
            place = np.ix_(frame.any(1), frame.any(0))
            light = batch.photo[k].permute(1, 2, 0).numpy()[place]
            yield HeldOut(light, batch.mask[k, 0].numpy()[place], count)
            made += 1


def held_out_tabletops(folder: Path, seed: int) -> Iterator[HeldOut]:
    """Photograph rendered pictures of objects on tables.

    Parameters
    ----------
    folder : Path
        Of `training.tabletops`, with held-out objects and panoramas.
    seed : int
        Of the cameras.

    Yields
    ------
    HeldOut

    Raises
    ------
    InputError
        If there is no picture, or a file is damaged.
    """
    rng = np.random.default_rng([seed, 12])
    torch.manual_seed(seed)
    for picture in read_pictures(folder):
        rows, columns = picture.codes.shape[:2]
        light = torch.from_numpy(picture.light).permute(2, 0, 1)[None]
        frame = torch.ones_like(light[:, :1])
        # whole blocks of JPEG
        light, frame = (pad(one, (0, -columns % BLOCK, 0, -rows % BLOCK)) for one in (light, frame))
        photo = as_photographed(light, frame, draw_cameras(rng, 1), light)
        whole = photo[0, :, :rows, :columns].permute(1, 2, 0).numpy()
        yield HeldOut(whole, picture.cover, picture.count, picture.scene)


def composites_of_targets(
    ingredients: Ingredients,
    shares: tuple[float, float, float],
    number: int,
    rng: np.random.Generator,
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Compose photos of which one object is the target; PyTorch's generator is used, too.

    Parameters
    ----------
    ingredients : Ingredients
    shares : tuple of float
        Of photos by `Count`.
    number : int
        Of photos.
    rng : numpy.random.Generator

    Yields
    ------
    light : (H, W, 3) float32 ndarray
        Linear, 1 is white.
    truth : (H, W) bool ndarray
        Mask of the target, of at least 200 pixels.
    """
    draw = CompositeDraws(_BATCH, hinted=1, shares=shares, backgrounds=(0, 0))
    compose, made = Composites(ingredients, draw, SIDE), 0
    while made < number:
        batch = compose(rng)
        for photo, frame, mask in zip(batch.photo, batch.frame, batch.mask, strict=True):
            place = np.ix_(*(frame[0].numpy().any(axis) for axis in (1, 0)))
            truth = mask[0].numpy()[place] >= 0.5
            if made < number and truth.sum() >= _LEAST:
                made += 1
                yield photo.permute(1, 2, 0).numpy()[place], truth
