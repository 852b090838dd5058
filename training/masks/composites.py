"""Photos of objects before backgrounds, with the mask of the target object.

Problem: a photo shows no object, one or several; others may be small in the background or cut by
the frame. Without hints, the target is the object in front; with hints, the object that they mark.

Equation: see `training.masks.pasting`. Then exposure, white balance, and the camera of
`training.world.camera`.

Random numbers are drawn in NumPy on the CPU, which determines all array shapes. Everything else
runs in batches on the device without synchronisation.

Limits: those of `training.masks.pasting` and `training.masks.backgrounds`.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch

from isc_core.networks.mask_network import Count

from ..world.camera import draw_camera, exposed, photographed
from ..world.random_draws import log_uniforms
from ..world.tensor_batch import TensorBatch
from .backgrounds import SHARES as BACKGROUND_SHARES
from .backgrounds import BackgroundDraws, Backgrounds, draw_backgrounds
from .bands import Bands, draw_bands, painted
from .defocus import Defocus, defocused, draw_defocus
from .difficulty import SIMPLE, Difficulty
from .hints import HintDraws, draw_hints, hint_maps, hinted
from .ingredients import LENGTH, SIDE
from .packs import Ingredients
from .pasting import CutOuts, shadows
from .scenes import MAX_OBJECTS, SHARES, PastedObjects, Scenes, draw_scenes
from .variation import (
    BackgroundVariation,
    ObjectVariation,
    draw_background_variation,
    matched_colours,
    varied_backgrounds,
    varied_objects,
)

_GREY = 0.04  # share of monochrome photos


@dataclass(frozen=True, eq=False)
class Composite(TensorBatch):
    """A batch of photos with their masks.

    Attributes
    ----------
    photo : (B, 3, SIDE, SIDE) tensor
        Linear light, 0 outside the frame.
    frame : (B, 1, SIDE, SIDE) tensor
        1 inside the photo.
    hints : (B, 3, SIDE, SIDE) tensor
        Points on the object, points on the background, the box.
    mask : (B, 1, SIDE, SIDE) tensor
        Coverage by the targets.
    count : (B,) int64 tensor
        Values of `isc_core.networks.mask_network.Count`.
    """

    photo: torch.Tensor
    frame: torch.Tensor
    hints: torch.Tensor
    mask: torch.Tensor
    count: torch.Tensor


@dataclass(frozen=True, eq=False)
class Cameras(TensorBatch):
    """White balance, and the attributes of `CameraDraw`, one for each photo.

    Attributes
    ----------
    balance : (B, 3) tensor
    grey : (B,) bool tensor
        The photo is monochrome.
    """

    balance: torch.Tensor
    grey: torch.Tensor
    exposure: torch.Tensor
    blur: torch.Tensor
    noise: torch.Tensor
    floor: torch.Tensor
    sharpness: torch.Tensor
    contrast: torch.Tensor
    quality: torch.Tensor
    subsampled: torch.Tensor
    clips: torch.Tensor


@dataclass(frozen=True)
class CompositeDraw(TensorBatch):
    """All random variables of a batch.

    Attributes
    ----------
    scenes : Scenes
    objects : PastedObjects
    backgrounds : BackgroundDraws
    hints : HintDraws
    cameras : Cameras
    object_variation, background_variation : ObjectVariation, BackgroundVariation or None
        None: without variation.
    defocus : Defocus or None
        None: all backgrounds are sharp.
    bands : Bands or None
        None: on no object.
    """

    scenes: Scenes
    objects: PastedObjects
    backgrounds: BackgroundDraws
    hints: HintDraws
    cameras: Cameras
    object_variation: ObjectVariation | None = None
    background_variation: BackgroundVariation | None = None
    defocus: Defocus | None = None
    bands: Bands | None = None


@dataclass(frozen=True)
class CompositeDraws:
    """Draws batches.

    Attributes
    ----------
    size : int
        Photos of a batch.
    hinted : float
        Share of photos with hints.
    shares : tuple of float
        Of scenes with no object, one and several.
    backgrounds : tuple of float
        Shares of plain backgrounds, and of backgrounds with a table.
    varied : bool
        Vary objects and backgrounds, see `variation`.
    difficulty : Difficulty
        Shares of difficult photos.
    """

    size: int
    hinted: float = 0.5
    shares: tuple[float, ...] = SHARES
    backgrounds: tuple[float, float] = BACKGROUND_SHARES
    varied: bool = False
    difficulty: Difficulty = SIMPLE

    def __call__(self, rng: np.random.Generator) -> CompositeDraw:
        """Draw a batch.

        Parameters
        ----------
        rng : numpy.random.Generator

        Returns
        -------
        CompositeDraw
            On the CPU.
        """
        scenes, objects = draw_scenes(rng, self.size, self.shares, self.difficulty)
        object_variation, of_backgrounds = None, None
        if self.varied:
            objects, object_variation = varied_objects(objects, rng)
            of_backgrounds = draw_background_variation(rng, self.size)
        drawn = CompositeDraw(
            scenes,
            objects,
            draw_backgrounds(rng, self.size, self.backgrounds),
            draw_hints(rng, self.size, self.hinted, MAX_OBJECTS),
            draw_cameras(rng, self.size),
            object_variation,
            of_backgrounds,
        )
        # numbers of difficult photos come last, and only for these: all others stay the same
        if share := self.difficulty.defocused:
            drawn = replace(drawn, defocus=draw_defocus(rng, self.size, share))
        if share := self.difficulty.banded:
            drawn = replace(drawn, bands=draw_bands(rng, len(objects), share))
        return drawn


def draw_cameras(rng: np.random.Generator, number: int) -> Cameras:
    """Draw white balances and cameras.

    Parameters
    ----------
    rng : numpy.random.Generator
    number : int

    Returns
    -------
    Cameras
        On the CPU.
    """
    drawn = [vars(draw_camera(rng)) for _ in range(number)]
    arrays = {name: np.array([one[name] for one in drawn], float) for name in drawn[0]}
    arrays["exposure"] *= log_uniforms(rng, 0.8, 1.3, number)
    arrays["balance"] = np.exp(rng.normal(0, 0.08, (number, 3)))
    arrays["grey"] = rng.random(number) < _GREY
    return Cameras.of(arrays)


@dataclass(frozen=True, eq=False)
class PastedScenes:
    """Objects on backgrounds, before the camera.

    Attributes
    ----------
    light : (B, 3, SIDE, SIDE) tensor
    frame : (B, 1, SIDE, SIDE) tensor
        1 inside the photo.
    covers : (B, T, SIDE, SIDE) tensor
        Visible parts of the layers.
    foreground : (N, 3, SIDE, SIDE) tensor
        Light of each object, multiplied by its coverage.
    cover : (N, 1, SIDE, SIDE) tensor
    """

    light: torch.Tensor
    frame: torch.Tensor
    covers: torch.Tensor
    foreground: torch.Tensor
    cover: torch.Tensor


class Composites:
    """Draws photos, and composes them on one device.

    Parameters
    ----------
    ingredients : Ingredients
    draw : CompositeDraws
    side : int
        Of the photos, pixels: a multiple of 32.
    device : str or torch.device
    """

    def __init__(
        self,
        ingredients: Ingredients,
        draw: CompositeDraws,
        side: int = SIDE,
        device: str | torch.device = "cpu",
    ) -> None:
        cutouts, panoramas, patterns = (
            torch.from_numpy(part).to(device) for part in vars(ingredients).values()
        )
        self._draw, self._side, self._device = draw, side, device
        self._cutouts, self._backgrounds = CutOuts(cutouts), Backgrounds(panoramas, patterns)
        self._factor = side / cutouts.shape[-1] / LENGTH

    def __call__(self, rng: np.random.Generator) -> Composite:
        """Return the next batch.

        Parameters
        ----------
        rng : numpy.random.Generator

        Returns
        -------
        Composite
        """
        return self.composed(self._draw(rng))

    def composed(self, drawn: CompositeDraw) -> Composite:
        """Compose the photos of a draw.

        Parameters
        ----------
        drawn : CompositeDraw
            On the CPU.

        Returns
        -------
        Composite
            On the device.
        """
        scene, drawn = self.pasted(drawn), drawn.to(self._device)
        light, frame = scene.light, scene.frame
        mask, hints, count = ground_truth(scene, drawn)
        photo = as_photographed(light, frame, drawn.cameras, light)
        return Composite(photo, frame, hints, mask, count)

    def pasted(self, drawn: CompositeDraw) -> PastedScenes:
        """Paste the objects of a draw on its backgrounds.

        Parameters
        ----------
        drawn : CompositeDraw
            On the CPU.

        Returns
        -------
        PastedScenes
            On the device.
        """
        levels = self._rows_of(self._cutouts.levels(drawn.objects.length * self._factor))
        layers = self._rows_of(drawn.objects.layer)
        focus = {} if drawn.defocus is None else self._rows_of(_first_in_focus(drawn, len(layers)))
        drawn = drawn.to(self._device)
        frame, light = frames(drawn.scenes.shape, self._side), self._background(drawn)
        covers = light.new_zeros(len(light), max(len(layers), 1), *light.shape[2:])
        foreground, cover = light.new_zeros(0, *light.shape[1:]), light[:0, :1]
        if layers:
            foreground, cover = self._cutouts.placed(drawn.objects, levels, self._side)
            if drawn.bands is not None:
                foreground = painted(foreground, drawn.objects, drawn.bands)
            _paste(light, covers, foreground, cover, drawn, layers, focus)
        _defocus(light, drawn, focus.get(len(layers)))
        return PastedScenes(light, frame, covers, foreground, cover)

    def _rows_of(self, numbers: torch.Tensor) -> dict[int, torch.Tensor]:
        """The rows in which each number occurs, found on the CPU, moved to the device."""
        found = {int(k): torch.nonzero(numbers == k)[:, 0] for k in numbers.unique()}
        return {k: rows.to(self._device) for k, rows in found.items()}

    def _background(self, drawn: CompositeDraw) -> torch.Tensor:
        light = self._backgrounds(drawn.backgrounds, self._side)
        if drawn.background_variation is not None:
            light = varied_backgrounds(light, drawn.background_variation)
        level = drawn.scenes.level[:, None, None, None]
        return light * (level / light.mean((1, 2, 3), keepdim=True).clamp(min=1e-3))


def frames(shapes: torch.Tensor, side: int) -> torch.Tensor:
    """Return which pixels of the network's frame lie in the photos.

    Parameters
    ----------
    shapes : (B, 2) tensor
        Width and height over the longer one.
    side : int

    Returns
    -------
    (B, 1, side, side) tensor
        1 inside.
    """
    across = ((torch.arange(side, device=shapes.device) + 0.5) * (2 / side) - 1).abs()
    wide, high = (across < shapes[:, k, None] for k in range(2))
    return (wide[:, None, None, :] & high[:, None, :, None]).float()


def _paste(
    light: torch.Tensor,
    covers: torch.Tensor,
    foreground: torch.Tensor,
    cover: torch.Tensor,
    drawn: CompositeDraw,
    layers: dict[int, torch.Tensor],
    focus: dict[int, torch.Tensor],
) -> None:
    """Paste objects into the light, in place; `covers` (B, T, H, W) receives the visible parts."""
    shade, varied = shadows(cover, drawn.objects), drawn.object_variation
    for k, rows in layers.items():
        _defocus(light, drawn, focus.get(k))
        photos, over, front = drawn.objects.photo[rows], cover[rows], foreground[rows]
        behind = light[photos]
        if varied is not None:
            front = matched_colours(front, over, behind, varied.chosen(rows))
        light[photos] = (1 - over) * behind * (1 - shade[rows]) + front
        covers[photos, :k] *= 1 - over
        covers[photos, k] = over[:, 0]


def _first_in_focus(drawn: CompositeDraw, layers: int) -> torch.Tensor:
    """The layer (B,) of the first target; without one, the number of layers; -1: all is sharp."""
    objects, radius = drawn.objects, drawn.defocus.radius  # type: ignore[union-attr]
    first = torch.full((len(radius),), layers)
    first.scatter_reduce_(0, objects.photo[objects.target], objects.layer[objects.target], "amin")
    return torch.where(radius > 0, first, -1)


def _defocus(light: torch.Tensor, drawn: CompositeDraw, photos: torch.Tensor | None) -> None:
    """Blur the light of some photos, in place."""
    if drawn.defocus is not None and photos is not None:
        light[photos] = defocused(light[photos], drawn.defocus.chosen(photos))


def ground_truth(
    scene: PastedScenes, drawn: CompositeDraw
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Return what the network is trained on.

    Parameters
    ----------
    scene : PastedScenes
        Of the draw.
    drawn : CompositeDraw
        On the same device.

    Returns
    -------
    mask : (B, 1, SIDE, SIDE) tensor
        Coverage by the target.
    hints : (B, 3, SIDE, SIDE) tensor
    count : (B,) tensor of int
        `Count`.
    """
    covers, objects = scene.covers * scene.frame, drawn.objects
    alone = torch.zeros(covers.shape[:2], dtype=torch.bool, device=covers.device)
    alone[objects.photo, objects.layer] = objects.target
    return hinted_truth(covers, alone, scene.frame, drawn.scenes.count, drawn.hints)


