"""Photos of bodies with relief of one paint, of smooth bodies with print, and of bodies with both.

Normals are exact. A body with both has patches, about a fifth of its length wide: some of one paint
with relief, the others flat with print. Two more kinds consist of parts (`part_maps`): their
surface does, with the same paint for all parts or slightly different ones, or their print does.
Parts shade each other: the light from all around by V of `part_maps`, that of lamps by horizons.

Every pixel is the mean of four points; its true normals are the normalised means of theirs. The
light is that of `lighting`, the camera one of `cameras`.

Limits: an orthographic projection.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from zlib import crc32

import numpy as np
from scipy import ndimage
from scipy.spatial.transform import Rotation

from isc_core.shading.environment_map import mean_radiance
from synth.scene.meshes import Mesh
from synth.scene.tracing import Hits, Tracer
from training.world.patterns.canvas import filtered_noise
from training.world.random_draws import log_uniform
from training.world.views import camera_rays

from .bodies import SHAPES, Wrap, displaced_normals, draw_wrap, facing, smooth_body
from .cameras import Camera, photo_of
from .lighting import Gloss, Lamp, ReachingLight, Room, outgoing_light, reaching_light
from .part_maps import PartKind, PartMap, draw_parts
from .part_prints import draw_part_print, varied_paint
from .print_maps import PrintKind, draw_colour, draw_print
from .relief_maps import ReliefKind, ReliefMap, draw_relief

SIDE, LENGTH = 1024, 860  # pixels: of a photo, and of the object in it
_COARSE = 8  # photo pixels a pixel of the grid on which light is traced
_OFFSETS = (-0.25, 0.25)  # of the points of a pixel
_PRINT_SIDE = 0.75  # of a print map, relative to the photo
_PATCHES = 2.5  # fewest waves a side of the noise that divides a body into patches
_RAMP = 16  # pixels in which relief begins within a patch


class SetKind(StrEnum):
    """What a body shows."""

    RELIEF = "relief"
    PRINT = "print"
    MIXED = "mixed"
    PARTS = "parts"  # the surface consists of parts
    DRAWN = "drawn"  # print of parts on a smooth body


@dataclass(frozen=True, eq=False)
class DetailScene:
    """A photo with its truth.

    Attributes
    ----------
    name : str
    codes : (H, W, 3) uint8 ndarray
        The photo, sRGB.
    mask : (H, W) ndarray of bool
    normal : (H, W, 3) float32 ndarray
        Unit, camera frame; 0 outside the mask.
    smooth : (H, W, 3) float32 ndarray
        Those of the body without relief.
    facts : dict
        What was drawn.
    """

    name: str
    codes: np.ndarray
    mask: np.ndarray
    normal: np.ndarray
    smooth: np.ndarray
    facts: dict[str, object]


@dataclass(frozen=True, eq=False)
class _Plan:
    """All that is drawn for one photo."""

    mesh: Mesh
    family: str
    room: Room
    gloss: Gloss
    slope: np.ndarray | None  # spline coefficients (2, side, side) of the relief's slopes
    paint: np.ndarray  # (3,) or a map (side, side, 3)
    facts: dict[str, object]
    shades: PartMap | None = None  # parts that shade each other


def render(
    kind: SetKind,
    seed: int,
    number: int,
    rooms: Sequence[np.ndarray],
    side: int = SIDE,
    camera: Camera = Camera.GOOD,
) -> DetailScene:
    """Render one photo of a set.

    Parameters
    ----------
    kind : SetKind
    seed : int
        Of the set.
    number : int
        Of the photo, from 0; decides the family, the pattern and whether there are lamps.
    rooms : sequence of (rows, 2 rows, 3) ndarray
        Surroundings to draw from.
    side : int, optional
        Of the photo, pixels, a multiple of 16; the object has the same share of it at any size.
    camera : Camera, optional
        Takes the photo; all else is the same for every camera.

    Returns
    -------
    DetailScene
    """
    rng = np.random.default_rng([seed, number, crc32(kind.encode())])
    plan = _planned(kind, number, rooms, rng, side)
    tracer, pixel = Tracer(plan.mesh), 2 / side
    centre = _traced(tracer, side, 0, 0)
    wrap = draw_wrap(plan.family, centre.position[centre.valid], rng, pixel)
    light = _light(plan, tracer, side, rng)
    fields = light.enlarged(side)
    total, count = np.zeros((side * side, 9), np.float32), np.zeros(side * side, int)
    for down in _OFFSETS:
        for right in _OFFSETS:
            hits = _traced(tracer, side, down, right)
            at = np.flatnonzero(hits.valid)
            total[at] += _shaded(plan, wrap, light, fields[:, at], hits, side)
            count[at] += 1
    mask = (count == len(_OFFSETS) ** 2).reshape(side, side)
    picture = (total / np.maximum(count, 1)[:, None]).reshape(side, side, 9)
    picture *= mask[..., None]
    codes, drawn = photo_of(picture[..., :3], mask, camera, rng)
    normal, smooth = (_unit(picture[..., part]) for part in (slice(3, 6), slice(6, 9)))
    facts = plan.facts | {"camera": drawn, "wrapped": bool(np.isfinite(wrap.axis_depth))}
    return DetailScene(f"{kind}_{number:02d}", codes, mask, normal, smooth, facts)


def _planned(
    kind: SetKind, number: int, rooms: Sequence[np.ndarray], rng: np.random.Generator, side: int
) -> _Plan:
    family = SHAPES[number % len(SHAPES)]
    mesh = smooth_body(family, rng, 2 * LENGTH / SIDE)
    chosen = int(rng.integers(len(rooms)))
    room = _room(rooms[chosen], number % 3 == 0, rng)
    glossy = rng.random() < 1 / 3
    gloss = Gloss(rng.uniform(0.03, 0.05), rng.uniform(0.3, 0.5)) if glossy else Gloss(0, 1)
    facts: dict[str, object] = {
        "family": family,
        "room": chosen,
        "lamps": len(room.lamps),
        "gloss": [gloss.front, gloss.alpha],
    }
    if kind in (SetKind.PARTS, SetKind.DRAWN):
        of_parts = list(PartKind)[number % len(PartKind)]
        parts = draw_parts(of_parts, rng, side)
        facts |= {"pattern": of_parts}
        if kind == SetKind.DRAWN:
            paint, style = draw_part_print(parts, number, rng)
            return _Plan(mesh, family, room, gloss, None, paint, facts | {"style": style})
        slope = np.stack([ndimage.spline_filter(one, mode="grid-wrap") for one in parts.slope])
        paint = varied_paint(parts, draw_colour(rng), rng)
        return _Plan(mesh, family, room, gloss, slope, paint, facts, parts)
    if kind != SetKind.PRINT:
        pattern = list(ReliefKind)[number % len(ReliefKind)]
        degrees, shares = rng.uniform(5, 16), rng.uniform(0.4, 1, 3)
        slopes = np.tan(np.radians(degrees)) * shares / np.linalg.norm(shares)
        relief = draw_relief(pattern, tuple(slopes.tolist()), rng, side)
        facts |= {"pattern": pattern, "slopes": slopes.tolist()}
        steep, paint = relief.slope, draw_colour(rng)
        if kind == SetKind.MIXED:
            steep, paint = _with_print(relief, paint, number, rng)
        slope = np.stack([ndimage.spline_filter(one, mode="grid-wrap") for one in steep])
        return _Plan(mesh, family, room, gloss, slope, paint, facts)
    pattern_of_paint = list(PrintKind)[number % len(PrintKind)]
    colours = draw_print(pattern_of_paint, rng, round(_PRINT_SIDE * side))
    return _Plan(mesh, family, room, gloss, None, colours, facts | {"pattern": pattern_of_paint})


def _with_print(
    relief: ReliefMap, colour: np.ndarray, number: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Slopes (2, side, side) of relief in patches, and paint (side, side, 3) with print elsewhere.

    The height is multiplied by a window that falls to 0 within the patch, so that slopes are exact.
    """
    side = len(relief.height)
    noise = filtered_noise(rng, side, 8.0, least=_PATCHES)
    patch = noise > np.quantile(noise, rng.uniform(0.4, 0.6))
    inside = ndimage.distance_transform_edt(np.pad(patch, _RAMP, mode="wrap"))
    inside = inside[_RAMP:-_RAMP, _RAMP:-_RAMP]
    window = 0.5 - 0.5 * np.cos(np.pi * np.minimum(inside / _RAMP, 1))
    rise = [np.roll(window, -1, axis) - np.roll(window, 1, axis) for axis in (1, 0)]
    slope = window * relief.slope + 0.5 * relief.height * np.stack(rise)
    printed = draw_print(list(PrintKind)[number % len(PrintKind)], rng, side)
    return slope, np.where(patch[..., None], colour, printed)


