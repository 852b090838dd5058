"""SIRFS' priors on reflectance: locally smooth, few colours, likely colours.

Equation: with log reflectance A = log I - log shading (n pixels in the crop), a pixel's weight t in
[0, 1], 0 where not valid, and n_t = sum t:
  smoothness  w (3/25)/(C n) * sum over pairs of t_p t_q cost(sqrt(m^2 + 1e-8)), m = 0.5 |B (A_p -
  A_q)|^2   (colour)
              w 3/(25 n) * sum of t_p t_q cost(A_p - A_q)
              (grey)
  parsimony   w * -log V, V ~ n_t^-2 sum_pq t_p t_q exp(-|w_p - w_q|^2 / (4 sigma^2)), w = W A: a
  quadratic Renyi entropy with
              a Parzen window (Principe & Xu 1999), by splatting onto a grid, blurring and summing
  absolute    w/(8 n_t) * sum of t F at w, F tabulated on the same grid

Citation: J. T. Barron, J. Malik 2015, doi:10.1109/TPAMI.2014.2377712.

Limits: no term for highlights.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np

from ..filters.correlation import correlated
from .priors.priors import AbsoluteTable, Priors
from .problem import PAIR_OFFSETS
from .settings import Weights
from .surface import pair_slices

SOFT_SQUARE = 1e-8
SIGMA_UNIT = 20.0
ABSOLUTE_DIVISOR = 8.0


def smoothness_cost(
    log_reflectance: np.ndarray, pixel_weight: np.ndarray, priors: Priors, weight: float
) -> tuple[float, np.ndarray]:
    """Compute the smoothness term.

    Parameters
    ----------
    log_reflectance : (H, W, C) ndarray
    pixel_weight : (H, W) ndarray
        0 where not valid.
    priors : Priors
    weight : float

    Returns
    -------
    cost : float
    gradient : (H, W, C) ndarray
        With respect to `log_reflectance`.
    """
    t = log_reflectance.dtype.type
    valid, pixel_weight = pixel_weight > 0, pixel_weight.astype(t)
    whitened = log_reflectance @ priors.smoothness_whiten.astype(log_reflectance.dtype)
    gradient = np.zeros_like(whitened)
    total = 0.0
    for offset in PAIR_OFFSETS:
        p, q = pair_slices(*offset)
        both = valid[p] & valid[q]
        difference, counts = (
            whitened[p][both] - whitened[q][both],
            pixel_weight[p][both] * pixel_weight[q][both],
        )
        if priors.channels == 1:
            cost, slope = priors.smoothness.evaluate(difference[:, 0])
            pair_gradient = (counts * slope)[:, None]
        else:
            m = np.einsum("kc,kc->k", difference, difference) / 2
            soft = np.sqrt(m * m + t(SOFT_SQUARE))
            cost, slope = priors.smoothness.evaluate(soft)
            pair_gradient = (counts * slope * m / soft)[:, None] * difference
        total += float((counts * cost).sum(dtype=float))
        gradient[p][both] += pair_gradient
        gradient[q][both] -= pair_gradient
    n = pixel_weight.size
    scale = weight * 3 / (25 * n * priors.channels)
    return scale * total, (gradient @ priors.smoothness_whiten.T.astype(gradient.dtype)) * t(scale)


@dataclass(frozen=True, eq=False)
class Splat:
    """Multilinear weights of n samples on the occupied part of a grid.

    Attributes
    ----------
    shape : tuple of int
        Shape of the occupied part.
    start : tuple of int
        Its first node on each axis.
    index : (2^C, n) ndarray
        Flat node of each corner.
    weight : (2^C, n) ndarray
        Weight of each corner.
    side : (n, C) ndarray
        Position in the cell.
    inside : (n, C) bool ndarray
        False where a value was clamped.
    step : float
        Spacing of the nodes.
    """

    shape: tuple[int, ...]
    start: tuple[int, ...]
    index: np.ndarray
    weight: np.ndarray
    side: np.ndarray
    inside: np.ndarray
    step: float


def splat(samples: np.ndarray, table: AbsoluteTable) -> Splat:
    """Find where samples fall on the grid of a table.

    Parameters
    ----------
    samples : (n, C) ndarray
        Whitened log reflectance.
    table : AbsoluteTable

    Returns
    -------
    Splat
    """
    nodes, channels = table.values.shape[0], samples.shape[1]
    step = (table.high - table.low) / (nodes - 1)
    position = (samples.astype(float) - table.low) / step
    inside = (position >= 0) & (position <= nodes - 1)
    position = np.clip(position, 0, nodes - 1)
    cell = np.minimum(position.astype(np.int64), nodes - 2)
    side = position - cell
    start, last = cell.min(axis=0), cell.max(axis=0) + 1
    shape = tuple(int(v) for v in last - start + 1)
    strides = (
        np.cumprod((*shape[1:][::-1], 1)[::-1][::-1])
        if channels == 1
        else np.array([shape[1] * shape[2], shape[2], 1])
    )
    base = (cell - start) @ strides
    corners = list(product((0, 1), repeat=channels))
    index = np.stack([base + int(np.dot(c, strides)) for c in corners])
    weight = np.stack([np.prod(np.where(c, side, 1 - side), axis=1) for c in corners])
    return Splat(shape, tuple(int(v) for v in start), index, weight, side, inside, step)


def gather_gradient(where: Splat, node_gradient: np.ndarray) -> np.ndarray:
    """Compute the gradient of the samples from that of the node counts.

    Parameters
    ----------
    where : Splat
    node_gradient : ndarray
        Of the shape of the occupied part.

    Returns
    -------
    (n, C) ndarray
    """
    flat = node_gradient.ravel()
    channels = where.side.shape[1]
    gradient = np.zeros(where.side.shape)
    for k, corner in enumerate(product((0, 1), repeat=channels)):
        value = flat[where.index[k]]
        for axis in range(channels):
            others = np.ones(len(value))
            for a in range(channels):
                if a != axis:
                    others = others * (where.side[:, a] if corner[a] else 1 - where.side[:, a])
            gradient[:, axis] += (1 if corner[axis] else -1) * value * others
    return np.where(where.inside, gradient / where.step, 0.0)


def parzen_taps(sigma: float, step: float, count: float, channels: int) -> np.ndarray:
    """Return the blur weights of one axis for the Parzen window.

    Parameters
    ----------
    sigma : float
        `parsimony_sigma / 20`.
    step : float
        Spacing of the nodes.
    count : float
        Sum of the pixels' weights; all axes together divide by its square.
    channels : int

    Returns
    -------
    (2 k + 1,) ndarray
    """
    half = min(100, int(np.ceil(6 * sigma / step)))
    k = np.arange(-half, half + 1)
    return np.exp(-((k * step) ** 2) / (4 * sigma**2)) / count ** (2 / channels)


def blur(counts: np.ndarray, taps: np.ndarray) -> np.ndarray:
    """Blur node counts along each axis, zero padded.

    The result is floored at the float64 machine epsilon.

    Parameters
    ----------
    counts : ndarray
    taps : (2 k + 1,) ndarray

    Returns
    -------
    ndarray
    """
    for axis in range(counts.ndim):
        counts = correlated(counts, taps, axis)
    return np.maximum(counts, np.finfo(float).eps)


def palette_cost(
    log_reflectance: np.ndarray, pixel_weight: np.ndarray, priors: Priors, weights: Weights
) -> tuple[float, float, np.ndarray]:
    """Compute the parsimony and absolute terms.

    Parameters
    ----------
    log_reflectance : (H, W, C) ndarray
    pixel_weight : (H, W) ndarray
        0 where not valid.
    priors : Priors
    weights : Weights

    Returns
    -------
    parsimony, absolute : float
    gradient : (H, W, C) ndarray
        Of their sum with respect to `log_reflectance`.
    """
    whiten, valid = priors.parsimony_whiten, pixel_weight > 0
    samples = log_reflectance[valid].astype(float) @ whiten.T
    where = splat(samples, priors.absolute)
    sample_weight = pixel_weight[valid].astype(float)
    count = float(sample_weight.sum())
    size = int(np.prod(where.shape))
    counts = np.bincount(where.index.ravel(), (where.weight * sample_weight).ravel(), size).reshape(
        where.shape
    )
    taps = parzen_taps(weights.parsimony_sigma / SIGMA_UNIT, where.step, count, priors.channels)
    blurred = blur(counts, taps)
    overlap = float((blurred * counts).sum())
    part = tuple(slice(s, s + n) for s, n in zip(where.start, where.shape, strict=True))
    costs = priors.absolute.values[part]
    scale = weights.absolute / (ABSOLUTE_DIVISOR * count)
    node_gradient = (-2 * weights.parsimony / overlap) * blurred + scale * costs
    gradient = np.zeros_like(log_reflectance)
    gradient[valid] = (sample_weight[:, None] * gather_gradient(where, node_gradient)) @ whiten
    return (
        -weights.parsimony * float(np.log(overlap)),
        scale * float((costs * counts).sum()),
        gradient,
    )


def one_color_cost(
    log_reflectance: np.ndarray, pixel_weight: np.ndarray, weight: float
) -> tuple[float, np.ndarray]:
    """Compute the term of shape-from-shading mode, weight/(2 n_t) * sum of t (A - mean A)^2.

    Parameters
    ----------
    log_reflectance : (H, W, C) ndarray
    pixel_weight : (H, W) ndarray
        t; the mean is weighted with it too.
    weight : float

    Returns
    -------
    cost : float
    gradient : (H, W, C) ndarray
    """
    valid = pixel_weight > 0
    residual = log_reflectance[valid].astype(float)
    sample_weight = pixel_weight[valid].astype(float)[:, None]
    residual = residual - (sample_weight * residual).sum(axis=0) / sample_weight.sum()
    gradient = np.zeros_like(log_reflectance)
    gradient[valid] = sample_weight * residual * (weight / sample_weight.sum())
    return weight / (2 * float(sample_weight.sum())) * float(
        (sample_weight * residual * residual).sum()
    ), gradient
