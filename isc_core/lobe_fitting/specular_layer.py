"""The base colour under the specular layer of a renderer's surface.

Problem: the recovered base colour rho explains the photo's diffuse image without a layer above it.
In renderers, the diffuse layer receives only the light that the specular layer does not reflect,
and the specular layer adds its reflection of the recovered environment. The diffuse image already
contains this broad reflection, since a separator extracts only highlights. The object would be too
bright in most places.

Equation: viewed at the angle t, the specular layer reflects the share E(t), its directional albedo:
GGX with Fresnel's equations for the index of refraction whose reflectance at normal incidence is
.04 level. It reflects M of the environment toward the photo's camera. With the shading S, the
colour b has the appearance of rho if

    b (1 - E) S + M = rho S

Where M is large compared with rho S, an error of M is more likely than a dark base colour: M comes
from the sides or from behind, where the environment is uncertain. So rho is reduced by at most a
half, smoothly, in each channel: b (1 - E) = rho (1 + exp(-2 M / (rho S))) / 2.

Citation: the layering is that of B. Burley, "Extending the Disney BRDF to a BSDF with integrated
subsurface scattering", SIGGRAPH 2015 courses (no DOI).

Limits: exact only for the photo's light and view. Interreflection between microfacets is neglected.
"""

from dataclasses import dataclass, field

import numpy as np

from ..imaging.channels import largest, total
from ..imaging.row_blocks import row_blocks
from ..imaging.srgb import srgb_codes, srgb_to_linear
from ..imaging.upsampling import enlarged
from ..inpainting.pull_push import fill
from ..shading.brdf.energy import directional_albedo
from ..shading.brdf.ggx import F0, Ggx
from ..shading.lights import VIEW
from ..shading.mirrored_environment import MirroredEnvironment, narrowest_alpha

MOST = 0.96  # of the reflectance at normal incidence: the index of refraction is finite
ENVIRONMENT_ROWS = 16  # enough: the recovered environment is smooth
_ANGLES, _NODES = 10, 32
_MIN_ROUGHNESS = 0.05
_DARKEST = 1e-6


@dataclass(frozen=True)
class _Layer:
    """GGX with Fresnel's equations, for the integral of the albedo."""

    alpha: float
    f0: float

    def value(self, normal: np.ndarray, view: np.ndarray, light: np.ndarray) -> np.ndarray:
        cosine = np.sqrt(np.clip((1 + (light * view).sum(-1)) / 2, 0, 1))
        facets = Ggx(self.alpha, 1.0).value(normal, view, light)
        return np.asarray(facets * _fresnel(cosine, self.f0))


@dataclass(frozen=True, eq=False)
class SpecularLayer:
    """Light that the specular layer of an object removes and adds, for the photo's light and view.

    Attributes
    ----------
    effect : (H, W, 4) ndarray of float32
        M / S in three channels, and E; extrapolated beyond the mask.
    """

    effect: np.ndarray

    def color_under(self, color: np.ndarray) -> np.ndarray:
        """Return the base colour that, under this layer, has the recovered appearance.

        Parameters
        ----------
        color : (H, W, 3) ndarray
            The recovered base colour, linear.

        Returns
        -------
        (H, W, 3) ndarray
            Not clipped at 1.
        """
        return _under(color, self.effect)

    def codes_under(self, codes: np.ndarray) -> np.ndarray:
        """Return the corrected texture, of any resolution, over the same frame.

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
        """Return the corrected colours of some rows of a texture.

        Parameters
        ----------
        colors : (rows, columns, 3) ndarray
            The recovered colours, linear.
        first : int
            Index of the first of these rows in the texture.

        Returns
        -------
        (rows, columns, 3) ndarray
            Not clipped at 1.
        """
        factor = colors.shape[1] / self.effect.shape[1]
        return _under(colors, enlarged(self.effect, colors.shape[:2], factor, (first, 0)))


@dataclass(frozen=True, eq=False)
class CoatedSurface:
    """A surface with a specular layer, in the recovered light.

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
        """Compute the light that a specular layer removes and adds.

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
        mask = largest(self.normal != 0)
        normal = self.normal[mask].astype(float)
        view = self.view if self.view.ndim == 1 else self.view[mask]
        cosines = total(normal * view)
        share = specular_share(level, roughness, cosines)[:, None]
        # Narrower lobes mirror a smooth map in the same way, but for their albedo.
        wide = max(roughness, float(np.sqrt(narrowest_alpha(len(self.environment)))))
        mirrored = MirroredEnvironment(_layer(level, wide), self.environment).toward(normal, view)
        if wide > roughness:
            mirrored *= share / specular_share(level, wide, cosines)[:, None]
        inside = np.concatenate([mirrored / np.maximum(self.shading[mask], _DARKEST), share], -1)
        if self.variation is not None:
            inside *= self.variation[mask][:, None]
        effect = np.zeros((*mask.shape, 4), np.float32)
        effect[mask] = inside
        return SpecularLayer(fill(effect, mask))


def specular_share(level: float, roughness: float, cosines: np.ndarray) -> np.ndarray:
    """Return the share of the light that the specular layer removes from the diffuse layer.

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
    nodes = np.linspace(1 / _ANGLES, 1, _ANGLES)
    albedos = [float(directional_albedo(layer, float(one), _NODES)) for one in nodes]
    return np.interp(cosines, nodes, albedos)


def _layer(level: float, roughness: float) -> _Layer:
    return _Layer(max(roughness, _MIN_ROUGHNESS) ** 2, min(F0 * level, MOST))


def _under(color: np.ndarray, effect: np.ndarray) -> np.ndarray:
    mirrored, share = effect[..., :3], effect[..., 3:]
    kept = (1 + np.exp(-2 * mirrored / np.maximum(color, _DARKEST))) / 2
    return np.asarray(color * kept / (1 - np.minimum(share, MOST)))


def _fresnel(cosine: np.ndarray, f0: float) -> np.ndarray:
    """The reflectance of unpolarised light, given that at normal incidence."""
    index = (1 + np.sqrt(f0)) / (1 - np.sqrt(f0))
    inner = np.sqrt(index**2 - 1 + cosine**2)
    across = (cosine - inner) / (cosine + inner)
    along = (index**2 * cosine - inner) / (index**2 * cosine + inner)
    return np.asarray((across**2 + along**2) / 2)
