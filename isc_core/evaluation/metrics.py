"""How far an answer is from the truth: the MIT-Berkeley errors of shape, light, shading and
reflectance, and image errors.

The six errors of one object and their geometric mean `avg` follow J. T. Barron, J. Malik (2015),
"Shape, illumination, and reflectance from shading", doi:10.1109/TPAMI.2014.2377712: what the image
cannot tell (the offset of the height, one scale of each of shading, reflectance and light) is free,
everything else counts. The local error is that of R. Grosse, M. K. Johnson, E. H. Adelson, W. T.
Freeman (2009), doi:10.1109/ICCV.2009.5459428: sum |t - a_b u|^2 / sum |t|^2 over windows b that
overlap by half, each with its own best scale a_b. It forgives slow drifts, and an estimate of zero
scores 1.

Limits: all errors need the truth; none is a perceptual distance. Images are compared at the scale
of their stored values.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields

import numpy as np

from ..datasets.mit_berkeley import MitBerkeleyObject
from ..shading.spherical_harmonics import light_from_reference, normal_from_reference, real_sh
from ..shading.surface_stencils import normals

# Windows of the local error: 20 pixels; the reference's second tiling begins at the tenth pixel,
# not the eleventh.
_WINDOW, _SECOND_TILING = 20, 9
_LIGHT_PROBE = 256
_TINY = float(np.finfo(np.float64).eps)


@dataclass(frozen=True)
class Scores:
    """The six errors of one object; 0 is perfect.

    `height`: mean absolute, pixels, after the best offset. `normal`: mean angle, radians.
    `shading`, `reflectance`: mean square after one scale for all channels. `rs_mse`: Grosse's local
    error, the mean of shading's and reflectance's. `light`: mean square of the rendered light probe
    after one scale for all channels.
    """

    height: float
    normal: float
    shading: float
    reflectance: float
    rs_mse: float
    light: float

    @property
    def average(self) -> float:
        """The geometric mean of the six."""
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
    """The errors of an answer for `truth`, on the truth's crop (h, w).

    `height`: (h, w) pixels toward the viewer. `normal`: (h, w, 3) unit vectors, x right, y up, z
    toward the viewer. `shading`, `reflectance`: (h, w, 3) linear, read where the truth's input is
    valid. `light`: (9, 3) coefficients of `shading.spherical_harmonics.real_sh`. Raises `ValueError` for a wrong
    shape, and where an answer is not finite although it is needed.
    """
    if light.shape != truth.light.shape or not np.isfinite(light).all():
        raise ValueError(f"{truth.name}: the light must be {truth.light.shape} finite coefficients")
    _require(truth, height=height, normal=normal, shading=shading, reflectance=reflectance)
    true_normal = truth_normal(truth.height)
    known = np.isfinite(true_normal[..., 2])
    compared = known & truth.valid
    compared[[0, -1], :] = False
    compared[:, [0, -1]] = False
    if not compared.any():
        raise ValueError(f"{truth.name}: no pixel has both a valid input and a known height")
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


def truth_normal(height: np.ndarray) -> np.ndarray:
    """Unit normals (h, w, 3), x right, y up, z toward the viewer, of a height map (h, w) in pixels.

    NaN where any height of the 3 x 3 neighbourhood (replicated at the border) is not finite.
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
    """Mean absolute difference, pixels, after the best constant offset, over the finite pixels of
    `truth`. Its scale counts.
    """
    difference = (estimate - truth)[np.isfinite(truth)]
    return float(np.abs(difference - np.median(difference)).mean())


def angular_error(truth: np.ndarray, estimate: np.ndarray) -> float:
    """Mean angle, radians, between unit vectors (..., 3)."""
    return float(np.arccos(np.clip((truth * estimate).sum(axis=-1), -1, 1)).mean())


def scaled_mse(truth: np.ndarray, estimate: np.ndarray) -> float:
    """Mean square difference after the one scale of `estimate` that makes it least."""
    scale = (truth * estimate).sum() / max(_TINY, float((estimate * estimate).sum()))
    return float(np.square(scale * estimate - truth).mean())


