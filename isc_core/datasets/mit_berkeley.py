"""Reading the MIT-Berkeley intrinsic images: photographs of objects with their true shape, light,
shading and reflectance.

Photographs, shading and reflectance under laboratory light: R. Grosse, M. K. Johnson, E. H.
Adelson, W. T. Freeman (2009), "Ground truth dataset and baseline evaluations for intrinsic image
algorithms", doi:10.1109/ICCV.2009.5459428. Heights, lights and the renderings under natural light:
J. T. Barron, J. Malik (2015), "Shape, illumination, and reflectance from shading",
doi:10.1109/TPAMI.2014.2377712.

Limits: in natural light `image = shading * reflectance` holds exactly (it is rendered), in the
laboratory only to a few per cent.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..io.json_files import read_json
from ..io.matlab import read_matrix
from ..photo import read_raster

ILLUMINATIONS = ("natural", "laboratory")
INPUTS = ("diffuse", "original")

_FOLDERS = {
    "laboratory": ("laboratory", "MIT-Berkeley-Laboratory"),
    "natural": ("natural", "MIT-Berkeley-Natural"),
}
_WHITE = 65535.0
_GLOSSY = "isc synth glossy-mit"  # kind of the sets of this command in their `scene.json`


@dataclass(frozen=True, eq=False)
class MitBerkeleyObject:
    """One object under one illumination, on the evaluation crop (h, w); row 0 at the top, float64.

    Attributes
    ----------
    name, illumination : str
        The object.
    image : (h, w, 3) ndarray
        The input, linear, in [0, 1].
    valid : (h, w) ndarray of bool
        All three channels of `image` are above 0.
    mask : (h, w) ndarray of bool
        The object.
    height : (h, w) ndarray
        Pixels toward the viewer, NaN where unknown.
    shading, reflectance : (h, w, 3) ndarray
        Linear, at the scale of the files; laboratory shading may exceed 1.
    light : (9, 3) ndarray
        Log-shading SH coefficients, reference convention
        (`shading.spherical_harmonics.light_from_reference` converts).
    """

    name: str
    illumination: str
    image: np.ndarray
    valid: np.ndarray
    mask: np.ndarray
    height: np.ndarray
    shading: np.ndarray
    reflectance: np.ndarray
    light: np.ndarray


def list_objects(root: str | Path, illumination: str) -> tuple[str, ...]:
    """List the objects under one illumination.

    Parameters
    ----------
    root : path
        Folder of the data set.
    illumination : str
        "natural" or "laboratory".

    Returns
    -------
    tuple of str
        Names in alphabetical order.

    Raises
    ------
    InputError
        If the folder is missing or has no object.
    """
    folder = _folder(Path(root), illumination)
    names = tuple(
        sorted(
            entry.name
            for entry in folder.iterdir()
            if entry.is_dir() and not entry.name.startswith(".")
        )
    )
    if not names:
        raise InputError(
            f"{folder} contains no objects: give the folder that contains the MIT-Berkeley set"
        )
    return names


def usual_illuminations(root: str | Path, input: str = "diffuse") -> tuple[str, ...]:
    """Return the illuminations of a set that have images of a kind.

    Parameters
    ----------
    root : path
        Folder of the data set.
    input : str, optional
        One of `INPUTS`.

    Returns
    -------
    tuple of str
        The set's own, except that its original images are those of the laboratory. A set of `isc
        synth glossy-mit` has one light, though both of its folders can be read.

    Raises
    ------
    InputError
        If the set's record is damaged.
    """
    path = Path(root) / "scene.json"
    record = read_json(path, "make the set again") if path.is_file() else None
    if isinstance(record, dict) and record.get("kind") == _GLOSSY:
        light = str(record.get("light")).partition("-")[0]
        if light in ILLUMINATIONS:
            return (light,)
    return ("laboratory",) if input == "original" else ILLUMINATIONS


def check_request(root: str | Path, name: str, illumination: str, input: str) -> None:
    """Check the arguments of `load_object` without reading the object.

    Parameters
    ----------
    root, name, illumination, input
        As for `load_object`.

    Raises
    ------
    InputError
        If a name or option is unknown.
    """
    _check_option("input", input, INPUTS)
    known = list_objects(root, illumination)
    if name not in known:
        raise InputError(f"unknown object '{name}': choose from {', '.join(known)}")
    if (
        illumination == "natural"
        and input == "original"
        and not (_folder(Path(root), "natural") / name / "original.png").is_file()
    ):
        raise InputError(
            "the natural images of this set have no highlights: use --input diffuse, or "
            "--illumination laboratory"
        )


def load_object(
    root: str | Path, name: str, illumination: str = "natural", input: str = "diffuse"
) -> MitBerkeleyObject:
    """Read one object of the set.

    Height, reflectance, mask and crop always come from the laboratory folder.

    Parameters
    ----------
    root : path
        Folder of the data set.
    name : str
        One of `list_objects`.
    illumination : str, optional
        "natural" or "laboratory".
    input : str, optional
        "diffuse" (without highlights) or "original" (as photographed; laboratory light, or the
        glossy sets of `isc synth glossy-mit`).

    Returns
    -------
    MitBerkeleyObject
        On the evaluation crop.

    Raises
    ------
    InputError
        If a name or option is unknown, or a file is missing, damaged or of the wrong size.
    """
    check_request(root, name, illumination, input)
    laboratory = _folder(Path(root), "laboratory") / name
    own = _folder(Path(root), illumination) / name
    crop = _crop(laboratory / "crop_idx.mat")
    image, reflectance = (
        _cut(_colour(path), crop, 3, path)
        for path in (own / f"{input}.png", laboratory / "reflectance.png")
    )
    mask = _cut(_pixels(laboratory / "mask.png"), crop, 1, laboratory / "mask.png") > 0
    if not mask.any():
        raise InputError(f"{laboratory / 'mask.png'} marks no pixel: is it damaged?")
    height = _cut(_matrix(laboratory / "Z.mat", "depth"), crop, 1, laboratory / "Z.mat")
    shading = _shading(own, illumination, crop)
    light = _matrix(
        own / "L.mat", *(("L",) if illumination == "natural" else ("color_lights", "diffuse"))
    )
    if light.shape != (9, 3):
        raise InputError(
            f"{own / 'L.mat'}: its light has shape {light.shape} where (9, 3) was expected"
        )
    _require_finite(light, own / "L.mat")
    valid = (image > 0).all(axis=-1)
    return MitBerkeleyObject(
        name, illumination, image, valid, mask, height, shading, reflectance, light
    )


def load_natural_lights(root: str | Path) -> np.ndarray:
    """Read the lights of real environments.

    Parameters
    ----------
    root : path
        Folder of the data set.

    Returns
    -------
    (9, 3, n) ndarray
        Log-shading SH coefficients, reference convention.

    Raises
    ------
    InputError
        If the file is missing or damaged.
    """
    path = Path(root) / "natural_lights.mat"
    lights = _matrix(path, "Ls")
    if lights.ndim != 3 or lights.shape[:2] != (9, 3):
        raise InputError(f"{path}: 'Ls' has shape {lights.shape} where (9, 3, n) was expected")
    _require_finite(lights, path)
    return lights


def _require_finite(light: np.ndarray, path: Path) -> None:
    if not np.isfinite(light).all():
        raise InputError(f"{path}: its light has values that are not finite: is it damaged?")


def _check_option(what: str, value: str, known: tuple[str, ...]) -> None:
    if value not in known:
        raise InputError(f"unknown {what} '{value}': choose from {', '.join(known)}")


def _folder(root: Path, illumination: str) -> Path:
    """The illumination's folder, under either of its two names."""
    _check_option("illumination", illumination, ILLUMINATIONS)
    for name in _FOLDERS[illumination]:
        if (root / name).is_dir():
            return root / name
    raise InputError(
        f"{root} has no folder {' or '.join(_FOLDERS[illumination])}: give the folder that "
        "contains the MIT-Berkeley set"
    )


def _pixels(path: Path) -> np.ndarray:
    """An image's stored values, (h, w) or (h, w, 3) in RGB order."""
    values = read_raster(path).values
    return values[..., 0] if values.shape[2] == 1 else values


def _colour(path: Path) -> np.ndarray:
    pixels = _pixels(path)
    if pixels.ndim != 3 or pixels.dtype != np.uint16:
        raise InputError(f"{path} is not a 16-bit colour image: fetch the data set again")
    return pixels / _WHITE


def _matrix(path: Path, *keys: str) -> np.ndarray:
    """A float64 array of a MAT file: the variable `keys[0]`, then its fields; sides of length 1 are
    dropped.
    """
    return np.squeeze(read_matrix(path, *keys)).astype(np.float64)


def _shading(folder: Path, illumination: str, crop: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    if illumination == "natural":
        path = folder / "shading_color.png"
        return _cut(_colour(path), crop, 3, path)
    path = folder / "shading_corrected_color.mat"
    return _cut(_matrix(path, "shading_correct"), crop, 3, path)


def _crop(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """The rows and columns of the evaluation crop, converted from 1-based to 0-based indices."""
    with np.errstate(invalid="ignore"):  # NaN becomes an index outside any image
        rows, columns = (
            np.atleast_1d(_matrix(path, key)).ravel().astype(np.int64) - 1
            for key in ("crop_idx1", "crop_idx2")
        )
    return rows, columns


def _cut(
    full: np.ndarray, crop: tuple[np.ndarray, np.ndarray], channels: int, path: Path
) -> np.ndarray:
    """The evaluation crop of a file's array, (h, w) for one channel, (h, w, 3) for three."""
    if full.shape[2:] != ((channels,) if channels > 1 else ()) or full.ndim < 2:
        raise InputError(
            f"{path}: shape {full.shape} where {channels} channel(s) were expected: is it the file "
            "of the data set?"
        )
    for indices, size in zip(crop, full.shape[:2], strict=True):
        if not 0 < indices.size <= size or indices.min() < 0 or indices.max() >= size:
            raise InputError(
                f"{path}: its {full.shape[1]} x {full.shape[0]} pixels do not hold the crop: is it "
                "a file of the data set?"
            )
    return np.ascontiguousarray(full[np.ix_(*crop)])
