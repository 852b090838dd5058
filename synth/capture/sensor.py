"""A camera's sensor and encoding: noise, clipping, quantisation. Their effect is the residual of
the ground truth.

Equation, for light x, 1 being full scale, each channel and pixel independently:

    x' = x + n,  n ~ N(0, noise^2 (x + READ^2))    `noise`: deviation of the photon noise at full
                                                   scale; READ noise: the sensor's own
    x" = min(max(x', 0), 1)                        below 0 always, above 1 if `clip` is on
    image = linear(round(srgb(x") peak) / peak)    peak = 2^bits - 1; 8 and 16 bits are sRGB-coded

    residual = image - (diffuse + specular)

Citation: G. E. Healey, R. Kondepudy, "Radiometric CCD camera calibration and noise estimation",
IEEE TPAMI 16(3) (1994), 267-276, doi:10.1109/34.276126 (the two parts of the noise).

Limits: photon noise is Gaussian, valid from about 20 photons; no colour filter, so neighbouring
pixels are independent; noise at black is clipped at 0, so its mean there is positive. Where
highlights are clipped, float32 keeps the sum of the layers to 6e-8 of the specular layer.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from isc_core.errors import InputError
from isc_core.imaging.srgb import linear_to_srgb, srgb_to_linear
from isc_core.io.atomic import new_file

from .truth import GroundTruth

READ = 0.1
DEPTHS = (0, 8, 16)


@dataclass(frozen=True)
class Sensor:
    """A sensor.

    Attributes
    ----------
    exposure_level : float
        Exposure for `truth.exposed`, > 0; `observe` ignores it.
    clip : bool
        Whether light above 1 is clipped.
    noise : float
        Deviation of the photon noise at full scale, [0, 1); 0 for none.
    bits : int
        Of the sRGB codes, 8 or 16; 0 for no quantisation. Codes end at 1, so they need `clip`.

    Raises
    ------
    InputError
        Outside these ranges.
    """

    exposure_level: float = 0.9
    clip: bool = True
    noise: float = 0.0
    bits: int = 0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.exposure_level) and self.exposure_level > 0):
            raise InputError("the exposure level must be finite and above 0")
        if not 0 <= self.noise < 1:
            raise InputError("the noise is a share of full scale: choose 0 or more, below 1")
        if self.bits not in DEPTHS:
            raise InputError(
                f"codes of {self.bits} bits are not supported: choose 8 or 16, or 0 for none"
            )
        if self.bits and not self.clip:
            raise InputError("codes end at full scale: choose bits 0 or clip")


def observe(truth: GroundTruth, sensor: Sensor, rng: np.random.Generator) -> GroundTruth:
    """Apply a sensor to the image of a ground truth.

    Parameters
    ----------
    truth : GroundTruth
        The scene.
    sensor : Sensor
        The sensor.
    rng : numpy.random.Generator
        Source of the noise.

    Returns
    -------
    GroundTruth
        With the sensor's image, non-negative and 0 outside the mask, and its residual. image =
        diffuse + specular + residual in float32, exactly where clipped, elsewhere to 1e-7 of the
        light.
    """
    light = truth.image.astype(float)
    if sensor.noise:
        light = light + rng.standard_normal(light.shape) * noise_deviation(light, sensor.noise)
    light = np.clip(light, 0, 1 if sensor.clip else None)
    if sensor.bits:
        light = srgb_to_linear(_codes(light, sensor.bits) / _peak(sensor.bits))
    image = np.where(truth.mask[..., None], light, 0).astype(np.float32)
    return replace(truth, image=image, residual=image - (truth.diffuse + truth.specular))


def noise_deviation(light: np.ndarray, noise: float) -> np.ndarray:
    """Return the standard deviation of the noise.

    Parameters
    ----------
    light : ndarray
        Light >= 0.
    noise : float
        Of the sensor.

    Returns
    -------
    ndarray
        Of the same shape.
    """
    return noise * np.sqrt(np.maximum(light, 0) + READ**2)


def write_photo(path: str | Path, truth: GroundTruth, bits: int = 16) -> None:
    """Write the image as a camera would: an sRGB PNG, clipped at 1, with the mask as alpha.

    `read_photo` recovers the image to within half a code, and exactly if `observe` made these
    codes.

    Parameters
    ----------
    path : str or Path
        The file.
    truth : GroundTruth
        Image and mask.
    bits : int, optional
        8 or 16 bits per channel.

    Raises
    ------
    InputError
        For other bits, or if the file cannot be written.
    """
    if bits not in DEPTHS[1:]:
        raise InputError(f"photos of {bits} bits are not supported: choose 8 or 16")
    colours = _codes(np.clip(truth.image.astype(float), 0, 1), bits)
    pixels = np.dstack([colours[..., ::-1], truth.mask * float(_peak(bits))])
    _, data = cv2.imencode(".png", pixels.astype(np.uint8 if bits == 8 else np.uint16))
    with new_file(path) as partial:
        partial.write_bytes(data.tobytes())


def _codes(light: np.ndarray, bits: int) -> np.ndarray:
    """The nearest sRGB codes of light in [0, 1], as floats."""
    return np.rint(linear_to_srgb(light) * _peak(bits))


def _peak(bits: int) -> int:
    return 2**bits - 1
