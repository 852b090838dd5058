"""Random recipes of pictures: paint, gloss and light of one view, as a few numbers.

Problem: a network generalises over what varies in training. Each choice here is a way in which
photographs of objects differ: one colour or many, print or none, gloss of any sharpness, light of
any kind.

Equation: albedo = a_0, then layer by layer a <- a + w g (c - a), with g the grey value of an atlas'
map at coordinates turned and scaled at random, w its strength and c its colour.

Limits: patterns lie on the body as projected from one side or around one axis; they do not follow
its seams.
"""

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from isc_core.shading.perspective import rotation_between

from .patterns import Atlas, PatternKind
from .random_draws import log_uniform

LAMPS, LAYERS = 4, 3
_WHITE_BASE = 0.2  # of bodies in white and a strong colour
_FROM_ABOVE = 0.05  # least sine of the angle under which a table is seen
_LOWEST_LAMP = 0.1  # sine of its angle above a table


class Kind(IntEnum):
    """What a body is made of."""

    OPAQUE = 0
    MIRROR = 1
    GLASS = 2


class Paint(IntEnum):
    """How the colours of a body are chosen."""

    ONE = 0
    FEW = 1
    NEAR_GREY = 2
    WHITE_WITH_BLACK = 3
    STRONG_WITH_WHITE = 4
    NATURAL = 5


class LightKind(IntEnum):
    """Where the light comes from."""

    HARMONICS = 0
    AROUND = 1
    ONE_LAMP = 2
    LAMPS = 3
    LABORATORY = 4


_WITH_TABLE = (LightKind.HARMONICS, LightKind.AROUND, LightKind.ONE_LAMP, LightKind.LAMPS)


@dataclass(frozen=True)
class Shares:
    """How often each choice is drawn; an ablation sets some to 0.

    Attributes
    ----------
    kinds : tuple of float
        Of `Kind`.
    paints : tuple of float
        Of `Paint`.
    lights : tuple of float
        Of `LightKind`.
    printed : float
        Bodies with text, a logo or a label.
    matte, coated : float
        Opaque bodies without gloss, and with a clear coat.
    white : float
        Bodies with stripes, dots, checks or patches that are white on a strong colour, or the other
        way round.
    standing : float
        Bodies seen from above that stand on a table.
    stretch : float
        Deviation of the logarithm of the factor by which depth is scaled; the aspect ratio varies
        as much.
    """

    kinds: tuple[float, ...] = (0.9, 0.05, 0.05)
    paints: tuple[float, ...] = (0.25, 0.25, 0.1, 0.08, 0.1, 0.22)
    lights: tuple[float, ...] = (0.16, 0.26, 0.26, 0.12, 0.2)
    printed: float = 0.25
    matte: float = 0.25
    coated: float = 0.12
    white: float = 0.0
    standing: float = 0.6
    stretch: float = 0.0


@dataclass(frozen=True, eq=False)
class Recipe:
    """Paint, gloss and light of one picture.

    Attributes
    ----------
    base : (3,) ndarray
        Colour below all layers.
    colours : (LAYERS, 3) ndarray
    strengths : (LAYERS,) ndarray
        0: no such layer.
    maps : (LAYERS,) ndarray of int
        Of the atlas.
    frames : (LAYERS, 3, 3) ndarray
        From a place on the body to coordinates of the map: u, v in turns, and the third axis.
    shifts : (LAYERS, 2) ndarray
    around : (LAYERS,) ndarray
        1: wound about the third axis, 0: projected along it.
    once : (LAYERS,) ndarray
        1: the map appears once, 0: it repeats.
    alpha, alpha_range : float
        GGX roughness and how far, as a logarithm, it varies with the first layer.
    front : (3,) ndarray
        Reflectance at normal incidence.
    coat, sigma, bounce : float
    kind : int
    environment : int
        Of the bank.
    turn : (3, 3) ndarray
        From the camera frame to that of the surroundings.
    standing : float
        1: the lower half of the surroundings is a table.
    table : (3,) ndarray
        Its reflectance.
    table_light : (3,) ndarray
        Irradiance, over pi, of the table by the lamps.
    ambient : (3,) ndarray
        Factor of the surroundings.
    lamp : (LAMPS,) ndarray of int
    power : (LAMPS, 3) ndarray
    distance, radius : (LAMPS,) ndarray
    given : float
        1: `harmonic_gain` times the surroundings' log harmonics are the light.
    harmonic_gain : float
    harmonic_noise : (9, 3) ndarray
    stretch : (3,) ndarray
        Factors of the body's width, height and depth.
    """

    base: np.ndarray
    colours: np.ndarray
    strengths: np.ndarray
    maps: np.ndarray
    frames: np.ndarray
    shifts: np.ndarray
    around: np.ndarray
    once: np.ndarray
    alpha: float
    alpha_range: float
    front: np.ndarray
    coat: float
    sigma: float
    bounce: float
    kind: int
    environment: int
    turn: np.ndarray
    standing: float
    table: np.ndarray
    table_light: np.ndarray
    ambient: np.ndarray
    lamp: np.ndarray
    power: np.ndarray
    distance: np.ndarray
    radius: np.ndarray
    given: float
    harmonic_gain: float
    harmonic_noise: np.ndarray
    stretch: np.ndarray


