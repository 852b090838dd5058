"""The lobe under a known environment map: its strength and its alpha.

Equation: s(n) = strength * y(n; alpha), y of `environment_response`: alpha is searched on a
logarithmic grid and refined between its nodes; the strength follows from re-weighted least squares
(Charbonnier's loss, as in `lamps`).

Citation: A. Ngan, F. Durand, W. Matusik, EGSR 2005, doi:10.2312/EGWR/EGSR05/117-126 (fits of lobes
under known light).

Limits: where the environment map is smooth, all alphas of the grid explain the image equally well:
alpha is undetermined.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..scene.lobe_fit import (
    CONVENTION,
    Interval,
    LobeFit,
    LobeFitOptions,
    LobeFitOutcome,
)
from .environment_response import (
    SplitEnvironment,
    interpolated_response,
    respond_to,
    split_environment,
)
from .lamps import ALPHAS
from .observed import Observed
from .pixels import Pixels
from .uncertainty import covariance, naive_variance

_NODES = 11
_STEPS = 6  # of re-weighting
_LOG_ALPHA_STEP = 0.01  # of log alpha, for the finite difference
# alpha is undetermined if one larger or smaller by this factor explains the image as well
_UNDETERMINED_FACTOR = 2.5
_EQUAL = 0.05  # of the specular light, RMS: closer predictions count as equal
_MIN_EXPLAINED = 0.25
_MIN_PEAK_PIXELS = 6


@dataclass(frozen=True, eq=False)
class _Candidate:
    """An alpha with its strength (mean of the channels), loss, residual and weights (N,)."""

    log_alpha: float
    strength: float
    loss: float
    residual: np.ndarray
    weight: np.ndarray


def fit_under_environment(
    radiance: np.ndarray, observed: Observed, pixels: Pixels, options: LobeFitOptions
) -> LobeFit:
    """Fit a lobe under an environment map.

    Parameters
    ----------
    radiance : (rows, 2 rows, 3) ndarray
        The environment map.
    observed : Observed
        The specular image.
    pixels : Pixels
        The fitted pixels.
    options : LobeFitOptions
        The lobe.

    Returns
    -------
    LobeFit
        With the lobe's strength, without lights.

    Raises
    ------
    InputError
        If the environment map is unusable.
    """
    mask = observed.mask
    environment = _checked(radiance)
    if not radiance.any():
        return LobeFit.without_lobe(
            options.model, LobeFitOutcome.NO_SPECULAR, observed.specular.shape
        )
    smallest = max(ALPHAS[0], 0.5 * np.pi / len(radiance))
    nodes = np.linspace(np.log(smallest), np.log(ALPHAS[1]), _NODES)
    candidates = [_candidate(environment, pixels, options, node) for node in nodes]
    best = _refined(environment, pixels, options, candidates)
    alpha = float(np.exp(best.log_alpha))
    strength, image = _coloured(environment, pixels, best, observed, options)
    given = observed.specular_at(mask)
    remaining, total = np.square(given - image[mask]).sum(), float(np.square(given).sum())
    explained = float(np.clip(1 - remaining / max(total, 1e-300), 0, 1))
    sd_alpha, sd_strength, allowed = _deviations(environment, pixels, best, options)
    if explained < _MIN_EXPLAINED:
        outcome = LobeFitOutcome.UNEXPLAINED
    elif _is_undetermined(candidates, best, pixels, allowed):
        outcome = LobeFitOutcome.SMOOTH_LIGHT
    elif pixels.bright < _MIN_PEAK_PIXELS:
        outcome = LobeFitOutcome.NARROW
    else:
        outcome = LobeFitOutcome.DETERMINED
    factor = float(np.exp(min(sd_strength, 20)))
    interval = Interval(
        max(alpha * np.exp(-sd_alpha), ALPHAS[0]), min(alpha * np.exp(sd_alpha), 1.0)
    )
    if outcome == LobeFitOutcome.NARROW:
        alpha, interval = float(interval.high), Interval(ALPHAS[0], interval.high)
    known = outcome in (LobeFitOutcome.DETERMINED, LobeFitOutcome.NARROW)
    return LobeFit(
        CONVENTION[options.model],
        outcome,
        alpha if known else None,
        interval if known else None,
        (),
        strength,
        Interval(strength / factor, strength * factor),
        explained,
        image,
    )


def _refined(
    environment: SplitEnvironment,
    pixels: Pixels,
    options: LobeFitOptions,
    candidates: Sequence[_Candidate],
) -> _Candidate:
    """The minimum of the loss between the neighbours of the best node of the grid."""
    from scipy.optimize import minimize_scalar

    best = int(np.argmin([one.loss for one in candidates]))
    low, high = candidates[max(best - 1, 0)], candidates[min(best + 1, len(candidates) - 1)]
    found = minimize_scalar(
        lambda node: _candidate(environment, pixels, options, node).loss,
        bounds=(low.log_alpha, high.log_alpha),
        method="bounded",
        options={"xatol": 1e-3, "maxiter": 14},
    )
    return _candidate(environment, pixels, options, float(found.x))


def _is_undetermined(
    candidates: Sequence[_Candidate], best: _Candidate, pixels: Pixels, allowed: float
) -> bool:
    """Whether an alpha far from the best one explains the image as well."""
    return any(
        one.loss - best.loss < allowed or _equal(one, best, pixels)
        for one in candidates
        if abs(one.log_alpha - best.log_alpha) > np.log(_UNDETERMINED_FACTOR)
    )


def _equal(one: _Candidate, other: _Candidate, pixels: Pixels) -> bool:
    """Whether two predictions differ by less than the models' accuracy."""
    difference = pixels.weight @ np.square((one.residual - other.residual) * pixels.sigma)
    return bool(difference < _EQUAL**2 * (pixels.weight @ np.square(pixels.value)))


