"""Light on bodies with relief, without the noise of paths.

Problem: relief of a few degrees changes the light by some hundredths; path tracing at an affordable
number of samples is noisier. What needs rays varies slowly over a body: it is traced on a coarse
grid, and what varies fast is closed.

Equation: with the radiance E_j of N directions w_j, of solid angle s each, and V_j(x) whether
the smooth body lets it pass, the coefficients of the light that reaches x are

    T_lm(x) = sum_j V_j(x) E_j s Y_lm(w_j),    irradiance = sum_lm A_l T_lm(x) Y_lm(n'),  l <= 4

A_l those of the clamped cosine. Lamps, and directions that outshine the others, add
P V(x) max(n'.w, 0) with soft shadows. The body's own light is estimated from the share of the
hemisphere that it covers. Gloss is a GGX lobe: for lamps closed, for the surroundings smoothed as
wide as the lobe, times the share that it reflects of uniform light.

Citation: R. Ramamoorthi, P. Hanrahan 2001, doi:10.1145/383259.383317 (A_l); P.-P. Sloan, J. Kautz,
J. Snyder 2002, doi:10.1145/566654.566612 (coefficients of transferred light); B. Walter et al.
2007, doi:10.2312/EGWR/EGSR07/195-206 (GGX); C. Schlick 1994, doi:10.1111/1467-8659.1330233.

Limits: relief shades itself by its normals alone; lamps are distant; of ten thousand points of the
grid the tracer takes about one for covered all around.
"""

from dataclasses import dataclass

import numpy as np
import torch
from scipy import ndimage

from isc_core.shading.environment_map import directions, solid_angles
from isc_core.shading.lights import sphere_directions
from isc_core.shading.spherical_harmonics import real_sh
from synth.scene.tracing import LIFT, Tracer
from training.world.environments import smoothed_levels
from training.world.reflectance import reflected_share

_DIRECTIONS = 192
_OUTSHINES = 0.1  # of all light: such a direction is a lamp
_RAYS = 8  # to each lamp
_AT_ONCE = 32  # directions that are traced together
_FOURTH = np.sqrt(1 / np.pi) * np.array(
    [
        0.75 * np.sqrt(35),
        0.75 * np.sqrt(17.5),
        0.75 * np.sqrt(5),
        0.75 * np.sqrt(2.5),
        3 / 16,
        0.75 * np.sqrt(2.5),
        0.375 * np.sqrt(5),
        0.75 * np.sqrt(17.5),
        3 / 16 * np.sqrt(35),
    ]
)
_COSINE = np.repeat([np.pi, 2 * np.pi / 3, np.pi / 4, -np.pi / 24], [1, 3, 5, 9])


@dataclass(frozen=True, eq=False)
class Lamp:
    """A distant lamp.

    Attributes
    ----------
    toward : (3,) ndarray
        Unit, camera frame.
    power : (3,) ndarray
        Irradiance of a surface that faces it.
    radius : float
        Half the angle under which it is seen, radians.
    """

    toward: np.ndarray
    power: np.ndarray
    radius: float


@dataclass(frozen=True, eq=False)
class Room:
    """Light from all around and lamps.

    Attributes
    ----------
    radiance : (rows, 2 rows, 3) ndarray
        In the layout of `isc_core.shading.environment_map`.
    turn : (3, 3) ndarray
        Rotation from the camera frame to that of the surroundings.
    lamps : tuple of Lamp
    """

    radiance: np.ndarray
    turn: np.ndarray
    lamps: tuple[Lamp, ...]


@dataclass(frozen=True)
class Gloss:
    """A weak lobe.

    Attributes
    ----------
    front : float
        Reflectance at normal incidence; 0 for none.
    alpha : float
        GGX roughness.
    """

    front: float
    alpha: float


@dataclass(frozen=True, eq=False)
class ReachingLight:
    """The light that reaches the places of a coarse grid.

    Attributes
    ----------
    fields : (3 * 18 + 1 + lamps, h, w) ndarray
        Coefficients of the surroundings, the share of the hemisphere that the body covers, and the
        share of each lamp that is seen.
    lamps : tuple of Lamp
    mean : (3,) ndarray
        Irradiance in the surroundings, averaged over all normals.
    """

    fields: np.ndarray
    lamps: tuple[Lamp, ...]
    mean: np.ndarray

    def enlarged(self, side: int) -> np.ndarray:
        """Interpolate the fields at the pixels of a photo.

        Parameters
        ----------
        side : int
            Of the photo.

        Returns
        -------
        (fields, side * side) ndarray of float32
        """
        size = self.fields.shape[1]
        place = np.clip((np.arange(side) + 0.5) * (size / side) - 0.5, 0, size - 1)
        first = np.minimum(place.astype(int), size - 2)
        share = (place - first).astype(np.float32)
        found = np.empty((len(self.fields), side, side), np.float32)
        for field, target in zip(self.fields.astype(np.float32), found, strict=True):
            rows = field[first] + share[:, None] * (field[first + 1] - field[first])
            target[:] = rows[:, first] + share * (rows[:, first + 1] - rows[:, first])
        return found.reshape(len(self.fields), -1)


