"""Relief on a smooth surface from fine changes of shading, by linear shape from shading.

Problem: under known light, fine changes of brightness determine the slope of fine relief, though
only along the direction in which shading changes. Where lights of several colours come from several
directions, fine changes of colour determine more, as in photometric stereo. Across all these
directions, and where shading hardly changes with the slope, the photo has no information.

Equation: of C features (log brightness, and logarithms of ratios of channels), let S_c be that of
the shading as a function of the slope, and e_c that of the light without the paint. With s_0 the
slopes of the smooth surface, the height r of the relief has the least

    sum over the object and the features of v^2 (e_c - S_c(s_0 + grad r))^2
    + rho^2 sum of |grad r|^2 / (1 + |s_0|^2)

with the weight v of each pixel. That is, its slopes are expected to be Gaussian, of equal strength
in all directions and in every octave, larger where the surface is seen from the side; rho is the
noise of e over their standard deviation. S is made linear at an estimate from an image of half the
size. The sum then is quadratic in r, and a few Chebyshev iterations, preconditioned by the sums of
its matrix' rows, find what that estimate lacks: coarser relief is known, and the finest converges
at once. Every value depends on pixels up to `REACH` away, by the same operations wherever they lie.

Citation: linear shape from shading: A. Pentland, "Linear shape from shading", IJCV 4, 1990,
doi:10.1007/BF00054993; lights of several colours: L. L. Kontsevich, A. P. Petrov,
I. S. Vergelskaya, "Reconstruction of shape from shading in color images", JOSA A 11, 1994,
doi:10.1364/JOSAA.11.001047; iteration: G. H. Golub, R. S. Varga, "Chebyshev semi-iterative
methods", Numerische Mathematik 3, 1961, doi:10.1007/BF01386013.

Limits: one paint; cast shadows and light between parts of the relief are taken for slopes.
"""

from collections.abc import Callable

import numpy as np

from .irradiance_basis import basis, basis_adjoint

ITERATIONS = 8
REACH = 24  # pixels, even: what a value of the relief depends on is nearer
RHO = 0.2
_LEAST_EIGENVALUE = 0.1  # of the preconditioned matrix, for relief of this level; none is above 1
_STEEPEST = 20.0  # 1 + |s_0|^2 is at most this: there is little to see of steeper surfaces
_RIDGE = 1e-3
Slopes = tuple[np.ndarray, np.ndarray]


def slopes(height: np.ndarray) -> Slopes:
    """Return dz/dx and dz/dy, x right and y down, by central differences; 0 along the border.

    Parameters
    ----------
    height : (H, W) ndarray

    Returns
    -------
    right, down : (H, W) ndarray
    """
    right, down = np.zeros_like(height), np.zeros_like(height)
    half = height.dtype.type(0.5)
    np.subtract(height[:, 2:], height[:, :-2], out=right[:, 1:-1])
    np.subtract(height[2:], height[:-2], out=down[1:-1])
    right *= half
    down *= half
    return right, down


def slopes_adjoint(right: np.ndarray, down: np.ndarray) -> np.ndarray:
    """Return the adjoint of `slopes`.

    Parameters
    ----------
    right, down : (H, W) ndarray
        0 along the border that `slopes` leaves out.

    Returns
    -------
    (H, W) ndarray
    """
    out = np.zeros_like(right)
    out[:, 2:] += right[:, 1:-1]
    out[:, :-2] -= right[:, 1:-1]
    out[2:] += down[1:-1]
    out[:-2] -= down[1:-1]
    out *= right.dtype.type(0.5)
    return out


def log_shading(slope: Slopes, light: np.ndarray) -> np.ndarray:
    """Return the log shading of a surface.

    Parameters
    ----------
    slope : tuple of (H, W) ndarray
        dz/dx and dz/dy, x right and y down.
    light : (9,) ndarray
        Log-shading SH coefficients, reference convention.

    Returns
    -------
    (H, W) ndarray
    """
    right, down = slope
    over = 1 / np.sqrt(1 + right * right + down * down)
    functions = basis(-down * over, -right * over, over)
    # One after the other: sums of a matrix product depend on its size.
    total = np.zeros_like(right)
    for function, coefficient in zip(functions, light.astype(right.dtype), strict=True):
        total += coefficient * function
    return total


