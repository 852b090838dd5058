"""Predicted normals as a soft term of SIRFS' shape.

Problem: shading alone is ambiguous; a network predicts the mean and the deviation of each normal
from the whole photo, and this term draws the shape toward them.

Equation: with the normal's part in the image plane t = (N1, N2), the part m of the predicted mean
direction and the deviation s of each component,
  cost = w/n_v * sum over valid pixels of |t - m|^2 / (2 s^2).
The mean of probable unit normals is shorter than 1, so its own part in the image plane is that of a
flatter normal; it is therefore divided by its length. The term of the `silhouette` is kept.

The solver can start from the integrated normals: m is averaged over blocks of pixels, since the
network's resolution is below the solver's, and the slopes of the blocks are integrated by least
squares. Where normals of a block differ, its mean is short and the shape is flat.

Citation: the quadratic term of a Gaussian likelihood; integration: B. K. P. Horn, M. J. Brooks,
"The variational approach to shape from shading", CVGIP 33, 1986,
doi:10.1016/0734-189X(86)90114-3.

Limits: s is the deviation of one pixel, while errors of neighbours are correlated; w compensates
for that on average. The surface is continuous: depth discontinuities become slopes.
"""

import numpy as np

from ..baselines.poisson import integrate
from ..filters.distance import nearest_pixels
from ..imaging.blocks import padded_means_inside
from ..imaging.channels import length
from ..imaging.framing import continued_height
from ..scene.normal_estimate import NormalEstimate
from .silhouette import ExpectedNormals

_MAX_IN_PLANE = 0.95  # largest in-plane part of a block's normal
_TOLERANCE = 1e-3  # of the integration: the solver refines its result
_SHORTEST = 0.1  # mean of normals in all directions: it has none


def normals_from_prediction(
    predicted: NormalEstimate | None, mask: np.ndarray
) -> ExpectedNormals | None:
    """Return predicted normals in the reference's frame.

    Parameters
    ----------
    predicted : NormalEstimate or None
        Camera frame, (H, W).
    mask : (H, W) bool ndarray
        The object; outside the prediction, the nearest predicted normal is used.

    Returns
    -------
    ExpectedNormals or None
        Of the mean's direction; None without a prediction.
    """
    if predicted is None:
        return None
    nearest = nearest_pixels(predicted.deviation > 0)
    normal = predicted.normal[nearest].astype(float)
    normal /= np.maximum(length(normal), _SHORTEST)[..., None]
    deviation = predicted.deviation[nearest].astype(float)
    maps = (-normal[..., 1], normal[..., 0], 1 / deviation**2)
    return ExpectedNormals(*(np.where(mask, values, 0) for values in maps))


def predicted_height(predicted: ExpectedNormals, mask: np.ndarray, block: int) -> np.ndarray:
    """Integrate predicted normals over blocks of pixels.

    Parameters
    ----------
    predicted : ExpectedNormals
        From `normals_from_prediction`.
    mask : (H, W) bool ndarray
        The object, not empty.
    block : int
        Side of a block, in pixels.

    Returns
    -------
    (ceil(H / block), ceil(W / block)) ndarray
        Height toward the viewer, in blocks, with mean 0 on each connected part of the object;
        extrapolated outside it.
    """
    normal = np.stack([predicted.down, predicted.right], axis=2)
    means, cover = padded_means_inside(normal, mask, block)
    inside = cover >= min(0.5, float(cover.max()))
    down, right = means[..., 0], means[..., 1]
    shrink = np.minimum(1, _MAX_IN_PLANE / np.maximum(np.hypot(down, right), 1e-6))
    toward = np.sqrt(1 - shrink**2 * (down**2 + right**2))
    slope_down, slope_right = -shrink * down / toward, -shrink * right / toward
    step_down, step_right = np.zeros((2, *cover.shape))
    step_down[:-1] = (slope_down[1:] + slope_down[:-1]) / 2
    step_right[:, :-1] = (slope_right[:, 1:] + slope_right[:, :-1]) / 2
    height = integrate(step_right, step_down, inside, _TOLERANCE)
    return continued_height(np.where(inside, height, 0), inside)
