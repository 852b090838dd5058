"""Predicted normals as a soft term of SIRFS' shape.

Problem: shading alone leaves many shapes; a network predicts the mean and the deviation of each
normal from the whole photo, and SIRFS can expect them.

Equation: with the normal's part in the image plane t = (N1, N2), the predicted mean m and the
deviation s of each component,
  cost = w/n_v * sum over valid pixels of |t - m|^2 / (2 s^2).
The term of the `silhouette` stays beside it.

Citation: none; the quadratic term of a Gaussian likelihood.

Limits: s is the deviation of one pixel, while errors of neighbours are correlated; w compensates
for that on average.
"""

import numpy as np
from scipy import ndimage

from ..scene.normal_estimate import NormalEstimate
from .silhouette import ExpectedNormals


def normals_from_prediction(
    predicted: NormalEstimate | None, mask: np.ndarray
) -> ExpectedNormals | None:
    """Return predicted normals in the reference's frame.

    Parameters
    ----------
    predicted : NormalEstimate or None
        Camera frame, (H, W).
    mask : (H, W) bool ndarray
        The object; where it reaches beyond the prediction, the nearest predicted normal continues.

    Returns
    -------
    ExpectedNormals or None
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
    maps = (-normal[..., 1], normal[..., 0], 1 / deviation**2)
    return ExpectedNormals(*(np.where(mask, values, 0) for values in maps))
