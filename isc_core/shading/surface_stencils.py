"""Derivatives of a height map by 3 x 3 stencils with replicated borders, and their adjoints.

Equation: rows grow downward, columns to the right:
  Zi = [row below - row above] (1,2,1)/8,   Zj = [right - left] (1,2,1)/8,
  Zii = (1,-2,1) (1,2,1)/4,   Zjj likewise,   Zij = [Z(--) + Z(++) - Z(+-) - Z(-+)]/4

Citation: J. T. Barron, J. Malik 2015, doi:10.1109/TPAMI.2014.2377712.
"""

import numpy as np

# (weights along rows, weights along columns) of each derivative
FIRST_DOWN = ((-1, 0, 1), (0.125, 0.25, 0.125))
FIRST_RIGHT = ((0.125, 0.25, 0.125), (-1, 0, 1))
SECOND_DOWN = ((1, -2, 1), (0.25, 0.5, 0.25))
SECOND_RIGHT = ((0.25, 0.5, 0.25), (1, -2, 1))
MIXED = ((-0.5, 0, 0.5), (-0.5, 0, 0.5))
DERIVATIVES = (FIRST_DOWN, FIRST_RIGHT, SECOND_DOWN, SECOND_RIGHT, MIXED)

Stencil = tuple[tuple[float, float, float], tuple[float, float, float]]


def _three(padded: np.ndarray, weights: tuple[float, float, float], axis: int) -> np.ndarray:
    """Correlation with three taps along `axis`, without the outermost elements.

    Differences are taken between neighbours, where they are exact: float32 heights keep their
    curvature.
    """
    n, t = padded.shape[axis], padded.dtype.type
    left, centre, right = (padded[(slice(None),) * axis + (slice(k, n - 2 + k),)] for k in range(3))
    if weights == (1, -2, 1):
        return (left - centre) + (right - centre)
    if weights[1] == 0:
        return (
            (right - left)
            if weights[2] == 1
            else (left - right)
            if weights[2] == -1
            else (right - left) * t(weights[2])
        )
    return (left + right) * t(weights[0]) + centre * t(weights[1])


def derivative(padded: np.ndarray, stencil: Stencil) -> np.ndarray:
    """Compute a derivative of a height map.

    Parameters
    ----------
    padded : (H + 2, W + 2) ndarray
        Height with replicated borders.
    stencil : Stencil
        One of `DERIVATIVES`.

    Returns
    -------
    (H, W) ndarray
    """
    axes = (
        (0, 1) if stencil[0][0] != stencil[0][2] or stencil[0][1] < 0 else (1, 0)
    )  # differences first, smoothing second
    for axis in axes:
        padded = _three(padded, stencil[axis], axis)
    return padded


def derivative_adjoint(gradient: np.ndarray, stencil: Stencil) -> np.ndarray:
    """Apply the adjoint of `derivative` after replicating borders.

    Parameters
    ----------
    gradient : (H, W) ndarray
        With respect to a derivative.
    stencil : Stencil

    Returns
    -------
    (H, W) ndarray
        With respect to the height.
    """
    full = np.pad(gradient, 2)
    flipped = (stencil[0][::-1], stencil[1][::-1])
    return fold_border(_three(_three(full, flipped[0], 0), flipped[1], 1))


def fold_border(wide: np.ndarray) -> np.ndarray:
    """Apply the adjoint of replicating the border by one pixel; changes `wide`.

    Parameters
    ----------
    wide : (H + 2, W + 2) ndarray

    Returns
    -------
    (H, W) ndarray
    """
    wide[1] += wide[0]
    wide[-2] += wide[-1]
    wide[:, 1] += wide[:, 0]
    wide[:, -2] += wide[:, -1]
    return wide[1:-1, 1:-1]


def normals(height: np.ndarray) -> np.ndarray:
    """Compute the unit normals of a height map.

    Parameters
    ----------
    height : (H, W) ndarray
        Pixels toward the viewer.

    Returns
    -------
    (H, W, 3) ndarray
        Down, right, toward the viewer.
    """
    padded = np.pad(height, 1, mode="edge")
    zi, zj = derivative(padded, FIRST_DOWN), derivative(padded, FIRST_RIGHT)
    n3 = 1 / np.sqrt(1 + zi * zi + zj * zj)
    return np.stack([-zi * n3, -zj * n3, n3], axis=-1)
