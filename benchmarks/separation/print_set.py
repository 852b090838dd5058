"""Rendered photos of bodies with paint that is easily mistaken for a highlight, with their truth.

Problem: letters, stripes, stickers, eyes, trim and white ceramics are bright and colourless, as
highlights are. A matt body with such paint shows what a method takes off where nothing is; a glossy
one, with true highlights across the paint, what it still finds.

Construction: a traced body of `training.world` is painted, lit by a white-balanced panorama and
lamps, and photographed: exposure, blur, noise, clipping, JPEG of 8-bit sRGB codes. Patterns are
drawn anew, none is of the atlas that the scene network has learned from. Bodies of one colour,
without print, are made alike. The three sets share no body, and the network has learned from none:
on bodies that it knows, it is surer than on others. `Part.TRAINING` has made bodies whose numbers
lie beyond those of the networks' worlds. No panorama that the network has learned from lights
`Part.VALIDATION` or `Part.TEST`.

Limits: trim is a bright grey band without a reflection of its own. A true diffuse image has the
noise of its photo.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from enum import IntEnum, StrEnum
from pathlib import Path

import numpy as np
import torch
from PIL import Image, ImageDraw
from scipy.spatial.transform import Rotation
from torch.nn import functional

from isc_core.errors import InputError
from isc_core.shading.environment_map import mean_radiance
from training.world.bodies.body import Source
from training.world.camera import CameraDraw
from training.world.environments import read_panoramas
from training.world.files import Split, half_of, views_in
from training.world.lit_pictures import LitPictures, make_pictures
from training.world.patterns.atlas import Atlas
from training.world.patterns.canvas import FINER, averaged
from training.world.patterns.logo import logo
from training.world.patterns.text import text
from training.world.pictures import Bank, bank_of, stacked
from training.world.random_draws import log_uniform
from training.world.recipes import LAYERS, Recipe, Shares, draw_recipe
from training.world.samples import OBJECT, Placement, photograph
from training.world.view_batches import PreparedView, batch_of, prepared
from training.world.views import View

PHOTO_SIDE = 160  # pixels; the body is 140 long
_MAP_SIDE = 128
_LEAST_PIXELS = 2500
# Numbers from which no network has learned from a made body of a kind.
_FIRST_NEW = {Source.BUILT: 450, Source.FAMILY: 100}
_TRIES = 12  # lights and paints for a body, until a highlight crosses the paint
# A highlight: specular light, averaged over _SPOT pixels, above _BRIGHT of the mean light, on a
# share of the body within _EXTENT, of which _ACROSS lies on the paint; three quarters of the body
# show less than _VEIL of the peak.
_SPOT, _BRIGHT, _EXTENT, _ACROSS, _VEIL = 5, 0.3, (0.005, 0.2), 0.15, 0.25


class PrintKind(IntEnum):
    """What is painted on a body."""

    LETTERS = 0
    LOGO = 1
    STRIPES = 2
    STICKER = 3
    EYES = 4
    TRIM = 5
    CERAMIC = 6


class Part(StrEnum):
    """What a set is for: fitting constants, choosing among rules, reporting."""

    TRAINING = "training"
    VALIDATION = "validation"
    TEST = "test"


# Part of the seeds, so that the photos stay those of the published figures.
_SEED_WORDS = {Part.TRAINING: "fit", Part.VALIDATION: "choice", Part.TEST: "report"}


@dataclass(frozen=True, eq=False)
class PrintScene:
    """A photo of a painted body.

    Attributes
    ----------
    name : str
        Number and kind of paint.
    body : str
        Name of the body.
    photo : (H, W, 3) float32 ndarray
        Linear light of an 8-bit file.
    diffuse : (H, W, 3) float32 ndarray
        The truth, at most `photo`; the photo itself for a matt body.
    mask, clipped : (H, W) ndarray of bool
    """

    name: str
    body: str
    photo: np.ndarray
    diffuse: np.ndarray
    mask: np.ndarray
    clipped: np.ndarray


def print_scenes(
    world: Path,
    panoramas: Path,
    part: Part,
    count: int,
    glossy: bool,
    seed: int = 0,
    painted: bool = True,
) -> Iterator[PrintScene]:
    """Render bodies, each from one side, the kinds of paint in turn.

    Parameters
    ----------
    world : Path
        A folder of `isc world build`.
    panoramas : Path
    part : Part
    count : int
    glossy : bool
        With highlights, across the paint if painted; otherwise matt.
    seed : int
    painted : bool
        Otherwise a body has one colour, strong or a mid-grey.

    Yields
    ------
    PrintScene

    Raises
    ------
    InputError
        If the world or the panoramas cannot be used.
    """
    torch.manual_seed(seed)
    rng = np.random.default_rng([seed, glossy, *map(ord, _SEED_WORDS[part])] + [1] * (not painted))
    found = [one for one in read_panoramas(panoramas) if one.held_out != (part == Part.TRAINING)]
    rooms = [_balanced(one.radiance) for one in found]
    if part != Part.TRAINING:
        rooms = rooms[part == Part.TEST :: 2]
    bodies, made = _bodies(world, part), 0
    for k in rng.permutation(len(bodies)):
        if made == count:
            return
        kind = PrintKind(made % len(PrintKind)) if painted else None
        scene = _scene(bodies[int(k)], kind, rooms, glossy, rng)
        if scene is not None:
            made += 1
            yield replace(
                scene,
                name=f"{made:03d} {'plain' if kind is None else kind.name.lower()}",
                body=bodies[int(k)].name,
            )


def _balanced(radiance: np.ndarray) -> np.ndarray:
    """A room of grey mean, as a camera's white balance shows it."""
    mean = mean_radiance(radiance)
    return np.asarray(radiance * (mean.mean() / mean))


