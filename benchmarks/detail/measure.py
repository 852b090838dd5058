"""How much of a relief an estimate has, octave by octave, and how much it invents.

Problem: an estimate's overall shape may be wrong by many degrees and its detail right, or the
reverse. Detail is therefore measured relative to each normal field's own smooth part.

Equation: with G_c a Gaussian over the mask (normalised convolution) of .2829 c pixels, scaled by
the object's length over 860, the low-pass

    L_c = 1 - (1 - G_c)^3

passes half of the wavelength c, 97 % of 2 c and .5 % of c / 2. With m = L_22.6 n, normalised, and R
the smallest rotation from m to the viewing direction, the fine normals and their octaves are the
tangential fields

    d = (R n)_xy,   d_16 = L_11.3 d - L_22.6 d,   d_8 = L_5.66 d - L_11.3 d,   d_4 = d - L_5.66 d

With m and R of the estimate for the estimate, of the truth for the truth, and means over the pixels
that count,

    error = mean |d_est - d_true|^2,   energy = mean |d_true|^2,   explained = 1 - error / energy

On a smooth body, d_true is that of the body, and the error what the estimate invents. Base: the
median angle between the normals after smoothing and sampling at an object length of 256 pixels.

Pixels that count: those farther than 16 from the mask's outline, from what is not estimated, and
from folds and steps of the smooth body.

Limits: an estimate of another size has to be resampled to the photo's first (`at_size`).
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from isc_core.imaging.bounding_box import mask_box
from isc_core.imaging.resampling import resample_inside
from isc_core.imaging.smoothing import masked_gaussian, masked_low_pass

OCTAVES = (16, 8, 4)
LENGTH, BASE_LENGTH = 860, 256
_CUTS = (16 * 2**0.5, 8 * 2**0.5, 4 * 2**0.5)  # between octaves, pixels
_SIGMA = 0.2829  # of the Gaussian, relative to the cut
_MARGIN = 16  # pixels
_FOLD = np.radians(3)  # of the smooth body's own fine normals


@dataclass(frozen=True)
class ReliefScore:
    """Errors of estimated normals, in each octave.

    Attributes
    ----------
    explained : tuple of float
        Share of the true energy in each of `OCTAVES`; at most 1.
    energy, error : tuple of float
        Mean squared fine normals of the truth, and of the difference, radians squared.
    base : float
        Median angle of the overall shape, degrees.
    """

    explained: tuple[float, ...]
    energy: tuple[float, ...]
    error: tuple[float, ...]
    base: float


def score_relief(
    estimated: np.ndarray, truth: np.ndarray, mask: np.ndarray, smooth: np.ndarray | None = None
) -> ReliefScore:
    """Compare estimated normals with the truth, octave by octave.

    Parameters
    ----------
    estimated, truth : (H, W, 3) ndarray
        Normals, camera frame; 0 or not finite where nothing is estimated.
    mask : (H, W) ndarray of bool
        The object.
    smooth : (H, W, 3) ndarray, optional
        Normals without relief, to leave out folds; without, only the outline is left out.

    Returns
    -------
    ReliefScore
    """
    known = mask & np.isfinite(estimated).all(2) & (np.abs(estimated).sum(2) > 0)
    estimated = _unit(np.where(known[..., None], estimated, 0))
    scored = scored_pixels(mask, known, smooth)
    found, wanted = fine_normals(estimated, known), fine_normals(truth, mask)
    energy = [_mean_square(one, scored) for one in wanted]
    error = [_mean_square(a - b, scored) for a, b in zip(found, wanted, strict=True)]
    explained = [1 - e / max(t, 1e-12) for e, t in zip(error, energy, strict=True)]
    base = base_angle(estimated, truth, known & mask)
    return ReliefScore(tuple(explained), tuple(energy), tuple(error), base)


def fine_normals(normal: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Divide the fine normals into octaves.

    Parameters
    ----------
    normal : (H, W, 3) ndarray
        Unit inside the mask.
    mask : (H, W) ndarray of bool

    Returns
    -------
    (3, H, W, 2) float32 ndarray
        d_16, d_8, d_4 of the module; right and up.
    """
    scale = max(mask_box(mask)[2:]) / LENGTH
    normal = np.asarray(normal, np.float32)
    middle = _unit(_low_passed(normal, mask, _CUTS[0] * scale))
    fine = _turned_to_viewer(normal, middle)
    smoother = [_low_passed(fine, mask, cut * scale) for cut in _CUTS]
    return np.stack([smoother[1] - smoother[0], smoother[2] - smoother[1], fine - smoother[2]])