def hinted_truth(
    covers: torch.Tensor,
    target: torch.Tensor,
    frame: torch.Tensor,
    count: torch.Tensor,
    hints: HintDraws,
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Choose what hints select, and the target where there are none.

    Parameters
    ----------
    covers : (B, T, H, W) tensor
        Visible part of each object.
    target : (B, T) bool tensor
        Targets without hints.
    frame : (B, 1, H, W) tensor
        1 inside the photo.
    count : (B,) tensor of int
        `Count` without hints.
    hints : HintDraws

    Returns
    -------
    mask, hints, count : tensors
        As `ground_truth` returns them.
    """
    marked = hinted(covers, target, count == int(Count.ONE), hints)
    some = torch.where(hints.given[:, None], marked, target)
    mask = (covers * some[..., None, None]).sum(1, keepdim=True).clamp(max=1)
    maps = hint_maps(mask[:, 0] > 0.5, frame[:, 0] > 0, hints)
    return mask, maps, torch.where(hints.given, marked.any(1) * int(Count.ONE), count)


def as_photographed(
    light: torch.Tensor, frame: torch.Tensor, cameras: Cameras, metered: torch.Tensor
) -> torch.Tensor:
    """Apply white balance, exposure and the camera.

    Parameters
    ----------
    light : (B, 3, H, W) tensor
    frame : (B, 1, H, W) tensor
    cameras : Cameras
    metered : (B, 3, H, W) tensor
        Light that determines the exposure.

    Returns
    -------
    (B, 3, H, W) tensor
        0 outside the frame.
    """

    def balanced(light: torch.Tensor) -> torch.Tensor:
        light = light * cameras.balance[..., None, None]
        grey = cameras.grey[:, None, None, None]
        return torch.where(grey, light.mean(1, keepdim=True), light)

    light = balanced(light) * exposed(balanced(metered), frame, cameras.exposure)
    values = {name: part for name, part in vars(cameras).items() if part.ndim == 1}
    return photographed(light, torch.ones_like(frame), values) * frame
