"""The response of a lobe to a whole environment map.

Equation: integral of L(l) f_r(n, v, l) (n . l) dl with v = (0, 0, 1). The map is split at a
radiance threshold. Brighter pixels are treated as small distant lights. The rest is smooth: it is
sampled in directions whose half vectors are distributed like the lobe, for GGX tan^2 t = alpha^2 u
/ (1 - u) with the weight F G (v . h) / ((n . v) (n . h)), for Blinn-Phong cos t = u^(1 / (p + 1))
with the weight (p + 8) / (p + 1) (v . h) (n . l), u at even steps.

Citation: B. Walter et al., EGSR 2007, doi:10.2312/EGWR/EGSR07/195-206 (sampling of microfacets).

Limits: no shadows. A lobe much narrower than the map's pixels resolves these pixels.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ..scene.lobe_fit import LobeModel
from ..shading.brdf.ggx import F0, visible
from ..shading.environment_map import directions, solid_angles
from .response import respond

_MAX_BRIGHT = 160
_RINGS, _SPOKES = 7, 9
_GRIDS = (81, 321)  # smallest and largest side of the table of normals on a disc
_NODES = 8.0  # its side, times alpha: the error of a lobe is then some 4 %


@dataclass(frozen=True, eq=False)
class SplitEnvironment:
    """A split environment map.

    Attributes
    ----------
    bright : (M, 3) ndarray
        Unit directions of its brightest pixels.
    irradiance : (M, 3) ndarray
        Of these.
    rest : (rows, 2 rows, 3) ndarray
        Radiance of the smooth rest.
    """

    bright: np.ndarray
    irradiance: np.ndarray
    rest: np.ndarray


def split_environment(radiance: np.ndarray) -> SplitEnvironment:
    """Split an environment map into bright pixels and a smooth rest.

    Parameters
    ----------
    radiance : (rows, 2 rows, 3) ndarray
        Environment map, linear radiance.

    Returns
    -------
    SplitEnvironment
    """
    rows = len(radiance)
    mean = radiance.mean(axis=2).ravel()
    level = np.sort(mean)[-min(_MAX_BRIGHT, mean.size)]
    gain = np.minimum(1, level / np.maximum(mean, 1e-300)).reshape(rows, 2 * rows, 1)
    over = (radiance * (1 - gain)).reshape(-1, 3)
    kept = over.max(axis=1) > 1e-6 * float(over.max(initial=0))
    irradiance = over * solid_angles(rows).reshape(-1, 1)
    return SplitEnvironment(
        directions(rows).reshape(-1, 3)[kept], irradiance[kept], radiance * gain
    )


def respond_to(
    environment: SplitEnvironment, model: LobeModel, normal: np.ndarray, alpha: float
) -> np.ndarray:
    """Compute the response of a lobe of strength 1.

    Parameters
    ----------
    environment : SplitEnvironment
        The environment map.
    model : {"ggx", "blinn_phong"}
        The lobe.
    normal : (N, 3) ndarray
        Unit normals.
    alpha : float
        Roughness.

    Returns
    -------
    (N, 3) ndarray
        Radiance toward the viewer.
    """
    total = _smooth(environment.rest, model, normal, alpha)
    for direction, irradiance in zip(environment.bright, environment.irradiance, strict=True):
        total += respond(model, normal, direction, alpha).value[:, None] * irradiance
    return total


def interpolated_response(
    environment: SplitEnvironment, model: LobeModel, alpha: float, normal: np.ndarray
) -> np.ndarray:
    """Interpolate `respond_to` for many normals from a table on the equal-area disc of normals.

    The table is finer for narrower lobes; for fewer normals than it has, they are computed.

    Parameters
    ----------
    environment, model, alpha, normal
        As for `respond_to`.

    Returns
    -------
    (N, 3) ndarray
        Radiance toward the viewer.
    """
    grid = int(np.clip(np.ceil(_NODES / alpha), *_GRIDS))
    if len(normal) <= grid**2:
        return respond_to(environment, model, normal, alpha)
    steps = np.linspace(-1, 1, grid)
    x, y = np.meshgrid(steps, steps, indexing="ij")
    square = np.minimum(x * x + y * y, 1)
    nodes = np.stack([x * np.sqrt(2 - square), y * np.sqrt(2 - square), 1 - square], -1).reshape(
        -1, 3
    )
    nodes[:, 2] = np.maximum(nodes[:, 2], 1e-3)
    nodes /= np.linalg.norm(nodes, axis=1, keepdims=True)
    values = respond_to(environment, model, nodes, alpha).reshape(grid, grid, 3)
    flat = normal[:, :2] / np.sqrt(1 + np.clip(normal[:, 2], 0, 1))[:, None]
    at = ((flat + 1) / 2 * (grid - 1)).T
    return np.stack(
        [ndimage.map_coordinates(values[..., c], at, order=1, mode="nearest") for c in range(3)],
        axis=1,
    )


def _smooth(radiance: np.ndarray, model: LobeModel, normal: np.ndarray, alpha: float) -> np.ndarray:
    first, second = _tangents(normal)
    exponent = 2 / alpha**2 - 2
    total = np.zeros((len(normal), 3))
    for ring in range(_RINGS):
        u = (ring + 0.5) / _RINGS
        cos_half = (
            1 / np.sqrt(1 + alpha**2 * u / (1 - u)) if model == "ggx" else u ** (1 / (exponent + 1))
        )
        sin_half = np.sqrt(1 - cos_half**2)
        for spoke in range(_SPOKES):
            azimuth = 2 * np.pi * (spoke + 0.5 * (ring % 2)) / _SPOKES
            half = cos_half * normal + sin_half * (
                np.cos(azimuth) * first + np.sin(azimuth) * second
            )
            view_half_cos = half[:, 2]
            light = 2 * view_half_cos[:, None] * half - (0, 0, 1)
            light_cos = (light * normal).sum(axis=1)
            usable = (view_half_cos > 0) & (light_cos > 0) & (normal[:, 2] > 0)
            weight = _weight(
                model, normal[:, 2], np.where(usable, light_cos, 1), cos_half, view_half_cos, alpha
            )
            total += np.where(usable, weight, 0)[:, None] * _radiance_from(radiance, light)
    return total / (_RINGS * _SPOKES)


def _weight(
    model: LobeModel,
    view_cos: np.ndarray,
    light_cos: np.ndarray,
    half_cos: float,
    view_half_cos: np.ndarray,
    alpha: float,
) -> np.ndarray:
    if model == "blinn_phong":
        exponent = 2 / alpha**2 - 2
        return (exponent + 8) / (exponent + 1) * view_half_cos * light_cos
    fresnel = F0 + (1 - F0) * (1 - np.clip(view_half_cos, 0, 1)) ** 5
    view_cos = np.maximum(view_cos, 1e-6)
    return (
        fresnel
        * visible(alpha, view_cos)
        * visible(alpha, light_cos)
        * view_half_cos
        / (view_cos * half_cos)
    )


def _radiance_from(radiance: np.ndarray, light: np.ndarray) -> np.ndarray:
    """The radiance (N, 3) from unit directions (N, 3), bilinear."""
    rows = len(radiance)
    row = np.arccos(np.clip(light[:, 1], -1, 1)) * rows / np.pi - 0.5
    column = (np.arctan2(light[:, 0], -light[:, 2]) % (2 * np.pi)) * rows / np.pi - 0.5
    row = np.clip(row, 0, rows - 1)
    top, left = np.minimum(row.astype(int), rows - 2), np.floor(column).astype(int)
    down, right = (row - top)[:, None], (column - left)[:, None]
    here, there = left % (2 * rows), (left + 1) % (2 * rows)
    upper = radiance[top, here] * (1 - right) + radiance[top, there] * right
    lower = radiance[top + 1, here] * (1 - right) + radiance[top + 1, there] * right
    return upper * (1 - down) + lower * down


def _tangents(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors (N, 3) perpendicular to normals that face the viewer, and to each other."""
    first = np.stack([normal[:, 2], np.zeros(len(normal)), -normal[:, 0]], axis=1)
    length = np.linalg.norm(first, axis=1, keepdims=True)
    first = np.where(length > 1e-6, first / np.maximum(length, 1e-6), (1.0, 0, 0))
    return first, np.cross(normal, first)
