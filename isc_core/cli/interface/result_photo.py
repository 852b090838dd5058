"""The photo of a result, read again at its own resolution."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...io.limits import Limits
from ...photo import Photo, read_photo
from ...photo.found_mask import FOUND
from ...photo.transfer import PROFILE
from ...result_files.mesh.object_cover import read_cover
from ...result_files.result_folder import MASK
from ...scene.decomposition import Decomposition


def photo_of_result(
    d: Decomposition,
    folder: Path,
    photo: Path,
    mask: Path | None,
    transfer: str | None,
    limits: Limits,
) -> Photo:
    """Read the photo of a result with the mask and the transfer curve of the result.

    Parameters
    ----------
    d : Decomposition
    folder : Path
        Of the result.
    photo : Path
    mask : Path or None
        Required if the result was made with a separate mask that has no grey pixels: others are in
        the result.
    transfer : str or None
        Replaces the curve of the result.
    limits : Limits

    Returns
    -------
    Photo
        The caller checks that the file is the same.

    Raises
    ------
    InputError
        If it cannot be read, or the mask is missing.
    """
    given = d.provenance.input
    curve = transfer or str(given.get("transfer", "auto"))
    source = given.get("mask_from")
    if mask is None and (source == "file" or source in FOUND):
        mask = folder / MASK
        if not mask.is_file():
            raise InputError(
                "the result was made with a separate mask: give the same one with --mask"
                if source == "file"
                else f"{folder} has no {MASK}, the mask that was found in its photo: give the mask "
                "with --mask, or decompose the photo again"
            )
    read = read_photo(photo, mask, "auto" if curve == PROFILE else curve, limits=limits)
    if mask is None and given.get("mask_from") == "alpha":
        return _own_object(read, read_cover(folder / MASK, given))
    return read


def _own_object(photo: Photo, cover: np.ndarray | None) -> Photo:
    """The photo with the mask of one object, where the alpha channel shows several."""
    if cover is None or cover.shape != photo.mask.shape:
        return photo
    mask = photo.mask & (cover >= 0.5)
    return replace(photo, mask=mask, cover=cover) if mask.any() else photo
