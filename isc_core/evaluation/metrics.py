"""Errors of shape, light, shading and reflectance on the MIT-Berkeley set, and image errors.

Problem: an estimate is compared with the ground truth up to quantities that an image cannot
determine: the offset of the height, and one scale each of shading, reflectance and light.

Equation: the six errors of one object and their geometric mean `avg` follow Barron and Malik. The
local error is that of Grosse et al.: sum |t - a_b u|^2 / sum |t|^2 over windows b that overlap by
half, each with its own optimal scale a_b. It is insensitive to slowly varying errors; an estimate
of zero has an error of 1.

Citation: J. T. Barron, J. Malik (2015), "Shape, illumination, and reflectance from shading",
doi:10.1109/TPAMI.2014.2377712; R. Grosse, M. K. Johnson, E. H. Adelson, W. T. Freeman (2009),
doi:10.1109/ICCV.2009.5459428.

Limits: all errors need the ground truth; none is perceptual. Images are compared at the
scale of their stored values.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields

import numpy as np

from ..datasets.mit_berkeley import MitBerkeleyObject
from ..errors import InputError
from ..shading.spherical_harmonics import light_from_reference, normal_from_reference, real_sh
from ..shading.surface_stencils import normals

# Windows of the local error: 20 pixels. The reference's second tiling starts at pixel ten, not
# the eleventh.
_WINDOW, _SECOND_TILING = 20, 9
_LIGHT_PROBE = 256
_TINY = float(np.finfo(np.float64).eps)


@dataclass(frozen=True)
class Scores:
    """The six errors of one object; 0 is perfect.

    Attributes
    ----------
    height : float
        Mean absolute error, pixels, after the optimal offset.
    normal : float
        Mean angle, radians.
    shading, reflectance : float
        Mean square error after one scale for all channels.
    rs_mse : float
        Grosse's local error, the mean of shading's and reflectance's.
    light : float
        Mean square error of the rendered light probe after one scale for all channels.
    """

    height: float
    normal: float
    shading: float
    reflectance: float
    rs_mse: float
    light: float

    @property
    def average(self) -> float:
        """The geometric mean of the six errors."""
        return geometric_mean(getattr(self, field.name) for field in fields(self))


def score(
    truth: MitBerkeleyObject,
    *,
    height: np.ndarray,
    normal: np.ndarray,
    shading: np.ndarray,
    reflectance: np.ndarray,
    light: np.ndarray,
) -> Scores:
    """Compute the errors of an estimate.

    Parameters
    ----------
    truth : MitBerkeleyObject
        The object, on its crop (h, w).
    height : (h, w) ndarray
        Pixels toward the viewer.
    normal : (h, w, 3) ndarray
        Unit vectors, camera frame: x right, y up, z toward the viewer.
    shading, reflectance : (h, w, 3) ndarray
        Linear, used where the input is valid.
    light : (9, 3) ndarray
        Log-shading coefficients of `shading.spherical_harmonics.real_sh`.

    Returns
    -------
    Scores
        The six errors.

    Raises
    ------
    InputError
        As `require_truth`.
    ValueError
        If a shape is wrong, or an estimate is not finite where it is used.
    """
    require_truth(truth)
    if light.shape != truth.light.shape or not np.isfinite(light).all():
        raise ValueError(f"{truth.name}: the light must be {truth.light.shape} finite coefficients")
    _require(truth, height=height, normal=normal, shading=shading, reflectance=reflectance)
    true_normal = truth_normal(truth.height)
    known = np.isfinite(true_normal[..., 2])
    compared = _compared(truth, known)
    return Scores(
        height=height_error(truth.height, height),
        normal=angular_error(true_normal[known], normal[known]),
        shading=scaled_mse(truth.shading[compared], shading[compared]),
        reflectance=scaled_mse(truth.reflectance[compared], reflectance[compared]),
        rs_mse=(
            lmse(truth.shading, shading, compared) + lmse(truth.reflectance, reflectance, compared)
        )
        / 2,
        light=light_error(light_from_reference(truth.light), light),
    )


def require_truth(truth: MitBerkeleyObject) -> None:
    """Check that the errors of an object are defined, whatever the estimate.

    Parameters
    ----------
    truth : MitBerkeleyObject
        The object.

    Raises
    ------
    InputError
        If no pixel can be compared, or shading, reflectance or light cannot be.
    """
    name = f"{truth.name}, {truth.illumination}"
    compared = _compared(truth, np.isfinite(truth_normal(truth.height)[..., 2]))
    if not compared.any():
        raise InputError(f"{name}: no pixel inside the crop has both an image and a known height")
    for layer, values in (("shading", truth.shading), ("reflectance", truth.reflectance)):
        if not np.isfinite(values[compared]).all():
            raise InputError(f"{name}: its {layer} has values that are not finite")
        if not values[compared].any(axis=0).all():
            raise InputError(f"{name}: its {layer} has a channel that is zero everywhere")
    with np.errstate(over="ignore", invalid="ignore"):
        brightness = np.square(np.exp(_probe_basis() @ light_from_reference(truth.light))).sum()
    if not np.isfinite(brightness):
        raise InputError(f"{name}: its light is too bright for floating-point numbers")


def truth_normal(height: np.ndarray) -> np.ndarray:
    """Compute the normals of a height map with holes.

    Parameters
    ----------
    height : (h, w) ndarray
        Pixels toward the viewer.

    Returns
    -------
    (h, w, 3) ndarray
        Unit normals, camera frame; NaN where any height of the 3 x 3 neighbourhood (replicated at
        the border) is not finite.
    """
    rows, columns = height.shape
    around = np.pad(np.isfinite(height), 1, mode="edge")
    known = np.ones_like(height, bool)
    for row in range(3):
        for column in range(3):
            known &= around[row : row + rows, column : column + columns]
    normal = normal_from_reference(normals(np.where(np.isfinite(height), height, 0.0)))
    return np.where(known[..., None], normal, np.nan)


def height_error(truth: np.ndarray, estimate: np.ndarray) -> float:
    """Compute the mean absolute difference of two heights after the optimal constant offset.

    Parameters
    ----------
    truth : (h, w) ndarray
        Pixels; only finite values are used.
    estimate : (h, w) ndarray
        Pixels; not rescaled.

    Returns
    -------
    float
        Pixels.
    """
    difference = (estimate - truth)[np.isfinite(truth)]
    return float(np.abs(difference - np.median(difference)).mean())


def angular_error(truth: np.ndarray, estimate: np.ndarray) -> float:
    """Return the mean angle between unit vectors.

    Parameters
    ----------
    truth, estimate : (..., 3) ndarray
        Unit vectors.

    Returns
    -------
    float
        Radians.
    """
    return float(np.arccos(np.clip((truth * estimate).sum(axis=-1), -1, 1)).mean())


def scaled_mse(truth: np.ndarray, estimate: np.ndarray) -> float:
    """Return the mean square difference after the scale of `estimate` that minimises it.

    Parameters
    ----------
    truth, estimate : ndarray
        Of the same shape.

    Returns
    -------
    float
    """
    scale = (truth * estimate).sum() / max(_TINY, float((estimate * estimate).sum()))
    return float(np.square(scale * estimate - truth).mean())


def light_error(truth: np.ndarray, estimate: np.ndarray) -> float:
    """Compare two lights on a rendered front hemisphere, after scaling by one factor.

    Parameters
    ----------
    truth, estimate : (9, C) ndarray
        Log-shading SH coefficients, ISC's convention.

    Returns
    -------
    float
        Mean square difference.
    """
    basis = _probe_basis()
    return scaled_mse(np.exp(basis @ truth), np.exp(basis @ estimate))


def mse(truth: np.ndarray, estimate: np.ndarray, mask: np.ndarray | None = None) -> float:
    """Compute the mean square difference of two images over all channels.

    Parameters
    ----------
    truth, estimate : (h, w[, C]) ndarray
        The images.
    mask : (h, w) ndarray of bool, optional
        Pixels that are used.

    Returns
    -------
    float
        Mean square difference.

    Raises
    ------
    ValueError
        If shapes differ or the mask is empty.
    """
    _same_shape(truth, estimate, mask)
    difference = np.asarray(truth, float) - estimate
    return float(np.square(difference if mask is None else difference[mask]).mean())


def psnr(
    truth: np.ndarray, estimate: np.ndarray, mask: np.ndarray | None = None, *, peak: float = 1.0
) -> float:
    """Compute the peak signal-to-noise ratio, 10 log10(peak^2 / MSE); values are not clipped.

    Parameters
    ----------
    truth, estimate : (h, w[, C]) ndarray
        The images.
    mask : (h, w) ndarray of bool, optional
        Pixels that are used.
    peak : float, optional
        Range of the values.

    Returns
    -------
    float
        dB; infinite for equal images.

    Raises
    ------
    ValueError
        If shapes differ or the mask is empty.
    """
    error = mse(truth, estimate, mask)
    return math.inf if error == 0 else 10 * math.log10(peak * peak / error)


def lmse(truth: np.ndarray, estimate: np.ndarray, mask: np.ndarray) -> float:
    """Compute Grosse's local error, the mean over the channels.

    Parameters
    ----------
    truth, estimate : (h, w[, C]) ndarray
        The images; NaN is allowed outside the mask.
    mask : (h, w) ndarray of bool
        Pixels that are used.

    Returns
    -------
    float
        0 is perfect; an estimate of zero has 1.

    Raises
    ------
    ValueError
        If shapes differ, the mask is empty, or a channel of the truth is zero everywhere.
    """
    _same_shape(truth, estimate, mask)
    t, u = (
        np.where(mask[..., None], image.reshape(*mask.shape, -1), 0.0)
        for image in (truth, estimate)
    )
    error, total = np.zeros(t.shape[2]), np.zeros(t.shape[2])
    for row in (0, _SECOND_TILING):
        for column in (0, _SECOND_TILING):
            tt, tu, uu = (_window_sums(product[row:, column:]) for product in (t * t, t * u, u * u))
            scale = tu / np.maximum(_TINY, uu)
            error += (tt - 2 * scale * tu + scale * scale * uu).sum(axis=(0, 1))
            total += tt.sum(axis=(0, 1))
    if not (total > 0).all():
        raise ValueError("the local error of a channel that is zero everywhere is not defined")
    return float(np.maximum(error / total, 0).mean())


def geometric_mean(values: Iterable[float]) -> float:
    """Compute the geometric mean of numbers >= 0; 0 if one of them is 0.

    Parameters
    ----------
    values : iterable of float

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If there are none, or one is negative.
    """
    numbers = list(values)
    if not numbers or min(numbers) < 0:
        raise ValueError("a geometric mean needs at least one number, and none below 0")
    return 0.0 if min(numbers) == 0 else math.exp(math.fsum(map(math.log, numbers)) / len(numbers))


def _compared(truth: MitBerkeleyObject, known: np.ndarray) -> np.ndarray:
    """The pixels (h, w) of the image errors: valid, with a known normal, not at the border."""
    compared = known & truth.valid
    compared[[0, -1], :] = False
    compared[:, [0, -1]] = False
    return compared


def _probe_basis() -> np.ndarray:
    """The basis functions (N, 9) at the normals of the light probe."""
    axis = (np.arange(1, _LIGHT_PROBE + 1) - _LIGHT_PROBE / 2) / (_LIGHT_PROBE / 2)
    down, right = np.meshgrid(axis, axis, indexing="ij")
    squared = 1 - down * down - right * right
    front = squared > 0
    probe = np.stack([down[front], right[front], np.sqrt(squared[front])], axis=-1)
    return real_sh(normal_from_reference(probe))


def _window_sums(image: np.ndarray) -> np.ndarray:
    """Sums over the windows that tile an image (h, w, C), zero outside."""
    down, right = (np.arange(0, size, _WINDOW) for size in image.shape[:2])
    if not (len(down) and len(right)):
        return np.zeros((0, 0, image.shape[2]))
    return np.add.reduceat(np.add.reduceat(image, down, axis=0), right, axis=1)


def _same_shape(truth: np.ndarray, estimate: np.ndarray, mask: np.ndarray | None) -> None:
    if truth.shape != estimate.shape or (mask is not None and mask.shape != truth.shape[:2]):
        raise ValueError(
            f"cannot compare images of shapes {truth.shape} and {estimate.shape} in a mask of "
            f"{getattr(mask, 'shape', None)}"
        )
    if mask is not None and not mask.any():
        raise ValueError("the mask is empty")


def _require(truth: MitBerkeleyObject, **maps: np.ndarray) -> None:
    """Check that every map has the shape of the truth and is finite where it is used."""
    needed = {"shading": truth.valid, "reflectance": truth.valid}
    for name, value in maps.items():
        shape = truth.height.shape if name == "height" else truth.image.shape
        if value.shape != shape:
            raise ValueError(
                f"{truth.name}: {name} has shape {value.shape} where {shape} was expected"
            )
        if not np.isfinite(value[needed.get(name, np.isfinite(truth.height))]).all():
            raise ValueError(f"{truth.name}: {name} is not finite everywhere inside the object")
