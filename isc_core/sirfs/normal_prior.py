"""Predicted normals as a prior on SIRFS' shape.

Problem: shading alone leaves many shapes; a network predicts the mean and the deviation of each
normal from the whole photo, and SIRFS can expect them.

Equation: with the normal's part in the image plane t = (N1, N2), the predicted mean m and the
deviation s of each component,
  cost = w/n_v * sum over valid pixels of |t - m|^2 / (2 s^2):
the term of `silhouette` with another expectation. The solver starts at the height Z whose slopes
are nearest to those of m,
  min over Z of sum over neighbours of (Z' - Z - slope)^2, slope = m / sqrt(1 - |m|^2),
on a coarse grid.

Citation: B. K. P. Horn and M. J. Brooks, "The variational approach to shape from shading", Computer
Vision, Graphics, and Image Processing 33(2) (1986), doi:10.1016/0734-189X(86)90114-3.

Limits: s is the deviation of one pixel, while errors of neighbours are correlated; w compensates
for that on average.
"""

import numpy as np
from scipy import ndimage

from ..imaging.upsampling import enlarged
from ..scene.normal_estimate import NormalEstimate
from .priors.priors import SilhouetteProfile
from .silhouette import ExpectedNormals, normals_from_silhouette

_STEP = 4  # pixels of the coarse grid
_STEEPEST = 0.97  # largest in-plane part of a normal that is integrated
_COVERED = 0.1  # least share of a cell that belongs to the object
_PRECISION = 1e-6  # relative residual: the start need not be more exact


def expected_normals(
    mask: np.ndarray, profile: SilhouetteProfile | None, predicted: NormalEstimate | None
) -> ExpectedNormals | None:
    """Return the normals expected inside a mask.

    Parameters
    ----------
    mask : (H, W) bool ndarray
    profile : SilhouetteProfile or None
        Profile to expect from the silhouette if nothing was predicted.
    predicted : NormalEstimate or None
        Predicted normals, (H, W).

    Returns
    -------
    ExpectedNormals or None
        None if neither is known.
    """
    if predicted is not None:
        return normals_from_prediction(predicted, mask)
    return None if profile is None else normals_from_silhouette(mask, profile)


def normals_from_prediction(predicted: NormalEstimate, mask: np.ndarray) -> ExpectedNormals:
    """Return predicted normals in the reference's frame.

    Parameters
    ----------
    predicted : NormalEstimate
        Camera frame, (H, W).
    mask : (H, W) bool ndarray
        The object; where it reaches beyond the prediction, the nearest predicted normal continues.

    Returns
    -------
    ExpectedNormals
    """
    nearest = tuple(
        ndimage.distance_transform_edt(
            predicted.deviation <= 0, return_distances=False, return_indices=True
        )
    )
    normal = predicted.normal[nearest].astype(float)
    deviation = predicted.deviation[nearest].astype(float)
    maps = (-normal[..., 1], normal[..., 0], 1 / deviation**2, height_of_normals(normal, mask))
    return ExpectedNormals(*(np.where(mask, values, 0) for values in maps))


def height_of_normals(normal: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Integrate mean normals to a height map, nothing finer than 4 pixels.

    Parameters
    ----------
    normal : (H, W, 3) ndarray
        Mean normals, camera frame.
    mask : (H, W) bool ndarray

    Returns
    -------
    (H, W) ndarray
        Pixels toward the viewer, 0 at its lowest and outside the mask.
    """
    cover = _cells(mask.astype(float))
    sums = [_cells(np.where(mask, normal[..., k], 0)) for k in (0, 1)]
    across, up = (total / np.where(cover > 0, cover, 1) for total in sums)
    flat = np.minimum(1, _STEEPEST / np.maximum(np.hypot(across, up), _STEEPEST))
    across, up = across * flat, up * flat
    steep = np.sqrt(1 - across**2 - up**2)
    known = cover > _COVERED
    if not known.any():
        return np.zeros(mask.shape)
    height = _integrated(-_STEP * across / steep, _STEP * up / steep, known)
    nearest = tuple(
        ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
    )
    fine = enlarged(height[nearest], tuple(_STEP * n for n in height.shape), _STEP)[
        : mask.shape[0], : mask.shape[1]
    ]
    return np.where(mask, fine, 0)


def _cells(values: np.ndarray) -> np.ndarray:
    """Means of cells of (H, W), which is padded with 0."""
    rows, columns = (-(-n // _STEP) for n in values.shape)
    padded = np.pad(
        values, [(0, _STEP * n - m) for n, m in zip((rows, columns), values.shape, strict=True)]
    )
    return np.asarray(padded.reshape(rows, _STEP, columns, _STEP).mean(axis=(1, 3)))


def _integrated(right: np.ndarray, down: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Height (h, w), least 0, 0 where not `known`, whose rises to the next cell are nearest to
    `right` and `down` in least squares.

    By conjugate gradients (M. R. Hestenes and E. Stiefel 1952, doi:10.6028/jres.049.044), whose
    sums no thread reorders.
    """
    beside, below = known[:, :-1] & known[:, 1:], known[:-1] & known[1:]

    def adjoint(along: np.ndarray, across: np.ndarray) -> np.ndarray:
        out = np.zeros(known.shape)
        out[:, 1:] += along
        out[:, :-1] -= along
        out[1:] += across
        out[:-1] -= across
        return out

    def rises(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.where(beside, np.diff(z, axis=1), 0), np.where(below, np.diff(z, axis=0), 0)

    wanted = (
        np.where(beside, (right[:, :-1] + right[:, 1:]) / 2, 0),
        np.where(below, (down[:-1] + down[1:]) / 2, 0),
    )
    height, residual = np.zeros(known.shape), adjoint(*wanted)
    direction, square = residual, float(np.square(residual).sum())
    enough = _PRECISION**2 * square
    for _ in range(known.size):
        if square <= enough:
            break
        image = adjoint(*rises(direction))
        step = square / float((direction * image).sum())
        height, residual = height + step * direction, residual - step * image
        before, square = square, float(np.square(residual).sum())
        direction = residual + square / before * direction
    return np.where(known, height - height[known].min(), 0)
