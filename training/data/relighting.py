"""Photos of `training.data.traced_objects` under random light: a few milliseconds each.

Equation: for a distant light toward l, with the half vector h between l and the viewer v,

    I = V (albedo n.l (1 - F) + pi F D(n.h) G(n.l) G(n.v) / (4 n.v)),   F = f + (1 - f) (1 - v.h)^5,

with the visibility V and the D and G of a rough surface. The ambient light is a random spherical
harmonic of low degree. The diffuse lobe receives it through the object's own shadows, from the
directions whose shadows are known; the specular lobe mirrors it at 2 (n.v) n - v. Extended lights
illuminate from the known directions nearby and widen the specular lobe.

Citation: B. Walter et al. 2007, doi:10.2312/EGWR/EGSR07/195-206 (D, G; D also by P. Beckmann and A.
Spizzichino); C. Schlick 1994, doi:10.1111/1467-8659.1330233 (F); R. O. Dror, A. S. Willsky, E. H.
Adelson 2004, doi:10.1167/4.9.11 (harmonics of falling power).

Limits: one bounce; no light from behind the object.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from enum import IntEnum
from pathlib import Path

import numpy as np

from isc_core.shading.environment_map import directions
from synth.light_rigs.harmonics import smooth_pattern, turned_to_front

from .random_draws import log_uniform
from .traced_objects import LIGHTS, WIDEST, TracedObject, objects_in


class LightCount(IntEnum):
    """How many directional lights there are besides the ambient light."""

    NONE = 0
    ONE = 1
    SEVERAL = 2


# Solid angle of each known direction, over pi.
_SOLID_ANGLE = 2 / LIGHTS * (1 - math.cos(math.radians(WIDEST)))
_ROWS = 32  # of the ambient environment map
_TRIES = 20
_LEAST_SECOND = 0.12  # of the lights' share: a fainter second light is drawn again
_LEAST_FIRST = 0.25  # of all light in the image: a fainter first light is drawn again
_ABOVE = 0.8  # log odds per unit of height: lights stand above more often than below
_VIEW = np.array([0.0, 0.0, 1.0], np.float32)


@dataclass(frozen=True)
class RelightableObject:
    """The N pixels of an object, ready to be lit.

    Attributes
    ----------
    normals : (N, 3) ndarray
        Camera frame: x right, y up, z toward the viewer.
    albedos : (ALBEDOS, N, 3) ndarray
        Linear, in [0, 1].
    mirrored : (N,) ndarray of int32
        Cell of the ambient environment map in the mirror direction of the view.
    toward : (LIGHTS, 3) ndarray
        Unit vectors to the lights.
    reached : (LIGHTS, N) ndarray of bool
        Pixels that each light reaches.
    mask : (SIZE, SIZE) ndarray of bool
        Pixels of the object.
    shape : str
        Shape family, or name of the data set's object.
    """

    normals: np.ndarray
    albedos: np.ndarray
    mirrored: np.ndarray
    toward: np.ndarray
    reached: np.ndarray
    mask: np.ndarray
    shape: str

    @classmethod
    def of(cls, traced: TracedObject) -> "RelightableObject":
        """Collect the pixels of a traced object.

        Parameters
        ----------
        traced : TracedObject

        Returns
        -------
        RelightableObject
        """
        normals = traced.normals[traced.mask].astype(np.float32)
        return cls(
            normals.astype(np.float16),
            traced.albedos[:, traced.mask],
            _mirror_cells(normals),
            traced.toward,
            np.ascontiguousarray(traced.reached[:, traced.mask]),
            traced.mask,
            traced.shape,
        )

    def mapped(self, space: np.ndarray) -> "RelightableObject":
        """Apply a linear map of space that keeps the viewing direction.

        Visibility is invariant under linear maps. The pixels keep their order: the caller moves
        them to where the map puts them in the image.

        Parameters
        ----------
        space : (3, 3) ndarray
            The map.

        Returns
        -------
        RelightableObject
            With the normals and lights of the mapped object.
        """
        normals = _unit(self.normals.astype(np.float32) @ np.linalg.inv(space).astype(np.float32))
        return replace(
            self,
            normals=normals,
            mirrored=_mirror_cells(normals),
            toward=_unit(self.toward @ space.T.astype(np.float32)),
        )


def relightable_objects(
    folders: Iterable[Path], excluded: Iterable[str]
) -> Iterator[RelightableObject]:
    """Read the objects of folders of `training.data.traced_objects`.

    Parameters
    ----------
    folders : iterable of Path
        Read in this order.
    excluded : iterable of str
        Shapes to leave out.

    Yields
    ------
    RelightableObject
        The objects, ordered by name within a folder.
    """
    left_out = set(excluded)
    for folder in folders:
        for traced in objects_in(folder):
            if traced.shape not in left_out:
                yield RelightableObject.of(traced)


@dataclass(frozen=True)
class RelitPhoto:
    """A photo with its ground truth.

    Attributes
    ----------
    photo : (SIZE, SIZE, 3) ndarray
        Linear, float32, mean 1 on the object.
    count : LightCount
        How many directional lights there are.
    toward : (K, 3) ndarray
        Unit vectors to the lights; K = 0 without any.
    shares : (K,) ndarray
        Of the lights in the image; their sum is 1.
    shading : (N,) ndarray
        Radiance of a white Lambertian surface, in the photo's units.
    """

    photo: np.ndarray
    count: LightCount
    toward: np.ndarray
    shares: np.ndarray
    shading: np.ndarray


@dataclass(frozen=True)
class SpecularLobe:
    """A specular lobe.

    Attributes
    ----------
    alpha : float
        Roughness, > 0.
    front : float
        Reflectance at normal incidence; 0: no specular reflection.
    beckmann : bool
        Beckmann distribution instead of GGX.
    """

    alpha: float
    front: float
    beckmann: bool = False


def draw_photo(relit: RelightableObject, rng: np.random.Generator, count: LightCount) -> RelitPhoto:
    """Draw a photo under ambient light and a number of directional lights.

    Parameters
    ----------
    relit : RelightableObject
        The object.
    rng : np.random.Generator
        Draws light, albedo and gloss.
    count : LightCount
        `SEVERAL`: two to four lights, of which the second contributes visibly.

    Returns
    -------
    RelitPhoto
        The photo and its ground truth.
    """
    for _ in range(_TRIES):
        photo, toward, light, shading = _photo(relit, rng, count)
        if count == LightCount.NONE or _is_clear(photo, light, count):
            break
    picture = np.zeros((*relit.mask.shape, 3), np.float32)
    scale = max(float(photo.mean()), 1e-9)
    picture[relit.mask] = photo / scale
    shares = light / max(float(light.sum()), 1e-9)
    return RelitPhoto(picture, count, toward, shares, shading / scale)


def _is_clear(photo: np.ndarray, light: np.ndarray, count: LightCount) -> bool:
    """Whether the lights contribute enough to be recognised."""
    total = float(np.minimum(photo, 3 * photo.mean()).mean())
    strongest = np.sort(light)[::-1]
    if strongest[0] <= _LEAST_FIRST * total:
        return False
    if count == LightCount.ONE:
        return True
    return len(light) > 1 and bool(strongest[1] > _LEAST_SECOND * light.sum())


def _photo(
    relit: RelightableObject, rng: np.random.Generator, count: LightCount
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The light (N, 3), the lights' directions (K, 3) and parts of the image (K,), shading (N,)."""
    normals, lobe = relit.normals.astype(np.float32), _random_lobe(rng)
    albedo = relit.albedos[int(rng.integers(len(relit.albedos)))].astype(np.float32)
    if rng.random() < 0.25:
        albedo = np.broadcast_to(rng.uniform(0.05, 0.8, 3).astype(np.float32), albedo.shape)
    cosines = np.maximum(relit.toward @ normals.T, 0) * relit.reached
    photo, shading = _ambient(relit, normals, albedo, lobe, cosines, rng, count)
    if count == LightCount.NONE:
        return photo, np.zeros((0, 3)), np.zeros(0), shading
    several = count == LightCount.SEVERAL
    tint, light = 0.6 if several and rng.random() < 0.4 else 0.04, []
    places = _light_places(relit.toward, rng, int(rng.choice([2, 2, 2, 3, 4])) if several else 1)
    half_angle = math.radians(rng.uniform(3, 14)) if rng.random() < 0.35 else 0.0
    for k, place in enumerate(places):
        strength = rng.uniform(0.4, 1) if k else 1.0
        irradiance = _nearby(relit, place, half_angle) @ cosines
        one = (
            _reflected(
                relit.toward[place], normals, cosines[place], irradiance, albedo, lobe, half_angle
            )
            * strength
            * _tint(rng, tint)
        )
        photo, shading = photo + one, shading + strength * irradiance
        light.append(float(np.minimum(one, 2).mean()))
    return photo, relit.toward[places], np.array(light), shading


