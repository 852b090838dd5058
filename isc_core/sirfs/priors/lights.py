"""The prior of the light: a Gaussian over the coefficients of the log shading, fitted to known
lights.

Equation: a light of C channels is the vector of its 9 C coefficients, channel by channel, in the
reference's convention (`sirfs.priors.priors`): l ~ N(mean, covariance). Left and right are equally
likely, so the mirror image of every light is a sample, too; the lights of a laboratory have no
preferred colour, so their channels may be permuted.

Published environment maps have less contrast than the light on real objects. Factors on their
coefficients (of log shading, so a factor is contrast) are fitted by the likelihood of the known
objects' lights, none of which is among the maps: one for the mean of the channels, and one for the
channels' deviations from it, since the maps lack contrast in brightness and not in colour.

Citation: J. T. Barron, J. Malik 2015, doi:10.1109/TPAMI.2014.2377712.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from ...errors import InputError
from .priors import LightPrior

COEFFICIENTS = 9
# Coefficients of N2, N1 N2 and N2 N3 change sign when left and right are exchanged.
_MIRROR = np.array([1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 1.0, 1.0, 1.0])


@dataclass(frozen=True, eq=False)
class GaussianLight:
    """A Gaussian over stacked coefficients.

    Attributes
    ----------
    mean : (n,) ndarray
    covariance : (n, n) ndarray
    floor : float
        Added to the covariance where the solver whitens the coefficients.
    """

    mean: np.ndarray
    covariance: np.ndarray
    floor: float = 0.01

    def light(self) -> LightPrior:
        """Return the solver's form.

        Its unwhiten = s (covariance + floor I)^(1/2), with s such that lights of this Gaussian
        have unit root mean square in u.

        Returns
        -------
        LightPrior
        """
        values, vectors = np.linalg.eigh(self.covariance)
        values = np.maximum(values, 0.0)
        scale = np.sqrt(np.mean(values / (values + self.floor)))
        unwhiten = scale * (vectors * np.sqrt(values + self.floor)) @ vectors.T
        return LightPrior(self.mean, self.covariance, unwhiten, self.mean)

    def grey(self) -> "GaussianLight":
        """Return the Gaussian of the mean over channels, of 9 coefficients."""
        channels = len(self.mean) // COEFFICIENTS
        average = np.kron(np.full((1, channels), 1 / channels), np.eye(COEFFICIENTS))
        return GaussianLight(
            average @ self.mean, _symmetric(average @ self.covariance @ average.T), self.floor
        )

    def log_likelihood(self, lights: np.ndarray) -> np.ndarray:
        """Return the log density of each light.

        Parameters
        ----------
        lights : (count, n) ndarray
            Stacked coefficients, see `stacked`.

        Returns
        -------
        (count,) ndarray
        """
        from scipy.linalg import solve_triangular

        factor = np.linalg.cholesky(self.covariance)
        white = solve_triangular(factor, (lights - self.mean).T, lower=True)
        log_determinant = 2 * np.log(np.diag(factor)).sum()
        return -0.5 * (
            np.sum(white**2, axis=0) + log_determinant + len(self.mean) * np.log(2 * np.pi)
        )


def mirrored(lights: np.ndarray) -> np.ndarray:
    """Return lights and their mirror images.

    Parameters
    ----------
    lights : (count, 9, C) ndarray

    Returns
    -------
    (2 count, 9, C) ndarray
    """
    return np.concatenate([lights, lights * _MIRROR[:, None]])


def permuted(lights: np.ndarray) -> np.ndarray:
    """Return lights with their channels in every order.

    Parameters
    ----------
    lights : (count, 9, C) ndarray

    Returns
    -------
    (C! count, 9, C) ndarray
    """
    return np.concatenate(
        [lights[:, :, list(order)] for order in itertools.permutations(range(lights.shape[2]))]
    )


def stacked(lights: np.ndarray) -> np.ndarray:
    """Flatten lights, channel by channel.

    Parameters
    ----------
    lights : (count, 9, C) ndarray

    Returns
    -------
    (count, 9 C) ndarray
    """
    return lights.transpose(0, 2, 1).reshape(len(lights), -1)


def fit_light(
    lights: np.ndarray, ridge: tuple[float, float] = (0.0, 0.0), floor: float = 0.01
) -> GaussianLight:
    """Fit a Gaussian to lights.

    Parameters
    ----------
    lights : (count, 9, C) ndarray
    ridge : tuple of float
        Variances of brightness and of colour added to the covariance, because few lights leave many
        directions unobserved; see `Contrast` for the split.
    floor : float
        See `GaussianLight`.

    Returns
    -------
    GaussianLight

    Raises
    ------
    InputError
        If there are too few different lights for a covariance.
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
    """Factors on a light's coefficients.

    Attributes
    ----------
    brightness : float
        On their mean over the channels.
    color : float
        On the channels' deviations from it.
    """

    brightness: float = 1.0
    color: float = 1.0


def scaled(lights: GaussianLight, contrast: Contrast) -> GaussianLight:
    """Return the Gaussian of lights with a scaled contrast.

    Parameters
    ----------
    lights : GaussianLight
    contrast : Contrast

    Returns
    -------
    GaussianLight
    """
    brightness = _brightness(len(lights.mean))
    change = contrast.brightness * brightness + contrast.color * (
        np.eye(len(lights.mean)) - brightness
    )
    return GaussianLight(
        change @ lights.mean, _symmetric(change @ lights.covariance @ change.T), lights.floor
    )


def fit_contrast(environments: GaussianLight, lights: np.ndarray, split: bool = True) -> Contrast:
    """Fit the factors on environments that maximise the likelihood of known lights.

    Parameters
    ----------
    environments : GaussianLight
    lights : (count, 9, C) ndarray
    split : bool
        Whether brightness and colour have separate factors.

    Returns
    -------
    Contrast
    """
    from scipy.optimize import minimize

    samples = stacked(lights)

    def cost(log_factors: np.ndarray) -> float:
        factors = np.exp(log_factors)
        return -float(
            scaled(environments, Contrast(float(factors[0]), float(factors[-1])))
            .log_likelihood(samples)
            .sum()
        )

    start = np.zeros(2 if split else 1)
    result = minimize(
        cost, start, method="Nelder-Mead", options={"xatol": 1e-5, "fatol": 1e-7, "maxiter": 1000}
    )
    factors = np.exp(result.x)
    return Contrast(float(factors[0]), float(factors[-1]))


def _brightness(size: int) -> np.ndarray:
    """Projection (size, size) of stacked coefficients onto the mean of the channels."""
    channels = size // COEFFICIENTS
    return np.kron(np.full((channels, channels), 1 / channels), np.eye(COEFFICIENTS))


def _symmetric(matrix: np.ndarray) -> np.ndarray:
    return (matrix + matrix.T) / 2
