"""Random variation of photos: geometry, noise, clipping, colour.

Limits: noise is Gaussian, proportional to the signal plus a constant part.
"""

import numpy as np
import torch
from torch.nn import functional

from .random_draws import log_uniform

INSIDE = 0.98  # coverage from which a resized pixel counts as inside the mask


def random_tint(rng: np.random.Generator, strength: float) -> torch.Tensor:
    """Draw a colour factor.

    Parameters
    ----------
    rng : np.random.Generator
    strength : float
        Standard deviation of the factor's logarithm.

    Returns
    -------
    (3, 1, 1) tensor
    """
    return colour_factor(np.exp(rng.normal(0, strength, 3)))


def colour_factor(values: np.ndarray) -> torch.Tensor:
    """Convert a colour to a factor of image tensors.

    Parameters
    ----------
    values : (3,) ndarray
        Linear.

    Returns
    -------
    (3, 1, 1) tensor
        float32.
    """
    return torch.tensor(values, dtype=torch.float32)[:, None, None]


def rescaled(layers: torch.Tensor, factor: float) -> torch.Tensor:
    """Resize layers bilinearly, with antialiasing when smaller.

    Parameters
    ----------
    layers : (C, H, W) tensor
    factor : float
        Of both sides.

    Returns
    -------
    (C, H', W') tensor
    """
    return functional.interpolate(
        layers[None],
        scale_factor=factor,
        mode="bilinear",
        antialias=factor < 1,
        align_corners=False,
    )[0]


def placed_in_square(layers: torch.Tensor, side: int, rng: np.random.Generator) -> torch.Tensor:
    """Put layers at a random place of a square.

    Parameters
    ----------
    layers : (C, h, w) tensor
        Of an axis longer than `side`, a random part is kept.
    side : int
        Side of the square, in pixels.
    rng : np.random.Generator
        Draws the place.

    Returns
    -------
    (C, side, side) tensor
        0 around the layers.
    """
    for axis in (1, 2):
        room = side - layers.shape[axis]
        start = int(rng.integers(abs(room) + 1))
        if room > 0:
            around = [0, 0, start, room - start] if axis == 1 else [start, room - start, 0, 0]
            layers = functional.pad(layers, around)
        else:
            layers = layers.narrow(axis, start, side)
    return layers


def less_saturated(image: torch.Tensor, rng: np.random.Generator) -> torch.Tensor:
    """Mix an image with its grey version in a random proportion.

    Parameters
    ----------
    image : (3, H, W) tensor
    rng : np.random.Generator
        Draws the proportion.

    Returns
    -------
    (3, H, W) tensor
    """
    kept = float(rng.uniform(0, 1))
    return image * kept + (1 - kept) * image.mean(0, keepdim=True)


def clipped(
    image: torch.Tensor, mask: torch.Tensor, lowest: float, highest: float, rng: np.random.Generator
) -> torch.Tensor:
    """Clip an image at a random quantile of the object's brightest channel.

    Parameters
    ----------
    image : (3, H, W) tensor
        Linear light.
    mask : (H, W) tensor
        Positive on the object; an empty mask leaves the image as it is.
    lowest, highest : float
        Bounds of the quantile.
    rng : np.random.Generator
        Draws the quantile.

    Returns
    -------
    (3, H, W) tensor
        The clipped image.
    """
    if not (mask > 0).any():
        return image
    bright = image.max(0).values[mask > 0]
    return image.clamp(max=float(torch.quantile(bright, float(rng.uniform(lowest, highest)))))


def simulate_sensor(
    image: torch.Tensor, mask: torch.Tensor, rng: np.random.Generator
) -> torch.Tensor:
    """Add noise, clipping and a tint; permute or reduce the colours.

    Parameters
    ----------
    image : (3, H, W) tensor
        Linear light, >= 0.
    mask : (H, W) tensor
        1 on the object, 0 elsewhere.
    rng : np.random.Generator
        Draws what is applied; PyTorch's global generator draws the noise.

    Returns
    -------
    (3, H, W) tensor
        The photo of a simulated camera.
    """
    noise = log_uniform(rng, 0.003, 0.08)
    mean = (image * mask).sum() / (3 * mask.sum().clamp(min=1))
    if rng.random() < 0.8:
        relative = image * (1 + noise * torch.randn_like(image))
        image = (relative + 0.3 * noise * mean * torch.randn_like(image)).clamp(min=0)
    if rng.random() < 0.7:
        image = clipped(image, mask, 0.92, 1, rng)
    image = image * random_tint(rng, 0.1)
    if rng.random() < 0.3:
        image = image[rng.permutation(3)]
    if rng.random() < 0.2:
        image = less_saturated(image, rng)
    return image