def _room(radiance: np.ndarray, lamps: bool, rng: np.random.Generator) -> Room:
    """Surroundings of grey mean 1, as a camera's white balance shows them, turned, and lamps."""
    balanced = radiance / mean_radiance(radiance)
    yaw, pitch, roll = rng.uniform(0, 360), rng.normal(0, 8), rng.normal(0, 4)
    # from the camera's frame to the room's, whose horizon stays level but for the roll
    turn = Rotation.from_euler("zxy", (roll, pitch, yaw), degrees=True).as_matrix()
    made = []
    for _ in range(int(rng.integers(1, 3)) if lamps else 0):
        aside, up = rng.uniform(-70, 70), rng.uniform(-5, 65)
        toward = Rotation.from_euler("yx", (aside, -up), degrees=True).apply((0.0, 0, 1))
        colour = np.array([1, 1, 1]) + rng.normal(0, 0.05) * np.array([1, 0, -1])
        power = np.pi * log_uniform(rng, 0.4, 1.5) * colour
        made.append(Lamp(toward, power, rng.uniform(0.03, 0.2)))
    return Room(balanced, turn, tuple(made))


def _traced(tracer: Tracer, side: int, down: float, right: float) -> Hits:
    origins, rays = camera_rays(side, np.inf)
    return tracer.hits(origins + np.array([right, -down, 0]) * (2 / side), rays)


