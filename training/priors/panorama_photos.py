"""Photos of panoramas: a camera in the middle, turned at random, exposed and white-balanced; and
the light that then falls on an object in front of it.

Equation: a camera sees the panorama L within its field of view, scaled so that the mean luminance
of the picture is a middle grey times e^z, z ~ N(0, s^2), and cut at white. White balance divides by
a part a of the colour e that an algorithm estimates from this picture, 0 <= a <= 1: panoramas have
been balanced by their photographers, and cameras correct the estimated colour only in part. A matt
white ball before the camera shows

    S(n) = 1/pi integral of L(w) / e^a max(n . w, 0) dw,    log S(n) ~ sum_k b_k(n) l_k

with l fitted by least squares over the normals that face the camera, as they project to a disc.

Citation: as `white_balance`.

Limits: nothing casts shadows; the object itself is not in the picture that is balanced; the ground
is as far away as the rest of the panorama.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import ndimage
from scipy.spatial.transform import Rotation

from isc_core.photo import read_linear
from isc_core.shading.environment_map import shading_under
from isc_core.shading.spherical_harmonics import reference_basis

from ..world.environments import FILES, Panorama, read_panoramas
from .white_balance import ALGORITHMS

ROWS, COLUMNS = 72, 96  # of a camera's picture
_HALF_WIDTH = 0.6  # tangent of half the field of view: a lens of 30 mm on a frame of 36 mm
_GREY, _EXPOSURE = 0.18, 0.4
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
_NORMALS = 300
_FLOOR = 0.03  # of the mean shading: added before the logarithm of what no light reaches


@dataclass(frozen=True, eq=False)
class PanoramaPhoto:
    """What a camera in a panorama sees.

    Attributes
    ----------
    panorama : str
    light : (9, 3) ndarray
        Log-shading coefficients of the balanced light, reference convention.
    cast : (3,) ndarray
        Colour of the balanced light as a white ball shows it: what white balance leaves. Linear RGB
        of geometric mean 1.
    unbalanced : (3,) ndarray
        The same without white balance.
    """

    panorama: str
    light: np.ndarray
    cast: np.ndarray
    unbalanced: np.ndarray


def read_pictures(folder: Path) -> list[tuple[Panorama, np.ndarray]]:
    """Read panoramas with all their pixels.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    list of (Panorama, (rows, 2 rows, 3) ndarray)
        In the order of names.

    Raises
    ------
    InputError
        As `read_panoramas`.
    """
    files = {path.stem: path for path in folder.iterdir() if path.suffix.lower() in FILES}
    return [
        (one, read_linear(files[one.name], "linear").astype(float))
        for one in read_panoramas(folder)
    ]


def draw_turn(rng: np.random.Generator) -> np.ndarray:
    """Draw how a camera is held: anywhere about the vertical, mostly looking a little down.

    Parameters
    ----------
    rng : numpy.random.Generator

    Returns
    -------
    (3, 3) ndarray
        From the camera frame to the panorama's.
    """
    angles = [rng.normal(0, 3), rng.normal(-15, 15), rng.uniform(0, 360)]
    return np.asarray(Rotation.from_euler("zxy", angles, degrees=True).as_matrix())


def camera_picture(
    radiance: np.ndarray, turn: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, float]:
    """Photograph a panorama.

    Parameters
    ----------
    radiance : (rows, 2 rows, 3) ndarray
    turn : (3, 3) ndarray
        From the camera frame to the panorama's.
    rng : numpy.random.Generator
        Draws the exposure.

    Returns
    -------
    picture : (ROWS, COLUMNS, 3) ndarray
        Linear, cut at 1.
    gain : float
        Of the exposure.
    """
    x = ((np.arange(COLUMNS) + 0.5) / COLUMNS * 2 - 1) * _HALF_WIDTH
    y = -((np.arange(ROWS) + 0.5) / ROWS * 2 - 1) * _HALF_WIDTH * ROWS / COLUMNS
    right, up = np.meshgrid(x, y)
    look = np.stack([right, up, -np.ones_like(right)], axis=-1)
    look = look / np.linalg.norm(look, axis=-1, keepdims=True) @ turn.T
    rows = len(radiance)
    row = np.arccos(np.clip(look[..., 1], -1, 1)) * rows / np.pi - 0.5
    place = (
        np.clip(row, 0, rows - 1),  # nothing lies beyond a pole
        np.arctan2(look[..., 0], -look[..., 2]) * rows / np.pi - 0.5,
    )
    channels = [radiance[..., c] for c in range(3)]
    picture = np.stack(
        [ndimage.map_coordinates(one, place, order=1, mode="grid-wrap") for one in channels],
        axis=-1,
    )
    mean = float((np.minimum(picture, 20 * np.median(picture)) @ _LUMINANCE).mean())
    gain = _GREY * float(np.exp(rng.normal(0, _EXPOSURE))) / max(mean, 1e-9)
    return np.minimum(gain * picture, 1.0), gain


def camera_balance(picture: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Draw what a camera divides a picture by.

    Parameters
    ----------
    picture : (H, W, 3) ndarray
        Linear, white at 1.
    rng : numpy.random.Generator
        Draws the algorithm and how far the camera follows it.

    Returns
    -------
    (3,) ndarray
        Linear RGB of geometric mean 1.
    """
    algorithm = list(ALGORITHMS.values())[int(rng.integers(len(ALGORITHMS)))]
    return np.asarray(algorithm.light(picture) ** rng.uniform(0, 1))


def photograph(panorama: Panorama, radiance: np.ndarray, rng: np.random.Generator) -> PanoramaPhoto:
    """Draw a photo of a panorama.

    Parameters
    ----------
    panorama : Panorama
    radiance : (rows, 2 rows, 3) ndarray
        The same with all its pixels.
    rng : numpy.random.Generator

    Returns
    -------
    PanoramaPhoto
    """
    turn = draw_turn(rng)
    picture, gain = camera_picture(radiance, turn, rng)
    balance = camera_balance(picture, rng)
    normals = _facing_normals()
    shading = gain * shading_under(panorama.radiance, normals @ turn.T)
    unbalanced = _colour(shading)
    shading = shading / balance
    logs = np.log(shading + _FLOOR * shading.mean())
    light = np.linalg.lstsq(reference_basis(normals), logs, rcond=None)[0]
    return PanoramaPhoto(panorama.name, light, _colour(shading), unbalanced)


def colour_on_a_ball(radiance: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Compute the colour that a matt white ball shows a camera on average.

    Parameters
    ----------
    radiance : (rows, 2 rows, 3) ndarray
        Of few rows.
    turn : (3, 3) ndarray
        From the camera frame to the panorama's.

    Returns
    -------
    (3,) ndarray
        Linear RGB of geometric mean 1.
    """
    return _colour(shading_under(radiance, _facing_normals() @ turn.T))


def _facing_normals() -> np.ndarray:
    """Unit normals (N, 3) toward the camera, evenly spread over the disc that they project to."""
    k = np.arange(_NORMALS) + 0.5
    across, turn = np.sqrt(k / _NORMALS), np.pi * (1 + np.sqrt(5)) * k
    return np.stack([across * np.cos(turn), across * np.sin(turn), np.sqrt(1 - across**2)], -1)


def _colour(shading: np.ndarray) -> np.ndarray:
    mean = np.log(np.maximum(shading, 1e-9)).mean(axis=0)
    return np.asarray(np.exp(mean - mean.mean()))