def _checked(radiance: np.ndarray) -> SplitEnvironment:
    if (
        radiance.ndim != 3
        or radiance.shape[0] < 4
        or radiance.shape[1:] != (2 * radiance.shape[0], 3)
    ):
        raise InputError(
            f"environment has shape {radiance.shape}: give (rows, 2 rows, 3), at least 4 rows"
        )
    if not (np.isfinite(radiance).all() and (radiance >= 0).all()):
        raise InputError("the environment has to be finite and 0 or more")
    return split_environment(radiance)


def _candidate(
    environment: SplitEnvironment, pixels: Pixels, options: LobeFitOptions, log_alpha: float
) -> _Candidate:
    shape = respond_to(environment, options.model, pixels.normal, float(np.exp(log_alpha))).mean(
        axis=1
    )
    weight = pixels.weight
    strength = 0.0
    for _ in range(_STEPS):
        scaled = weight * shape / pixels.sigma**2
        strength = max(float(scaled @ pixels.value) / max(float(scaled @ shape), 1e-300), 1e-12)
        residual = (strength * shape - pixels.value) / pixels.sigma
        residual = np.where(pixels.clipped & (residual > 0), 0, residual)
        weight = np.where(
            pixels.clipped & (residual == 0), 0, pixels.weight / np.sqrt(1 + residual**2)
        )
    return _Candidate(
        log_alpha,
        strength,
        float(pixels.weight @ (2 * (np.sqrt(1 + residual**2) - 1))),
        residual,
        weight,
    )


def _deviations(
    environment: SplitEnvironment, pixels: Pixels, best: _Candidate, options: LobeFitOptions
) -> tuple[float, float, float]:
    """Deviations of log alpha and of log strength, and the increase of the loss within one
    deviation of log alpha.
    """
    here, there = (
        respond_to(
            environment, options.model, pixels.normal, float(np.exp(best.log_alpha + d))
        ).mean(axis=1)
        for d in (0, -_LOG_ALPHA_STEP)
    )
    jacobian = (
        np.stack([here, (here - there) / _LOG_ALPHA_STEP], axis=1)
        * (best.strength / pixels.sigma)[:, None]
    )
    variances = covariance(jacobian, best.residual, best.weight, pixels)
    systematic = np.radians(options.normal_error)
    sd_alpha = float(np.sqrt(variances[1, 1] + systematic**2))
    allowed = max(1.0, sd_alpha**2 / max(naive_variance(jacobian, best.weight, 1), 1e-300))
    return sd_alpha, float(np.sqrt(variances[0, 0] + (2 * systematic) ** 2)), allowed


def _coloured(
    environment: SplitEnvironment,
    pixels: Pixels,
    best: _Candidate,
    observed: Observed,
    options: LobeFitOptions,
) -> tuple[np.ndarray, np.ndarray]:
    """The strength (3,) of each channel and the predicted image (H, W, 3)."""
    alpha = float(np.exp(best.log_alpha))
    shape = respond_to(environment, options.model, pixels.normal, alpha)
    scaled = (best.weight / pixels.sigma**2)[:, None] * shape
    strength = (scaled * pixels.colour).sum(axis=0) / np.maximum(
        (scaled * shape).sum(axis=0), 1e-300
    )
    image, inside = np.zeros(observed.normal.shape, np.float32), observed.normal_at(observed.mask)
    image[observed.mask] = (
        interpolated_response(environment, options.model, alpha, inside) * strength
    )
    return strength, image
