"""Reading known height maps and lights of a scene from common file formats."""

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..filters.distance import nearest_pixels
from ..imaging.area_resize import reduced_count
from ..imaging.framing import continued_height
from ..imaging.resampling import nearest_samples, resample_height
from ..io.exr import read_channels
from ..io.json_files import numbers, read_json
from ..io.limits import DEFAULT_LIMITS, Limits
from ..io.npy import read_array
from ..io.regular_files import require_regular
from ..photo import read_raster
from .result_folder import load

CODE = 1 / 64  # photo pixels per code of an integer file: 16 bits span 1024 pixels
_BEYOND = 2  # pixels of a result's maps by which its height is continued beyond its mask
_EXR = b"\x76\x2f\x31\x01"
_NUMPY = b"\x93NUMPY"
_CHANNELS = ("height.Z", "Z", "Y", "height.Y")


def read_height(
    path: str | Path,
    shape: tuple[int, ...],
    scale: float | None = None,
    limits: Limits = DEFAULT_LIMITS,
) -> np.ndarray:
    """Read a height map.

    Parameters
    ----------
    path : str or Path
        An EXR with a channel Y, Z or height.Z; a NumPy array; an integer PNG or TIFF (0 is a hole);
        or the folder of an earlier result of the same photo.
    shape : tuple of int
        (H, W) of the photo.
    scale : float, optional
        Photo pixels per unit of the file; by default 1, or 1/64 for integers.
    limits : Limits

    Returns
    -------
    (H, W) float64 ndarray
        Photo pixels toward the viewer; NaN in holes.

    Raises
    ------
    InputError
        If the file is missing, damaged, of another size, or has only holes.
    """
    path = Path(path)
    height, unit = (_of_result(path, shape), 1.0) if path.is_dir() else _of_file(path, limits)
    if height.shape != shape:
        raise InputError(
            f"{path}: the height map is {_size(height.shape)} pixels, the photo {_size(shape)}: "
            "use one of the photo's size"
        )
    height = np.where(np.isfinite(height), height, np.nan) * (unit if scale is None else scale)
    if not np.isfinite(height).any():
        raise InputError(f"{path}: the height map has no finite value, only holes")
    return height


def read_light(path: str | Path) -> np.ndarray:
    """Read a light.

    Parameters
    ----------
    path : str or Path
        A decomposition.json, its folder, or a JSON file with 9 lists of 3 numbers, plain or as
        "coefficients".

    Returns
    -------
    (9, 3) float64 ndarray
        SH coefficients of log shading, Rec.709.

    Raises
    ------
    InputError
        If the file has no light.
    """
    path = Path(path)
    path = path / "decomposition.json" if path.is_dir() else path
    data: Any = read_json(path, "a light is a decomposition.json or 9 lists of 3 numbers")
    for key in ("illumination", "coefficients"):
        data = data[key] if isinstance(data, dict) and key in data else data
    light = numbers(data, (9, 3))
    if light is None:
        raise InputError(
            f"{path} is not a light: expected 9 lists of 3 numbers, red, green and blue of each "
            "spherical harmonic"
        )
    return light


def _of_file(path: Path, limits: Limits) -> tuple[np.ndarray, float]:
    """The map as stored, and its default unit in photo pixels."""
    try:
        require_regular(path, limits, "use a height map")
        with path.open("rb") as file:
            start = file.read(8)
    except OSError as error:
        raise InputError(f"cannot read the height map {path}: {error.strerror}") from error
    if start.startswith(_EXR):
        return _of_exr(path, limits), 1.0
    if start.startswith(_NUMPY):
        return _of_numpy(path, limits), 1.0
    raster = read_raster(path, limits)
    if raster.values.shape[2] != 1 or raster.bit_depth < 16:
        raise InputError(
            f"{path}: a height map needs one channel of 16 bits or more: save it as a grey 16-bit "
            "PNG, TIFF, EXR or .npy"
        )
    values = raster.values[..., 0].astype(np.float64)
    return (values, 1.0) if raster.peak is None else (np.where(values > 0, values, np.nan), CODE)


def _of_exr(path: Path, limits: Limits) -> np.ndarray:
    channels = read_channels(path, limits)
    name = next(
        (name for name in _CHANNELS if name in channels),
        next(iter(channels)) if len(channels) == 1 else None,
    )
    if name is None:
        raise InputError(
            f"{path}: no channel Y, Z or height.Z, only {', '.join(list(channels)[:8])}: save "
            "the height as one of these"
        )
    height = channels[name].astype(np.float64)
    inside = channels.get("mask.A")
    return (
        height if inside is None or name != "height.Z" else np.where(inside > 0.5, height, np.nan)
    )


def _of_numpy(path: Path, limits: Limits) -> np.ndarray:
    values = read_array(path, limits)
    if values.ndim != 2 or values.dtype.kind not in "fiu":
        raise InputError(
            f"{path} holds {values.dtype} of shape {values.shape}: a height map is one array (H, "
            "W) of numbers"
        )
    return values.astype(np.float64)


def _of_result(folder: Path, shape: tuple[int, ...]) -> np.ndarray:
    """A result's height on the photo's grid, smoothly, NaN outside its mask.

    Pixels of the photo's mask may lie beyond a smaller mask of the maps, by a few of its pixels:
    the height is continued to them.
    """
    result = load(folder)
    scale = result.provenance.input.get("scale")
    if not isinstance(scale, int | float) or not 0 < scale <= 1:
        raise InputError(
            f"{folder / 'decomposition.json'} has no usable input.scale: it is damaged"
        )
    if tuple(reduced_count(count, scale) for count in shape) != result.mask.shape:
        raise InputError(
            f"{folder} is the result of a photo of another size than {_size(shape)}: use a result "
            "of this photo"
        )
    if scale == 1:
        return np.where(result.mask, result.height, np.nan)
    rim = nearest_pixels(result.mask)
    steps = [np.abs(r - i) for r, i in zip(rim, np.indices(result.mask.shape), strict=True)]
    near = nearest_samples(np.where(np.maximum(*steps) <= _BEYOND, 1.0, np.nan), shape, 1 / scale)
    height = continued_height(result.height.astype(float), result.mask)
    return near * resample_height(height, shape, 1 / scale)


def _size(shape: tuple[int, ...]) -> str:
    return f"{shape[1]} x {shape[0]}"
