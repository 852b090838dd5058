"""The Python interface in four functions, exported by `isc_core`.

    import isc_core

    result = isc_core.decompose("cup.png")
    isc_core.save(result, "cup")

An image is a file, an array or a `Photo`. Arrays of uint8 and uint16 are sRGB codes, arrays of
floats are linear light. The functions return frozen dataclasses of float32 arrays; docs/concepts.md
defines their frames and units.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from .decomposition import pipeline
from .decomposition.settings import Settings
from .errors import InputError
from .io.decoders import Raster, read_raster
from .masking.finder import MaskSearch
from .photo.arrays import raster_from_array
from .photo.highlight_marks import HighlightMarks
from .photo.names import WholeFrame
from .photo.photo import Photo
from .photo.reading import photo_from_raster
from .progress import Monitor
from .result_files import result_folder
from .result_files.mesh.object_cover import read_cover
from .scene.decomposition import Decomposition, Separation
from .scene.known_inputs import KnownInputs
from .separation import BEST, IMPROVED
from .separation import separate as separate_layers

__all__ = ["Image", "decompose", "load", "save", "separate"]

Image = str | Path | np.ndarray | Photo


def decompose(
    image: Image,
    mask: str | Path | np.ndarray | None = None,
    *,
    settings: Settings | None = None,
    known: KnownInputs | None = None,
    transfer: str = "auto",
    marks: HighlightMarks | None = None,
    monitor: Monitor | None = None,
) -> Decomposition:
    """Decompose a photo of one glossy object into its intrinsic scene characteristics.

    Parameters
    ----------
    image : str, Path, ndarray or Photo
        An image file; an array (H, W), (H, W, 3) or (H, W, 4), uint8 or uint16 sRGB codes or linear
        Rec.709 floats; or a photo.
    mask : str, Path or (H, W) ndarray, optional
        The object, white on black or True. By default the image's alpha channel, else the pixels
        inside a black border, else the one distinct object.
    settings : Settings, optional
        Model and options, such as `Settings(model="sirfs", max_size=256)`.
    known : KnownInputs, optional
        Known shape, light or depth.
    transfer : {"auto", "srgb", "linear"}
        Encoding of the image; "auto": floats are linear, all others sRGB.
    marks : HighlightMarks, optional
        Positions of highlights, and of print or paint that looks like them; for the model joint.
    monitor : Monitor, optional
        Receives progress; can cancel.

    Returns
    -------
    Decomposition
        `diffuse`, `specular`, `residual`, `reflectance`, `shading`, `normal` (H, W, 3), `height`,
        `mask`, `confidence` (H, W), `illumination` (9, 3), the fitted lobe, and provenance.
        `cover` is the coverage of the photo's pixels by the object, if it is known.

    Raises
    ------
    InputError
        If the image, the mask or the settings cannot be used; the message names the remedy.
    Cancelled
        If the monitor cancels.
    """
    photo = _photo(image, mask, transfer, WholeFrame.NEVER)
    if marks:
        photo = replace(photo, marks=marks)
    name = Path(image).name if isinstance(image, str | Path) else ""
    result = pipeline.decompose(photo, settings, known=known, name=name, monitor=monitor)
    return replace(result, cover=photo.cover)


def separate(
    image: Image,
    mask: str | Path | np.ndarray | None = None,
    *,
    method: str = BEST,
    variant: str = IMPROVED,
    transfer: str = "auto",
    monitor: Monitor | None = None,
) -> Separation:
    """Separate a photo into diffuse and specular light.

    Parameters
    ----------
    image : str, Path, ndarray or Photo
        As for `decompose`.
    mask : str, Path or (H, W) ndarray, optional
        As for `decompose`; an image without a mask, an alpha channel, a black border or one
        distinct object is processed as a whole.
    method : str
        One of `isc_core.separation.METHODS`.
    variant : str
        "improved", or "paper" as published; see `isc_core.separation.variants`.
    transfer : {"auto", "srgb", "linear"}
        As for `decompose`.
    monitor : Monitor, optional

    Returns
    -------
    Separation
        `diffuse`, `specular`, `residual` and the photo's `image` (H, W, 3), `confidence` and
        `mask` (H, W).

    Raises
    ------
    InputError
        If the image, the mask or a name cannot be used.
    Cancelled
        If the monitor cancels.
    """
    photo = _photo(image, mask, transfer, WholeFrame.WITHOUT_MASK)
    layers = separate_layers(
        method, photo.image, photo.mask, photo.clipped, variant=variant, monitor=monitor
    )
    cover = None if photo.found is None else photo.found.cover
    return replace(layers, image=photo.image, mask=photo.mask, cover=cover)


def save(result: Decomposition | Separation, folder: str | Path) -> None:
    """Write a result's folder, as the commands do; an earlier one is replaced.

    Parameters
    ----------
    result : Decomposition or Separation
    folder : str or Path

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    if isinstance(result, Decomposition):
        result_folder.save(result, folder, cover=result.cover)
        return
    image = result.image
    if image is None:
        image = result.diffuse + result.specular + result.residual
    result_folder.save_separation(result, image, folder, mask=result.mask, cover=result.cover)


def load(folder: str | Path) -> Decomposition:
    """Read the folder of a decomposition.

    Parameters
    ----------
    folder : str or Path

    Returns
    -------
    Decomposition

    Raises
    ------
    InputError
        If a file is missing, damaged, or inconsistent.
    """
    result = result_folder.load(folder)
    mask_file = Path(folder) / result_folder.MASK
    return replace(result, cover=read_cover(mask_file, result.provenance.input))


def _photo(
    image: Image, mask: str | Path | np.ndarray | None, transfer: str, whole_frame: WholeFrame
) -> Photo:
    if isinstance(image, Photo):
        if mask is not None:
            raise InputError("a Photo already has a mask: give an array or a file with a mask")
        return image
    raster, name = _raster(image, "the image")
    mask_raster, mask_name = (None, "") if mask is None else _raster(mask, "the mask")
    return photo_from_raster(
        raster,
        name,
        mask_raster,
        mask_name,
        transfer=transfer,
        whole_frame=whole_frame,
        finder=MaskSearch(lenient=whole_frame is not WholeFrame.NEVER),
    )


def _raster(image: str | Path | np.ndarray, name: str) -> tuple[Raster, str]:
    """The image, and its name in error messages."""
    if isinstance(image, np.ndarray):
        return raster_from_array(image, name), name
    return read_raster(image), str(image)
