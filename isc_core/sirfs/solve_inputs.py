"""The input maps of a SIRFS problem: cropped from the image, and resampled to the size solved.

Limits: pixels that are mostly outside the mask after resampling are ignored.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..imaging.area_enlarge import enlarge_averages
from ..imaging.resampling import height_scale, resample_inside
from ..imaging.window import Window
from ..scene.known_inputs import DepthObservation
from ..scene.normal_estimate import NormalEstimate
from ..scene.shading_estimate import ShadingEstimate


@dataclass(frozen=True, eq=False)
class SolveInputs:
    """The input maps of a problem, all at one scale.

    Attributes
    ----------
    image : (h, w, C) ndarray
        Linear diffuse image.
    valid : (h, w) bool ndarray
        Pixels whose values are used.
    silhouette : (h, w) bool ndarray
        The object, continued beyond the photo.
    photo : (h, w) bool ndarray
        The part of the window inside the photo.
    pixel_weight : (h, w) ndarray or None
        See `Problem`.
    normals : NormalEstimate or None
        Predicted normals.
    depth : DepthObservation or None
        Observed depth.
    shading : ShadingEstimate or None
        Predicted log shading.
    """

    image: np.ndarray
    valid: np.ndarray
    silhouette: np.ndarray
    photo: np.ndarray
    pixel_weight: np.ndarray | None = None
    normals: NormalEstimate | None = None
    depth: DepthObservation | None = None
    shading: ShadingEstimate | None = None

    def cut(self, window: Window) -> "SolveInputs":
        """Crop all maps to a window.

        Parameters
        ----------
        window : Window

        Returns
        -------
        SolveInputs
        """
        weight, normals, depth = self.pixel_weight, self.normals, self.depth
        shading = self.shading
        return SolveInputs(
            window.cut(self.image, 0),
            window.cut(self.valid, False),
            window.cut_silhouette(self.silhouette),
            window.cut(self.photo, False),
            None if weight is None else window.cut(weight, 0),
            normals
            and NormalEstimate(window.cut(normals.normal, 0), window.cut(normals.deviation, 0)),
            depth and replace(depth, height=window.cut(depth.height, np.nan)),
            shading
            and ShadingEstimate(
                window.cut(shading.log_shading, 0), window.cut(shading.deviation, 0)
            ),
        )

    def scaled(self, factor: float) -> "SolveInputs":
        """Resample all maps.

        Parameters
        ----------
        factor : float
            New size over the old.

        Returns
        -------
        SolveInputs
            `self` if the factor is 1.
        """
        if factor == 1:
            return self
        weight, normals, depth = self.pixel_weight, self.normals, self.depth

        def inside(values: np.ndarray) -> np.ndarray:
            return resample_inside(values, self.valid, factor)[0]

        _, share = resample_inside(self.valid, self.valid, factor)
        if factor > 1:
            image = enlarge_averages(self.image, self.valid, share.shape)
        else:
            image = inside(self.image)
        silhouette, photo = (
            resample_inside(m.astype(float), np.ones_like(m), factor)[0] >= 0.5
            for m in (self.silhouette, self.photo)
        )
        return SolveInputs(
            image,
            share >= 0.5 * share.max(),  # no pixel of a very thin object is half covered
            silhouette,
            photo,
            None if weight is None else inside(weight),
            normals and NormalEstimate(inside(normals.normal), inside(normals.deviation)),
            depth and _scaled_depth(depth, factor),
            self.shading and _scaled_shading(self.shading, factor),
        )


def _scaled_depth(depth: DepthObservation, factor: float) -> DepthObservation:
    height, share = resample_inside(np.nan_to_num(depth.height), np.isfinite(depth.height), factor)
    scale = height_scale(depth.height.shape, height.shape)
    return DepthObservation(
        np.where(share >= 0.5, height * scale, np.nan), depth.sigma * scale, depth.weight
    )


def _scaled_shading(shading: ShadingEstimate, factor: float) -> ShadingEstimate:
    known = shading.deviation > 0
    mean, share = resample_inside(shading.log_shading, known, factor)
    deviation = resample_inside(shading.deviation, known, factor)[0]
    inside = share >= 0.5 * share.max()
    return ShadingEstimate(np.where(inside[..., None], mean, 0), np.where(inside, deviation, 0))
