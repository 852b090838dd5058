"""The inputs of a lobe fit, validated."""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..imaging.bounding_box import mask_slices
from ..imaging.channels import channel_means
from ..imaging.row_blocks import row_blocks
from ..scene.light_estimate import LightEstimate
from ..shading.brdf.directions import unit


@dataclass(frozen=True, eq=False)
class PixelData:
    """Optional data for the pixels of a specular image.

    Attributes
    ----------
    confidence : (H, W) ndarray or None
        Reliability in [0, 1]; None for 1.
    clipped : (H, W) ndarray of bool or None
        Where the light is a lower bound.
    height : (H, W) ndarray or None
        Pixels toward the viewer. With it, lights may be near; otherwise they are infinitely far.
    """

    confidence: np.ndarray | None = None
    clipped: np.ndarray | None = None
    height: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class GivenLight:
    """Known light: at most one of the two attributes.

    Attributes
    ----------
    direction : (3,) ndarray or None
        Unit vector toward the light, camera frame.
    environment : (rows, 2 rows, 3) ndarray or None
        Environment map, see `shading.environment_map`.
    """

    direction: np.ndarray | None = None
    environment: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class RecoveredScene:
    """Quantities recovered from the same photo as the specular image, see `recovered`.

    Attributes
    ----------
    shading : (H, W, 3) ndarray
        Of a white Lambertian surface, >= 0.
    silhouette_normals : (H, W, 3) ndarray or None
        Unit normals expected from the silhouette alone.
    light_estimate : LightEstimate or None
        The predicted light.
    """

    shading: np.ndarray
    silhouette_normals: np.ndarray | None = None
    light_estimate: LightEstimate | None = None


@dataclass(frozen=True, eq=False)
class SurfacePositions:
    """Surface positions of the pixels, in radii of the object (half of the longer side of the
    mask's bounding box) from the centre of that box.

    Attributes
    ----------
    height : (H, W) ndarray
        Pixels toward the viewer.
    middle : tuple of float
        Row, column and height of the origin.
    radius : float
        In pixels.
    """

    height: np.ndarray
    middle: tuple[float, float, float]
    radius: float

    def at(self, cells: np.ndarray) -> np.ndarray:
        """Return surface positions.

        Parameters
        ----------
        cells : (N, 2) ndarray of int
            Row and column, on the object.

        Returns
        -------
        (N, 3) ndarray
            Right, up, toward the viewer.
        """
        (row, column), (middle_row, middle_column, middle) = cells.T, self.middle
        depth = self.height[row, column] - middle
        return np.stack([column - middle_column, middle_row - row, depth], axis=1) / self.radius


@dataclass(frozen=True, eq=False)
class Observed:
    """A validated specular image.

    Attributes
    ----------
    specular, normal : (H, W, 3) ndarray
        Specular light and unit normals.
    mask : (H, W) ndarray of bool
        The object.
    confidence : (H, W) ndarray
        In [0, 1].
    clipped : (H, W) ndarray of bool
        Where the light is a lower bound.
    inside : (H, W) ndarray of bool
        Pixels that are used.
    positions : SurfacePositions or None
        None where the height is unknown.
    silhouette_normals : (H, W, 3) ndarray or None
        Unit normals expected from the silhouette alone.
    """

    specular: np.ndarray
    normal: np.ndarray
    mask: np.ndarray
    confidence: np.ndarray
    clipped: np.ndarray
    inside: np.ndarray
    positions: SurfacePositions | None
    silhouette_normals: np.ndarray | None = None

    @property
    def peak(self) -> float:
        """The largest mean over the channels."""
        return float(self.brightness.max()) if self.inside.any() else 0.0

    @property
    def brightness(self) -> np.ndarray:
        """Means over the channels (n,) of the specular light of the pixels that are used."""
        return channel_means(self.specular, self.inside)

    def specular_at(self, where: np.ndarray) -> np.ndarray:
        """Return the specular light of some pixels in float64.

        Parameters
        ----------
        where : (H, W) ndarray of bool

        Returns
        -------
        (n, 3) ndarray
        """
        return np.asarray(self.specular[where], float)

    def normal_at(self, where: np.ndarray | tuple[slice, slice]) -> np.ndarray:
        """Return the normals of some pixels in float64.

        Parameters
        ----------
        where : (H, W) ndarray of bool, or slices

        Returns
        -------
        (..., 3) ndarray
        """
        return np.asarray(self.normal[where], float)


