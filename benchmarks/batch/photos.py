"""Synthetic photos for the benchmarks of `isc batch`: any number, all different, a few ms each.

Equation: a bumpy dome. Its outline is a low Fourier series, its albedo a few flat colours, its
light exp(SH(normal)) plus one Blinn-Phong highlight.

Limits: no shadows and no interreflection; for throughput and fault tolerance, not for accuracy.
"""

from pathlib import Path

import cv2
import numpy as np

from isc_core.imaging.srgb import linear_to_srgb
from isc_core.shading.spherical_harmonics import real_sh

_MODES = 5
_COLOURS = 6


def synthetic_photo(size: int, seed: int) -> np.ndarray:
    """Make a photo.

    Parameters
    ----------
    size : int
        Side in pixels.
    seed : int
        Chooses the photo.

    Returns
    -------
    (size, size, 4) ndarray
        uint8 sRGB with alpha: a glossy object that fills most of the image.
    """
    rng = np.random.default_rng((size, seed))
    rows, columns = (np.mgrid[:size, :size] + 0.5) * (2.0 / size) - 1.0
    angle, radius = np.arctan2(-rows, columns), np.hypot(rows, columns)
    waves = np.arange(2, 2 + _MODES)
    swing = 0.08 * rng.standard_normal(_MODES) / waves
    turned = waves * angle[..., None] + rng.uniform(0, 2 * np.pi, _MODES)
    outline = 0.8 * (1 + (swing * np.cos(turned)).sum(-1))
    mask = radius < outline
    height = np.sqrt(np.maximum(1 - (radius / outline) ** 2, 0))
    normal = _normals(cv2.GaussianBlur(height, (0, 0), 0.02 * size), 2.0 / size)
    light = np.concatenate(
        [
            rng.normal(-1.2, 0.1, (1, 3)),
            rng.normal(0, 0.45, (1, 1)) + rng.normal(0, 0.1, (8, 3)) * 0.8,
        ]
    )
    half = np.array([rng.uniform(-0.5, 0.5), rng.uniform(0.1, 0.6), 1.0])
    gloss = 0.6 * np.maximum(normal @ (half / np.linalg.norm(half)), 0) ** rng.uniform(30, 120)
    image = _albedo(rng, rows, columns) * np.exp(real_sh(normal) @ light) + gloss[..., None]
    coded = linear_to_srgb(np.clip(np.where(mask[..., None], image, 0), 0, 1))
    return np.rint(255 * np.dstack([coded, mask])).astype(np.uint8)


def _normals(height: np.ndarray, step: float) -> np.ndarray:
    down, right = np.gradient(height, step)
    normal = np.stack([-right, down, np.ones_like(height)], -1)
    return np.asarray(normal / np.linalg.norm(normal, axis=-1, keepdims=True))


def _albedo(rng: np.random.Generator, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Flat colours, each where its own centre is nearest."""
    centres, colours = rng.uniform(-0.8, 0.8, (_COLOURS, 2)), rng.uniform(0.1, 0.7, (_COLOURS, 3))
    distance = np.hypot(rows[..., None] - centres[:, 0], columns[..., None] - centres[:, 1])
    return np.asarray(colours[distance.argmin(-1)])


def synthetic_photos(folder: Path, count: int, size: int) -> list[Path]:
    """Write the photos that do not exist yet: `0000.png` and so on.

    Parameters
    ----------
    folder : Path
        Where to write.
    count : int
        Number of photos.
    size : int
        Side in pixels.

    Returns
    -------
    list of Path
        All photos.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"{number:04d}.png" for number in range(count)]
    for number, path in enumerate(paths):
        if not path.exists():
            data = cv2.imencode(
                ".png", cv2.cvtColor(synthetic_photo(size, number), cv2.COLOR_RGBA2BGRA)
            )[1].tobytes()
            path.with_suffix(".part").write_bytes(data)
            path.with_suffix(".part").replace(path)
    return paths