def _bodies(world: Path, part: Part) -> list[PreparedView]:
    """One view of each body of a set."""
    splits = tuple(Split) if part == Part.TRAINING else (Split.UNSEEN_BODY,)
    found = dict[str, View]()
    for split in splits:
        for view in views_in(world, split):
            if view.mask.sum() > _LEAST_PIXELS and part_of(view.name, split) == part:
                found.setdefault(view.name, view)
    if not found:
        raise InputError(f"{world} has no bodies for {part}: build a world with more of them")
    return [prepared(view) for view in found.values()]


def part_of(name: str, split: Split) -> Part | None:
    """Return the set of a body.

    Parameters
    ----------
    name : str
        Of the body.
    split : Split
        Of its reference.

    Returns
    -------
    Part or None
        None for a body that a network has learned from, or of a source that is not used.
    """
    source, *_, number = name.split("/")
    if source in _FIRST_NEW and int(number) >= _FIRST_NEW[Source(source)]:
        return Part.TRAINING
    if split != Split.UNSEEN_BODY:
        return None
    return Part.TEST if half_of(name) else Part.VALIDATION


def _scene(
    view: PreparedView,
    kind: PrintKind | None,
    rooms: list[np.ndarray],
    glossy: bool,
    rng: np.random.Generator,
) -> PrintScene | None:
    """A photo of a body, without print for None; None if no highlight crosses its print."""
    for _ in range(_TRIES if glossy else 1):
        maps = np.stack([_EMPTY, _EMPTY] if kind is None else _MAPS[kind](rng))
        atlas = Atlas(maps, np.zeros(len(maps), np.uint8), np.zeros(len(maps), bool))
        bank = bank_of([rooms[int(rng.integers(len(rooms)))]], atlas)
        recipe = _painted(
            draw_recipe(view.directions, view.up, atlas, np.zeros(1, int), rng, _SHARES), rng
        )
        recipe = _plain(recipe, rng) if kind is None else _coloured(recipe, kind, rng)
        recipe = _finished(recipe, glossy, rng)
        pictures = make_pictures(batch_of([view]), stacked([recipe]), bank)
        if not glossy or _highlights_cross(pictures, view, recipe, bank):
            return _photographed(pictures, rng)
    return None


_SHARES = Shares(kinds=(1, 0, 0), lights=(0, 0.25, 0.35, 0.15, 0.25), printed=0, matte=0, coated=0)


def _painted(recipe: Recipe, rng: np.random.Generator) -> Recipe:
    """The recipe with print that faces the viewer: layers 1 and 2 of one frame, each map once."""
    angles = rng.normal(0, (15, 15, 20))
    turn = Rotation.from_euler("zxy", angles, degrees=True).as_matrix()
    size = log_uniform(rng, 0.45, 0.8)
    frame = np.array([size, -size, 1])[:, None] * turn
    return replace(
        recipe,
        strengths=np.array([1.0, 1.0, 0.0]),
        maps=np.array([0, 1, 0]),
        frames=np.repeat(frame[None], LAYERS, axis=0),
        shifts=np.repeat(rng.uniform(0.4, 0.6, (1, 2)), LAYERS, axis=0),
        around=np.zeros(LAYERS),
        once=np.ones(LAYERS),
    )