def draw_recipe(
    directions: np.ndarray,
    up: np.ndarray,
    atlas: Atlas,
    environments: np.ndarray,
    rng: np.random.Generator,
    shares: Shares,
) -> Recipe:
    """Draw the recipe of a picture.

    Parameters
    ----------
    directions : (DIRECTIONS, 3) ndarray
        The view's.
    up : (3,) ndarray
        The view's; 0 for a body that lies anyhow.
    atlas : Atlas
    environments : (N,) ndarray of int
        Those of the bank that may be used.
    rng : numpy.random.Generator
    shares : Shares

    Returns
    -------
    Recipe
    """
    kind = Kind(int(rng.choice(len(Kind), p=shares.kinds)))
    light = LightKind(int(rng.choice(len(LightKind), p=shares.lights)))
    if kind != Kind.OPAQUE and light == LightKind.HARMONICS:
        light = LightKind.AROUND
    stretch = _stretch(rng, shares) if shares.stretch else np.ones(3)
    up = up / stretch  # as a normal of the table
    parts: dict[str, Any] = {
        **_paint(atlas, kind, rng, shares),
        **_gloss(kind, rng, shares),
        **_light(_units(directions * stretch), _units(up), light, rng, shares),
    }
    environment = int(rng.choice(environments))
    return Recipe(kind=int(kind), environment=environment, stretch=stretch, **parts)


