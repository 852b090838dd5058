"""The base colour under the specular layer of a Principled BSDF.

Problem: the recovered base colour rho explains the photo's diffuse image without a layer above it.
Blender's Principled BSDF gives the diffuse layer only what the specular one does not reflect, and
adds what that one mirrors of the recovered environment. This broad reflection is in the diffuse
image already: a separator finds highlights. The object would be too bright in most places.

Equation: seen at the angle t, the specular layer reflects the share E(t), its directional albedo:
GGX with Fresnel's equations for the index of refraction whose reflectance along the normal is
.04 level. Of the environment it mirrors M toward the photo's camera. With the shading S, the colour
b looks like rho where

    b (1 - E) S + M = rho S

Where M is large beside rho S, it is more likely wrong than the base colour is dark: it comes from
the sides or from behind, where the environment is a guess. So at most half of rho is taken off,
smoothly, in each channel:  b (1 - E) = rho (1 + exp(-2 M / (rho S))) / 2.

Citation: the layering is that of B. Burley, "Extending the Disney BRDF to a BSDF with integrated
subsurface scattering", SIGGRAPH 2015 courses (no DOI).

Where the gloss is edited, b is computed anew, as if the fit had found the edited gloss. For that
the file keeps the normals, and the light as numbers.

Limits: right in the photo's light and view. Light that is reflected between facets is left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from isc_core.imaging.row_blocks import row_blocks
from isc_core.imaging.srgb import srgb_codes, srgb_to_linear
from isc_core.imaging.upsampling import enlarged
from isc_core.inpainting.pull_push import fill
from isc_core.photo.camera import Camera
from isc_core.shading.brdf.energy import directional_albedo
from isc_core.shading.brdf.ggx import F0, Ggx
from isc_core.shading.environment_map import resampled
from isc_core.shading.lights import VIEW
from isc_core.shading.mirrored_environment import MirroredEnvironment
from isc_core.shading.perspective import view_directions
from isc_core.shading.spherical_harmonics import real_sh

from ..files.result_arrays import ResultArrays
from .camera import camera_of
from .dichromatic import MOST

_ANGLES, _NODES = 10, 32
_SMALLEST_ROUGHNESS = 0.05
_ROWS = 16  # of the environment: the recovered one is smooth
_COEFFICIENTS = 27  # of the illumination
_DARKEST = 1e-6


@dataclass(frozen=True)
class _Layer:
    """GGX with Fresnel's equations, as the integral of the albedo needs it."""

    alpha: float
    f0: float

    def value(self, normal: np.ndarray, view: np.ndarray, light: np.ndarray) -> np.ndarray:
        cosine = np.sqrt(np.clip((1 + (light * view).sum(-1)) / 2, 0, 1))
        facets = Ggx(self.alpha, 1.0).value(normal, view, light)
        return np.asarray(facets * _fresnel(cosine, self.f0))


@dataclass(frozen=True)
class SpecularLayer:
    """What the specular layer of an object takes and adds, in the photo's light and view.

    Attributes
    ----------
    effect : (H, W, 4) ndarray of float32
        M / S in three channels, and E; continued beyond the mask.
    """

    effect: np.ndarray

    def color_under(self, color: np.ndarray) -> np.ndarray:
        """Return the base colour that looks as recovered under this layer.

        Parameters
        ----------
        color : (H, W, 3) ndarray
            The recovered one, linear.

        Returns
        -------
        (H, W, 3) ndarray
            Not clipped at 1.
        """
        return _under(color, self.effect)

    def codes_under(self, codes: np.ndarray) -> np.ndarray:
        """Return the same for a texture of any resolution over the same frame.

        Parameters
        ----------
        codes : (rows, columns, 3) ndarray of uint8
            The recovered base colour, sRGB.

        Returns
        -------
        (rows, columns, 3) ndarray of uint8
        """
        table = srgb_to_linear(np.arange(256) / 255).astype(np.float32)
        under = np.empty_like(codes)
        for block in row_blocks(codes.shape):
            colors = self.rows_under(table[codes[block.rows]], block.rows.start)
            under[block.rows] = srgb_codes(colors)
        return under

    def rows_under(self, colors: np.ndarray, first: int) -> np.ndarray:
        """Return the same for some rows of such a texture.

        Parameters
        ----------
        colors : (rows, columns, 3) ndarray
            The recovered ones, linear.
        first : int
            The texture's row that is their first one.

        Returns
        -------
        (rows, columns, 3) ndarray
            Not clipped at 1.
        """
        factor = colors.shape[1] / self.effect.shape[1]
        return _under(colors, enlarged(self.effect, colors.shape[:2], factor, (first, 0)))


