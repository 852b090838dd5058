"""Lights of real places: the log-shading lights of natural_lights.mat, and photographed
environments.

The file's lights are quadratics of LOG shading for the normals that face a viewer;
`isc_core.shading.environment_map` fits a non-negative environment to that shading. Panoramas are
latitude-longitude images, straight up in row 0, with the viewer in their middle; they are rotated
about the vertical so that the visible side is lit.

Citation: J. T. Barron, J. Malik (2015), "Shape, illumination, and reflectance from shading",
doi:10.1109/TPAMI.2014.2377712 (the lights); P. Debevec (1998), "Rendering synthetic objects into
real scenes", doi:10.1145/280814.280864 (panoramas of radiance).

Limits: log-shading lights do not constrain the environment behind the object. A panorama keeps
details of 180 / 128 degrees.
"""

from pathlib import Path

import numpy as np

from isc_core.datasets.mit_berkeley import load_natural_lights
from isc_core.errors import InputError
from isc_core.photo import read_linear
from isc_core.shading.environment_map import (
    directions,
    environment_from_shading,
    mean_radiance,
    resampled,
    solid_angles,
)
from isc_core.shading.spherical_harmonics import light_from_reference

from ..scene.lights import EnvironmentLight, Light

PANORAMAS = (".exr", ".hdr")
_FINE, _COARSE = 128, 64
_LEAST_FRONT = 0.8  # of the light on the visible side, relative to a uniform environment


def natural_lights(rng: np.random.Generator, source: Path) -> tuple[Light, ...]:
    """Draw one of the lights of natural_lights.mat, as an environment.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.
    source : Path
        Folder of the file.

    Returns
    -------
    tuple of Light
        One environment.

    Raises
    ------
    InputError
        If the file is missing or another one.
    """
    lights = load_natural_lights(source)
    pick = int(rng.integers(lights.shape[2]))
    return (EnvironmentLight(environment_from_shading(light_from_reference(lights[..., pick]))),)


def hdr_lights(rng: np.random.Generator, source: Path) -> tuple[Light, ...]:
    """Draw one panorama of a folder, rotated at random.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.
    source : Path
        A panorama, or a folder of them.

    Returns
    -------
    tuple of Light
        One environment.

    Raises
    ------
    InputError
        If there is none, and as `read_panorama`.
    """
    files = [source]
    if source.is_dir():
        files = sorted(
            path for path in source.iterdir() if path.suffix.lower() in PANORAMAS and path.is_file()
        )
        if not files:
            raise InputError(
                f"{source} has no {' or '.join(PANORAMAS)} file: give a folder of "
                "latitude-longitude images"
            )
    radiance = read_panorama(files[int(rng.integers(len(files)))])
    return (EnvironmentLight(_turned_to_viewer(radiance, rng)),)


def read_panorama(path: Path) -> np.ndarray:
    """Read a latitude-longitude image as an environment.

    Parameters
    ----------
    path : Path
        An .hdr or .exr file, twice as wide as high.

    Returns
    -------
    (rows, 2 rows, 3) ndarray of float32
        Radiance of mean 1; 64 or 128 rows.

    Raises
    ------
    InputError
        For another file type or aspect ratio, or a black image.
    """
    if path.suffix.lower() not in PANORAMAS:
        raise InputError(
            f"{path} is not an {' or '.join(PANORAMAS)} file: other formats clip the radiance of "
            "an environment"
        )
    picture = read_linear(path, "linear")
    height, width = picture.shape[:2]
    if width != 2 * height:
        raise InputError(
            f"{path} is {width} x {height} pixels: an environment in latitude-longitude layout is "
            "twice as wide as high"
        )
    radiance = resampled(picture, _FINE if height >= _FINE else _COARSE)
    mean = float(mean_radiance(radiance).mean())
    if not mean > 0:
        raise InputError(f"{path} is black: it contains no light")
    return np.asarray(radiance / mean, np.float32)


def _turned_to_viewer(radiance: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Rotated about the vertical by a random angle of those that light the visible side enough."""
    rows = len(radiance)
    front = np.maximum(directions(rows)[..., 2], 0) * solid_angles(rows) / np.pi
    light = radiance.mean(-1)
    # Light on the visible side for all rotations at once: a circular correlation along the rows.
    spectra = np.conj(np.fft.rfft(front, axis=1)) * np.fft.rfft(light, axis=1)
    brought = np.fft.irfft(spectra.sum(0), 2 * rows)
    turns = np.flatnonzero(brought >= min(_LEAST_FRONT, brought.max()))
    return np.roll(radiance, -int(rng.choice(turns)), axis=1)
