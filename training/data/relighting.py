"""`training.data.traced_objects` under light that is drawn anew each time: gloss, lamps and smooth
light, in a few milliseconds a picture.

Equation: of a far lamp toward l, with the half vector h between l and the viewer,

    I = V (albedo n.l (1 - F) + pi F D(n.h) G(n.l) G(n.v) / (4 n.v)),   F = f + (1 - f) (1 - v.h)^5,

V whether it is seen, D and G those of a rough surface. The light from around is a random harmonic
of low degree: paint gets of it what its normal and the object's own shadows let through (of the
directions whose shadows are known), gloss mirrors it at 2 n.v n - v. Wide lamps shine from the
known directions that are near, and on a rougher gloss.

Citation: B. Walter et al. 2007, doi:10.2312/EGWR/EGSR07/195-206 (D, G; D also P. Beckmann and A.
Spizzichino's); C. Schlick 1994, doi:10.1111/1467-8659.1330233 (F); R. O. Dror, A. S. Willsky, E. H.
Adelson 2004, doi:10.1167/4.9.11 (harmonics whose power falls).

Limits: one bounce of light alone; no light from behind the object.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from isc_core.shading.environment_map import directions
from synth.light_rigs.harmonics import smooth_pattern, turned_to_front

from .random_draws import log_uniform
from .traced_objects import LAMPS, WIDEST, Unlit

NONE, ONE, SEVERAL = range(3)  # lamps
_SKY = 2 / LAMPS * (1 - math.cos(math.radians(WIDEST)))  # what each direction stands for, over pi
_ROWS = 32  # of the light from around
_TRIES = 20
_SEEN = 0.12  # of the lamps' light in the picture: a second lamp that gives less is not asked for
_FAINT = 0.25  # of all light in the picture: a first lamp that gives less is not asked for
_ABOVE = 0.8  # how much likelier lamps stand above than at the side, as a logarithm
_VIEW = np.array([0.0, 0.0, 1.0], np.float32)


@dataclass(frozen=True)
class Relit:
    """An object prepared: of its N pixels `normals` (N, 3), `albedos` (PAINTS, N, 3), `mirrored`
    (N,), where in the light from around the view is mirrored to; `toward` (LAMPS, 3), `reached`
    (LAMPS, N) bool; `mask` (SIZE, SIZE); `shape`, its family's name.
    """

    normals: np.ndarray
    albedos: np.ndarray
    mirrored: np.ndarray
    toward: np.ndarray
    reached: np.ndarray
    mask: np.ndarray
    shape: str

    @classmethod
    def of(cls, unlit: Unlit) -> "Relit":
        """The object's pixels."""
        normals = unlit.normals[unlit.mask].astype(np.float32)
        reached = np.ascontiguousarray(unlit.reached[:, unlit.mask])
        albedos, mirrored = unlit.albedos[:, unlit.mask], _mirrored(normals)
        return cls(
            normals.astype(np.float16),
            albedos,
            mirrored,
            unlit.toward,
            reached,
            unlit.mask,
            unlit.shape,
        )

    def mapped(self, space: np.ndarray) -> "Relit":
        """The object after a linear map of `space` (3, 3) that keeps the view: what sees what stays
        true, and its pixels are as they were, to be moved by whoever shows them where the map moves
        them in the picture.
        """
        normals = _unit(self.normals.astype(np.float32) @ np.linalg.inv(space).astype(np.float32))
        return replace(
            self,
            normals=normals,
            mirrored=_mirrored(normals),
            toward=_unit(self.toward @ space.T.astype(np.float32)),
        )


@dataclass(frozen=True)
class Lit:
    """A photo (SIZE, SIZE, 3) float32 of mean 1 on the object; `lamps`: NONE, ONE or SEVERAL;
    `toward` (K, 3) and `shares` (K,) of their light in the picture, adding up to 1; K = 0 for NONE;
    `shading` (N,): what white paint there would give back, in the photo's units.
    """

    photo: np.ndarray
    lamps: int
    toward: np.ndarray
    shares: np.ndarray
    shading: np.ndarray


@dataclass(frozen=True)
class Gloss:
    """`alpha`: roughness, > 0;

    `front`: mirrored along the normal; `beckmann`: else GGX. None of it where `front` is 0.
    """

    alpha: float
    front: float
    beckmann: bool = False


