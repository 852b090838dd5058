"""A result at the scale at which its gloss is fitted: the object at most `LONGEST` pixels long.

Equation: means over blocks of `step` x `step` pixels, restricted to the mask; a block is used if
more than half of it is inside.

Limits: highlights narrower than a block are blurred.
"""

from dataclasses import dataclass

import numpy as np

from ..imaging.blocks import padded_means_inside
from ..imaging.bounding_box import mask_slices
from ..scene.decomposition import Decomposition
from ..shading.perspective import far_view_normals

LONGEST = 192
_CLIPPED = 0.995  # of the brightest value
_MIN_Z = 1e-3  # of a normal's z


@dataclass(frozen=True, eq=False)
class WorkingScale:
    """The maps of a result over the bounding box of its object, downsampled.

    Attributes
    ----------
    box : tuple of slice
        Bounding box of the object in the result's maps.
    step : int
        Pixels of the result's maps per pixel of these.
    mask, clipped : (h, w) ndarray of bool
    specular : (h, w) ndarray
        Mean of the channels.
    normal : (h, w, 3) ndarray
        Unit normals that reflect the same light to a viewer along z.
    diffuse, shading : (h, w, 3) ndarray
    """

    box: tuple[slice, slice]
    step: int
    mask: np.ndarray
    clipped: np.ndarray
    specular: np.ndarray
    normal: np.ndarray
    diffuse: np.ndarray
    shading: np.ndarray

    @property
    def slopes(self) -> tuple[np.ndarray, np.ndarray]:
        """Slopes (h, w) of the height along rows and columns, 0 outside the mask."""
        return slopes_from_normals(self.normal)

    def reduced(self, layer: np.ndarray, mask: np.ndarray) -> np.ndarray:
        """Downsample a layer of the result.

        Parameters
        ----------
        layer : (H, W, ...) ndarray
        mask : (H, W) ndarray of bool
            Of the result.

        Returns
        -------
        (h, w, ...) ndarray
        """
        return padded_means_inside(layer[self.box].astype(float), mask[self.box], self.step)[0]


def slopes_from_normals(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute the slopes of the height along rows and columns from normals.

    Parameters
    ----------
    normal : (..., 3) ndarray
        Unit normals, camera frame.

    Returns
    -------
    down, right : (...) ndarray
    """
    facing = np.maximum(normal[..., 2], _MIN_Z)
    return normal[..., 1] / facing, -normal[..., 0] / facing


def mirroring_normals(d: Decomposition) -> np.ndarray:
    """Return normals (H, W, 3) that reflect the same light to a viewer along z.

    Parameters
    ----------
    d : Decomposition

    Returns
    -------
    (H, W, 3) ndarray
        The result's own normals if it has no camera.
    """
    normal = d.normal.astype(float)
    return normal if d.camera is None else far_view_normals(normal, d.view)


def working_scale(d: Decomposition) -> WorkingScale:
    """Downsample the maps of a result.

    Parameters
    ----------
    d : Decomposition

    Returns
    -------
    WorkingScale
    """
    box = mask_slices(d.mask)
    mask = d.mask[box]
    step = -(-max(mask.shape) // LONGEST)
    image = d.image[box].max(axis=2)
    clipped = mask & (image >= _CLIPPED * image.max())
    normal, share = padded_means_inside(mirroring_normals(d)[box], mask, step)
    inside = share > 0.5
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    normal = np.where(
        inside[..., None] & (length > 0), normal / np.maximum(length, 1e-9), (0, 0, 1)
    )
    specular, diffuse, shading = (
        np.where(inside[..., None], padded_means_inside(layer[box].astype(float), mask, step)[0], 0)
        for layer in (d.specular, d.diffuse, d.shading)
    )
    any_clipped = inside & (padded_means_inside(clipped.astype(float), mask, step)[0] > 0)
    return WorkingScale(
        box, step, inside, any_clipped, specular.mean(axis=2), normal, diffuse, shading
    )
