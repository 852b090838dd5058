"""The share of the light that the specular layer of a Principled BSDF takes from the diffuse one.

Problem: the recovered base colour explains the photo's diffuse image without a layer above it.
Blender's Principled BSDF gives the diffuse layer only what the specular one does not reflect, and
the object would become darker than in the photo.

Equation: seen at the angle t, the specular layer reflects E(t), its directional albedo: GGX with
Fresnel's equations for the index of refraction whose reflectance along the normal is .04 level. The
base colour is divided by 1 - s, s the mean of E over the object's pixels. What the mean leaves is
the darkening of the diffuse light toward the outline that a real varnish causes, too; an exact
compensation would paint a bright outline onto the texture, right for the photo's camera alone.

Citation: the layering is that of B. Burley, "Extending the Disney BRDF to a BSDF with integrated
subsurface scattering", SIGGRAPH 2015 courses (no DOI).

Limits: the photo's rays are taken as parallel; light that is reflected between facets is left out.
"""

from dataclasses import dataclass

import numpy as np

from isc_core.shading.brdf.energy import directional_albedo
from isc_core.shading.brdf.ggx import F0, Ggx

from .dichromatic import MOST

_ANGLES, _NODES = 10, 32
_SMALLEST_ROUGHNESS = 0.05


@dataclass(frozen=True)
class _Layer:
    """GGX with Fresnel's equations, as the integral of the albedo needs it."""

    alpha: float
    f0: float

    def value(self, normal: np.ndarray, view: np.ndarray, light: np.ndarray) -> np.ndarray:
        cosine = np.sqrt(np.clip((1 + (light * view).sum(-1)) / 2, 0, 1))
        facets = Ggx(self.alpha, 1.0).value(normal, view, light)
        return np.asarray(facets * _fresnel(cosine, self.f0))


def specular_share(level: float, roughness: float, cosines: np.ndarray) -> float:
    """Return the mean share.

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
    float
        In [0, 1).
    """
    if level <= 0:
        return 0.0
    layer = _Layer(max(roughness, _SMALLEST_ROUGHNESS) ** 2, min(F0 * level, MOST))
    places = np.linspace(1 / _ANGLES, 1, _ANGLES)
    albedos = [float(directional_albedo(layer, float(one), _NODES)) for one in places]
    return float(np.interp(cosines, places, albedos).mean())


def _fresnel(cosine: np.ndarray, f0: float) -> np.ndarray:
    """The reflectance of unpolarised light, from that along the normal."""
    index = (1 + np.sqrt(f0)) / (1 - np.sqrt(f0))
    inner = np.sqrt(index**2 - 1 + cosine**2)
    across = (cosine - inner) / (cosine + inner)
    along = (index**2 * cosine - inner) / (index**2 * cosine + inner)
    return np.asarray((across**2 + along**2) / 2)
