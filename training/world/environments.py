"""Light from all around: photographed panoramas, and what gloss shows of them.

An environment is an image (rows, 2 rows, 3) of linear radiance in the layout of
`isc_core.shading.environment_map`. `procedural_environments` draws others.

Equation: reduction takes the mean radiance of the solid angle that a pixel covers, so that the
light as a whole stays the same. A gloss of width a (GGX) reflects, for a viewer along the
normal,

    L_a(r) = integral of K(r, w) L(w) dw,        K ~ D_a(half angle) max(r . w, 0)

K is scaled by a factor for each ring of latitude so that a uniform environment stays uniform and
the mean radiance of any other stays as it is (Sinkhorn).

Citation: B. Walter et al. (2007), "Microfacet models for refraction through rough surfaces",
doi:10.2312/EGWR/EGSR07/195-206 (GGX); B. Karis (2013), "Real shading in Unreal Engine 4" (one lobe
for each direction); R. Sinkhorn (1964), doi:10.1214/aoms/1177703591.

Limits: 32 rows show details of 6 degrees, which is also the narrowest lobe. Lobes do not
stretch at grazing angles.
"""

import re
from dataclasses import dataclass
from functools import lru_cache
from itertools import groupby
from pathlib import Path

import numpy as np

from isc_core.errors import InputError
from isc_core.photo import read_linear, read_raster
from isc_core.shading.environment_map import (
    directions,
    resampled,
    solid_angles,
)

ROWS = 32
FILES = (".exr", ".hdr")
HELD_OUT_OF = 6  # one panorama of so many is held out
_SPLIT = 0  # seed of the choice: with one of each run, a run would learn from held-out light
_SAMPLES = 4  # a pixel's side, for rotation and lobes
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
_LEAST_SHADING = 1e-3  # of the brightest: where no light comes from, the logarithm has no value


@dataclass(frozen=True, eq=False)
class Panorama:
    """A photographed environment.

    Attributes
    ----------
    name : str
        Of its file, without the suffix.
    radiance : (ROWS, 2 ROWS, 3) ndarray
        Linear, float32, >= 0, as bright as the file says.
    held_out : bool
        Whether it is left out of every fit.
    """

    name: str
    radiance: np.ndarray
    held_out: bool


def read_panoramas(folder: Path) -> list[Panorama]:
    """Read all latitude-longitude images of a folder and split them.

    One of six in the order of names is held out, in every program the same. If possible, it is one
    without others of the same place (the same name but for a number), whose light a network would
    have seen in training.

    Parameters
    ----------
    folder : Path
        With .exr or .hdr files, twice as wide as high.

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
    held_out = _held_out([path.stem for path in files], np.random.default_rng(_SPLIT))
    return [Panorama(path.stem, _read(path), path.stem in held_out) for path in files]


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


def _held_out(names: list[str], rng: np.random.Generator) -> set[str]:
    """One name of each six in order, rather one whose place occurs once."""
    places = [re.sub(r"[\d_-]+$", "", name) for name in names]
    held_out = set()
    for _, group in groupby(range(len(names)), key=lambda k: k // HELD_OUT_OF):
        six = list(group)
        if len(six) == HELD_OUT_OF:
            alone = [k for k in six if places.count(places[k]) == 1]
            held_out.add(names[int(rng.choice(alone or six))])
    return held_out


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
