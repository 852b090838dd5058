"""What a camera's sensor and coding make of the light: noise, clipping, codes. All of it is the
residual of the truth.

Equation, for light x, 1 being full scale, each channel and pixel on its own:

    x' = x + n,  n ~ N(0, noise^2 (x + READ^2))      `noise`: deviation of the photons' part at full
    scale; READ noise: the sensor's own x" = min(max(x', 0), 1)                           below 0
    always, above 1 where `clip` is on image = linear(round(srgb(x") peak) / peak)       peak =
    2^bits - 1; codes of 8 and of 16 bits are both sRGB-coded

    residual = image - (diffuse + specular)

Citation: G. E. Healey, R. Kondepudy, "Radiometric CCD camera calibration and noise estimation",
IEEE TPAMI 16(3) (1994), 267-276, doi:10.1109/34.276126 (the two parts of the noise).

Limits: photons are counted by a Gaussian, sound from about 20 of them; no colour filter, so
neighbours are independent; noise at black is cut off at 0, so its mean there is above 0. Where
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
    """`exposure_level`: what `truth.exposed` brings the scene to before the sensor sees it, > 0;
    `observe` itself leaves it alone. `clip`: whether light above 1 is lost. `noise`: deviation of
    the photons' noise at full scale, [0, 1); 0: none. `bits`: of the sRGB codes, 8 or 16; 0: no
    codes. Codes end at 1, so they need `clip`. Raises `InputError` outside these.
    """

    exposure_level: float = 0.9
    clip: bool = True
    noise: float = 0.0
    bits: int = 0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.exposure_level) and self.exposure_level > 0):
            raise InputError("the exposure level has to be finite and above 0")
        if not 0 <= self.noise < 1:
            raise InputError("the noise has to be a share of full scale: 0 or more, below 1")
        if self.bits not in DEPTHS:
            raise InputError(
                f"codes of {self.bits} bits cannot be made: choose 8 or 16, or 0 for none"
            )
        if self.bits and not self.clip:
            raise InputError("codes end at full scale: choose bits 0, or clip")


def observe(truth: GroundTruth, sensor: Sensor, rng: np.random.Generator) -> GroundTruth:
    """The truth with the image that `sensor` makes of `truth.image`: never negative, 0 outside the
    mask; the other layers stay.

    `image = diffuse + specular + residual` as float32 adds them, exactly where clipped, elsewhere
    to 1e-7 of the light.
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
    """Standard deviation of the noise on `light` >= 0 (any shape) of a sensor with this `noise`."""
    return noise * np.sqrt(np.maximum(light, 0) + READ**2)


def write_photo(path: str | Path, truth: GroundTruth, bits: int = 16) -> None:
    """Writes the image as a camera would: an sRGB PNG of 8 or 16 bits a channel, clipped at 1, the
    mask as alpha.

    `read_photo` gives the image back to within half a code, and to the last bit where `observe`
    made these codes. Raises `InputError` for other bits, and where the file cannot be written.
    """
    if bits not in DEPTHS[1:]:
        raise InputError(f"a photo of {bits} bits cannot be written: choose 8 or 16")
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
