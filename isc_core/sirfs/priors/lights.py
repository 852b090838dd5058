"""Which light is likely: a Gaussian over the coefficients of the log shading, fitted to known
lights.

A light of C channels is the vector of its 9 C coefficients, channel by channel, in the reference's
convention (`sirfs.priors.priors`): l ~ N(mean, covariance). J. T. Barron, J. Malik (2015),
doi:10.1109/TPAMI.2014.2377712. The world has no preferred left, so every light counts also
mirrored; a laboratory's lamps have no preferred colour, so its lights may count in every order of
channels.

Environment maps as published are tamer than the light that falls on real objects. Factors on their
coefficients (of log shading, so a factor is contrast) are fitted by the likelihood of the known
objects' lights, none of which is among the maps: one for the mean of the channels and one for the
channels' deviations from it, since it is the brightness of the maps that is tame and not their
colour.
"""

import itertools
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.optimize

from ...errors import InputError
from .priors import Light

COEFFICIENTS = 9
# Coefficients of N2, N1 N2 and N2 N3 change sign when left and right are exchanged.
_MIRROR = np.array([1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 1.0, 1.0, 1.0])


@dataclass(frozen=True)
class GaussianLight:
    """`mean` (n,) and `covariance` (n, n) of stacked coefficients, and the `floor` used where the
    solver whitens them.
    """

    mean: np.ndarray
    covariance: np.ndarray
    floor: float = 0.01

    def light(self) -> Light:
        """With unwhiten = s (covariance + floor I)^(1/2), s such that lights of this Gaussian have
        unit root mean square in u.
        """
        values, vectors = np.linalg.eigh(self.covariance)
        values = np.maximum(values, 0.0)
        scale = np.sqrt(np.mean(values / (values + self.floor)))
        unwhiten = scale * (vectors * np.sqrt(values + self.floor)) @ vectors.T
        return Light(self.mean, self.covariance, unwhiten, self.mean)

    def grey(self) -> "GaussianLight":
        """The Gaussian of the mean over channels, of 9 coefficients."""
        channels = len(self.mean) // COEFFICIENTS
        average = np.kron(np.full((1, channels), 1 / channels), np.eye(COEFFICIENTS))
        return GaussianLight(
            average @ self.mean, _symmetric(average @ self.covariance @ average.T), self.floor
        )

    def log_likelihood(self, lights: np.ndarray) -> np.ndarray:
        """log density of each of the `lights` (count, n); shape (count,)."""
        factor = np.linalg.cholesky(self.covariance)
        white = scipy.linalg.solve_triangular(factor, (lights - self.mean).T, lower=True)
        log_determinant = 2 * np.log(np.diag(factor)).sum()
        return -0.5 * (
            np.sum(white**2, axis=0) + log_determinant + len(self.mean) * np.log(2 * np.pi)
        )


def mirrored(lights: np.ndarray) -> np.ndarray:
    """The `lights` (count, 9, C) and their mirror images, (2 count, 9, C)."""
    return np.concatenate([lights, lights * _MIRROR[:, None]])


def permuted(lights: np.ndarray) -> np.ndarray:
    """The `lights` (count, 9, C) with their channels in every order."""
    return np.concatenate(
        [lights[:, :, list(order)] for order in itertools.permutations(range(lights.shape[2]))]
    )


def stacked(lights: np.ndarray) -> np.ndarray:
    """(count, 9, C) to (count, 9 C): channel by channel."""
    return lights.transpose(0, 2, 1).reshape(len(lights), -1)


def fit_light(
    lights: np.ndarray, ridge: tuple[float, float] = (0.0, 0.0), floor: float = 0.01
) -> GaussianLight:
    """The Gaussian of `lights` (count, 9, C).

    `ridge` is what its covariance gains, for want of lights to see it in: the variance of the
    brightness, and that of the colour (see `Contrast`). Raises `InputError` where there are too few
    different lights for a covariance.
    """
    samples = stacked(lights)
    mean = samples.mean(axis=0)
    centred = samples - mean
    brightness = _brightness(len(mean))
    gain = ridge[0] * brightness + ridge[1] * (np.eye(len(mean)) - brightness)
    covariance = _symmetric(centred.T @ centred / len(samples) + gain)
    spread = np.linalg.eigvalsh(covariance)
    if not spread[0] > 1e-9 * spread[-1]:
        raise InputError(
            f"{len(samples)} lights, mirror images included, are too few for a prior of light:"
            " give more objects or lights"
        )
    return GaussianLight(mean, covariance, floor)


@dataclass(frozen=True)
class Contrast:
    """Factors on a light's coefficients:

    `brightness` on their mean over channels, `color` on the deviations from it.
    """

    brightness: float = 1.0
    color: float = 1.0


def scaled(lights: GaussianLight, contrast: Contrast) -> GaussianLight:
    """The Gaussian of the same lights with their coefficients multiplied by `contrast`."""
    brightness = _brightness(len(lights.mean))
    change = contrast.brightness * brightness + contrast.color * (
        np.eye(len(lights.mean)) - brightness
    )
    return GaussianLight(
        change @ lights.mean, _symmetric(change @ lights.covariance @ change.T), lights.floor
    )


def fit_contrast(environments: GaussianLight, lights: np.ndarray, split: bool = True) -> Contrast:
    """The factors on the `environments`' coefficients under which known `lights` (count, 9, C) are
    likeliest.

    `split`: whether brightness and colour have a factor each.
    """
    samples = stacked(lights)

    def cost(log_factors: np.ndarray) -> float:
        factors = np.exp(log_factors)
        return -float(
            scaled(environments, Contrast(float(factors[0]), float(factors[-1])))
            .log_likelihood(samples)
            .sum()
        )

    start = np.zeros(2 if split else 1)
    result = scipy.optimize.minimize(
        cost, start, method="Nelder-Mead", options={"xatol": 1e-5, "fatol": 1e-7, "maxiter": 1000}
    )
    factors = np.exp(result.x)
    return Contrast(float(factors[0]), float(factors[-1]))


def _brightness(size: int) -> np.ndarray:
    """The projection of stacked coefficients on what the channels have in common, (size, size)."""
    channels = size // COEFFICIENTS
    return np.kron(np.full((channels, channels), 1 / channels), np.eye(COEFFICIENTS))


def _symmetric(matrix: np.ndarray) -> np.ndarray:
    return (matrix + matrix.T) / 2
