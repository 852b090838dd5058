"""Photos with known diffuse and specular layers, on which separations are evaluated.

Shen & Zheng's photographs with ground truth: H.-L. Shen, Z.-H. Zheng (2013),
doi:10.1364/AO.52.004483. Their figures, and all published since, use the stored values / 255
without linearising, over the whole frame. The laboratory objects: R. Grosse, M. K. Johnson, E. H.
Adelson, W. T. Freeman (2009), doi:10.1109/ICCV.2009.5459428: 16 bits, linear, inside the mask.
Rendered scenes: multilayer EXR files with the channel names of `maps.exr`.

Limits: in Shen & Zheng's set the specular layer is the photo less the diffuse one, rounded to 8
bits; the laboratory's light is white to about ten per cent.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..io.exr import read_channels
from ..photo import read_linear

_IMAGE_SUFFIXES = (".exr", ".png", ".bmp", ".tif", ".tiff")
_MULTILAYER = ("maps.exr", "truth.exr")


@dataclass(frozen=True, eq=False)
class SeparationTruth:
    """A photo with its true layers.

    Attributes
    ----------
    name : str
        Of the photo.
    image, diffuse, specular : (H, W, 3) ndarray of float32
        >= 0.
    mask : (H, W) ndarray of bool
        The object.
    clipped : (H, W) ndarray of bool
        Some channel is at the coding's maximum.
    coded : bool
        The values are a camera's sRGB codes, not linear light. For display only; methods do not use
        it.
    """

    name: str
    image: np.ndarray
    mask: np.ndarray
    diffuse: np.ndarray
    specular: np.ndarray
    clipped: np.ndarray
    coded: bool = False


def list_shen_zheng(folder: str | Path) -> tuple[str, ...]:
    """List the photos that have a ground truth (`NAME.bmp` with `NAME_gt.bmp`).

    Parameters
    ----------
    folder : path
        Folder of the photos.

    Returns
    -------
    tuple of str
        Names in alphabetical order.
    """
    ends = "_gt.bmp"
    return tuple(sorted(path.name.removesuffix(ends) for path in Path(folder).glob(f"*{ends}")))


def load_shen_zheng(folder: str | Path, name: str) -> SeparationTruth:
    """Read a photo of Shen & Zheng's set; the mask is the whole frame.

    Parameters
    ----------
    folder : path
        Folder of the photos.
    name : str
        One of `list_shen_zheng`.

    Returns
    -------
    SeparationTruth
        The photo and its layers.

    Raises
    ------
    InputError
        If a file is missing, unreadable or of another size.
    """
    image, diffuse = (
        read_linear(Path(folder) / file, "linear") for file in (f"{name}.bmp", f"{name}_gt.bmp")
    )
    _same_size(image, diffuse, Path(folder) / f"{name}_gt.bmp")
    whole = np.ones(image.shape[:2], bool)
    return SeparationTruth(
        name,
        image,
        whole,
        diffuse,
        np.maximum(image - diffuse, 0),
        (image >= 1).any(axis=2),
        coded=True,
    )


def load_laboratory(root: str | Path, name: str) -> SeparationTruth:
    """Read a laboratory object of the MIT-Berkeley set: the whole frame of `original.png` and its
    layers.

    Parameters
    ----------
    root : path
        Folder of the data set.
    name : str
        Of the object.

    Returns
    -------
    SeparationTruth
        The photo and its layers.

    Raises
    ------
    InputError
        If a file is missing, unreadable or of another size.
    """
    folder = Path(root) / "laboratory" / name
    image, diffuse, specular = (
        read_linear(folder / f"{layer}.png", "linear")
        for layer in ("original", "diffuse", "specular")
    )
    mask = read_linear(folder / "mask.png", "linear")[..., 0] > 0
    for layer in (diffuse, specular, mask):
        _same_size(image, layer, folder)
    return SeparationTruth(name, image, mask, diffuse, specular, mask & (image >= 1).any(axis=2))


def load_rendered(folder: str | Path) -> SeparationTruth:
    """Read a rendered scene; the specular layer is the image less the diffuse layer.

    Parameters
    ----------
    folder : path
        Contains `maps.exr` or `truth.exr` (channels `image.R`, `diffuse.R`, ..., `mask.A`), or
        three images named `image`, `diffuse` and `mask` (EXR linear, others sRGB).

    Returns
    -------
    SeparationTruth
        The image and its layers.

    Raises
    ------
    InputError
        If a file or channel is missing, or sizes differ.
    """
    folder = Path(folder)
    multilayer = next((folder / name for name in _MULTILAYER if (folder / name).is_file()), None)
    if multilayer is not None:
        channels = read_channels(multilayer)
        if missing := [
            f"{layer}.{c}"
            for layer in ("image", "diffuse")
            for c in "RGB"
            if f"{layer}.{c}" not in channels
        ]:
            raise InputError(
                f"{multilayer} lacks the channel {missing[0]}: render it with its diffuse layer"
            )
        image, diffuse = (
            np.stack([channels[f"{layer}.{c}"] for c in "RGB"], -1)
            for layer in ("image", "diffuse")
        )
        mask = channels["mask.A"] > 0.5 if "mask.A" in channels else image.max(axis=2) > 0
    else:
        image, diffuse = (read_linear(_image(folder, layer)) for layer in ("image", "diffuse"))
        _same_size(image, diffuse, folder)
        mask = read_linear(_image(folder, "mask"))[..., 0] > 0.2
        _same_size(image, mask, folder)
    # A sensor clips at exactly 1; above it, an EXR file was rendered without a sensor.
    clipped = mask & (image == 1).any(axis=2)
    return SeparationTruth(
        folder.name, image, mask, diffuse, np.maximum(image - diffuse, 0), clipped
    )


def _image(folder: Path, layer: str) -> Path:
    found = next(
        (
            folder / f"{layer}{suffix}"
            for suffix in _IMAGE_SUFFIXES
            if (folder / f"{layer}{suffix}").is_file()
        ),
        None,
    )
    if found is None:
        raise InputError(
            f"{folder} has neither {' nor '.join(_MULTILAYER)} nor an image named {layer}: "
            "it is not a rendered scene"
        )
    return found


def _same_size(image: np.ndarray, other: np.ndarray, path: Path) -> None:
    if image.shape[:2] != other.shape[:2]:
        raise InputError(f"{path}: the layers differ in size: is the set complete?")