def harmonics(normal: np.ndarray) -> np.ndarray:
    """Evaluate the spherical harmonics of degrees 0, 1, 2 and 4.

    Parameters
    ----------
    normal : (N, 3) ndarray
        Unit.

    Returns
    -------
    (N, 18) ndarray
    """
    normal = np.asarray(normal)
    x, y, z = normal.T
    x2, y2, z2 = x * x, y * y, z * z
    fourth = [
        x * y * (x2 - y2),
        y * z * (3 * x2 - y2),
        x * y * (7 * z2 - 1),
        y * z * (7 * z2 - 3),
        35 * z2 * z2 - 30 * z2 + 3,
        x * z * (7 * z2 - 3),
        (x2 - y2) * (7 * z2 - 1),
        x * z * (x2 - 3 * y2),
        x2 * (x2 - 3 * y2) - y2 * (3 * x2 - y2),
    ]
    return np.concatenate([real_sh(normal), np.stack(fourth, -1) * _FOURTH], axis=-1)


def reaching_light(
    room: Room,
    tracer: Tracer,
    position: np.ndarray,
    normal: np.ndarray,
    mask: np.ndarray,
    rng: np.random.Generator,
) -> ReachingLight:
    """Trace what light reaches a body.

    Parameters
    ----------
    room : Room
    tracer : Tracer
        The smooth body.
    position, normal : (N, 3) ndarray
        Of the pixels of a coarse grid.
    mask : (h, w) ndarray of bool
        Those pixels.
    rng : numpy.random.Generator
        Draws the rays to lamps.

    Returns
    -------
    ReachingLight
    """
    toward = sphere_directions(_DIRECTIONS)
    around, lamps = _divided(room, toward)
    lifted = position + LIFT * normal
    visible = _passing(tracer, lifted, toward)
    weight = (around[:, None] * harmonics(toward)[:, :, None]).reshape(_DIRECTIONS, -1)
    facing = np.clip(normal @ toward.T, 0, None)
    covered = 1 - (visible * facing).sum(1) / facing.sum(1)
    columns = [visible @ weight, covered[:, None]]
    for lamp in lamps:
        seen = _passing(tracer, lifted, _rays(lamp, rng))
        columns.append(seen.mean(axis=1, keepdims=True))
    values = np.concatenate(columns, axis=1)
    picture = np.zeros((values.shape[1], *mask.shape))
    picture[:, mask] = values.T
    nearest = ndimage.distance_transform_edt(~mask, return_distances=False, return_indices=True)
    mean = around.sum(0) / 4
    return ReachingLight(picture[:, nearest[0], nearest[1]], lamps, mean)


def outgoing_light(
    light: ReachingLight,
    fields: np.ndarray,
    normal: np.ndarray,
    albedo: np.ndarray,
    gloss: Gloss,
    room: Room,
) -> np.ndarray:
    """Compute the light toward the viewer.

    Parameters
    ----------
    light : ReachingLight
    fields : (fields, N) ndarray
        Of `light`, at the points.
    normal : (N, 3) ndarray
        With relief.
    albedo : (N, 3) ndarray
    gloss : Gloss
    room : Room

    Returns
    -------
    (N, 3) ndarray
    """
    covered, seen = fields[54], fields[55:]
    basis = np.asarray(harmonics(normal) * _COSINE, np.float32)
    parts = fields[:54].reshape(18, 3, -1)
    irradiance = np.stack([(basis.T * parts[:, c]).sum(0) for c in range(3)], axis=1)
    irradiance = np.maximum(irradiance, 0.02 * light.mean)
    irradiance = irradiance + covered[:, None] * albedo * light.mean
    for lamp, share in zip(light.lamps, seen, strict=True):
        level = np.clip(normal @ lamp.toward, 0, None) * share
        irradiance = irradiance + level[:, None] * lamp.power
    found = albedo / np.pi * irradiance
    if not gloss.front:
        return found
    share = _reflected(gloss, normal[:, 2])[:, None]
    return found * (1 - share) + _mirrored(light, fields, normal, gloss, room, share)


