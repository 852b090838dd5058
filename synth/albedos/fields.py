"""Random fields on a texture: what patterns are made of.

Equation: white noise times a filter of the spatial frequency f (cycles in the height of the
texture), scaled to mean 0 and variance 1: smooth noise exp(-(f / cycles)^2), fractal noise
f^(-slope / 2 - 1 / 2), whose power falls as f^(-slope) along a line.

Citation: R. F. Voss, "Random fractal forgeries", in Fundamental algorithms for computer graphics
(1985), 805-835, doi:10.1007/978-3-642-84574-1_34.

Limits: made by Fourier transforms, so the fields repeat along v as well, where textures stop.
"""

from collections.abc import Callable

import numpy as np
from scipy.ndimage import gaussian_filter

# How many heights of the texture it is once around.
ASPECT = 1.6


def grid(size: int) -> tuple[np.ndarray, np.ndarray]:
    """u and v in (0, 1) of the texel centres: (size, size) each."""
    steps = (np.arange(size) + 0.5) / size
    u, v = np.meshgrid(steps, steps)
    return u, v


def smooth_noise(
    rng: np.random.Generator, size: int, cycles: float, stretch: float = 1.0
) -> np.ndarray:
    """(size, size): blobs, about `cycles` of them in the height of the texture;

    `stretch` times as long along u.
    """
    return _filtered(rng, size, stretch, lambda frequency: np.exp(-np.square(frequency / cycles)))


def fractal_noise(
    rng: np.random.Generator, size: int, slope: float, stretch: float = 1.0
) -> np.ndarray:
    """(size, size): detail of all sizes;

    `slope` 1 is grainy, 3 is cloudy; `stretch` times as long along u.
    """
    return _filtered(rng, size, stretch, lambda frequency: frequency ** (-slope / 2 - 0.5))


def over(below: np.ndarray, colour: np.ndarray | float, cover: np.ndarray) -> np.ndarray:
    """`below` (h, w, 3) painted with a colour (3,) or texture (h, w, 3) where `cover` (h, w),
    clipped to [0, 1], is above 0.
    """
    share = np.clip(cover, 0, 1)[..., None]
    return below * (1 - share) + colour * share


def softened(values: np.ndarray, texels: float = 0.7) -> np.ndarray:
    """(h, w[, C]) blurred by a Gaussian of this standard deviation, around the seam: so that edges
    are as soft as a texel.
    """
    sigma, mode = (texels, texels, 0)[: values.ndim], ("nearest", "wrap", "nearest")[: values.ndim]
    return gaussian_filter(values, sigma, mode=mode)


def step(values: np.ndarray, width: float) -> np.ndarray:
    """0 where `values` are below -width, 1 above +width, a straight ramp between."""
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
