"""Random fields on a texture, the building blocks of patterns.

Equation: white noise times a filter of the spatial frequency f (cycles per height of the texture),
scaled to mean 0 and variance 1: smooth noise exp(-(f / cycles)^2), fractal noise
f^(-slope / 2 - 1 / 2), whose power decreases as f^(-slope) along a line.

Citation: R. F. Voss, "Random fractal forgeries", in Fundamental algorithms for computer graphics
(1985), 805-835, doi:10.1007/978-3-642-84574-1_34.

Limits: computed by Fourier transforms, so the fields are periodic along v, too, where textures end.
"""

from collections.abc import Callable

import numpy as np
from scipy.ndimage import gaussian_filter

# Circumference in heights of the texture.
ASPECT = 1.6


def grid(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the texture coordinates of the texel centres.

    Parameters
    ----------
    size : int
        Texels a side.

    Returns
    -------
    u, v : (size, size) ndarray
        In (0, 1); u increases along the columns, v along the rows.
    """
    steps = (np.arange(size) + 0.5) / size
    u, v = np.meshgrid(steps, steps)
    return u, v


def smooth_noise(
    rng: np.random.Generator, size: int, cycles: float, stretch: float = 1.0
) -> np.ndarray:
    """Draw a field of smooth blobs.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.
    size : int
        Side in texels.
    cycles : float
        Blobs per height of the texture.
    stretch : float, optional
        Factor of their length along u.

    Returns
    -------
    (size, size) ndarray
        Mean 0, variance 1.
    """
    return _filtered(rng, size, stretch, lambda frequency: np.exp(-np.square(frequency / cycles)))


def fractal_noise(
    rng: np.random.Generator, size: int, slope: float, stretch: float = 1.0
) -> np.ndarray:
    """Draw a field with detail at all scales.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.
    size : int
        Side in texels.
    slope : float
        Spectral slope: 1 is grainy, 3 is cloudy.
    stretch : float, optional
        Factor of the length along u.

    Returns
    -------
    (size, size) ndarray
        Mean 0, variance 1.
    """
    return _filtered(rng, size, stretch, lambda frequency: frequency ** (-slope / 2 - 0.5))


def over(below: np.ndarray, colour: np.ndarray | float, cover: np.ndarray) -> np.ndarray:
    """Composite a colour over a texture.

    Parameters
    ----------
    below : (h, w, 3) ndarray
        The texture.
    colour : (3,) or (h, w, 3) ndarray or float
        Colour of the top layer.
    cover : (h, w) ndarray
        Coverage, clipped to [0, 1].

    Returns
    -------
    (h, w, 3) ndarray
        The composite.
    """
    share = np.clip(cover, 0, 1)[..., None]
    return below * (1 - share) + colour * share


def softened(values: np.ndarray, texels: float = 0.7) -> np.ndarray:
    """Blur a texture (h, w[, C]) by a Gaussian across the seam, so that edges are a texel wide.

    Parameters
    ----------
    values : (h, w) or (h, w, C) ndarray
        The texture.
    texels : float, optional
        Standard deviation.

    Returns
    -------
    ndarray
        Of the same shape.
    """
    sigma, mode = (texels, texels, 0)[: values.ndim], ("nearest", "wrap", "nearest")[: values.ndim]
    return gaussian_filter(values, sigma, mode=mode)


def step(values: np.ndarray, width: float) -> np.ndarray:
    """Return a linear ramp.

    Parameters
    ----------
    values : ndarray
        Any values.
    width : float
        Half width of the ramp.

    Returns
    -------
    ndarray
        0 where `values` are below -width, 1 above +width.
    """
    return np.clip(0.5 + values / (2 * width), 0, 1)


def _filtered(
    rng: np.random.Generator,
    size: int,
    stretch: float,
    response: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:
    spectrum = np.fft.rfft2(rng.standard_normal((size, size)))
    across, down = (
        np.fft.rfftfreq(size, 1 / size) * stretch / ASPECT,
        np.fft.fftfreq(size, 1 / size),
    )
    frequency = np.hypot(across[None], down[:, None])
    frequency[0, 0] = 1
    gain = response(frequency)
    gain[0, 0] = 0
    field = np.fft.irfft2(spectrum * gain, (size, size))
    return field / field.std()