def _coloured(recipe: Recipe, kind: PrintKind, rng: np.random.Generator) -> Recipe:
    """White on strong colour, with dark or strong details; ceramics the other way round."""
    strong = [_hue(rng, rng.uniform(0.55, 1), log_uniform(rng, 0.12, 0.8)) for _ in range(2)]
    value = rng.uniform(0.45, 0.7) if kind == PrintKind.TRIM else rng.uniform(0.65, 0.92)
    white, dark = _hue(rng, rng.uniform(0, 0.1), value), _hue(rng, 0.3, 0.04)
    detail = dark if rng.random() < 0.5 else strong[1]
    if kind == PrintKind.CERAMIC:
        return replace(recipe, base=white, colours=np.stack([strong[0], detail, detail]))
    return replace(recipe, base=strong[0], colours=np.stack([white, detail, detail]))


def _plain(recipe: Recipe, rng: np.random.Generator) -> Recipe:
    """One colour: two of three bodies strong, the others a mid-grey."""
    strong = _hue(rng, rng.uniform(0.55, 1), log_uniform(rng, 0.12, 0.8))
    grey = _hue(rng, rng.uniform(0, 0.1), rng.uniform(0.15, 0.5))
    base = strong if rng.random() < 2 / 3 else grey
    return replace(recipe, base=base, strengths=np.zeros(LAYERS))


def _hue(rng: np.random.Generator, saturation: float, value: float) -> np.ndarray:
    hue = rng.uniform(0, 6)
    pure = np.clip(2 - np.abs((hue - np.array([0.0, 2.0, 4.0]) + 3) % 6 - 3), 0, 1)
    return np.asarray(np.clip(value * (1 - saturation * (1 - pure)), 0.01, 0.95))


def _finished(recipe: Recipe, glossy: bool, rng: np.random.Generator) -> Recipe:
    front = np.full(3, rng.uniform(0.03, 0.06) if glossy else 0.0)
    alpha = log_uniform(rng, 0.06, 0.3)
    return replace(recipe, front=front, alpha=alpha, alpha_range=0.0, coat=0.0, sigma=0.0)


