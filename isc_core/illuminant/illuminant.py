"""The colour of the light, from highlights, as a separation under white light needs it.

Problem: separations assume white light. Otherwise only the highlights show the light's colour;
albedo may have any.

Equation: of one albedo under one light every pixel is I = m B + s L, diffuse colour B and light
colour L, and so is every change of I. Both lie in the plane of B and L (Lee 1986), whose normal is
perpendicular to L whatever B is:

    n = I x dI,    n . L = 0.

One albedo gives one plane, which determines one of two unknowns; several albedos meet in L alone.
So L = 1 + d, sum d = 0, minimises

    sum w (n . (1 + d))^2 / |n|^2   and   |d|^2 / 2 prior_deviation^2,

weighted by the precision of the first, which comes from the disagreement of the normals, summed
over blocks of the photo because neighbours have similar errors. The second term thus covers both
kinds of ignorance, noise and a missing second plane: what the planes do not determine stays white.
Confidence is the share of the data's precision in its weakest direction.

Only changes count that look like a highlight's flank: all channels rise, and the chromaticity moves
toward the light's (the highlight's end of the lines that R. T. Tan, K. Nishino and K. Ikeuchi draw
over inverse intensity). Changes that disagree have Cauchy's weight, and the square of the share
that agrees reduces the precision: where half of the flanks are texture, the other half is less
reliable.

Citation: H.-C. Lee 1986, doi:10.1364/JOSAA.3.001694; R. T. Tan, K. Nishino, K. Ikeuchi 2004,
doi:10.1364/JOSAA.21.000321. The blocks: K.-Y. Liang and S. L. Zeger 1986,
doi:10.1093/biomet/73.1.13.

Limits: one colour of light, tinted by a quarter at most; `gamut` checks for stronger colours.
Metals tint their highlights themselves. Albedo that fades toward a common colour looks like a
highlight; grey albedo carries no information.
"""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..imaging.channels import length, total
from ..imaging.smoothing import masked_gaussian
from ..scene.diagnostics import IlluminantOutcome
from .gamut import PLANE, leads_to, turns, without_white

_FINE = 0.006  # of the object's diagonal: changes are taken over twice this
_LOOSE, _TOLERANCE = 0.2, 0.02  # of n . L / |n|, in the first round and in the last
_ROUNDS, _GATES = 15, 3
_OPEN = 2.0  # factor of the prior's deviation in the rounds, before the result is weighted
_BLOCKS = 8
_FEW = 20  # changes; fewer carry no information
_FARTHEST = 0.25  # d beyond this is albedo, not light


@dataclass(frozen=True)
class IlluminantOptions:
    """Priors and thresholds of the estimate.

    Attributes
    ----------
    prior_deviation : float
        Prior standard deviation of a light's colour from white, of mean 1; > 0.
    common_deviation : float
        Standard deviation of the error that all planes of normals of a photo share; >= 0.
    min_confidence : float
        Confidence from which on the colour is determined, in [0, 1].
    """

    prior_deviation: float = 0.1
    common_deviation: float = 0.02
    min_confidence: float = 0.5


@dataclass(frozen=True)
class Illuminant:
    """The estimated colour of the light.

    Attributes
    ----------
    colour : (3,) ndarray
        Linear RGB > 0 of mean 1; white where the photo has no information.
    confidence : float
        Share of the data's precision in its weakest direction, in [0, 1].
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


@dataclass(frozen=True)
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
        Pixels to leave out.
    options : IlluminantOptions, optional
        Priors and thresholds.

    Returns
    -------
    Illuminant
        White where the photo does not determine the colour.

    Raises
    ------
    InputError
        If the arrays do not fit, the mask is empty, or an option is out of range.
    """
    options = options or IlluminantOptions()
    if image.ndim != 3 or image.shape[2] != 3 or mask.shape != image.shape[:2] or not mask.any():
        raise InputError(
            "the light's colour needs an image (H, W, 3) and a mask of its size that is not empty"
        )
    if (
        options.prior_deviation <= 0
        or options.common_deviation < 0
        or not 0 <= options.min_confidence <= 1
    ):
        raise InputError(
            "prior_deviation must be above 0, common_deviation at least 0, min_confidence within "
            "[0, 1]"
        )
    changes = _changes(image, mask if clipped is None else mask & ~clipped)
    if without_white(changes.colour, changes.change):
        return _white(IlluminantOutcome.STRONG_OBJECT_COLOUR)
    here, turn, rising = turns(changes.colour, changes.change)
    rises, here, turn = changes.at(rising), here[rising], turn[rising]
    shift = np.zeros(2)
    precision = np.zeros((2, 2))
    for _ in range(_GATES):
        flanks = rises.at(leads_to(_colour(shift), here, turn))
        if len(flanks.block) < _FEW:
            return _white(IlluminantOutcome.NO_FLANKS)
        shift, precision = _planes(flanks, shift, options)
    weakest = float(np.linalg.eigvalsh(precision)[0])
    confidence = weakest / (weakest + 1 / options.prior_deviation**2)
    if np.abs(PLANE @ shift).max() > _FARTHEST:
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
        The image under white light.

    Raises
    ------
    InputError
        If the colour is unusable.
    """
    return image / _checked(colour).astype(image.dtype)


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
        The image under the light.

    Raises
    ------
    InputError
        If the colour is unusable.
    """
    return image * _checked(colour).astype(image.dtype)


