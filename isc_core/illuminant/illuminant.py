"""The colour of the light from highlights, for a separation that assumes white light.

Problem: separations assume white light. Only highlights show the colour of another light, since
albedo may have any colour.

Equation: with one albedo and one light, every pixel is I = m B + s L, with diffuse colour B and
light colour L, and so is every change of I. Both lie in the plane of B and L (Lee 1986), whose
normal is perpendicular to L for any B:

    n = I x dI,    n . L = 0.

One albedo gives one plane, which determines one of two unknowns; the planes of several albedos
intersect in L. So L = 1 + d, sum d = 0, minimises

    sum w (n . (1 + d))^2 / |n|^2   and   |d|^2 / 2 prior_deviation^2,

weighted by the precision of the first, which comes from the disagreement of the normals, summed
over blocks of the photo because neighbours have similar errors. The second term handles both noise
and a missing second plane: components that the planes do not determine remain white. Confidence is
the share of the data in the total precision along the least determined direction.

Only potential flanks of highlights are used: all channels increase, and the chromaticity changes
toward that of the light (the specular end of the lines in the inverse-intensity space of R. T. Tan,
K. Nishino and K. Ikeuchi). Outliers are down-weighted by Cauchy's function, and the precision is
multiplied by the square of the share of inliers: where half of the flanks are texture, the other
half is less reliable.

Citation: H.-C. Lee 1986, doi:10.1364/JOSAA.3.001694; R. T. Tan, K. Nishino, K. Ikeuchi 2004,
doi:10.1364/JOSAA.21.000321. The blocks: K.-Y. Liang and S. L. Zeger 1986,
doi:10.1093/biomet/73.1.13.

Limits: one colour of light, at most a quarter away from white; `gamut` checks for stronger colours.
Metals have coloured highlights. Albedo that fades toward a common colour resembles a highlight;
grey albedo carries no information.
"""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..imaging.channels import length, total
from ..imaging.smoothing import masked_gaussian
from ..scene.diagnostics import IlluminantOutcome
from .gamut import PLANE, chromaticity_changes, lacks_white, points_toward

_FINE = 0.006  # of the object's diagonal: changes are taken over twice this
_FIRST_TOLERANCE, _TOLERANCE = 0.2, 0.02  # of n . L / |n|, in the first and in the last iteration
_ITERATIONS, _SELECTIONS = 15, 3
_WIDE_PRIOR = 2.0  # factor of the prior's deviation during the iterations
_BLOCKS = 8
_MIN_FLANKS = 20  # flanks; fewer carry no information
_MAX_SHIFT = 0.25  # of |d|; larger values are caused by albedo, not light


@dataclass(frozen=True)
class IlluminantOptions:
    """Priors and thresholds of the estimate.

    Attributes
    ----------
    prior_deviation : float
        Prior standard deviation of the colour of a light, of mean 1, from white; > 0.
    common_deviation : float
        Standard deviation of the error common to all planes of a photo; >= 0.
    min_confidence : float
        Smallest confidence at which the colour counts as determined, in [0, 1].
    """

    prior_deviation: float = 0.1
    common_deviation: float = 0.02
    min_confidence: float = 0.5


@dataclass(frozen=True, eq=False)
class Illuminant:
    """The estimated colour of the light.

    Attributes
    ----------
    colour : (3,) ndarray
        Linear RGB > 0 of mean 1; white where the photo has no information.
    confidence : float
        Share of the data in the precision along the least determined direction, in [0, 1].
    outcome : IlluminantOutcome
        Whether the photo determines the colour, and if not, why.
    """

    colour: np.ndarray
    confidence: float
    outcome: IlluminantOutcome

    @property
    def determined(self) -> bool:
        """Whether the photo determines the colour."""
        return self.outcome == IlluminantOutcome.DETERMINED


@dataclass(frozen=True, eq=False)
class _Changes:
    """`colour` and `change` (N, 3) in units of the bright pixels' intensity, the change upward;
    `block` (N,).
    """

    colour: np.ndarray
    change: np.ndarray
    block: np.ndarray

    def at(self, chosen: np.ndarray) -> "_Changes":
        """The changes where `chosen` (N,) bool is set."""
        return _Changes(self.colour[chosen], self.change[chosen], self.block[chosen])


