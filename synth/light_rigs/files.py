"""Lights of real places: the log-shading lights of natural_lights.mat, and photographed
environments.

The file's lights are quadratics of LOG shading for the normals that face a viewer;
`isc_core.shading.environment_map` finds an environment, never negative, that gives a shading as near as can be.
Panoramas are latitude-longitude pictures, straight up in row 0, and what is in their middle stands
at the viewer; they are turned about the vertical so that the viewer's side is lit.

Citation: J. T. Barron, J. Malik (2015), "Shape, illumination, and reflectance from shading",
doi:10.1109/TPAMI.2014.2377712 (the lights); P. Debevec (1998), "Rendering synthetic objects into
real scenes", doi:10.1145/280814.280864 (panoramas of radiance).

Limits: what the log-shading lights hold behind the object is a guess. A panorama keeps details of
180 / 128 degrees.
"""

from pathlib import Path

import numpy as np

from isc_core.datasets.mit_berkeley import load_natural_lights
from isc_core.errors import InputError
from isc_core.photo import read_linear
from isc_core.shading.environment_map import (
    directions,
    environment_from_shading,
    resampled,
    solid_angles,
)
from isc_core.shading.spherical_harmonics import light_from_reference

from ..scene.lights import EnvironmentLight, Light

PANORAMAS = (".exr", ".hdr")
_FINE, _COARSE = 128, 64
_LEAST_FRONT = (
    0.8  # of the light that would come from the viewer's side if it came from everywhere alike
)


def natural_lights(rng: np.random.Generator, source: Path) -> tuple[Light, ...]:
    """One of the lights of `source`/natural_lights.mat as an environment.

    Raises `InputError` where the file is absent or another.
    """
    lights = load_natural_lights(source)
    pick = int(rng.integers(lights.shape[2]))
    return (EnvironmentLight(environment_from_shading(light_from_reference(lights[..., pick]))),)


def hdr_lights(rng: np.random.Generator, source: Path) -> tuple[Light, ...]:
    """A panorama:

    `source` itself, or one of the folder's. Raises `InputError` where there is none, and as
    `read_panorama` does.
    """
    files = [source]
    if source.is_dir():
        files = sorted(
            path for path in source.iterdir() if path.suffix.lower() in PANORAMAS and path.is_file()
        )
        if not files:
            raise InputError(
                f"{source} holds no {' or '.join(PANORAMAS)} file: name a folder with latitude-longitude pictures"
            )
    radiance = read_panorama(files[int(rng.integers(len(files)))])
    return (EnvironmentLight(_turned_to_viewer(radiance, rng)),)


def read_panorama(path: Path) -> np.ndarray:
    """A latitude-longitude picture as an environment of 64 or 128 rows, (rows, 2 rows, 3) float32,
    of the mean radiance 1.

    Raises `InputError` for what is no .hdr or .exr file, is not twice as wide as high, or black.
    """
    if path.suffix.lower() not in PANORAMAS:
        raise InputError(
            f"{path} is no {' or '.join(PANORAMAS)} file: an environment needs its radiance, which others cut off"
        )
    picture = read_linear(path, "linear")
    height, width = picture.shape[:2]
    if width != 2 * height:
        raise InputError(
            f"{path} is {width} x {height} pixels: an environment in latitude-longitude layout is twice as wide as high"
        )
    radiance = resampled(picture, _FINE if height >= _FINE else _COARSE)
    mean = float((radiance.mean(-1) * solid_angles(len(radiance))).sum() / (4 * np.pi))
    if not mean > 0:
        raise InputError(f"{path} is black: there is no light in it")
    return np.asarray(radiance / mean, np.float32)


def _turned_to_viewer(radiance: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Turned about the vertical by a random one of the angles that bring enough light to the
    viewer's side.
    """
    rows = len(radiance)
    front = np.maximum(directions(rows)[..., 2], 0) * solid_angles(rows) / np.pi
    light = radiance.mean(-1)
    # What each turn brings, for all of them at once: a circular correlation along the rows.
    spectra = np.conj(np.fft.rfft(front, axis=1)) * np.fft.rfft(light, axis=1)
    brought = np.fft.irfft(spectra.sum(0), 2 * rows)
    turns = np.flatnonzero(brought >= min(_LEAST_FRONT, brought.max()))
    return np.roll(radiance, -int(rng.choice(turns)), axis=1)
