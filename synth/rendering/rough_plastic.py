"""Mitsuba's rough plastic in plain arrays: a diffuse base under a rough dielectric interface.

Equation: f_r = albedo g(cos_view) g(cos_light) / pi + F D G / (4 cos_view cos_light). D, G: GGX
facets and Smith's separable shadowing as in `isc_core.shading.brdf.ggx`; F: the exact Fresnel term
of unpolarised light at a dielectric, for the angle between view and half vector,

    F = (r_s^2 + r_p^2) / 2,   r_s = (c - n t) / (c + n t),   r_p = (n c - t) / (n c + t),
    t = sqrt(1 - (1 - c^2) / n^2)

g, the transmission of the interface on the way in or out, with the light between base and interface
attributed evenly to both, is a table over the cosine that Mitsuba integrates; it is evaluated from
its own plugin, at the table's knots.

Citation: B. Walter, S. R. Marschner, H. Li, K. E. Torrance, "Microfacet models for refraction
through rough surfaces", EGSR 2007, 195-206, doi:10.2312/EGWR/EGSR07/195-206; W. Jakob et al.,
"Mitsuba 3 renderer", 2022, https://mitsuba-renderer.org (the plastic).

Limits: `nonlinear` off: colour does not saturate by multiple reflections at the base. One alpha for
the whole object.
"""

import numpy as np

from isc_core.shading.brdf.directions import cosines
from isc_core.shading.brdf.ggx import Ggx

from ..scene.variant import load_mitsuba

_KNOTS = 64  # of Mitsuba's own table, evenly spaced in the cosine


class RoughPlastic:
    """Rough plastic without its albedo.

    Parameters
    ----------
    alpha : float
        Roughness in [.01, 1].
    ior : float
        Index of refraction, > 1.

    Raises
    ------
    InputError
        If Mitsuba is not installed.
    """

    def __init__(self, alpha: float, ior: float) -> None:
        self._alpha, self._ior = alpha, ior
        self._cosines, self._through = _transmission(alpha, ior)

    def diffuse(self, normal: np.ndarray, view: np.ndarray, light: np.ndarray) -> np.ndarray:
        """Evaluate the diffuse lobe for albedo 1; 0 below the horizon.

        Parameters
        ----------
        normal, view, light : (..., 3) ndarray
            Unit vectors.

        Returns
        -------
        (...) ndarray
            f_r in 1/sr.
        """
        angles = cosines(normal, view, light)
        way_in, way_out = (
            np.interp(cosine, self._cosines, self._through)
            for cosine in (angles.light, angles.view)
        )
        return np.where(angles.lit, way_in * way_out / np.pi, 0)

    def gloss(self, normal: np.ndarray, view: np.ndarray, light: np.ndarray) -> np.ndarray:
        """Evaluate the interface; 0 below the horizon.

        Parameters
        ----------
        normal, view, light : (..., 3) ndarray
            Unit vectors.

        Returns
        -------
        (...) ndarray
            f_r in 1/sr.
        """
        mirror = Ggx(self._alpha, 1.0).value(normal, view, light)
        return mirror * fresnel(cosines(normal, view, light).deviation, self._ior)


def fresnel(cosine: np.ndarray, ior: float) -> np.ndarray:
    """Return the reflectance of a dielectric for unpolarised light from outside.

    Parameters
    ----------
    cosine : ndarray
        Cosine of the angle of incidence, [0, 1].
    ior : float
        Index of refraction, > 1.

    Returns
    -------
    ndarray
        In [0, 1].
    """
    inside = np.sqrt(1 - (1 - np.square(cosine)) / ior**2)
    across = (cosine - ior * inside) / (cosine + ior * inside)
    along = (ior * cosine - inside) / (ior * cosine + inside)
    return (across**2 + along**2) / 2


def _transmission(alpha: float, ior: float) -> tuple[np.ndarray, np.ndarray]:
    """The cosines of the table's knots and g there: pi f_diffuse(c, 1) = g(c) g(1)."""
    mi = load_mitsuba()
    white = {"type": "rgb", "value": 1.0}
    facets = {
        "type": "roughplastic",
        "distribution": "ggx",
        "alpha": alpha,
        "int_ior": ior,
        "ext_ior": 1.0,
    }
    plastic = mi.load_dict({**facets, "nonlinear": False, "diffuse_reflectance": white})
    context = mi.BSDFContext()
    context.type_mask = mi.BSDFFlags.DiffuseReflection
    knots = np.linspace(0, 1, _KNOTS)
    knots[0] = 1e-6  # the plugin is black at 0
    products = np.array([_diffuse_toward_zenith(mi, plastic, context, cosine) for cosine in knots])
    return knots, products / np.sqrt(products[-1])


def _diffuse_toward_zenith(mi: object, plastic: object, context: object, cosine: float) -> float:
    """pi f_diffuse of a white plastic seen from `cosine` and lit from the zenith."""
    point = mi.SurfaceInteraction3f()  # type: ignore[attr-defined]
    point.wi = mi.Vector3f(float(np.sqrt(1 - cosine**2)), 0.0, float(cosine))  # type: ignore[attr-defined]
    toward = mi.Vector3f(0.0, 0.0, 1.0)  # type: ignore[attr-defined]
    return float(np.pi * np.ravel(plastic.eval(context, point, toward))[0])  # type: ignore[attr-defined]