@dataclass(frozen=True)
class RecoveredLight:
    """What of the recovered light a layer needs.

    Attributes
    ----------
    environment : (rows, 2 rows, 3) ndarray
        Radiance, see `isc_core.shading.environment_map`.
    illumination : (9, 3) ndarray
        Log-shading SH coefficients for the base colour.
    camera : Camera or None
        The photo's, of the maps; None for an orthographic view.
    """

    environment: np.ndarray
    illumination: np.ndarray
    camera: Camera | None

    @property
    def numbers(self) -> list[float]:
        """The same as numbers, which a datablock can store."""
        camera = self.camera
        place = [0.0, 0, 0] if camera is None else [camera.focal_length, *camera.principal_point]
        return [*place, *self.illumination.ravel().tolist(), *self.environment.ravel().tolist()]


def light_of_numbers(numbers: Sequence[float]) -> RecoveredLight:
    """Return the light of `RecoveredLight.numbers`.

    Parameters
    ----------
    numbers : sequence of float

    Returns
    -------
    RecoveredLight
    """
    values = np.array(numbers, float)
    (focal_length, x, y), illumination, environment = np.split(values, (3, 3 + _COEFFICIENTS))
    rows = round((len(environment) / 6) ** 0.5)
    return RecoveredLight(
        environment.reshape(rows, 2 * rows, 3),
        illumination.reshape(9, 3),
        Camera(float(focal_length), (float(x), float(y))) if focal_length > 0 else None,
    )


def recovered_light(result: ResultArrays) -> RecoveredLight:
    """Return what of the light of a result a layer needs.

    Parameters
    ----------
    result : ResultArrays

    Returns
    -------
    RecoveredLight
    """
    environment = resampled(result.environment_map.astype(float), _ROWS)
    return RecoveredLight(environment, result.mesh_illumination, camera_of(result))


@dataclass(frozen=True)
class CoatedSurface:
    """A surface in the recovered light, on which a specular layer lies.

    Attributes
    ----------
    normal : (H, W, 3) ndarray
        Unit normals; 0 outside the object.
    shading : (H, W, 3) ndarray
        That of the base colour.
    light : RecoveredLight
        The light.
    variation : (H, W) ndarray or None
        Spatial factor of the specular level, in [0, 1].
    """

    normal: np.ndarray
    shading: np.ndarray
    light: RecoveredLight
    variation: np.ndarray | None = None

    def layer(self, level: float, roughness: float) -> SpecularLayer | None:
        """Compute what a specular layer takes and adds.

        Parameters
        ----------
        level : float
            Specular level, 0 or more, where the variation is 1; 1 is plastic.
        roughness : float
            In [0, 1], as Blender defines it.

        Returns
        -------
        SpecularLayer or None
            None without a specular layer.
        """
        if level <= 0:
            return None
        mask, camera = self.normal.any(-1), self.light.camera
        normal = self.normal[mask].astype(float)
        view = VIEW if camera is None else view_directions(camera, mask.shape)[mask]
        model = _layer(level, roughness)
        mirrored = MirroredEnvironment(model, self.light.environment).toward(normal, view)
        share = specular_share(level, roughness, (normal * view).sum(-1))[:, None]
        inside = np.concatenate([mirrored / np.maximum(self.shading[mask], _DARKEST), share], -1)
        if self.variation is not None:
            inside *= self.variation[mask][:, None]
        effect = np.zeros((*mask.shape, 4), np.float32)
        effect[mask] = inside
        return SpecularLayer(fill(effect, mask))


