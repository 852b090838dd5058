"""Options and result of fitting a lobe to a specular image."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ..errors import InputError
from ..shading.brdf.ggx import F0
from ..shading.brdf.roughness import blender_from_alpha, exponent_from_alpha
from .diagnostics import LobeFitOutcome

__all__ = [
    "CONVENTION",
    "Interval",
    "LobeFit",
    "LobeFitOptions",
    "LobeFitOutcome",
    "LobeLight",
    "LobeModel",
]

LobeModel = Literal["ggx", "blinn_phong"]

CONVENTION = {
    "ggx": f"ggx: f_r = D G F / (4 cos cos), alpha, Schlick's F with f0 = {F0:g}",
    "blinn_phong": "blinn_phong: f_r = (p + 8) / (8 pi) cos^p, p = 2 / alpha^2 - 2",
}


@dataclass(frozen=True)
class LobeFitOptions:
    """How a lobe is fitted.

    Attributes
    ----------
    model : {"ggx", "blinn_phong"}
        The lobe.
    most_lights : int
        At most so many lights, 1 to 3.
    most_pixels : int
        At most so many pixels are used, >= 100.
    normal_error : float
        Error of the normals, degrees, in [0, 90); it widens the intervals. 0 for exact normals,
        about 15 for recovered ones.
    floor : float
        Deviation of the specular light as a share of its peak, in (0, 1).
    relative : float
        Deviation as a share of the light itself, in [0, 1).
    thresholded : bool
        The specular image is a separator's, which shows only light above an unknown level.

    Raises
    ------
    InputError
        If a value is out of range.
    """

    model: LobeModel = "ggx"
    most_lights: int = 3
    most_pixels: int = 3000
    normal_error: float = 0.0
    floor: float = 0.02
    relative: float = 0.1
    thresholded: bool = False

    def __post_init__(self) -> None:
        if self.model not in CONVENTION:
            raise InputError(f"unknown lobe {self.model!r}: choose {', '.join(CONVENTION)}")
        if not 1 <= self.most_lights <= 3 or self.most_pixels < 100:
            raise InputError("most_lights has to be 1 to 3 and most_pixels at least 100")
        if not (0 <= self.normal_error < 90 and 0 < self.floor < 1 and 0 <= self.relative < 1):
            raise InputError(
                "normal_error has to be within [0, 90), floor within (0, 1), relative within [0, 1)"
            )


@dataclass(frozen=True, eq=False)
class Interval:
    """Interval that contains the truth with a probability of 68 %.

    Attributes
    ----------
    low, high : float or ndarray
        Its ends; arrays of the same shape for several quantities.
    """

    low: float | np.ndarray
    high: float | np.ndarray


@dataclass(frozen=True, eq=False)
class LobeLight:
    """One light of a lobe fit.

    Attributes
    ----------
    direction : (3,) ndarray
        Unit vector toward the light, camera frame: x right, y up, z toward the viewer.
    cone : float
        The light lies within so many degrees of `direction` with a probability of 68 %.
    strength_light : (3,) ndarray
        Strength of the lobe times the light's irradiance on a plane across its beam, linear RGB;
        only this product is observable. Radiance of the photo x sr (W / m^2 where the photo is in
        W / (m^2 sr)).
    interval : Interval
        Of `strength_light`.
    """

    direction: np.ndarray
    cone: float
    strength_light: np.ndarray
    interval: Interval


@dataclass(frozen=True, eq=False)
class LobeFit:
    """A lobe and its lights.

    Attributes
    ----------
    model : str
        The convention of `alpha`, one of `CONVENTION`.
    outcome : LobeFitOutcome
        How far `alpha` is determined.
    alpha : float or None
        Roughness of the lobe in (0, 1]; the upper bound where the outcome is bounded, None where it
        is unknown.
    alpha_interval : Interval or None
        Of `alpha`.
    lights : tuple of LobeLight
        The brightest first; empty where there is no specular light, no lobe explains it, or an
        environment map was given.
    strength : (3,) ndarray or None
        Of the lobe, where an environment map was given.
    strength_interval : Interval or None
        Of `strength`.
    explained : float
        Share of the squared specular image that the fit explains, in [0, 1].
    predicted : (H, W, 3) ndarray of float32
        Specular image of the fit, 0 outside the mask. It includes light that a separator left in
        the diffuse layer.
    """

    model: str
    outcome: LobeFitOutcome
    alpha: float | None
    alpha_interval: Interval | None
    lights: tuple[LobeLight, ...]
    strength: np.ndarray | None
    strength_interval: Interval | None
    explained: float
    predicted: np.ndarray

    @classmethod
    def without_lobe(
        cls, model: LobeModel, outcome: LobeFitOutcome, shape: tuple[int, ...]
    ) -> "LobeFit":
        """Make the result of a fit that found no lobe.

        Parameters
        ----------
        model : {"ggx", "blinn_phong"}
            The lobe.
        outcome : LobeFitOutcome
            Why there is none.
        shape : tuple of int
            Shape (H, W, 3) of the specular image.

        Returns
        -------
        LobeFit
            Without roughness and lights; the predicted image is 0.
        """
        empty = np.zeros(shape, np.float32)
        return cls(CONVENTION[model], outcome, None, None, (), None, None, 0.0, empty)

    @property
    def determined(self) -> bool:
        """Whether the roughness is determined."""
        return self.outcome == LobeFitOutcome.DETERMINED

    @property
    def direction(self) -> np.ndarray | None:
        """Unit vector (3,) toward the brightest light; None without lights."""
        return self.lights[0].direction if self.lights else None

    @property
    def strength_light(self) -> np.ndarray | None:
        """`LobeLight.strength_light` (3,) of the brightest light; None without lights."""
        return self.lights[0].strength_light if self.lights else None

    @property
    def exponent(self) -> float | None:
        """Blinn-Phong exponent equivalent to `alpha` (see `shading.brdf.roughness`)."""
        return None if self.alpha is None else float(exponent_from_alpha(self.alpha))

    @property
    def blender_roughness(self) -> float | None:
        """Roughness of Blender's Principled BSDF and of glTF, in [0, 1]."""
        return None if self.alpha is None else float(blender_from_alpha(self.alpha))

    def to_json(self) -> dict[str, Any]:
        """Return everything but the predicted image, ready for JSON."""
        return {
            "model": self.model,
            "determined": self.determined,
            "outcome": self.outcome.value,
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