def estimate_illuminant(
    image: np.ndarray,
    mask: np.ndarray,
    clipped: np.ndarray | None = None,
    options: IlluminantOptions | None = None,
) -> Illuminant:
    """Estimate the colour of the light.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear, >= 0 inside the mask.
    mask : (H, W) ndarray of bool
        The object.
    clipped : (H, W) ndarray of bool, optional
        Pixels to ignore.
    options : IlluminantOptions, optional
        Priors and thresholds.

    Returns
    -------
    Illuminant
        White where the photo does not determine the colour.

    Raises
    ------
    InputError
        If the arrays do not fit together, the mask is empty, or an option is out of range.
    """
    options = options or IlluminantOptions()
    masks = [mask] if clipped is None else [mask, clipped]
    if (
        image.ndim != 3
        or image.shape[2] != 3
        or any(one.shape != image.shape[:2] or one.dtype != bool for one in masks)
        or not mask.any()
    ):
        raise InputError(
            "the light's colour needs an image (H, W, 3) and a mask of its size that is not empty, "
            "mask and clipped of bool"
        )
    if (
        not 0 < options.prior_deviation < np.inf
        or not 0 <= options.common_deviation < np.inf
        or not 0 <= options.min_confidence <= 1
    ):
        raise InputError(
            "prior_deviation must be above 0, common_deviation at least 0, min_confidence within "
            "[0, 1]"
        )
    changes = _changes(image, mask if clipped is None else mask & ~clipped)
    if lacks_white(changes.colour, changes.change):
        return _white(IlluminantOutcome.STRONG_OBJECT_COLOUR)
    here, change_direction, rising = chromaticity_changes(changes.colour, changes.change)
    rises, here, change_direction = changes.at(rising), here[rising], change_direction[rising]
    shift = np.zeros(2)
    precision = np.zeros((2, 2))
    for _ in range(_SELECTIONS):
        flanks = rises.at(points_toward(_colour(shift), here, change_direction))
        if len(flanks.block) < _MIN_FLANKS:
            return _white(IlluminantOutcome.NO_FLANKS)
        shift, precision = _fit_planes(flanks, shift, options)
    weakest = float(np.linalg.eigvalsh(precision)[0])
    confidence = weakest / (weakest + 1 / options.prior_deviation**2)
    if np.abs(PLANE @ shift).max() > _MAX_SHIFT:
        return _white(IlluminantOutcome.STRONG_HIGHLIGHT_COLOUR)
    determined = confidence >= options.min_confidence
    outcome = IlluminantOutcome.DETERMINED if determined else IlluminantOutcome.UNRELIABLE
    return Illuminant(_colour(shift), confidence, outcome)


def _white(outcome: IlluminantOutcome) -> Illuminant:
    return Illuminant(np.ones(3), 0.0, outcome)


def whitened(image: np.ndarray, colour: np.ndarray) -> np.ndarray:
    """Divide an image by the light's colour.

    Parameters
    ----------
    image : (..., 3) ndarray
        Linear.
    colour : (3,) ndarray
        > 0.

    Returns
    -------
    (..., 3) ndarray
        The image under white light; of floats.

    Raises
    ------
    InputError
        If the colour is invalid.
    """
    return image / _checked(colour, image.dtype)


def tinted(image: np.ndarray, colour: np.ndarray) -> np.ndarray:
    """Multiply an image, or a layer, by the light's colour: the inverse of `whitened`.

    Parameters
    ----------
    image : (..., 3) ndarray
        Linear.
    colour : (3,) ndarray
        > 0.

    Returns
    -------
    (..., 3) ndarray
        The image under the light; of floats.

    Raises
    ------
    InputError
        If the colour is invalid.
    """
    return image * _checked(colour, image.dtype)


