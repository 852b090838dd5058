"""Smooth random environments: spherical harmonics of low degree, clipped at 0.

Equation: with P_l the Legendre polynomials and u_k random axes, sum_k g_k P_l(d . u_k) is an
isotropic random spherical harmonic of degree l (addition theorem: P_l(d . u) is a sum over the Y_lm
of the degree). Radiance = max(0, 1 + sum over l = 1..degree of such sums), each scaled to a
standard deviation that decreases with l, as in photographed environments.

Citation: R. O. Dror, A. S. Willsky, E. H. Adelson, "Statistical characterization of real-world
illumination", Journal of Vision 4(9) (2004), doi:10.1167/4.9.11 (power decreases with the degree).

Limits: no sharp features such as a sun or a window; highlights are broad.
"""

import numpy as np
from numpy.polynomial.legendre import legval

from isc_core.shading.environment_map import directions, solid_angles

from ..scene.lights import EnvironmentLight, Light
from .placing import white

_ROWS = 32
_COLOUR = 0.04  # standard deviation of the part that differs between channels


def harmonic_lights(rng: np.random.Generator) -> tuple[Light, ...]:
    """Draw one environment of degree 2, 3 or 4.

    It is mirrored so that most light comes from front and above.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    tuple of Light
        One environment.
    """
    degree, contrast = int(rng.integers(2, 5)), rng.uniform(0.7, 1.7)
    towards, solid = directions(_ROWS), solid_angles(_ROWS)[..., None]
    pattern = smooth_pattern(towards, degree, contrast, rng)
    colour = np.stack([_COLOUR * _harmonic(towards, 1, rng) for _ in range(3)], -1)
    radiance = np.maximum(0, 1 + pattern[..., None] + colour)
    radiance *= 4 * np.pi / (radiance * solid).sum((0, 1)).mean()
    _, up, front = (radiance * solid).sum(-1).ravel() @ towards.reshape(-1, 3)
    if up < 0:
        radiance = radiance[::-1]
    if front < 0:
        radiance = turned_to_front(radiance)
    return (EnvironmentLight(radiance * white(rng)),)


def smooth_pattern(
    towards: np.ndarray, degree: int, contrast: float, rng: np.random.Generator
) -> np.ndarray:
    """Evaluate a random deviation of the radiance from its mean, 1.

    Parameters
    ----------
    towards : (..., 3) ndarray
        Unit directions.
    degree : int
        Largest degree, >= 1.
    contrast : float
        Standard deviation of degree 1.
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    (...) ndarray
        The deviation.
    """
    return np.asarray(
        sum(contrast / l**0.75 * _harmonic(towards, l, rng) for l in range(1, degree + 1))
    )


def turned_to_front(radiance: np.ndarray) -> np.ndarray:
    """Mirror an environment in z: its front becomes its back.

    Parameters
    ----------
    radiance : (rows, 2 rows, ...) ndarray
        Laid out as in `isc_core.shading.environment_map`.

    Returns
    -------
    (rows, 2 rows, ...) ndarray
        The mirrored environment.
    """
    rows = len(radiance)
    return radiance[:, (rows - 1 - np.arange(2 * rows)) % (2 * rows)]


def _harmonic(towards: np.ndarray, degree: int, rng: np.random.Generator) -> np.ndarray:
    """A random spherical harmonic at the directions (..., 3), of variance 1 over draws and
    directions.
    """
    axes = rng.normal(size=(2 * degree + 1, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    # P_l has the mean square 1 / (2 l + 1) over the sphere, and there are 2 l + 1 of them.
    return legval(towards @ axes.T, [0] * degree + [1]) @ rng.normal(size=2 * degree + 1)