def _checked(colour: np.ndarray) -> np.ndarray:
    colour = np.asarray(colour)
    if colour.shape != (3,) or not np.isfinite(colour).all() or colour.min() <= 0:
        raise InputError("a light's colour is three numbers above 0")
    return colour


def _colour(shift: np.ndarray) -> np.ndarray:
    return np.ones(3) + PLANE @ shift


def _changes(image: np.ndarray, mask: np.ndarray) -> _Changes:
    """All changes over a short distance whose ends and middle are in the mask."""
    rows, columns = np.nonzero(mask)
    if len(rows) == 0:
        return _Changes(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, int))
    box = np.s_[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
    image, mask = image[box], mask[box]  # the background does not count
    diagonal = float(np.hypot(mask.shape[0], mask.shape[1]))
    sigma = max(_FINE * diagonal, 0.6)
    smooth = masked_gaussian(np.where(mask[..., None], image, 0).astype(float), mask, sigma)
    bright = max(float(np.quantile(total(smooth[mask]), 0.99)), 1e-30)
    step, side = max(1, round(sigma)), max(diagonal / _BLOCKS, 1.0)
    places = np.stack(
        np.meshgrid(*(np.arange(n) // side for n in mask.shape), indexing="ij"), -1
    ) @ [4 * _BLOCKS, 1]
    colours, rises, blocks = [], [], []
    for axis in (0, 1):
        before, middle, after = (_slices(axis, start, 2 * step) for start in (0, step, 2 * step))
        known = mask[before] & mask[middle] & mask[after]
        change = (smooth[after] - smooth[before])[known] / bright
        colours.append(smooth[middle][known] / bright)
        rises.append(change * np.where(total(change) < 0, -1, 1)[:, None])
        blocks.append(places[middle][known].astype(int))
    return _Changes(np.concatenate(colours), np.concatenate(rises), np.concatenate(blocks))


def _slices(axis: int, start: int, length: int) -> tuple[slice, ...]:
    """All but `length` of an axis, starting at `start`."""
    part = slice(start, start - length or None)
    return (part,) if axis == 0 else (slice(None), part)


def _planes(
    flanks: _Changes, shift: np.ndarray, options: IlluminantOptions
) -> tuple[np.ndarray, np.ndarray]:
    """The shift (2,) along `PLANE` and the planes' precision (2, 2) of it, from changes that may
    be highlights of that light.
    """
    normals = np.cross(flanks.colour, flanks.change)
    size = length(normals)
    units = normals / size[:, None]
    along, offset = units @ PLANE, total(units)
    in_use = np.bincount(flanks.block) > 0
    blocks = (np.cumsum(in_use) - 1)[flanks.block]
    prior = np.eye(2) / options.prior_deviation**2
    precision, wanted, agreeing = np.zeros((2, 2)), shift, 0.0
    for tolerance in np.geomspace(_LOOSE, _TOLERANCE, _ROUNDS):
        off = offset + along @ shift
        weight = size / (1 + np.square(off / tolerance))
        agreeing = weight.sum() / size.sum()
        weight /= weight.sum()
        curvature = (along * weight[:, None]).T @ along
        pulls = np.stack([np.bincount(blocks, weight * off * along[:, k]) for k in (0, 1)], axis=1)
        # The blocks' pulls scatter around zero at the best shift; `common_deviation` is the error
        # that all of them share, along each plane's normal.
        scatter = pulls.T @ pulls + options.common_deviation**2 * curvature + 1e-12 * np.eye(2)
        precision = curvature @ np.linalg.solve(scatter, curvature)
        wanted = (
            shift
            - np.linalg.lstsq(curvature, (along * (weight * off)[:, None]).sum(axis=0), rcond=1e-6)[
                0
            ]
        )
        shift = np.linalg.solve(precision + prior / _OPEN**2, precision @ wanted)
    precision *= agreeing**2
    return np.linalg.solve(precision + prior, precision @ wanted), precision