def draw_photo(relit: Relit, rng: np.random.Generator, lamps: int) -> Lit:
    """A photo under smooth light alone, or under one lamp or two to four besides, of which no
    second one goes unseen.
    """
    for _ in range(_TRIES):
        photo, toward, light, shading = _photo(relit, rng, lamps)
        total = float(np.minimum(photo, 3 * photo.mean()).mean())
        strongest = np.sort(light)[::-1]
        if lamps == NONE or (
            strongest[0] > _FAINT * total
            and (lamps == ONE or (len(light) > 1 and strongest[1] > _SEEN * light.sum()))
        ):
            break
    picture = np.zeros((*relit.mask.shape, 3), np.float32)
    scale = max(float(photo.mean()), 1e-9)
    picture[relit.mask] = photo / scale
    return Lit(picture, lamps, toward, light / max(float(light.sum()), 1e-9), shading / scale)


def _photo(
    relit: Relit, rng: np.random.Generator, lamps: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The light (N, 3), the lamps' directions (K, 3) and their light in the picture (K,), and the
    shading (N,).
    """
    normals, gloss = relit.normals.astype(np.float32), _gloss(rng)
    albedo = relit.albedos[int(rng.integers(len(relit.albedos)))].astype(np.float32)
    if rng.random() < 0.25:
        albedo = np.broadcast_to(rng.uniform(0.05, 0.8, 3).astype(np.float32), albedo.shape)
    facing = np.maximum(relit.toward @ normals.T, 0) * relit.reached
    around, level = (
        _around(rng),
        1.0 if lamps == NONE else log_uniform(rng, 0.02, 0.5 if rng.random() < 0.3 else 0.25),
    )
    arriving = (_SKY * around[_place_around(relit.toward)]) @ facing
    matt = albedo * arriving[:, None]
    mirrored = (
        _fresnel(gloss.front, normals[:, 2]) * around[relit.mirrored]
        if gloss.front
        else np.zeros_like(arriving)
    )
    photo = (matt + mirrored[:, None]) * level * _tint(rng, 0.08)
    photo += (
        rng.uniform(0, 0.07) * albedo.mean(0) * matt
    )  # a little of what its own parts throw at each other
    shading = arriving * level
    if lamps == NONE:
        return photo, np.zeros((0, 3)), np.zeros(0), shading
    tint, light = 0.6 if lamps == SEVERAL and rng.random() < 0.4 else 0.04, []
    places = _places(relit.toward, rng, int(rng.choice([2, 2, 2, 3, 4])) if lamps == SEVERAL else 1)
    wide = math.radians(rng.uniform(3, 14)) if rng.random() < 0.35 else 0.0
    for k, place in enumerate(places):
        strength = rng.uniform(0.4, 1) if k else 1.0
        spread = _near(relit, place, wide) @ facing
        one = (
            _lamp_light(relit, normals, facing[place], spread, place, albedo, gloss, wide)
            * strength
            * _tint(rng, tint)
        )
        photo, shading = photo + one, shading + strength * spread
        light.append(float(np.minimum(one, 2).mean()))
    return photo, relit.toward[places], np.array(light), shading


def _near(relit: Relit, place: int, wide: float) -> np.ndarray:
    """How much of a lamp's light (LAMPS,) comes from each of the known directions;

    `wide`: half the angle that it is seen under.
    """
    near = np.exp(-(1 - relit.toward @ relit.toward[place]) / max(wide, 1e-3) ** 2)
    near = np.where(near > 0.05, near, 0)
    return np.asarray(near / near.sum(), np.float32)


def _lamp_light(
    relit: Relit,
    normals: np.ndarray,
    direct: np.ndarray,
    arriving: np.ndarray,
    place: int,
    albedo: np.ndarray,
    gloss: Gloss,
    wide: float,
) -> np.ndarray:
    """The light (N, 3) of a lamp that gives white paint which faces it 1:

    `direct` (N,) as if it were small, `arriving` (N,) as it is.
    """
    toward = relit.toward[place]
    if not gloss.front:
        return np.asarray(albedo * arriving[:, None])
    half = (toward + _VIEW) / np.linalg.norm(toward + _VIEW)
    fresnel = float(_fresnel(gloss.front, half[2]))
    square, view = gloss.alpha**2 + math.tan(wide) ** 2 / 4, np.maximum(normals[:, 2], 0.02)
    steep = np.clip(normals @ half, 1e-3, 1) ** 2
    if gloss.beckmann:
        lobe = np.exp((1 - 1 / steep) / square) / (square * steep**2)
    else:
        lobe = square / (steep * (square - 1) + 1) ** 2
    specular = (
        fresnel
        * lobe
        * _masking(view, square)
        * _masking(np.maximum(direct, 0.02), square)
        / (4 * view)
        * (direct > 0)
    )
    return np.asarray(albedo * (arriving * (1 - fresnel))[:, None] + specular[:, None])


def _fresnel(front: float, cosine: np.ndarray) -> np.ndarray:
    return np.asarray(front + (1 - front) * (1 - cosine) ** 5)


def _masking(cosine: np.ndarray, square: float) -> np.ndarray:
    return np.asarray(2 * cosine / (cosine + np.sqrt(square + (1 - square) * cosine**2)))


def _around(rng: np.random.Generator) -> np.ndarray:
    """The light from around, of mean about 1, at `directions(_ROWS)`, as one row."""
    towards = directions(_ROWS).reshape(-1, 3)
    degree, contrast = int(rng.integers(1, 5)), rng.uniform(0.2, 1.7)
    light = np.maximum(1 + smooth_pattern(towards, degree, contrast, rng), 0)
    front, above = light @ towards[:, 2], light @ towards[:, 1]
    grid = light.reshape(_ROWS, 2 * _ROWS)
    if front < 0:
        grid = turned_to_front(grid)
    if above < 0 and rng.random() < 0.7:
        grid = grid[::-1]
    return np.asarray(grid / max(float(light.mean()), 1e-9), np.float32).ravel()


def _place_around(towards: np.ndarray) -> np.ndarray:
    """Where unit vectors (N, 3) are in `directions(_ROWS)`, as one row:

    (N,) int32, the nearest of a latitude and longitude.
    """
    turn = np.float32(_ROWS / np.pi)
    rows = np.minimum((np.arccos(np.clip(towards[:, 1], -1, 1)) * turn).astype(np.int32), _ROWS - 1)
    columns = np.floor(np.arctan2(towards[:, 0], -towards[:, 2]) * turn).astype(np.int32) % (
        2 * _ROWS
    )
    return np.asarray(rows * 2 * _ROWS + columns, np.int32)


def _mirrored(normals: np.ndarray) -> np.ndarray:
    """Where the view is mirrored to (N,), in the light from around."""
    return _place_around(2 * normals[:, 2:] * normals - _VIEW)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return np.asarray(
        vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-9), np.float32
    )


def _tint(rng: np.random.Generator, strength: float) -> np.ndarray:
    return np.exp(rng.normal(0, strength, 3)).astype(np.float32)


def _gloss(rng: np.random.Generator) -> Gloss:
    if rng.random() < 0.12:
        return Gloss(1, 0)
    alpha, ior = log_uniform(rng, 0.03, 0.2 if rng.random() < 0.5 else 0.45), rng.uniform(1.35, 1.8)
    return Gloss(
        alpha,
        ((ior - 1) / (ior + 1)) ** 2 * (rng.uniform(1, 4) if rng.random() < 0.15 else 1),
        bool(rng.random() < 0.5),
    )


def _places(toward: np.ndarray, rng: np.random.Generator, count: int) -> list[int]:
    """Lamps at least 30 or 40 degrees apart, the first of them not too far at the side; as many as
    there can be.
    """
    apart, near = (
        math.cos(math.radians(40 if rng.random() < 0.7 else 30)),
        np.flatnonzero(toward[:, 2] > math.cos(math.radians(75))),
    )
    likely = np.exp(_ABOVE * toward[near, 1])
    places = [int(rng.choice(near, p=likely / likely.sum()))]
    for lamp in rng.permutation(len(toward)):
        if len(places) < count and all(toward[lamp] @ toward[place] < apart for place in places):
            places.append(int(lamp))
    return places
