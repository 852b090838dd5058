"""Cameras of the measured sets: a good one, and that of a phone in little light.

Equation: light is exposed, blurred, gets noise, is clipped and stored with 8 bits
(`training.world.camera`). The good camera has white noise of variance (a I + b)^2, and two of
three photos are JPEGs of high quality. The phone has noise of variance

    a^2 I + b^2,

smoothed by a Gaussian as by demosaicing and denoising (its variance is that above afterwards), and
every photo is a JPEG with colours of half the resolution.

Citation: noise of photons and of reading: A. Foi, M. Trimeche, V. Katkovnik, K. Egiazarian,
"Practical Poissonian-Gaussian noise modeling and fitting for single-image raw-data", IEEE Trans.
Image Processing 17, 2008, doi:10.1109/TIP.2008.2001399.

Limits: no sharpening, no tone curve of a camera's own, no denoising that adapts to the picture.
"""

from enum import StrEnum

import numpy as np
import torch
from scipy import ndimage

from training.world.camera import CameraDraw, encoded_srgb, exposed, photographed
from training.world.random_draws import log_uniform


class Camera(StrEnum):
    """What takes the photos of a set."""

    GOOD = "good"
    PHONE = "phone"


def photo_of(
    light: np.ndarray, mask: np.ndarray, camera: Camera, rng: np.random.Generator
) -> tuple[np.ndarray, dict[str, float]]:
    """Take a photo, on a grey ground.

    Parameters
    ----------
    light : (H, W, 3) float32 ndarray
        Linear; sides are multiples of 16.
    mask : (H, W) ndarray of bool
        The object.
    camera : Camera
    rng : numpy.random.Generator

    Returns
    -------
    codes : (H, W, 3) uint8 ndarray
        sRGB.
    facts : dict of str to float
        What was drawn.
    """
    drawn = _good(rng)
    noise: dict[str, float] = {}
    torch.manual_seed(int(rng.integers(2**31)))
    ground = light[mask].mean(axis=0) * rng.uniform(0.1, 1.2)
    if camera == Camera.PHONE:
        drawn, noise = _phone(rng)
    filled = np.where(mask[..., None], light, ground)
    layers = torch.from_numpy(filled).float().permute(2, 0, 1)[None]
    cover = torch.from_numpy(mask).float()[None, None]
    values = {name: torch.tensor([value]) for name, value in vars(drawn).items()}
    layers = layers * exposed(layers, cover, values["exposure"])
    if noise:
        layers = torch.from_numpy(_noisy(layers.numpy(), noise, rng))
    seen = photographed(layers, cover, values)
    tones = encoded_srgb(seen[0].permute(1, 2, 0).clamp(0, 1)).numpy()
    return np.rint(255 * tones).astype(np.uint8), vars(drawn) | noise


def _good(rng: np.random.Generator) -> CameraDraw:
    noise = log_uniform(rng, 0.002, 0.012)
    return CameraDraw(
        exposure=rng.uniform(0.6, 1.0),
        blur=rng.uniform(0.3, 0.7),
        noise=noise,
        floor=0.2 * noise,
        sharpness=0.0,
        contrast=0.0,
        quality=float(rng.random() < 2 / 3) * rng.uniform(88, 97),
        subsampled=float(rng.random() < 0.5),
        clips=1.0,
    )


def _phone(rng: np.random.Generator) -> tuple[CameraDraw, dict[str, float]]:
    """A camera without noise of its own, and the noise: a, b, and the smoothing in pixels."""
    photons = log_uniform(rng, 0.008, 0.04)
    noise = {"photons": photons, "reading": 0.2 * photons, "smoothing": rng.uniform(0.0, 1.0)}
    drawn = CameraDraw(
        exposure=rng.uniform(0.5, 1.0),
        blur=0.0,
        noise=0.0,
        floor=0.0,
        sharpness=0.0,
        contrast=0.0,
        quality=rng.uniform(75, 95),
        subsampled=1.0,
        clips=1.0,
    )
    return drawn, noise


def _noisy(layers: np.ndarray, noise: dict[str, float], rng: np.random.Generator) -> np.ndarray:
    """Exposed light (1, 3, H, W) with a little blur and the noise of a phone."""
    blurred = ndimage.gaussian_filter(layers, (0, 0, 0.5, 0.5))
    grain = rng.standard_normal(layers.shape)
    if noise["smoothing"] > 0:
        grain = ndimage.gaussian_filter(grain, (0, 0, *2 * (noise["smoothing"],)))
        grain /= grain.std()
    deviation = np.sqrt(noise["photons"] ** 2 * np.maximum(blurred, 0) + noise["reading"] ** 2)
    return np.maximum(blurred + deviation * grain, 0).astype(np.float32)