def _light(plan: _Plan, tracer: Tracer, side: int, rng: np.random.Generator) -> ReachingLight:
    coarse = side // _COARSE
    hits = _traced(tracer, coarse, 0, 0)
    mask = hits.valid.reshape(coarse, coarse)
    position, normal = hits.position[hits.valid], facing(hits.normal[hits.valid])
    return reaching_light(plan.room, tracer, position, normal, mask, rng)


def _shaded(
    plan: _Plan, wrap: Wrap, light: ReachingLight, fields: np.ndarray, hits: Hits, side: int
) -> np.ndarray:
    """Light, normals and smooth normals (N, 9) of the hit points."""
    position, smooth = hits.position[hits.valid], facing(hits.normal[hits.valid])
    uv, gradient = wrap.at(position)
    normal, albedo = smooth, plan.paint
    if plan.slope is not None:
        slope = np.stack([_sampled(one, uv, side / 2, order=3) for one in plan.slope], axis=1)
        normal = displaced_normals(smooth, gradient, slope)
    if plan.paint.ndim == 3:
        middle = plan.paint.shape[0] / 2
        planes = [_sampled(plan.paint[..., c], uv, middle, order=1) for c in range(3)]
        albedo = np.clip(np.stack(planes, axis=1), 0.005, 0.95)
    if plan.shades is not None:
        fields = _between_parts(plan.shades, light, fields, uv, gradient, smooth, albedo)
    seen = outgoing_light(light, fields, normal, albedo, plan.gloss, plan.room)
    return np.concatenate([seen, normal, smooth], axis=1).astype(np.float32)


def _between_parts(
    parts: PartMap,
    light: ReachingLight,
    fields: np.ndarray,
    uv: np.ndarray,
    gradient: np.ndarray,
    smooth: np.ndarray,
    albedo: np.ndarray,
) -> np.ndarray:
    """The fields (fields, N) of light that reaches points between parts."""
    middle, found = len(parts.height) / 2, fields.copy()
    visible = _sampled(parts.visible, uv, middle, order=1)[:, None]
    share = visible / (1 - albedo * (1 - visible))
    found[:54] *= np.tile(share.T, (18, 1))
    for lamp, seen in zip(light.lamps, found[55:], strict=True):
        across = gradient @ lamp.toward
        turn = np.arctan2(across[:, 1], across[:, 0]) / (2 * np.pi) % 1 * len(parts.horizon)
        tangent = smooth @ lamp.toward / np.maximum(np.linalg.norm(across, axis=1), 1e-6)
        places = [turn, uv[:, 1] + middle, uv[:, 0] + middle]
        horizon = ndimage.map_coordinates(parts.horizon, places, order=1, mode="grid-wrap")
        apart = (np.arctan(tangent) - np.arctan(horizon)) / (2 * lamp.radius)
        seen *= np.clip(0.5 + apart, 0, 1)
    return found


def _sampled(values: np.ndarray, uv: np.ndarray, middle: float, order: int) -> np.ndarray:
    """Values (N,) of a map that repeats, given by spline coefficients; 0 is its middle."""
    places = [uv[:, 1] + middle, uv[:, 0] + middle]
    found = ndimage.map_coordinates(values, places, order=order, mode="grid-wrap", prefilter=False)
    return np.asarray(found)


def _unit(vectors: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=2, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1), np.float32)