def light_error(truth: np.ndarray, estimate: np.ndarray) -> float:
    """Mean square difference of two lights (9, C) of our convention, seen on a front hemisphere,
    after one common scale.
    """
    axis = (np.arange(1, _LIGHT_PROBE + 1) - _LIGHT_PROBE / 2) / (_LIGHT_PROBE / 2)
    down, right = np.meshgrid(axis, axis, indexing="ij")
    squared = 1 - down * down - right * right
    front = squared > 0
    probe = np.stack([down[front], right[front], np.sqrt(squared[front])], axis=-1)
    basis = real_sh(normal_from_reference(probe))
    return scaled_mse(np.exp(basis @ truth), np.exp(basis @ estimate))


def mse(truth: np.ndarray, estimate: np.ndarray, mask: np.ndarray | None = None) -> float:
    """Mean square difference of two images (h, w[, C]) over all channels, inside `mask` (h, w) if
    one is given.
    """
    _same_shape(truth, estimate, mask)
    difference = np.asarray(truth, float) - estimate
    return float(np.square(difference if mask is None else difference[mask]).mean())


def psnr(
    truth: np.ndarray, estimate: np.ndarray, mask: np.ndarray | None = None, *, peak: float = 1.0
) -> float:
    """10 log10(peak^2 / MSE), dB, values not clipped; infinite for equal images.

    Images and mask as in `mse`.
    """
    error = mse(truth, estimate, mask)
    return math.inf if error == 0 else 10 * math.log10(peak * peak / error)


def lmse(truth: np.ndarray, estimate: np.ndarray, mask: np.ndarray) -> float:
    """Grosse's local error of images (h, w[, C]) inside `mask` (h, w): each channel by itself, then
    their mean. 0 is perfect.

    An estimate of zero scores 1. NaN outside the mask is never read. Raises `ValueError` where the
    truth is zero everywhere.
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
    """The geometric mean of numbers >= 0; 0 if one of them is 0.

    Raises `ValueError` where there are none, or one is negative.
    """
    numbers = list(values)
    if not numbers or min(numbers) < 0:
        raise ValueError("a geometric mean needs at least one number, and none below 0")
    return 0.0 if min(numbers) == 0 else math.exp(math.fsum(map(math.log, numbers)) / len(numbers))


def _window_sums(image: np.ndarray) -> np.ndarray:
    """Sums over the windows that tile an image (h, w, C), zero beyond its end:

    (windows down, windows right, C).
    """
    down, right = (np.arange(0, size, _WINDOW) for size in image.shape[:2])
    if not (len(down) and len(right)):
        return np.zeros((0, 0, image.shape[2]))
    return np.add.reduceat(np.add.reduceat(image, down, axis=0), right, axis=1)


def _same_shape(truth: np.ndarray, estimate: np.ndarray, mask: np.ndarray | None) -> None:
    if truth.shape != estimate.shape or (mask is not None and mask.shape != truth.shape[:2]):
        raise ValueError(
            f"cannot compare images of shapes {truth.shape} and {estimate.shape} in a mask of {getattr(mask, 'shape', None)}"
        )
    if mask is not None and not mask.any():
        raise ValueError("the mask is empty")


def _require(truth: MitBerkeleyObject, **answer: np.ndarray) -> None:
    """Every map of the answer fits the truth and is finite where it will be read."""
    needed = {"shading": truth.valid, "reflectance": truth.valid}
    for name, value in answer.items():
        shape = truth.height.shape if name == "height" else truth.image.shape
        if value.shape != shape:
            raise ValueError(
                f"{truth.name}: {name} has shape {value.shape} where {shape} was expected"
            )
        if not np.isfinite(value[needed.get(name, np.isfinite(truth.height))]).all():
            raise ValueError(f"{truth.name}: {name} is not finite everywhere inside the object")