def shading_gain(slope: Slopes, light: np.ndarray) -> Slopes:
    """Return the derivatives of log shading by the slopes.

    With N = (-q, -p, 1) / l and c the gradient of log shading by N, they are
    -c_2 / l - p (c . N) / l^2 and -c_1 / l - q (c . N) / l^2.

    Parameters
    ----------
    slope : tuple of (H, W) ndarray
        dz/dx and dz/dy, p and q.
    light : (9,) ndarray
        As for `log_shading`.

    Returns
    -------
    right, down : (H, W) ndarray
    """
    right, down = slope
    over = 1 / np.sqrt(1 + right * right + down * down)
    n1, n2, n3 = -down * over, -right * over, over
    c1, c2, c3 = basis_adjoint(n1, n2, n3, light.astype(right.dtype))
    along = (c1 * n1 + c2 * n2 + c3 * n3) * over
    return -(c2 + right * along) * over, -(c1 + down * along) * over


def relief_from_shading(
    shading: np.ndarray, weight: np.ndarray, slope: Slopes, light: np.ndarray, relief: np.ndarray
) -> np.ndarray:
    """Refine an estimate of the relief by what an image of this size shows beyond half of it.

    Parameters
    ----------
    shading : (C, H, W) float32 ndarray
        Features of log light without the paint, e.
    weight : (H, W) ndarray
        How much they count, v, in [0, 1].
    slope : tuple of (H, W) float32 ndarray
        Of the smooth surface, dz/dx and dz/dy, x right and y down.
    light : (9, C) ndarray
        SH coefficients of the features of log shading, reference convention.
    relief : (H, W) float32 ndarray
        An estimate from an image of half the size, pixels toward the viewer.

    Returns
    -------
    (H, W) float32 ndarray
        Pixels toward the viewer. Within `REACH` of the border it differs from what a larger map has
        there.
    """
    tilt = slopes(relief)
    whole = (slope[0] + tilt[0], slope[1] + tilt[1])
    steepness = np.minimum(1 + slope[0] * slope[0] + slope[1] * slope[1], np.float32(_STEEPEST))
    across = np.float32(RHO**2) / steepness
    down, both, right_pull, down_pull = across.copy(), *np.zeros((3, *relief.shape), np.float32)
    for feature, one in zip(shading, light.T, strict=True):
        g1, g2 = shading_gain(whole, one)
        left = feature - log_shading(whole, one)
        left += g1 * tilt[0] + g2 * tilt[1]
        left *= weight
        g1, g2 = g1 * weight, g2 * weight
        across += g1 * g1
        down += g2 * g2
        both += g1 * g2
        right_pull += g1 * left
        down_pull += g2 * left

    def product(height: np.ndarray) -> np.ndarray:
        p, q = slopes(height)
        return slopes_adjoint(across * p + both * q, both * p + down * q)

    sums = _row_sums(across, down, np.abs(both)) + np.float32(_RIDGE)
    return _chebyshev(product, slopes_adjoint(right_pull, down_pull), 1 / sums, relief)


def _row_sums(across: np.ndarray, down: np.ndarray, both: np.ndarray) -> np.ndarray:
    """Bounds of the sums of absolute values in the rows of the matrix.

    The matrix divided by them has no eigenvalue above 1 (Gershgorin).
    """
    half = np.float32(0.5)
    across, down = (across + both) * half, (down + both) * half
    sums = np.zeros_like(across)
    sums[:, 2:] += across[:, 1:-1]
    sums[:, :-2] += across[:, 1:-1]
    sums[2:] += down[1:-1]
    sums[:-2] += down[1:-1]
    return sums


def _chebyshev(
    product: Callable[[np.ndarray], np.ndarray],
    wanted: np.ndarray,
    scale: np.ndarray,
    start: np.ndarray,
) -> np.ndarray:
    """Solve product(x) = wanted, preconditioned by `scale`, for eigenvalues up to 1."""
    middle, radius = (1 + _LEAST_EIGENVALUE) / 2, (1 - _LEAST_EIGENVALUE) / 2
    ratio = radius / middle
    step = scale * (wanted - product(start)) * np.float32(1 / middle)
    found = start + step
    for _ in range(ITERATIONS - 1):
        following = 1 / (2 * middle / radius - ratio)
        step *= np.float32(following * ratio)
        step += np.float32(2 * following / radius) * scale * (wanted - product(found))
        found += step
        ratio = following
    return found
