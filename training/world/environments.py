"""Light from all around: photographed panoramas, their variations, and what a network learns of
them.

An environment is an image (rows, 2 rows, 3) of linear radiance in the layout of
`isc_core.shading.environment_map`. `invented_environments` draws those that nobody photographed.

Equations: reduction and rotation take the mean radiance of the solid angle that a pixel covers, so
that the light as a whole stays the same. A gloss of width a (GGX) reflects, for a viewer along the
normal,

    L_a(r) = integral of K(r, w) L(w) dw,        K ~ D_a(half angle) max(r . w, 0)

K is scaled by a factor for each ring of latitude so that a uniform environment stays uniform and
the mean radiance of any other stays as it is (Sinkhorn). The light description of SIRFS is the
quadratic that is closest to the logarithm of the diffuse shading on the normals that face a viewer.

Citation: B. Walter et al. (2007), "Microfacet models for refraction through rough surfaces",
doi:10.2312/EGWR/EGSR07/195-206 (GGX); B. Karis (2013), "Real shading in Unreal Engine 4" (one lobe
for each direction); R. Sinkhorn (1964), doi:10.1214/aoms/1177703591; J. T. Barron, J. Malik (2015),
doi:10.1109/TPAMI.2014.2377712 (log shading).

Limits: 32 rows show details of 6 degrees, which is also the narrowest lobe. A rotation spreads a
pixel over the neighbours. Lobes do not stretch at grazing angles.
"""

import re
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import groupby
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from isc_core.errors import InputError
from isc_core.photo import read_linear, read_raster
from isc_core.shading.environment_map import (
    directions,
    resampled,
    shading_under,
    solid_angles,
)
from isc_core.shading.spherical_harmonics import real_sh

ROWS = 32
FILES = (".exr", ".hdr")
JUDGED_OF = 6  # one panorama of so many is kept from learning
_SAMPLES = 4  # a pixel's side, for rotation and lobes
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
_LEAST_SHADING = 1e-3  # of the brightest: where no light comes from, the logarithm has no value


@dataclass(frozen=True)
class Panorama:
    """A photographed environment.

    Attributes
    ----------
    name : str
        Of its file, without the suffix.
    radiance : (ROWS, 2 ROWS, 3) ndarray
        Linear, float32, >= 0, as bright as the file says.
    judged : bool
        Kept for judging: nothing learns from it.
    """

    name: str
    radiance: np.ndarray
    judged: bool


def read_panoramas(folder: Path, seed: int) -> list[Panorama]:
    """Read all latitude-longitude images of a folder and split them.

    One of six in the order of names is judged. If possible, it is one without others of the same
    place (the same name but for a number): light that a network has seen judges nothing.

    Parameters
    ----------
    folder : Path
        With .exr or .hdr files, twice as wide as high.
    seed : int
        Chooses which are judged.

    Returns
    -------
    list of Panorama
        In the order of names.

    Raises
    ------
    InputError
        If there is none, or one cannot be used.
    """
    files = (
        sorted(path for path in folder.iterdir() if path.suffix.lower() in FILES)
        if folder.is_dir()
        else []
    )
    if not files:
        raise InputError(
            f"{folder} has no {' or '.join(FILES)} file: give a folder of latitude-longitude images"
        )
    judged = _judged([path.stem for path in files], np.random.default_rng(seed))
    return [Panorama(path.stem, _read(path), path.stem in judged) for path in files]