def _ambient(
    relit: RelightableObject,
    normals: np.ndarray,
    albedo: np.ndarray,
    lobe: SpecularLobe,
    cosines: np.ndarray,
    rng: np.random.Generator,
    count: LightCount,
) -> tuple[np.ndarray, np.ndarray]:
    """The light (N, 3) under ambient light alone, and its shading (N,)."""
    around = _random_environment(rng)
    level = 1.0
    if count != LightCount.NONE:
        level = log_uniform(rng, 0.02, 0.5 if rng.random() < 0.3 else 0.25)
    irradiance = (_SOLID_ANGLE * around[_cells_of(relit.toward)]) @ cosines
    diffuse = albedo * irradiance[:, None]
    mirrored = np.zeros_like(irradiance)
    if lobe.front:
        mirrored = _fresnel(lobe.front, normals[:, 2]) * around[relit.mirrored]
    photo = (diffuse + mirrored[:, None]) * level * _tint(rng, 0.08)
    photo += rng.uniform(0, 0.07) * albedo.mean(0) * diffuse  # a rough interreflection
    return photo, irradiance * level


def _nearby(relit: RelightableObject, place: int, half_angle: float) -> np.ndarray:
    """Weights (LIGHTS,) of the known directions in an extended light; their sum is 1."""
    near = np.exp(-(1 - relit.toward @ relit.toward[place]) / max(half_angle, 1e-3) ** 2)
    near = np.where(near > 0.05, near, 0)
    return np.asarray(near / near.sum(), np.float32)