def _reflected(gloss: Gloss, cosine: np.ndarray) -> np.ndarray:
    """Share (N,) of uniform light that the lobe reflects toward the viewer."""
    column = torch.from_numpy(cosine).float()[:, None]
    front, alpha = torch.tensor([gloss.front]), torch.full_like(column, gloss.alpha)
    return np.asarray(reflected_share(front, column, alpha).numpy()[:, 0])


def _mirrored(
    light: ReachingLight,
    fields: np.ndarray,
    normal: np.ndarray,
    gloss: Gloss,
    room: Room,
    share: np.ndarray,
) -> np.ndarray:
    """Light (N, 3) of the lobe; `share` is what it reflects of uniform light."""
    cosine = normal[:, 2]
    mirror = 2 * cosine[:, None] * normal - (0, 0, 1)
    level = smoothed_levels(room.radiance, (gloss.alpha,))[0]
    found = _looked_up(level, mirror @ room.turn.T) * (1 - fields[54])[:, None] * share
    square = gloss.alpha**2
    for lamp, seen in zip(light.lamps, fields[55:], strict=True):
        half = lamp.toward + (0, 0, 1)
        half = half / np.linalg.norm(half)
        lean, level_at = np.clip(normal @ half, 0, 1), np.clip(normal @ lamp.toward, 0, None)
        density = square / (np.pi * (lean**2 * (square - 1) + 1) ** 2)
        hidden = _masking(cosine, square) * _masking(np.maximum(level_at, 0.02), square)
        fresnel = gloss.front + (1 - gloss.front) * (1 - half[2]) ** 5
        lobe = density * hidden * fresnel / (4 * cosine) * (level_at > 0) * seen
        found = found + lobe[:, None] * lamp.power
    return np.asarray(found)


def _masking(cosine: np.ndarray, square: float) -> np.ndarray:
    return np.asarray(2 * cosine / (cosine + np.sqrt(square + (1 - square) * cosine**2)))


def _looked_up(level: np.ndarray, toward: np.ndarray) -> np.ndarray:
    """Bilinear values (N, 3) of surroundings, in their own frame."""
    rows = len(level)
    polar = np.arccos(np.clip(toward[:, 1], -1, 1)) * rows / np.pi - 0.5
    turn = np.arctan2(toward[:, 0], -toward[:, 2]) % (2 * np.pi) * rows / np.pi - 0.5
    wide = np.concatenate([level[:, -1:], level, level[:, :1]], axis=1)
    places = [polar, turn + 1]
    return np.stack(
        [ndimage.map_coordinates(wide[..., c], places, order=1, mode="nearest") for c in range(3)],
        axis=1,
    )


def _divided(room: Room, toward: np.ndarray) -> tuple[np.ndarray, tuple[Lamp, ...]]:
    """Radiance times solid angle (N, 3) around each direction, and lamps with what outshines."""
    rows = len(room.radiance)
    places = directions(rows).reshape(-1, 3) @ room.turn
    light = (room.radiance * solid_angles(rows)[..., None]).reshape(-1, 3)
    nearest = np.argmax(places @ toward.T, axis=1)
    around = np.stack([np.bincount(nearest, light[:, c], len(toward)) for c in range(3)], axis=1)
    share = around.mean(1) / around.mean(1).sum()
    lamps = list(room.lamps)
    for k in np.flatnonzero(share > _OUTSHINES):
        here = nearest == k
        middle = (places[here] * light[here].mean(1)[:, None]).sum(0)
        lamps.append(Lamp(middle / np.linalg.norm(middle), around[k].copy(), 0.06))
        around[k] = 0
    return around, tuple(lamps)


def _rays(lamp: Lamp, rng: np.random.Generator) -> np.ndarray:
    """Directions (`_RAYS`, 3) to a lamp's disc."""
    aside = np.linalg.svd(lamp.toward[None])[2][1:]
    radius, turn = np.sqrt(rng.random(_RAYS)), rng.uniform(0, 2 * np.pi, _RAYS)
    disc = np.stack([radius * np.cos(turn), radius * np.sin(turn)], 1) * np.tan(lamp.radius)
    rays = lamp.toward + disc @ aside
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def _passing(tracer: Tracer, origins: np.ndarray, toward: np.ndarray) -> np.ndarray:
    """Whether each direction passes the body from each point (points, directions)."""
    found = []
    for some in np.array_split(toward, -(-len(toward) // _AT_ONCE)):
        rays = np.repeat(some, len(origins), axis=0)
        blocked = tracer.blocked(np.tile(origins, (len(some), 1)), rays, np.inf)
        found.append(~blocked.reshape(len(some), len(origins)).T)
    return np.concatenate(found, axis=1)