def turned(environment: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Rotate an environment at random.

    Most are turned about the vertical, half of these also tilted a little, as by a camera that
    looks down at a table. One in eight is rotated anyhow.

    Parameters
    ----------
    environment : (rows, 2 rows, 3) ndarray
    rng : numpy.random.Generator

    Returns
    -------
    (rows, 2 rows, 3) ndarray
    """
    if rng.random() < 1 / 8:
        return rotated(environment, Rotation.random(random_state=rng).as_matrix())
    yaw = rng.uniform(0, 360)
    pitch, roll = rng.normal(0, (12, 5)) if rng.random() < 0.5 else (0.0, 0.0)
    turn = Rotation.from_euler("yxz", (yaw, pitch, roll), degrees=True)
    return rotated(environment, turn.as_matrix())


def rotated(environment: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Rotate an environment about the object.

    Parameters
    ----------
    environment : (rows, 2 rows, 3) ndarray
    rotation : (3, 3) ndarray
        Takes a direction that light came from to the one that it comes from now, camera frame.

    Returns
    -------
    (rows, 2 rows, 3) ndarray of float32
        Of the same total light in each channel.
    """
    rows = len(environment)
    # Several directions in each pixel: the share of each old pixel in each new one.
    came = directions(rows * _SAMPLES) @ rotation
    row = np.clip((np.arccos(np.clip(came[..., 1], -1, 1)) * (rows / np.pi)).astype(int), 0, None)
    azimuth = np.arctan2(came[..., 0], -came[..., 2]) % (2 * np.pi)
    column = (azimuth * (rows / np.pi)).astype(int) % (2 * rows)
    new = resampled(environment.astype(float)[np.minimum(row, rows - 1), column], rows)
    before, after = _light(environment), _light(new)
    return np.asarray(new * before / np.where(after > 0, after, 1), np.float32)


def exposed(environment: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Vary contrast, colour and exposure of an environment.

    Parameters
    ----------
    environment : (rows, 2 rows, 3) ndarray
    rng : numpy.random.Generator

    Returns
    -------
    (rows, 2 rows, 3) ndarray of float32
        Its mean luminance is between 1/2 and 2.
    """
    changed = contrasted(environment, float(np.exp(rng.normal(0, 0.2))))
    warmth, tint = rng.normal(0, (0.15, 0.04))
    changed = changed * np.exp([warmth, tint, -warmth])
    level = float((_light(changed) * _LUMINANCE).sum() / (4 * np.pi))
    return np.asarray(changed * (2 ** rng.uniform(-1, 1) / max(level, 1e-12)), np.float32)


def contrasted(environment: np.ndarray, exponent: float) -> np.ndarray:
    """Change the contrast of an environment and keep its hues.

    Parameters
    ----------
    environment : (rows, 2 rows, 3) ndarray
    exponent : float
        Of the luminance; above 1, bright places stand out more.

    Returns
    -------
    (rows, 2 rows, 3) ndarray of float32
        Of the same mean luminance.
    """
    luminance = environment @ _LUMINANCE
    mean = float((luminance * solid_angles(len(environment))).sum() / (4 * np.pi))
    if not mean > 0:
        return np.asarray(environment, np.float32)
    factor = np.maximum(luminance / mean, 1e-6) ** (exponent - 1)
    changed = environment * factor[..., None]
    kept = (_light(environment) @ _LUMINANCE) / (_light(changed) @ _LUMINANCE)
    return np.asarray(changed * kept, np.float32)


def smoothed_levels(environment: np.ndarray, widths: tuple[float, ...]) -> np.ndarray:
    """Compute what glosses of several widths reflect from each direction.

    Parameters
    ----------
    environment : (rows, 2 rows, 3) ndarray
    widths : tuple of float
        GGX alphas, > 0.

    Returns
    -------
    (levels, rows, 2 rows, 3) ndarray of float32
        Radiance that a viewer sees whose mirrored direction is the pixel's; the mean radiance is
        that of the environment.
    """
    flat = np.asarray(environment, np.float32).reshape(-1, 3)
    levels = [lobe_matrix(len(environment), width) @ flat for width in widths]
    return np.stack(levels).reshape(len(widths), *environment.shape)


@lru_cache(maxsize=12)
def lobe_matrix(rows: int, width: float) -> np.ndarray:
    """Return the weights of each pixel's light in a gloss around each direction.

    Parameters
    ----------
    rows : int
    width : float
        GGX alpha.

    Returns
    -------
    (2 rows^2, 2 rows^2) ndarray of float32
        A row for each mirrored direction, which sums to 1. Read-only.
    """
    ring = _ring_lobes(rows, width)  # (target row, source row, step of columns)
    weight = ring * solid_angles(rows)[:, :1]
    scale = np.ones(rows)
    for _ in range(200):  # the square root damps the alternation of the plain iteration
        sums = np.einsum("rsc,s->r", weight, scale, optimize=False) * scale
        scale = scale / np.sqrt(sums)
    weight = weight * scale[:, None, None] * scale[:, None]
    step = (np.arange(2 * rows) - np.arange(2 * rows)[:, None]) % (2 * rows)
    matrix = np.asarray(weight[:, :, step].transpose(0, 2, 1, 3), np.float32)
    matrix = matrix.reshape(2 * rows * rows, -1)
    matrix.setflags(write=False)
    return matrix


def log_harmonics(environment: np.ndarray) -> np.ndarray:
    """Fit the light description of SIRFS to an environment.

    Parameters
    ----------
    environment : (rows, 2 rows, 3) ndarray

    Returns
    -------
    (9, 3) ndarray
        Coefficients of `real_sh` for the logarithm of the diffuse shading on the normals that face
        the viewer, each weighted by its area in the picture of a sphere. Shading below a thousandth
        of the brightest counts as that.
    """
    shading = shading_under(environment, facing_normals())
    return fitted_harmonics(np.log(np.maximum(shading, _LEAST_SHADING * shading.max() + 1e-12)))


def fitted_harmonics(log_shading: np.ndarray) -> np.ndarray:
    """Fit the quadratic that is closest to a log shading.

    Parameters
    ----------
    log_shading : (N, 3) ndarray
        At `facing_normals`.

    Returns
    -------
    (9, 3) ndarray
        Coefficients of `real_sh`, least squares.
    """
    return _fit() @ log_shading


@cache
def facing_normals(steps: int = 24) -> np.ndarray:
    """Return the normals of a sphere's picture.

    Parameters
    ----------
    steps : int
        Pixels of its diameter.

    Returns
    -------
    (N, 3) ndarray
        Unit vectors with z > 0, camera frame. Read-only.
    """
    places = (np.arange(steps) + 0.5) * 2 / steps - 1
    x, y = np.meshgrid(places, places)
    inside = x * x + y * y < 1
    x, y = x[inside], y[inside]
    normals = np.stack([x, y, np.sqrt(1 - x * x - y * y)], -1)
    normals.setflags(write=False)
    return normals


@cache
def _fit() -> np.ndarray:
    """The matrix (9, N) of the least-squares fit at `facing_normals`."""
    return np.linalg.pinv(real_sh(facing_normals()))


def _light(environment: np.ndarray) -> np.ndarray:
    """The total light (3,) of an environment."""
    return (environment * solid_angles(len(environment))[..., None]).sum((0, 1), dtype=float)


def _ring_lobes(rows: int, width: float) -> np.ndarray:
    """Unscaled lobe (rows, rows, 2 rows): mean over the source pixel, for a target in column 0."""
    # The lobe around the first pixel of each row, then both ways round, because each pixel is as
    # large in the other's lobe.
    target = directions(rows)[:, 0]
    fine = directions(rows * _SAMPLES)
    cosine = np.einsum("rk,ijk->rij", target, fine, optimize=False)
    area = solid_angles(rows * _SAMPLES) / (solid_angles(rows).mean() / _SAMPLES**2)
    lobe = _lobe(cosine, width) * area
    blocks = (rows, rows, _SAMPLES, 2 * rows, _SAMPLES)
    mean = lobe.reshape(blocks).sum((2, 4)) / area.reshape(blocks[1:]).sum((1, 3))
    return (mean + mean.transpose(1, 0, 2)) / 2


def _lobe(cosine: np.ndarray, width: float) -> np.ndarray:
    """GGX around the mirrored direction, for a viewer along the normal."""
    half = np.clip((1 + cosine) / 2, 0, 1)  # the squared cosine of half the angle
    return np.clip(cosine, 0, None) / (half * (width * width - 1) + 1) ** 2


def _judged(names: list[str], rng: np.random.Generator) -> set[str]:
    """One name of each six in order, rather one whose place occurs once."""
    places = [re.sub(r"[\d_-]+$", "", name) for name in names]
    judged = set()
    for _, group in groupby(range(len(names)), key=lambda k: k // JUDGED_OF):
        six = list(group)
        if len(six) == JUDGED_OF:
            alone = [k for k in six if places.count(places[k]) == 1]
            judged.add(names[int(rng.choice(alone or six))])
    return judged


def _read(path: Path) -> np.ndarray:
    values = read_raster(path).values[..., :3]
    if not np.isfinite(values).all() or (values < 0).any():
        raise InputError(
            f"{path} has NaN, infinite or negative values: repair it or remove it from the folder"
        )
    height, width = values.shape[:2]
    if width != 2 * height or height < ROWS:
        raise InputError(
            f"{path} is {width} x {height} pixels: a panorama is twice as wide as high, and at "
            f"least {2 * ROWS} x {ROWS}"
        )
    radiance = resampled(read_linear(path, "linear").astype(float), ROWS)
    if not radiance.max() > 0:
        raise InputError(f"{path} is black: remove it from the folder")
    return np.asarray(radiance, np.float32)