def _units(vectors: np.ndarray) -> np.ndarray:
    """Divide by lengths; a vector 0 stays."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9))


def _stretch(rng: np.random.Generator, shares: Shares) -> np.ndarray:
    aspect, depth = rng.normal(0, shares.stretch, 2)
    return np.exp([aspect / 2, -aspect / 2, depth])


def _paint(atlas: Atlas, kind: Kind, rng: np.random.Generator, shares: Shares) -> dict[str, Any]:
    paint = Paint(int(rng.choice(len(Paint), p=shares.paints)))
    base, inks = _palette(paint, rng)
    strengths = np.zeros(LAYERS)
    if paint != Paint.ONE:
        strengths[0] = rng.uniform(0.1, 1) if paint == Paint.NATURAL else rng.uniform(0, 0.4)
        strengths[1] = rng.uniform(0.5, 1) * (rng.random() < 0.5)
    elif rng.random() < 0.3:
        strengths[0] = rng.uniform(0, 0.15)
    printed = {Paint.WHITE_WITH_BLACK: 1.0, Paint.STRONG_WITH_WHITE: 0.9, Paint.ONE: 0.0}
    strengths[2] = rng.uniform(0.7, 1) * (rng.random() < printed.get(paint, shares.printed))
    strengths[2] *= shares.printed > 0
    if shares.white and rng.random() < shares.white:
        base, inks[1] = _white_on_strong(rng)
        strengths[:2] = rng.uniform(0, 0.2), rng.uniform(0.7, 1)
    if kind == Kind.MIRROR:
        strengths[:] = 0
    if kind == Kind.GLASS:
        base, strengths[0] = 1 - (1 - base) * rng.uniform(0, 0.6), 0
    groups = (_NATURAL, _DRAWN, _PRINTED)
    once = np.array([0, 0, float(rng.random() < 0.6)])
    around = (rng.random(LAYERS) < 0.35).astype(float)
    return {
        "base": base,
        "colours": inks,
        "strengths": strengths,
        "maps": np.array([_map_of(atlas, group, rng) for group in groups]),
        "frames": np.stack([_frame(k, bool(around[k]), rng) for k in range(LAYERS)]),
        "shifts": np.where(once[:, None] > 0, rng.uniform(0.2, 0.8, (LAYERS, 2)), rng.random(2)),
        "around": around,
        "once": once,
    }


_NATURAL = (
    PatternKind.WOOD,
    PatternKind.CLOTH,
    PatternKind.NOISE,
    PatternKind.MARBLE,
    PatternKind.BLOTCHES,
    PatternKind.GRADIENT,
    PatternKind.STROKES,
)
_DRAWN = (PatternKind.PATCHES, PatternKind.STRIPES, PatternKind.CHECKS, PatternKind.DOTS)
_PRINTED = (PatternKind.TEXT, PatternKind.LOGO, PatternKind.LABEL)


def _map_of(atlas: Atlas, group: tuple[PatternKind, ...], rng: np.random.Generator) -> int:
    kind = group[int(rng.integers(len(group)))]
    found = np.flatnonzero(atlas.kinds == kind)
    return int(rng.choice(found)) if len(found) else 0


def _frame(layer: int, around: bool, rng: np.random.Generator) -> np.ndarray:
    """Coordinates of a map: prints face the viewer more or less, other patterns lie anyhow."""
    if layer == 2:
        turn = Rotation.from_euler(
            "zxy", [rng.normal(0, 25), rng.normal(0, 20), rng.normal(0, 30)], degrees=True
        ).as_matrix()
        size = log_uniform(rng, 0.4, 1.3)
    else:
        turn = Rotation.random(random_state=int(rng.integers(2**31))).as_matrix()
        size = log_uniform(rng, 0.4, 2.5)
    scale = np.array([size, -size * log_uniform(rng, 0.7, 1.4), 1])
    if around:
        scale[0] = max(1, round(rng.uniform(0.5, 3)))
    return scale[:, None] * turn


def _palette(paint: Paint, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """The base colour (3,) and the layers' (LAYERS, 3), linear."""
    base = _colour(rng, rng.uniform(0, 0.9))
    inks = np.stack([_colour(rng, rng.uniform(0, 1)) for _ in range(LAYERS)])
    match paint:
        case Paint.NEAR_GREY:
            base = _colour(rng, rng.uniform(0, 0.12))
            inks = np.stack([_colour(rng, rng.uniform(0, 0.15)) for _ in range(LAYERS)])
        case Paint.WHITE_WITH_BLACK:
            base = _colour(rng, 0.05, rng.uniform(0.6, 0.9))
            inks[2] = _colour(rng, rng.uniform(0, 0.3), rng.uniform(0.02, 0.1))
        case Paint.STRONG_WITH_WHITE:
            base = _colour(rng, rng.uniform(0.7, 1), log_uniform(rng, 0.1, 0.8))
            inks[2] = _colour(rng, rng.uniform(0, 0.15), rng.uniform(0.55, 0.92))
        case Paint.NATURAL:
            factor = np.exp(rng.normal(0, 0.35, 3) + rng.normal(0, 0.8))
            inks[0] = np.clip(base * factor, 0.02, 0.95)
    return base, inks