def scored_pixels(
    mask: np.ndarray, known: np.ndarray, smooth: np.ndarray | None = None
) -> np.ndarray:
    """Return the pixels that count.

    Parameters
    ----------
    mask, known : (H, W) ndarray of bool
        The object, and where there is an estimate.
    smooth : (H, W, 3) ndarray, optional
        Normals without relief.

    Returns
    -------
    (H, W) ndarray of bool
    """
    usable = mask & known
    if smooth is not None:
        own = fine_normals(smooth, mask).sum(0)
        usable &= np.linalg.norm(own, axis=2) < _FOLD
    margin = _MARGIN * max(mask_box(mask)[2:]) / LENGTH
    padded = np.pad(usable, 1)
    return np.asarray(ndimage.distance_transform_edt(padded)[1:-1, 1:-1] > margin)


def base_angle(estimated: np.ndarray, truth: np.ndarray, mask: np.ndarray) -> float:
    """Return the median angle between overall shapes.

    Parameters
    ----------
    estimated, truth : (H, W, 3) ndarray
        Unit inside the mask.
    mask : (H, W) ndarray of bool

    Returns
    -------
    float
        Degrees.
    """
    factor = BASE_LENGTH / max(mask_box(mask)[2:])
    small = []
    for normal in (estimated, truth):
        blurred = masked_gaussian(np.asarray(normal, np.float32), mask, 0.5 / factor)
        values, share = resample_inside(blurred, mask, factor)
        small.append(_unit(values))
    cosine = (small[0] * small[1]).sum(2)[share > 0.99]
    return float(np.degrees(np.median(np.arccos(np.clip(cosine, -1, 1)))))


def at_size(normal: np.ndarray, inside: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Bring normals of a smaller or larger grid to a photo's.

    Parameters
    ----------
    normal : (h, w, 3) ndarray
    inside : (h, w) ndarray of bool
    shape : tuple of int
        (H, W) of the photo.

    Returns
    -------
    (H, W, 3) float32 ndarray
        Unit; 0 where nothing is estimated.
    """
    if normal.shape[:2] == shape:
        return np.where(inside[..., None], normal, 0).astype(np.float32)
    rows, columns = (
        (np.arange(new) + 0.5) * old / new - 0.5
        for new, old in zip(shape, inside.shape, strict=True)
    )
    nearest = ndimage.distance_transform_edt(~inside, return_distances=False, return_indices=True)
    filled = normal[nearest[0], nearest[1]].astype(float)
    places = np.meshgrid(rows, columns, indexing="ij")
    planes = [
        ndimage.map_coordinates(filled[..., c], places, order=3, mode="nearest") for c in range(3)
    ]
    near = ndimage.map_coordinates(inside.astype(float), places, order=1, mode="nearest") > 0.5
    return np.asarray(_unit(np.stack(planes, axis=2)) * near[..., None], np.float32)


def _low_passed(field: np.ndarray, mask: np.ndarray, cut: float) -> np.ndarray:
    """L_c of the module."""
    return masked_low_pass(field, mask, _SIGMA * cut)


def _turned_to_viewer(normal: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """x and y (H, W, 2) of normals after the smallest rotation that turns `middle` to z.

    Rodrigues' formula for the axis a = m x z, written out:
    R n = m_z n + a x n + a (a . n) / (1 + m_z).
    """
    (x, y, z), (mx, my, mz) = np.moveaxis(normal, 2, 0), np.moveaxis(middle, 2, 0)
    turn = (my * x - mx * y) / np.maximum(1 + mz, 1e-6)
    return np.stack([mz * x - mx * z + my * turn, mz * y - my * z - mx * turn], axis=2)


def _unit(vectors: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=2, keepdims=True)
    return np.asarray(vectors / np.where(length > 1e-6, length, 1))


def _mean_square(field: np.ndarray, where: np.ndarray) -> float:
    return float(np.square(field[where], dtype=float).sum(-1).mean()) if where.any() else 0.0
