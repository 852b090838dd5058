"""Integrates differences between neighbouring pixels inside a mask to heights (or log images).

Problem: minimise the sum over pairs of 4-neighbours p, q in the mask of (z_q - z_p - d_pq)^2. The
normal equations are a Poisson equation with natural boundary conditions: pixels outside the mask
have no effect. Each connected part of the mask has mean zero.

Equation: conjugate gradients, preconditioned by one V-cycle of multigrid with bilinear
interpolation and Galerkin coarse operators: about 15 iterations for any size. All sums are taken in
a fixed order: BLAS would round differently on one thread than on two.

Citation: least-squares integration of a field that is not necessarily integrable: B. K. P. Horn and
M. J. Brooks, CVGIP 33(2), 174-208 (1986), doi:10.1016/0734-189X(86)90114-3; conjugate gradients: M.
R. Hestenes and E. Stiefel, J. Res. Natl. Bur. Stand. 49(6), 409-436 (1952),
doi:10.6028/jres.049.044.
"""

from dataclasses import dataclass

import numpy as np

from ..filters.components import labelled, means
from ..numerics.ellpack import Ellpack
from ..numerics.linear import solve_linear

_COARSEST = 60
_DAMPING = 0.7
_MAX_STEPS = 200
# Fraction of the coarsest diagonal that is added to make the matrix invertible; the constants that
# this introduces are removed at the end.
_RIDGE = 1e-9


@dataclass(frozen=True, eq=False)
class _Level:
    """One grid: its operator, the inverse of its diagonal, the interpolation from the next coarser
    grid, and its adjoint.
    """

    operator: Ellpack
    inverse_diagonal: np.ndarray
    up: Ellpack
    down: Ellpack


@dataclass(frozen=True, eq=False)
class _Multigrid:
    levels: list[_Level]
    coarsest_inverse: np.ndarray

    def cycle(self, residual: np.ndarray, depth: int = 0) -> np.ndarray:
        """One symmetric V-cycle: an approximate solution (n,) for the residual (n,)."""
        if depth == len(self.levels):
            return np.einsum("ij,j->i", self.coarsest_inverse, residual)
        level = self.levels[depth]
        z = _DAMPING * level.inverse_diagonal * residual
        z += level.up @ self.cycle(level.down @ (residual - level.operator @ z), depth + 1)
        return z + _DAMPING * level.inverse_diagonal * (residual - level.operator @ z)


def integrate(
    right: np.ndarray, down: np.ndarray, mask: np.ndarray, tolerance: float = 1e-6
) -> np.ndarray:
    """Integrate differences by least squares.

    Parameters
    ----------
    right, down : (H, W) or (H, W, C) ndarray
        Target of z[i, j+1] - z[i, j] and of z[i+1, j] - z[i, j].
    mask : (H, W) bool ndarray
        Pairs that are not completely inside are ignored.
    tolerance : float
        Relative residual of the normal equations.

    Returns
    -------
    (H, W) or (H, W, C) float64 ndarray
        0 outside the mask, mean 0 over each 4-connected part of it.
    """
    out = np.zeros(right.shape)
    if not mask.any():
        return out
    difference, horizontal, vertical = _differences(mask)
    adjoint = difference.transposed
    operator = adjoint.times(difference)
    multigrid = _build(operator, mask)
    target = np.concatenate([right[:, :-1][horizontal], down[:-1][vertical]]).astype(float)
    columns = (adjoint @ target).reshape(operator.width, -1)
    values = [_conjugate_gradients(operator, multigrid, b, tolerance) for b in columns.T]
    out[mask] = np.stack(values, axis=1).reshape(out[mask].shape)
    return _centred(out, mask)


