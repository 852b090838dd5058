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

Limits: right for the fitted gloss in the photo's light and view; edits of the gloss leave the base
colour as it is. Light that is reflected between facets is left out.
"""

from dataclasses import dataclass

import numpy as np

from isc_core.imaging.row_blocks import row_blocks
from isc_core.imaging.srgb import srgb_codes, srgb_to_linear
from isc_core.imaging.upsampling import enlarged
from isc_core.inpainting.pull_push import fill
from isc_core.shading.brdf.energy import directional_albedo
from isc_core.shading.brdf.ggx import F0, Ggx
from isc_core.shading.environment_map import resampled
from isc_core.shading.lights import VIEW
from isc_core.shading.mirrored_environment import MirroredEnvironment
from isc_core.shading.perspective import view_directions

from ..files.result_arrays import ResultArrays
from .camera import camera_of
from .dichromatic import MOST

_ANGLES, _NODES = 10, 32
_SMALLEST_ROUGHNESS = 0.05
_ROWS = 16  # of the environment: the recovered one is smooth
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
        factor = codes.shape[1] / self.effect.shape[1]
        under = np.empty_like(codes)
        for block in row_blocks(codes.shape):
            part = codes[block.rows]
            effect = enlarged(self.effect, part.shape[:2], factor, (block.rows.start, 0))
            under[block.rows] = srgb_codes(_under(table[part], effect))
        return under


def specular_layer(result: ResultArrays, level: float, roughness: float) -> SpecularLayer | None:
    """Compute what the specular layer of an object takes and adds.

    Parameters
    ----------
    result : ResultArrays
        The object.
    level : float
        Its specular level, 0 or more, without the spatial variation; 1 is plastic.
    roughness : float
        In [0, 1], as Blender defines it.

    Returns
    -------
    SpecularLayer or None
        None without a specular layer.
    """
    if level <= 0:
        return None
    mask, camera = result.mask, camera_of(result)
    normal = result.normal[mask].astype(float)
    view = VIEW if camera is None else view_directions(camera, result.size[::-1])[mask]
    mirrored = MirroredEnvironment(
        _layer(level, roughness), resampled(result.environment_map.astype(float), _ROWS)
    ).toward(normal, view)
    shading = result.shading[mask] / result.reflectance_scale
    share = specular_share(level, roughness, (normal * view).sum(-1))[:, None]
    inside = np.concatenate([mirrored / np.maximum(shading, _DARKEST), share], -1)
    if result.specular_variation is not None:
        inside *= result.specular_variation[mask][:, None]
    effect = np.zeros((*mask.shape, 4), np.float32)
    effect[mask] = inside
    return SpecularLayer(fill(effect, mask))


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