def _checked(colour: np.ndarray, dtype: np.dtype) -> np.ndarray:
    """The colour in the precision of an image's `dtype`, if that is one of floats."""
    colour = np.asarray(colour)
    if (
        colour.shape != (3,)
        or colour.dtype.kind not in "fiu"
        or not np.isfinite(colour).all()
        or colour.min() <= 0
    ):
        raise InputError("a light's colour is three numbers above 0")
    return colour.astype(np.result_type(dtype, np.float32))


def _colour(shift: np.ndarray) -> np.ndarray:
    return np.ones(3) + PLANE @ shift


def _changes(image: np.ndarray, mask: np.ndarray) -> _Changes:
    """All changes over a short distance whose ends and middle are in the mask."""
    rows, columns = np.nonzero(mask)
    if len(rows) == 0:
        return _Changes(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, int))
    box = np.s_[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
    image, mask = image[box], mask[box]  # without the background
    diagonal = float(np.hypot(mask.shape[0], mask.shape[1]))
    sigma = max(_FINE * diagonal, 0.6)
    smooth = masked_gaussian(np.where(mask[..., None], image, 0).astype(float), mask, sigma)
    bright = max(float(np.quantile(total(smooth[mask]), 0.99)), 1e-30)
    step, side = max(1, round(sigma)), max(diagonal / _BLOCKS, 1.0)
    block_of = np.stack(
        np.meshgrid(*(np.arange(n) // side for n in mask.shape), indexing="ij"), -1
    ) @ [4 * _BLOCKS, 1]
    colours, rises, blocks = [], [], []
    for axis in (0, 1):
        before, middle, after = (_slices(axis, start, 2 * step) for start in (0, step, 2 * step))
        known = mask[before] & mask[middle] & mask[after]
        change = (smooth[after] - smooth[before])[known] / bright
        colours.append(smooth[middle][known] / bright)
        rises.append(change * np.where(total(change) < 0, -1, 1)[:, None])
        blocks.append(block_of[middle][known].astype(int))
    return _Changes(np.concatenate(colours), np.concatenate(rises), np.concatenate(blocks))


def _slices(axis: int, start: int, length: int) -> tuple[slice, ...]:
    """All but `length` of an axis, starting at `start`."""
    part = slice(start, start - length or None)
    return (part,) if axis == 0 else (slice(None), part)


def _fit_planes(
    flanks: _Changes, shift: np.ndarray, options: IlluminantOptions
) -> tuple[np.ndarray, np.ndarray]:
    """The shift (2,) along `PLANE` and its precision (2, 2) from the planes of potential flanks of
    highlights.
    """
    normals = np.cross(flanks.colour, flanks.change)
    size = length(normals)
    units = normals / size[:, None]
    along, offset = units @ PLANE, total(units)
    in_use = np.bincount(flanks.block) > 0
    blocks = (np.cumsum(in_use) - 1)[flanks.block]
    prior = np.eye(2) / options.prior_deviation**2
    precision, target, inliers = np.zeros((2, 2)), shift, 0.0
    for tolerance in np.geomspace(_FIRST_TOLERANCE, _TOLERANCE, _ITERATIONS):
        residual = offset + along @ shift
        weight = size / (1 + np.square(residual / tolerance))
        inliers = weight.sum() / size.sum()
        weight /= weight.sum()
        curvature = (along * weight[:, None]).T @ along
        scores = np.stack(
            [np.bincount(blocks, weight * residual * along[:, k]) for k in (0, 1)], axis=1
        )
        # The blocks' scores scatter around zero at the best shift; `common_deviation` is the error
        # common to all of them, along each plane's normal.
        scatter = scores.T @ scores + options.common_deviation**2 * curvature + 1e-12 * np.eye(2)
        precision = curvature @ np.linalg.solve(scatter, curvature)
        target = (
            shift
            - np.linalg.lstsq(
                curvature, (along * (weight * residual)[:, None]).sum(axis=0), rcond=1e-6
            )[0]
        )
        shift = np.linalg.solve(precision + prior / _WIDE_PRIOR**2, precision @ target)
    precision *= inliers**2
    return np.linalg.solve(precision + prior, precision @ target), precision
