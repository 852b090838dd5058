"""Predicted normals as a soft term of SIRFS' shape.

Problem: shading alone leaves many shapes; a network predicts the mean and the deviation of each
normal from the whole photo, and SIRFS can expect them.

Equation: with the normal's part in the image plane t = (N1, N2), the predicted mean m and the
deviation s of each component,
  cost = w/n_v * sum over valid pixels of |t - m|^2 / (2 s^2).
The term of the `silhouette` stays beside it.

The solver can start from the shape that the normals add up to: the mean normals, made unit vectors,
are averaged over blocks of pixels, as the network is coarser than the solver, and their slopes are
integrated in least squares.

Citation: the quadratic term of a Gaussian likelihood; integration: B. K. P. Horn and M. J. Brooks
1986, doi:10.1016/0734-189X(86)90114-3.

Limits: s is the deviation of one pixel, while errors of neighbours are correlated; w compensates
for that on average. The shape is one sheet: jumps of depth become slopes.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ..baselines.poisson import integrate
from ..imaging.framing import continued_height
from ..scene.normal_estimate import NormalEstimate
from .silhouette import ExpectedNormals

_STEEPEST = 0.95  # largest in-plane part of a block's normal
_TOLERANCE = 1e-3  # of the integration: the solver goes on from there


@dataclass(frozen=True)
class PredictedNormals(ExpectedNormals):
    """Predicted normals, and the directions that their means have.

    Attributes
    ----------
    unit_down, unit_right : (H, W) ndarray
        In-plane part of the mean, made a unit vector.
    """

    unit_down: np.ndarray
    unit_right: np.ndarray


def normals_from_prediction(
    predicted: NormalEstimate | None, mask: np.ndarray
) -> PredictedNormals | None:
    """Return predicted normals in the reference's frame.

    Parameters
    ----------
    predicted : NormalEstimate or None
        Camera frame, (H, W).
    mask : (H, W) bool ndarray
        The object; where it reaches beyond the prediction, the nearest predicted normal continues.

    Returns
    -------
    PredictedNormals or None
        None without a prediction.
    """
    if predicted is None:
        return None
    nearest = tuple(
        ndimage.distance_transform_edt(
            predicted.deviation <= 0, return_distances=False, return_indices=True
        )
    )
    normal = predicted.normal[nearest].astype(float)
    deviation = predicted.deviation[nearest].astype(float)
    unit = normal / np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), 1e-6)
    maps = (-normal[..., 1], normal[..., 0], 1 / deviation**2, -unit[..., 1], unit[..., 0])
    return PredictedNormals(*(np.where(mask, values, 0) for values in maps))


def predicted_height(predicted: PredictedNormals, mask: np.ndarray, block: int) -> np.ndarray:
    """Return the height that predicted normals add up to, in blocks of pixels.

    Parameters
    ----------
    predicted : PredictedNormals
    mask : (H, W) bool ndarray
        The object.
    block : int
        Side of a block, in pixels.

    Returns
    -------
    (ceil(H / block), ceil(W / block)) ndarray
        Toward the viewer, in blocks, mean 0 on each part of the object; it goes on beyond it.
    """
    cover = _block_means(mask.astype(float), block)
    inside = cover >= min(0.5, float(cover.max()))
    down, right = (
        _block_means(np.where(mask, values, 0), block) / np.maximum(cover, 1e-6)
        for values in (predicted.unit_down, predicted.unit_right)
    )
    shrink = np.minimum(1, _STEEPEST / np.maximum(np.hypot(down, right), 1e-6))
    toward = np.sqrt(1 - shrink**2 * (down**2 + right**2))
    slope_down, slope_right = -shrink * down / toward, -shrink * right / toward
    step_down, step_right = np.zeros((2, *cover.shape))
    step_down[:-1] = (slope_down[1:] + slope_down[:-1]) / 2
    step_right[:, :-1] = (slope_right[:, 1:] + slope_right[:, :-1]) / 2
    height = integrate(step_right, step_down, inside, _TOLERANCE)
    return continued_height(np.where(inside, height, 0), inside)


def _block_means(values: np.ndarray, block: int) -> np.ndarray:
    """Means of blocks of pixels; `values` (H, W) are continued to whole blocks."""
    rows, columns = (-n % block for n in values.shape)
    whole = np.pad(values, ((0, rows), (0, columns)), mode="edge")
    split = whole.reshape(whole.shape[0] // block, block, whole.shape[1] // block, block)
    return split.mean(axis=(1, 3))