def _reflected(
    toward: np.ndarray,
    normals: np.ndarray,
    cosines: np.ndarray,
    irradiance: np.ndarray,
    albedo: np.ndarray,
    lobe: SpecularLobe,
    half_angle: float,
) -> np.ndarray:
    """The light (N, 3) of one light that gives a white surface facing it radiance 1.

    `cosines` (N,) of the light's centre, `irradiance` (N,) of its whole extent.
    """
    if not lobe.front:
        return np.asarray(albedo * irradiance[:, None])
    half = (toward + _VIEW) / np.linalg.norm(toward + _VIEW)
    fresnel = float(_fresnel(lobe.front, half[2]))
    square = lobe.alpha**2 + math.tan(half_angle) ** 2 / 4
    view = np.maximum(normals[:, 2], 0.02)
    steep = np.clip(normals @ half, 1e-3, 1) ** 2
    if lobe.beckmann:
        distribution = np.exp((1 - 1 / steep) / square) / (square * steep**2)
    else:
        distribution = square / (steep * (square - 1) + 1) ** 2
    specular = (
        fresnel
        * distribution
        * _masking(view, square)
        * _masking(np.maximum(cosines, 0.02), square)
        / (4 * view)
        * (cosines > 0)
    )
    return np.asarray(albedo * (irradiance * (1 - fresnel))[:, None] + specular[:, None])


def _fresnel(front: float, cosine: np.ndarray) -> np.ndarray:
    return np.asarray(front + (1 - front) * (1 - cosine) ** 5)


def _masking(cosine: np.ndarray, square: float) -> np.ndarray:
    return np.asarray(2 * cosine / (cosine + np.sqrt(square + (1 - square) * cosine**2)))


def _random_environment(rng: np.random.Generator) -> np.ndarray:
    """Ambient radiance of mean about 1 at `directions(_ROWS)`, flattened."""
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


def _cells_of(towards: np.ndarray) -> np.ndarray:
    """Indices (N,) int32 of the cells of `_random_environment` nearest to unit vectors (N, 3)."""
    turn = np.float32(_ROWS / np.pi)
    rows = np.minimum((np.arccos(np.clip(towards[:, 1], -1, 1)) * turn).astype(np.int32), _ROWS - 1)
    columns = np.floor(np.arctan2(towards[:, 0], -towards[:, 2]) * turn).astype(np.int32)
    return np.asarray(rows * 2 * _ROWS + columns % (2 * _ROWS), np.int32)


def _mirror_cells(normals: np.ndarray) -> np.ndarray:
    """Cells (N,) of the ambient environment map in the mirror direction of the view."""
    return _cells_of(2 * normals[:, 2:] * normals - _VIEW)


def _unit(vectors: np.ndarray) -> np.ndarray:
    lengths = np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-9)
    return np.asarray(vectors / lengths, np.float32)


def _tint(rng: np.random.Generator, strength: float) -> np.ndarray:
    return np.exp(rng.normal(0, strength, 3)).astype(np.float32)


def _random_lobe(rng: np.random.Generator) -> SpecularLobe:
    if rng.random() < 0.12:
        return SpecularLobe(1, 0)
    alpha = log_uniform(rng, 0.03, 0.2 if rng.random() < 0.5 else 0.45)
    ior = rng.uniform(1.35, 1.8)
    gain = rng.uniform(1, 4) if rng.random() < 0.15 else 1
    return SpecularLobe(alpha, ((ior - 1) / (ior + 1)) ** 2 * gain, bool(rng.random() < 0.5))


def _light_places(toward: np.ndarray, rng: np.random.Generator, count: int) -> list[int]:
    """Up to `count` lights, 30 or 40 degrees apart; the first within 75 degrees of the view."""
    apart = math.cos(math.radians(40 if rng.random() < 0.7 else 30))
    near = np.flatnonzero(toward[:, 2] > math.cos(math.radians(75)))
    likely = np.exp(_ABOVE * toward[near, 1])
    places = [int(rng.choice(near, p=likely / likely.sum()))]
    for light in rng.permutation(len(toward)):
        if len(places) < count and all(toward[light] @ toward[place] < apart for place in places):
            places.append(int(light))
    return places