def _white_on_strong(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Two colours (3,), linear: in one of five cases the white one is the base."""
    strong = _colour(rng, rng.uniform(0.5, 1), log_uniform(rng, 0.1, 0.8))
    white = _colour(rng, rng.uniform(0, 0.15), rng.uniform(0.5, 0.92))
    return (white, strong) if rng.random() < _WHITE_BASE else (strong, white)


def _colour(rng: np.random.Generator, saturation: float, value: float | None = None) -> np.ndarray:
    value = log_uniform(rng, 0.05, 0.9) if value is None else value
    hue = rng.uniform(0, 6)
    pure = np.clip(np.abs((hue - np.array([0.0, 2.0, 4.0]) + 3) % 6 - 3) * -1 + 2, 0, 1)
    return np.asarray(np.clip(value * (1 - saturation * (1 - pure)), 0.01, 0.95))


def _gloss(kind: Kind, rng: np.random.Generator, shares: Shares) -> dict[str, Any]:
    alpha, ior = log_uniform(rng, 0.05, 0.6), rng.uniform(1.3, 1.8)
    front = np.full(3, ((ior - 1) / (ior + 1)) ** 2 * (log_uniform(rng, 0.5, 3)))
    coat, sigma = 0.04 * (rng.random() < shares.coated), rng.uniform(0, 0.7) * (rng.random() < 0.4)
    if rng.random() < shares.matte:
        front, coat = np.zeros(3), 0.0
    if kind == Kind.MIRROR:
        alpha, coat = log_uniform(rng, 0.03, 0.25), 0.0
        front = rng.uniform(0.5, 0.95) * (
            np.ones(3) if rng.random() < 0.6 else np.array([1, rng.uniform(0.6, 0.9), 0.4])
        )
    if kind == Kind.GLASS:
        alpha, front, coat, sigma = 0.03, np.full(3, 0.04), 0.0, 0.0
    return {
        "alpha": alpha,
        "alpha_range": rng.normal(0, 0.8) * (rng.random() < 0.3),
        "front": front,
        "coat": coat,
        "sigma": sigma,
        "bounce": rng.uniform(0.2, 0.9),
    }


def _light(
    directions: np.ndarray,
    up: np.ndarray,
    light: LightKind,
    rng: np.random.Generator,
    shares: Shares,
) -> dict[str, Any]:
    count = {LightKind.ONE_LAMP: 1, LightKind.LABORATORY: 1}.get(light, 0)
    if light == LightKind.LAMPS:
        count = int(rng.choice([2, 2, 2, 3, 4]))
    balanced = rng.random() < 0.75
    level = 1.0
    if count:
        level = log_uniform(rng, 0.02, 0.15 if light == LightKind.LABORATORY else 0.6)
    power = np.zeros((LAMPS, 3))
    standing = up[2] > _FROM_ABOVE and light in _WITH_TABLE and rng.random() < shares.standing
    places = lamp_places(directions, rng, LAMPS, up if standing else None)
    tint = 0.05 if rng.random() < 0.7 else 0.4
    for k in range(count):
        strength = rng.uniform(0.25, 1) if k else 1.0
        power[k] = strength * np.exp(rng.normal(0, tint, 3) * (balanced or tint))
    near = rng.random(LAMPS) < 0.3
    wide = rng.random(LAMPS) < 0.4
    turn = _turn(up, rng)
    if not standing and rng.random() < 0.15:
        turn = Rotation.random(random_state=int(rng.integers(2**31))).as_matrix()
    falling = (directions[places] @ up).clip(0)
    cast = rng.normal(0, 0.06 if balanced else 0.3, 3)
    return {
        "turn": turn,
        "standing": float(standing),
        "table": _colour(rng, rng.uniform(0, 0.8) ** 2) if standing else np.zeros(3),
        "table_light": falling @ power,
        "ambient": level * np.exp(cast),
        "lamp": places,
        "power": power,
        "distance": np.where(near, rng.uniform(1.6, 6, LAMPS), np.inf),
        "radius": np.where(wide, np.radians(rng.uniform(3, 25, LAMPS)), 0.01),
        "given": float(light == LightKind.HARMONICS),
        "harmonic_gain": log_uniform(rng, 0.7, 2.2),
        "harmonic_noise": rng.normal(0, rng.uniform(0.05, 0.4), (9, 1))
        + rng.normal(0, rng.uniform(0, 0.1), (9, 3)),
    }


def _turn(up: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Turn surroundings: upright with a body that stands, else as seen from a little above."""
    yaw = Rotation.from_euler("y", rng.uniform(0, 360), degrees=True).as_matrix()
    if up.any():
        tilt = rotation_between(up, np.array([0.0, 1, 0]))
    else:
        tilt = Rotation.from_euler("x", rng.normal(-15, 20), degrees=True).as_matrix()
    return np.asarray(yaw @ tilt)


def lamp_places(
    directions: np.ndarray, rng: np.random.Generator, count: int, up: np.ndarray | None = None
) -> np.ndarray:
    """Draw lamps at stored directions, at least 30 degrees apart; most shine from above.

    Parameters
    ----------
    directions : (DIRECTIONS, 3) ndarray
    rng : numpy.random.Generator
    count : int
    up : (3,) ndarray, optional
        Away from a table; lamps are above it.

    Returns
    -------
    (count,) ndarray of int
        The first one shines from in front of the body.
    """
    apart = math.cos(math.radians(30))
    above = np.ones(len(directions), bool) if up is None else directions @ up > _LOWEST_LAMP
    near = np.flatnonzero(above & (directions[:, 2] > math.cos(math.radians(80))))
    likely = np.exp(0.8 * directions[near, 1])
    places = [int(rng.choice(near, p=likely / likely.sum()))]
    for one in rng.permutation(np.flatnonzero(above & (directions[:, 2] > -0.3))):
        if len(places) < count and all(directions[one] @ directions[p] < apart for p in places):
            places.append(int(one))
    return np.array(places[:1] * (count - len(places)) + places)[::-1][:count][::-1].copy()