def _conjugate_gradients(
    operator: Ellpack, multigrid: _Multigrid, right: np.ndarray, tolerance: float
) -> np.ndarray:
    """x (n,) of `operator` x = `right` (n,), to a relative residual of `tolerance`."""
    size = np.abs(right).max(initial=0)
    if size == 0:
        return np.zeros(len(right))
    x, residual = np.zeros(len(right)), right / size  # squares of tiny differences would underflow
    threshold = tolerance**2 * _dot(residual, residual)
    direction, previous = np.zeros(len(right)), 1.0
    for _ in range(_MAX_STEPS):
        if _dot(residual, residual) <= threshold:
            break
        z = multigrid.cycle(residual)
        product = _dot(residual, z)
        direction = z + product / previous * direction
        image = operator @ direction
        step = product / _dot(direction, image)
        x, residual, previous = x + step * direction, residual - step * image, product
    return size * x


def _dot(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.einsum("i,i->", a, b))


def _differences(mask: np.ndarray) -> tuple[Ellpack, np.ndarray, np.ndarray]:
    """The matrix (pairs, pixels) of differences z_q - z_p, and masks of its pairs: (H, W-1) and
    (H-1, W) bool.
    """
    index = np.full(mask.shape, -1)
    index[mask] = np.arange(mask.sum())
    horizontal, vertical = mask[:, 1:] & mask[:, :-1], mask[1:] & mask[:-1]
    p = np.concatenate([index[:, :-1][horizontal], index[:-1][vertical]])
    q = np.concatenate([index[:, 1:][horizontal], index[1:][vertical]])
    weights = np.tile([-1.0, 1.0], (len(p), 1))
    return Ellpack(np.stack([p, q], axis=1), weights, int(mask.sum())), horizontal, vertical


def _build(operator: Ellpack, mask: np.ndarray) -> _Multigrid:
    levels = []
    while operator.width > _COARSEST:
        up, mask = _interpolation(mask)
        # An isolated pixel has no equation to solve; any diagonal is valid.
        diagonal, down = operator.diagonal, up.transposed
        levels.append(_Level(operator, 1 / np.where(diagonal > 0, diagonal, 1), up, down))
        operator = down.times(operator.times(up))
    coarsest = operator.dense
    largest = coarsest.diagonal().max(initial=0) or 1.0
    return _Multigrid(
        levels,
        solve_linear(coarsest + _RIDGE * largest * np.eye(len(coarsest)), np.eye(len(coarsest))),
    )


def _interpolation(mask: np.ndarray) -> tuple[Ellpack, np.ndarray]:
    """Interpolation (pixels, coarse pixels) from the grid of 2 x 2 blocks that contain any pixel of
    the mask, and that grid's mask.
    """
    padded = np.pad(mask, [(0, n % 2) for n in mask.shape])
    coarse = padded.reshape(padded.shape[0] // 2, 2, padded.shape[1] // 2, 2).any(axis=(1, 3))
    place = np.full(coarse.shape, -1)
    place[coarse] = np.arange(coarse.sum())
    rows, columns = (
        _two_nearest(at, size) for at, size in zip(np.nonzero(mask), coarse.shape, strict=True)
    )
    beside = np.stack([place[row, column] for row, _ in rows for column, _ in columns], axis=1)
    weight = np.stack([one * other for _, one in rows for _, other in columns], axis=1)
    kept = (weight > 0) & (beside >= 0)
    weight[~kept] = 0
    weight *= 1 / weight.sum(axis=1, keepdims=True)
    return Ellpack(np.maximum(beside, 0), weight, int(coarse.sum())), coarse


def _two_nearest(at: np.ndarray, coarse: int) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    """The two coarse rows, of `coarse`, whose centres are nearest to each row, and their weights,
    the later first; at the frame, one and nothing.
    """
    own = at // 2
    other = np.clip(own + np.where(at % 2, 1, -1), 0, coarse - 1)
    share = np.where(own == other, 1.0, 0.75)
    later = np.where(own >= other, share, 0.25)
    return (np.maximum(own, other), later), (np.minimum(own, other), 1 - later)


def _centred(values: np.ndarray, mask: np.ndarray) -> np.ndarray:
    parts, count = labelled(mask)
    own = parts[mask] - 1
    for channel in values.reshape(*mask.shape, -1).transpose(2, 0, 1):
        channel[mask] -= means(channel, parts, count)[own]
    return values
