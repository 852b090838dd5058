"""The base colour under the specular layer of a renderer's surface.

Problem: the recovered base colour rho explains the photo's diffuse image without a layer above it.
Renderers give the diffuse layer only what the specular one does not reflect, and add what that one
mirrors of the recovered environment. This broad reflection is in the diffuse image already: a
separator finds highlights. The object would be too bright in most places.

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

Limits: right in the photo's light and view. Light that is reflected between facets is left out.
"""

from dataclasses import dataclass, field

import numpy as np

from ..imaging.row_blocks import row_blocks
from ..imaging.srgb import srgb_codes, srgb_to_linear
from ..imaging.upsampling import enlarged
from ..inpainting.pull_push import fill
from ..shading.brdf.energy import directional_albedo
from ..shading.brdf.ggx import F0, Ggx
from ..shading.lights import VIEW
from ..shading.mirrored_environment import MirroredEnvironment

MOST = 0.96  # of the reflectance along the normal: an index of refraction is finite
ENVIRONMENT_ROWS = 16  # enough: the recovered environment is smooth
_ANGLES, _NODES = 10, 32
_SMALLEST_ROUGHNESS = 0.05
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
class CoatedSurface:
    """A surface in the recovered light, on which a specular layer lies.

    Attributes
    ----------
    normal : (H, W, 3) ndarray
        Unit normals; 0 outside the object.
    shading : (H, W, 3) ndarray
        That of the base colour.
    environment : (rows, 2 rows, 3) ndarray
        Radiance of the light, see `environment_map`.
    view : (3,) or (H, W, 3) ndarray
        Unit vectors toward the viewer.
    variation : (H, W) ndarray or None
        Spatial factor of the specular level, in [0, 1].
    """

    normal: np.ndarray
    shading: np.ndarray
    environment: np.ndarray
    view: np.ndarray = field(default_factory=VIEW.copy)
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
        mask = self.normal.any(-1)
        normal = self.normal[mask].astype(float)
        view = self.view if self.view.ndim == 1 else self.view[mask]
        model = _layer(level, roughness)
        mirrored = MirroredEnvironment(model, self.environment).toward(normal, view)
        share = specular_share(level, roughness, (normal * view).sum(-1))[:, None]
        inside = np.concatenate([mirrored / np.maximum(self.shading[mask], _DARKEST), share], -1)
        if self.variation is not None:
            inside *= self.variation[mask][:, None]
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
