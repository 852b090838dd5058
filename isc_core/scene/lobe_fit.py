"""What a lobe fit is asked for, and what it answers."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ..errors import InputError
from ..shading.brdf.ggx import F0
from ..shading.brdf.roughness import blender_from_alpha, exponent_from_alpha

LobeModel = Literal["ggx", "blinn_phong"]

CONVENTION = {
    "ggx": f"ggx: f_r = D G F / (4 cos cos), alpha, Schlick's F with f0 = {F0:g}",
    "blinn_phong": "blinn_phong: f_r = (p + 8) / (8 pi) cos^p, p = 2 / alpha^2 - 2",
}

NO_LIGHT = "undetermined: no specular light"
SMOOTH = "undetermined: the light is smooth, any roughness explains it"
NARROW = "the highlight is narrower than a pixel: only an upper bound"
CLIPPED = "the highlight is brighter than the photo could show: only an upper bound"
UNLIKE = "undetermined: the specular image has no highlight that a lobe explains"
FOUND = "determined"


@dataclass(frozen=True)
class LobeFitOptions:
    """`model`: of the lobe. `most_lights`: 1 to 3. `most_pixels`: that are looked at, >= 100.
    `normal_error`: of the normals, degrees, [0, 90): 0 for exact ones, about 15 for recovered ones;
    it widens the intervals. `floor`: deviation of the specular light as a share of its peak;
    `relative`: as a share of itself. `darkest`: radiance >= 0 that is no highlight yet.
    `thresholded`: the specular image is a separator's, which sees only what rises above an unknown
    level. `recovered`: normals and shading too were recovered from the same photo, see `recovered`.
    Raises `InputError` outside these.
    """

    model: LobeModel = "ggx"
    most_lights: int = 3
    most_pixels: int = 3000
    normal_error: float = 0.0
    floor: float = 0.02
    relative: float = 0.1
    darkest: float = 1e-6
    thresholded: bool = False
    recovered: bool = False

    def __post_init__(self) -> None:
        if self.model not in CONVENTION:
            raise InputError(f"unknown lobe {self.model!r}: choose {', '.join(CONVENTION)}")
        if not 1 <= self.most_lights <= 3 or self.most_pixels < 100:
            raise InputError("most_lights has to be 1 to 3 and most_pixels at least 100")
        if not (
            0 <= self.normal_error < 90
            and 0 < self.floor < 1
            and 0 <= self.relative < 1
            and self.darkest >= 0
        ):
            raise InputError(
                "normal_error has to be within [0, 90), floor within (0, 1), relative within [0, 1), darkest 0 or more"
            )


@dataclass(frozen=True)
class Interval:
    """Holds the truth with a probability of 68 %: from `low` to `high`; numbers, or arrays of the
    same shape.
    """

    low: float | np.ndarray
    high: float | np.ndarray


@dataclass(frozen=True)
class LobeLight:
    """One light. `direction` (3,): unit, x right, y up, z toward the viewer; it lies within `cone`
    degrees with a probability of 68 %. `strength_light` (3,): the lobe's strength times the light's
    irradiance on a plane across its beam, linear RGB; only this product can be known. Unit: the
    photo's radiance x sr (W / m^2 where the photo is in W / (m^2 sr)). `interval`: of it.
    """

    direction: np.ndarray
    cone: float
    strength_light: np.ndarray
    interval: Interval


@dataclass(frozen=True)
class LobeFit:
    """A lobe and its lights. `model`: what alpha means, in words. `determined`: whether alpha is;
    else `reason` says why not.

    `alpha`: None where it is not known at all; where the highlight is narrower than a pixel, or
    clipped, the upper bound. `alpha_interval`: likewise. `lights`: the brightest first; none where
    there is no specular light, no lobe explains it, or an environment was given. `strength`,
    `strength_interval`: of the lobe (3,), where an environment was given, else None. `explained`:
    share of the squared specular image, in [0, 1]. `predicted`: (H, W, 3) float32, the specular
    image of the fit, 0 outside the mask; what a separator left out is in it.
    """

    model: str
    determined: bool
    reason: str
    alpha: float | None
    alpha_interval: Interval | None
    lights: tuple[LobeLight, ...]
    strength: np.ndarray | None
    strength_interval: Interval | None
    explained: float
    predicted: np.ndarray

    @property
    def direction(self) -> np.ndarray | None:
        """Of the brightest light, (3,)."""
        return self.lights[0].direction if self.lights else None

    @property
    def strength_light(self) -> np.ndarray | None:
        """Of the brightest light, (3,)."""
        return self.lights[0].strength_light if self.lights else None

    @property
    def exponent(self) -> float | None:
        """Blinn-Phong's exponent by the usual rule (see `shading.brdf.roughness`)."""
        return None if self.alpha is None else float(exponent_from_alpha(self.alpha))

    @property
    def blender_roughness(self) -> float | None:
        """Of Blender's Principled surface and of glTF, in [0, 1]."""
        return None if self.alpha is None else float(blender_from_alpha(self.alpha))

    def to_json(self) -> dict[str, Any]:
        """Everything but the image, ready for JSON."""
        return {
            "model": self.model,
            "determined": self.determined,
            "reason": self.reason,
            "alpha": self.alpha,
            "alpha_interval_68": _pair(self.alpha_interval),
            "exponent": self.exponent,
            "blender_roughness": self.blender_roughness,
            "lights": [
                {
                    "direction": light.direction.tolist(),
                    "cone_68_degrees": light.cone,
                    "strength_light": light.strength_light.tolist(),
                    "strength_light_interval_68": _pair(light.interval),
                }
                for light in self.lights
            ],
            "strength_light_unit": "radiance of the photo x sr",
            "strength": None if self.strength is None else self.strength.tolist(),
            "strength_interval_68": _pair(self.strength_interval),
            "explained": self.explained,
        }


def _pair(interval: Interval | None) -> list[Any] | None:
    return (
        None
        if interval is None
        else [np.asarray(interval.low).tolist(), np.asarray(interval.high).tolist()]
    )