def _highlights_cross(
    pictures: LitPictures, view: PreparedView, recipe: Recipe, bank: Bank
) -> bool:
    """Whether light of a highlight lies on the print, or on a body without."""
    plain = stacked([replace(recipe, strengths=np.zeros(LAYERS))])
    diffuse, gloss = pictures.layers[0, :6].float().split(3)
    unpainted = make_pictures(batch_of([view]), plain, bank).layers[0, :3].float()
    paint = (diffuse - unpainted).abs().amax(0) > 0.05 * unpainted.amax()
    if not recipe.strengths.any():
        paint = torch.ones_like(paint)
    cover = pictures.cover[0].float()
    light = functional.avg_pool2d(gloss.mean(0, keepdim=True), _SPOT, 1, _SPOT // 2)
    light = light / functional.avg_pool2d(cover, _SPOT, 1, _SPOT // 2).clamp(min=0.5)
    body = cover[0] > 0
    light = light[0] / (diffuse + gloss)[:, body].mean()
    bright = (light > _BRIGHT) & body
    extent = float(bright.sum() / body.sum())
    across = float((bright & paint).sum() / bright.sum().clamp(min=1))
    most = float(light[body].quantile(0.75))
    flat = most > _VEIL * float(light[body].max())
    return _EXTENT[0] < extent < _EXTENT[1] and across > _ACROSS and not flat


def _photographed(pictures: LitPictures, rng: np.random.Generator) -> PrintScene:
    noise = log_uniform(rng, 0.002, 0.02)
    camera = CameraDraw(
        exposure=rng.uniform(0.6, 1.3),
        blur=rng.uniform(0.2, 0.6),
        noise=noise,
        floor=0.2 * noise,
        sharpness=0.0,
        contrast=0.0,
        quality=rng.uniform(85, 95),
        subsampled=float(rng.random() < 0.5),
        clips=1.0,
    )
    placement = Placement(0.0, 1.0, OBJECT, np.zeros(2), np.zeros(4), 0.0, np.zeros(2))
    cameras, placements = (
        {name: torch.tensor(np.asarray(value))[None].float() for name, value in vars(one).items()}
        for one in (camera, placement)
    )
    sample = photograph(pictures, cameras, placements, PHOTO_SIDE)
    photo, ratio = (part[0].permute(1, 2, 0).numpy() for part in (sample.photo, sample.ratio))
    mask = (sample.mask[0, 0] * sample.known[0, 0]).numpy() > 0
    photo = np.where(mask[..., None], photo, 0).astype(np.float32)
    clipped = mask & (photo.max(axis=2) >= 1)
    return PrintScene("", "", photo, photo * np.exp(-ratio), mask, clipped)


_Draw = Callable[[ImageDraw.ImageDraw], None]


def _drawn(draw: _Draw) -> np.ndarray:
    """A map (side, side) uint8 of what is drawn on a canvas three times as fine."""
    canvas = Image.new("L", (FINER * _MAP_SIDE, FINER * _MAP_SIDE), 0)
    draw(ImageDraw.Draw(canvas))
    return np.asarray(np.rint(averaged(np.asarray(canvas, float))), np.uint8)


def _grey(values: np.ndarray) -> np.ndarray:
    return np.asarray(np.rint(255 * values), np.uint8)


_EMPTY = np.zeros((_MAP_SIDE, _MAP_SIDE), np.uint8)


def _letters(rng: np.random.Generator) -> list[np.ndarray]:
    return [_grey(text(rng, _MAP_SIDE).values), _EMPTY]


def _logo(rng: np.random.Generator) -> list[np.ndarray]:
    return [_grey(logo(rng, _MAP_SIDE).values), _EMPTY]


def _stripes(rng: np.random.Generator) -> list[np.ndarray]:
    """Bars of one width and distance, in any direction."""
    period, share = rng.uniform(0.12, 0.5), rng.uniform(0.15, 0.5)
    angle, phase = rng.uniform(0, math.pi), rng.random()
    line = (np.arange(FINER * _MAP_SIDE) + 0.5) / (FINER * _MAP_SIDE)
    across = line * math.cos(angle) + line[:, None] * math.sin(angle)
    return [_grey(averaged(((across / period + phase) % 1 < share) * 1.0)), _EMPTY]


def _sticker(rng: np.random.Generator) -> list[np.ndarray]:
    """A white sheet with rounded corners, and text on it."""
    size = FINER * _MAP_SIDE
    width, height = rng.uniform(0.3, 0.8, 2) * size
    left, top = (size - width) / 2, (size - height) / 2
    box = (left, top, left + width, top + height)
    round_ = float(rng.choice([0, 0.1, 0.5])) * min(width, height)
    sheet = _drawn(lambda draw: draw.rounded_rectangle(box, round_, fill=255))
    return [sheet, np.minimum(sheet, _grey(text(rng, _MAP_SIDE).values))]


def _eyes(rng: np.random.Generator) -> list[np.ndarray]:
    """Pairs of white discs with pupils."""
    size, radius = FINER * _MAP_SIDE, rng.uniform(0.06, 0.16)
    rows = [0.5] if rng.random() < 0.6 else [0.3, 0.7]
    places = [(0.5 + side * 1.3 * radius, row) for row in rows for side in (-1, 1)]
    off, pupil = rng.uniform(-0.3, 0.3, 2) * radius, rng.uniform(0.3, 0.6) * radius

    def discs(draw: ImageDraw.ImageDraw, reach: float, dx: float, dy: float) -> None:
        for x, y in places:
            x, y = x + dx, y + dy
            box = [size * one for one in (x - reach, y - reach, x + reach, y + reach)]
            draw.ellipse(tuple(box), fill=255)

    return [
        _drawn(lambda draw: discs(draw, radius, 0, 0)),
        _drawn(lambda draw: discs(draw, pupil, *off)),
    ]


def _trim(rng: np.random.Generator) -> list[np.ndarray]:
    """One or two bands across, straight or as a ring."""
    size, width = FINER * _MAP_SIDE, rng.uniform(0.03, 0.1)
    places = rng.uniform(0.2, 0.8, int(rng.integers(1, 3)))
    if rng.random() < 0.4:
        radius = rng.uniform(0.2, 0.4) * size
        low, high, line_width = size / 2 - radius, size / 2 + radius, int(width * size)
        box = (low, low, high, high)
        return [
            _drawn(lambda draw: draw.ellipse(box, outline=255, width=line_width)),
            _EMPTY,
        ]
    line = (np.arange(_MAP_SIDE) + 0.5) / _MAP_SIDE
    near = np.abs(line[:, None] - places).min(axis=1) < width / 2
    return [_grey(np.repeat(near[:, None] * 1.0, _MAP_SIDE, axis=1)), _EMPTY]


def _ceramic(rng: np.random.Generator) -> list[np.ndarray]:
    painters = (_stripes, _logo, _trim, lambda _: [_EMPTY, _EMPTY])
    return painters[int(rng.integers(len(painters)))](rng)


_MAPS: dict[PrintKind, Callable[[np.random.Generator], list[np.ndarray]]] = {
    PrintKind.LETTERS: _letters,
    PrintKind.LOGO: _logo,
    PrintKind.STRIPES: _stripes,
    PrintKind.STICKER: _sticker,
    PrintKind.EYES: _eyes,
    PrintKind.TRIM: _trim,
    PrintKind.CERAMIC: _ceramic,
}
