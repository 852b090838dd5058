"""How much of each pixel of the maps the object covers.

Problem: the maps of a result end at pixels that the object covers by half. The edge of a mask that
was found in the photo is known more finely: `mask.png` has the cover of each of the photo's pixels.

Equation: the cover of a pixel of the maps is the mean over its area. Beyond two pixels from the
object it is 0: the photo may show other things.

Limits: without that file the edge is that of the maps, of pixels that are the object's or not.
"""

from pathlib import Path

import numpy as np
from scipy import ndimage

from ...imaging.area_resize import AreaFilter
from ...io.decoders import read_raster
from ...scene.decomposition import Decomposition

_NEAR = 2  # pixels


def object_cover(d: Decomposition, mask_file: Path) -> np.ndarray:
    """Return the object's cover.

    Parameters
    ----------
    d : Decomposition
    mask_file : Path
        `mask.png` of the result; may be absent.

    Returns
    -------
    (H, W) float32 ndarray
        In [0, 1].

    Raises
    ------
    InputError
        If the file is no image.
    """
    hard = d.mask.astype(np.float32)
    if not mask_file.is_file():
        return hard
    raster = read_raster(mask_file)
    values = raster.values.reshape(*raster.values.shape[:2], -1)[..., 0]
    cover = values.astype(np.float32) / np.iinfo(raster.values.dtype).max
    scale = float(d.provenance.input.get("scale", 1.0))
    if scale < 1:
        area = AreaFilter.of(cover.shape, scale)
        cover = area(cover) / np.maximum(area.full, 1e-6)
    if cover.shape != d.mask.shape:  # of another photo
        return hard
    near = ndimage.binary_dilation(d.mask, iterations=_NEAR)
    return np.where(near, np.clip(cover, 0, 1), 0).astype(np.float32)