def observe(
    specular: np.ndarray,
    normal: np.ndarray,
    mask: np.ndarray,
    pixels: PixelData | None = None,
    silhouette_normals: np.ndarray | None = None,
) -> Observed:
    """Validate the arrays of a fit.

    Parameters
    ----------
    specular, normal : (H, W, 3) ndarray
        Specular light and unit normals.
    mask : (H, W) ndarray of bool
        The object.
    pixels : PixelData, optional
        Confidence, clipping and height.
    silhouette_normals : (H, W, 3) ndarray, optional
        Unit normals expected from the silhouette alone.

    Returns
    -------
    Observed

    Raises
    ------
    InputError
        If the arrays do not fit together.
    """
    specular, normal, mask = (np.asarray(values) for values in (specular, normal, mask))
    shape = mask.shape
    if (
        mask.ndim != 2
        or mask.dtype != bool
        or specular.shape != (*shape, 3)
        or normal.shape != (*shape, 3)
    ):
        shapes = f"specular {specular.shape}, normal {normal.shape} and mask {shape} {mask.dtype}"
        raise InputError(f"{shapes} have to be (H, W, 3), (H, W, 3) and (H, W) bool")
    pixels = pixels or PixelData()
    confidence = (
        np.broadcast_to(1.0, shape)
        if pixels.confidence is None
        else np.asarray(pixels.confidence, float)
    )
    clipped = np.zeros(shape, bool) if pixels.clipped is None else np.asarray(pixels.clipped)
    if confidence.shape != shape or clipped.shape != shape or clipped.dtype != bool:
        raise InputError("confidence and clipped have to be (H, W) like the mask, clipped of bool")
    if not (np.isfinite(specular[mask]).all() and (specular[mask] >= 0).all()):
        raise InputError("the specular image has to be finite and 0 or more inside the mask")
    if not (
        np.isfinite(confidence[mask]).all()
        and (confidence[mask] >= 0).all()
        and (confidence[mask] <= 1).all()
    ):
        raise InputError("the confidence has to be within [0, 1] inside the mask")
    _check_unit(normal, mask, "normal")
    if silhouette_normals is not None:
        silhouette_normals = np.asarray(silhouette_normals)
        if silhouette_normals.shape != normal.shape:
            raise InputError(
                f"silhouette_normals has shape {silhouette_normals.shape}: give (H, W, 3) like the "
                "normals"
            )
        _check_unit(silhouette_normals, mask, "silhouette_normals")
    inside = mask & (confidence > 0) & (normal[..., 2] > 0)
    positions = _positions(pixels.height, mask)
    return Observed(
        specular, normal, mask, confidence, clipped, inside, positions, silhouette_normals
    )


def _check_unit(vectors: np.ndarray, mask: np.ndarray, name: str) -> None:
    for block in row_blocks(mask.shape):
        unit(vectors[block.rows][mask[block.rows]], name)


def _positions(height: np.ndarray | None, mask: np.ndarray) -> SurfacePositions | None:
    if height is None or not mask.any():
        return None
    height = np.asarray(height, float)
    if height.shape != mask.shape or not np.isfinite(height[mask]).all():
        raise InputError(
            f"height has shape {height.shape}: give finite (H, W) pixels like the mask"
        )
    box = mask_slices(mask)
    low, high = np.array([part.start for part in box]), np.array([part.stop - 1 for part in box])
    (row, column), radius = (low + high) / 2, max(float((high - low).max()) / 2, 1.0)
    middle = float((height[mask].min() + height[mask].max()) / 2)
    return SurfacePositions(height, (float(row), float(column), middle), radius)