def coated_surface(result: ResultArrays) -> CoatedSurface:
    """Return the surface of a result.

    Parameters
    ----------
    result : ResultArrays

    Returns
    -------
    CoatedSurface
    """
    variation = result.specular_variation
    return CoatedSurface(
        np.where(result.mask[..., None], result.normal, 0),
        result.shading / result.reflectance_scale,
        recovered_light(result),
        None if variation is None else variation / max(1.0, float(variation.max())),
    )


def coded_normals(normal: np.ndarray) -> np.ndarray:
    """Code normals in 8 bits; 0 outside the object, where they are 0.

    Parameters
    ----------
    normal : (H, W, 3) ndarray

    Returns
    -------
    (H, W, 3) ndarray of uint8
    """
    codes = np.rint(127 * normal + 128).astype(np.uint8)
    return np.where(normal.any(-1)[..., None], codes, np.uint8(0))


def surface_of_codes(
    normals: np.ndarray, light: RecoveredLight, variation: np.ndarray | None
) -> CoatedSurface:
    """Return the surface of `coded_normals`, whose shading is that of the light's illumination.

    Parameters
    ----------
    normals : (H, W, 3) ndarray of uint8
    light : RecoveredLight
    variation : (H, W) ndarray of uint8 or None
        Coded factor of the specular level.

    Returns
    -------
    CoatedSurface
    """
    mask = normals.any(-1)
    normal, shading = (np.zeros(normals.shape) for _ in range(2))
    inside = (normals[mask] - 128.0) / 127
    normal[mask] = inside / np.linalg.norm(inside, axis=-1, keepdims=True)
    shading[mask] = np.exp(real_sh(normal[mask]) @ light.illumination)
    return CoatedSurface(normal, shading, light, None if variation is None else variation / 255)


def specular_share(level: float, roughness: float, cosines: np.ndarray) -> np.ndarray:
    """Return the share of the light that the specular layer takes from the diffuse one.

    Parameters
    ----------
    level : float
        Specular level, 0 or more; 1 is plastic.
    roughness : float
        In [0, 1], as Blender defines it.
    cosines : (N,) ndarray
        Cosines between the normals and the view.

    Returns
    -------
    (N,) ndarray
        In [0, 1).
    """
    if level <= 0:
        return np.zeros(len(cosines))
    layer = _layer(level, roughness)
    places = np.linspace(1 / _ANGLES, 1, _ANGLES)
    albedos = [float(directional_albedo(layer, float(one), _NODES)) for one in places]
    return np.interp(cosines, places, albedos)


def _layer(level: float, roughness: float) -> _Layer:
    return _Layer(max(roughness, _SMALLEST_ROUGHNESS) ** 2, min(F0 * level, MOST))


def _under(color: np.ndarray, effect: np.ndarray) -> np.ndarray:
    mirrored, share = effect[..., :3], effect[..., 3:]
    kept = (1 + np.exp(-2 * mirrored / np.maximum(color, _DARKEST))) / 2
    return np.asarray(color * kept / (1 - np.minimum(share, MOST)))


def _fresnel(cosine: np.ndarray, f0: float) -> np.ndarray:
    """The reflectance of unpolarised light, from that along the normal."""
    index = (1 + np.sqrt(f0)) / (1 - np.sqrt(f0))
    inner = np.sqrt(index**2 - 1 + cosine**2)
    across = (cosine - inner) / (cosine + inner)
    along = (index**2 * cosine - inner) / (index**2 * cosine + inner)
    return np.asarray((across**2 + along**2) / 2)
