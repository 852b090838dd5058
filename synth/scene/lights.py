"""Lights as plain numbers, which every renderer here converts to its own form.

Directions point from the object toward the light, in the camera frame (x right, y up, z toward the
viewer); lengths are object units. All radiometric values are linear Rec.709 triples >= 0.
Environments are images laid out as in `isc_core.shading.environment_map`.

Equation: the irradiance of a surface with the normal n: directional, E max(0, n . d); point,
I max(0, n . d) / r^2; panel and environment, the integral of L max(0, n . w) over their solid
angle.

Citation: F. E. Nicodemus et al., "Geometrical considerations and nomenclature for reflectance", NBS
Monograph 160 (1977), doi:10.6028/NBS.MONO.160.

Limits: lights are invisible to the camera; panels emit to their front only.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from isc_core.errors import InputError
from isc_core.shading.environment_map import directions, resampled, solid_angles


@dataclass(frozen=True, eq=False)
class DirectionalLight:
    """A distant light.

    Attributes
    ----------
    direction : (3,) ndarray
        Unit, toward the light.
    irradiance : (3,) ndarray
        On a plane perpendicular to it.
    """

    direction: np.ndarray
    irradiance: np.ndarray

    def __post_init__(self) -> None:
        _check("direction", self.direction, (3,), unit=True)
        _check("irradiance", self.irradiance, (3,), light=True)


@dataclass(frozen=True, eq=False)
class PointLight:
    """A point light.

    Attributes
    ----------
    position : (3,) ndarray
        Outside the object, object units.
    intensity : (3,) ndarray
        Radiant intensity, per steradian.
    """

    position: np.ndarray
    intensity: np.ndarray

    def __post_init__(self) -> None:
        _check("position", self.position, (3,))
        _check("intensity", self.intensity, (3,), light=True)


@dataclass(frozen=True, eq=False)
class PanelLight:
    """A rectangular area light.

    Attributes
    ----------
    centre : (3,) ndarray
        Object units.
    right, up : (3,) ndarray
        Half its sides, at right angles; it emits toward right x up.
    radiance : (3,) ndarray
        Uniform over its area and over all directions in front.
    """

    centre: np.ndarray
    right: np.ndarray
    up: np.ndarray
    radiance: np.ndarray

    def __post_init__(self) -> None:
        for name in ("centre", "right", "up"):
            _check(name, getattr(self, name), (3,))
        _check("radiance", self.radiance, (3,), light=True)
        if self.area <= 0 or abs(float(np.dot(self.right, self.up))) > 1e-6 * self.area:
            raise InputError(
                "a panel's sides must be at right angles to each other and longer than 0"
            )

    @property
    def normal(self) -> np.ndarray:
        """Unit direction of emission, (3,)."""
        across = np.cross(self.right, self.up)
        return across / np.linalg.norm(across)

    @property
    def area(self) -> float:
        """Area in square object units."""
        return 4 * float(np.linalg.norm(np.cross(self.right, self.up)))


@dataclass(frozen=True, eq=False)
class EnvironmentLight:
    """An infinitely distant environment.

    Attributes
    ----------
    radiance : (rows, 2 rows, 3) ndarray
        rows >= 4, laid out as in `isc_core.shading.environment_map.directions`.
    """

    radiance: np.ndarray

    def __post_init__(self) -> None:
        rows = np.shape(self.radiance)[0] if np.ndim(self.radiance) == 3 else 0
        if rows < 4:
            raise InputError("an environment needs at least 4 rows of pixels")
        _check("radiance", self.radiance, (rows, 2 * rows, 3), light=True)


Light = DirectionalLight | PointLight | PanelLight | EnvironmentLight
Lights = Sequence[Light]


def panel_toward_origin(
    centre: Sequence[float], size: tuple[float, float], radiance: Sequence[float]
) -> PanelLight:
    """Return a panel that faces the origin.

    Parameters
    ----------
    centre : sequence of float
        Its position.
    size : (float, float)
        Width and height in object units; the height is as upright as possible.
    radiance : sequence of float
        Linear Rec.709.

    Returns
    -------
    PanelLight
        The panel.
    """
    place = np.asarray(centre, float)
    forward = -place / np.linalg.norm(place)
    pole = np.array([0.0, 1.0, 0.0]) if abs(forward[1]) < 0.999 else np.array([0.0, 0.0, -1.0])
    right = np.cross(pole, forward)
    right /= np.linalg.norm(right)
    up = np.cross(forward, right)
    return PanelLight(place, 0.5 * size[0] * right, 0.5 * size[1] * up, np.asarray(radiance, float))


def scaled(light: Light, gain: float) -> Light:
    """Scale the brightness of a light.

    Parameters
    ----------
    light : Light
        The light.
    gain : float
        The factor.

    Returns
    -------
    Light
        Of the same kind.
    """
    if isinstance(light, DirectionalLight):
        return DirectionalLight(light.direction, light.irradiance * gain)
    if isinstance(light, PointLight):
        return PointLight(light.position, light.intensity * gain)
    if isinstance(light, PanelLight):
        return PanelLight(light.centre, light.right, light.up, light.radiance * gain)
    return EnvironmentLight(light.radiance * gain)


def lights_as_environment(lights: Lights, rows: int) -> np.ndarray:
    """Render all lights as seen from the origin.

    Point and directional lights fill one pixel. Panels fill the pixels whose centres they cover,
    which keeps their radiance; one that covers none keeps its irradiance.

    Parameters
    ----------
    lights : sequence of Light
        The lights.
    rows : int
        Rows of the image.

    Returns
    -------
    (rows, 2 rows, 3) ndarray of float32
        Radiance.
    """
    towards, solid = directions(rows), solid_angles(rows)
    total = np.zeros((rows, 2 * rows, 3))
    for light in lights:
        if isinstance(light, EnvironmentLight):
            total += resampled(light.radiance, rows)
            continue
        if isinstance(light, PanelLight):
            covered = _seen_through(light, towards)
            if covered.any():
                total[covered] += light.radiance
                continue
        place, irradiance = _beam(light)
        row, column = np.unravel_index(np.argmax(towards @ place), solid.shape)
        total[row, column] += irradiance / solid[row, column]
    return total.astype(np.float32)


def _beam(light: DirectionalLight | PointLight | PanelLight) -> tuple[np.ndarray, np.ndarray]:
    """The direction in which the origin sees a light, and the irradiance perpendicular to it."""
    if isinstance(light, DirectionalLight):
        return light.direction, np.asarray(light.irradiance)
    place = np.asarray(light.position if isinstance(light, PointLight) else light.centre, float)
    square = float(place @ place)
    toward = place / np.sqrt(square)
    if isinstance(light, PointLight):
        return toward, np.asarray(light.intensity) / square
    return toward, np.asarray(light.radiance) * light.area * max(
        0.0, float(-light.normal @ toward)
    ) / square


def _seen_through(panel: PanelLight, towards: np.ndarray) -> np.ndarray:
    """Which of the directions (..., 3) from the origin hit the panel's front."""
    along = towards @ panel.normal
    facing = along < -1e-9
    distance = float(panel.centre @ panel.normal) / np.where(facing, along, -1)
    met = towards * distance[..., None] - panel.centre
    inside = [np.abs(met @ side) <= side @ side for side in (panel.right, panel.up)]
    return facing & (distance > 0) & inside[0] & inside[1]


def _check(
    name: str, value: np.ndarray, shape: tuple[int, ...], *, unit: bool = False, light: bool = False
) -> None:
    value = np.asarray(value)
    if value.shape != shape or not np.isfinite(value).all():
        raise InputError(f"a light's {name} must be finite numbers of shape {shape}")
    if unit and abs(float(np.linalg.norm(value)) - 1) > 1e-6:
        raise InputError(f"a light's {name} must have length 1")
    if light and (value < 0).any():
        raise InputError(f"a light's {name} cannot be negative")
