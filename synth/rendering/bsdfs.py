"""The lobes of `scene.materials` on Mitsuba's arrays: their values, and importance sampling of
directions.

Directions are in the local frame of a point, z along its normal: `view` toward the camera, `light`
toward the light, both unit vectors of Dr.Jit, or of numbers in a scalar variant. Parameters are
numbers or arrays with one entry per lane; all may carry gradients. No code is shared with
`isc_core.shading.brdf`, so that each tests the other.

Equation: values are f_r cos_light. A specular lobe is sampled by half vectors: with the density
p(h) per solid angle of h, the light's is p(h) / (4 view . h); p is proportional to cos^p of the
normal for Blinn-Phong, and to the visible facets for GGX.

Citation: E. Heitz, "Sampling the GGX distribution of visible normals", Journal of Computer Graphics
Techniques 7(4), 2018 (no DOI), as implemented in Mitsuba; for the models see
`isc_core.shading.brdf`.

Limits: reflection only. Half of the directions are sampled from the diffuse lobe and half from the
specular one, whatever their strengths.
"""

import math
from dataclasses import dataclass
from types import ModuleType
from typing import Any, Protocol

import numpy as np

from ..scene.materials import Material, SurfaceReflectance
from ..scene.tracing import lanes
from ..scene.variant import load_mitsuba

# Arrays of Dr.Jit, whose types depend on the variant.
Lanes = Any


def load_drjit() -> ModuleType:
    """Return the `drjit` module.

    Raises
    ------
    InputError
        If Mitsuba is not installed.
    """
    load_mitsuba()
    import drjit

    return drjit


class Lobes(Protocol):
    """The reflection of a point, diffuse and specular lobes separate."""

    def values(self, view: Lanes, light: Lanes) -> tuple[Lanes, Lanes]:
        """Evaluate both lobes.

        Parameters
        ----------
        view, light : Dr.Jit vectors
            Unit directions in the local frame.

        Returns
        -------
        diffuse, specular : Dr.Jit array
            f_r cos_light of the diffuse lobe for albedo 1, and of the specular lobe; 0 below the
            horizon.
        """
        ...

    def density(self, view: Lanes, light: Lanes) -> Lanes:
        """Return the density of `sample`.

        Parameters
        ----------
        view, light : Dr.Jit vectors
            Unit directions in the local frame.

        Returns
        -------
        Dr.Jit array
            Per steradian.
        """
        ...

    def sample(self, view: Lanes, choice: Lanes, place: Lanes) -> Lanes:
        """Sample a direction to the light.

        Parameters
        ----------
        view : Dr.Jit vector
            Unit direction to the camera, local frame.
        choice, place : Dr.Jit array and point
            One and two uniform random numbers.

        Returns
        -------
        Dr.Jit vector
            Unit direction in the local frame.
        """
        ...


class SpecularLobe(Protocol):
    """A specular lobe of strength 1.

    The methods are those of `Lobes`, but for f_r without the cosine, for view and light above the
    horizon.
    """

    def value(self, view: Lanes, light: Lanes) -> Lanes:
        """Evaluate the lobe; see `Lobes.values`.

        Parameters
        ----------
        view, light : Dr.Jit vectors
            Unit directions in the local frame.

        Returns
        -------
        Dr.Jit array
            f_r in 1/sr.
        """
        ...

    def density(self, view: Lanes, light: Lanes) -> Lanes:
        """Return the density of `sample`; see `Lobes.density`.

        Parameters
        ----------
        view, light : Dr.Jit vectors
            Unit directions in the local frame.

        Returns
        -------
        Dr.Jit array
            Per steradian.
        """
        ...

    def sample(self, view: Lanes, place: Lanes) -> Lanes:
        """Sample a direction to the light; see `Lobes.sample`.

        Parameters
        ----------
        view : Dr.Jit vector
            Unit direction to the camera, local frame.
        place : Dr.Jit point
            Two uniform random numbers.

        Returns
        -------
        Dr.Jit vector
            Unit direction in the local frame.
        """
        ...


@dataclass(frozen=True)
class BlinnPhongLobe:
    """The normalised Blinn-Phong lobe of an exponent > 0."""

    exponent: Lanes

    def value(self, view: Lanes, light: Lanes) -> Lanes:
        """Evaluate the lobe; see `SpecularLobe`.

        Parameters
        ----------
        view, light : Dr.Jit vectors
            Unit directions in the local frame.

        Returns
        -------
        Dr.Jit array
            f_r in 1/sr.
        """
        return (self.exponent + 8) / (8 * math.pi) * self._lobe(view, light)

    def density(self, view: Lanes, light: Lanes) -> Lanes:
        """Return the density of `sample`; see `SpecularLobe`.

        Parameters
        ----------
        view, light : Dr.Jit vectors
            Unit directions in the local frame.

        Returns
        -------
        Dr.Jit array
            Per steradian.
        """
        dr = load_drjit()
        across = dr.maximum(dr.dot(view, dr.normalize(view + light)), 1e-6)
        return (self.exponent + 1) / (2 * math.pi) * self._lobe(view, light) / (4 * across)

    def sample(self, view: Lanes, place: Lanes) -> Lanes:
        """Sample a direction to the light; see `SpecularLobe`.

        Parameters
        ----------
        view : Dr.Jit vector
            Unit direction to the camera, local frame.
        place : Dr.Jit point
            Two uniform random numbers.

        Returns
        -------
        Dr.Jit vector
            Unit direction in the local frame.
        """
        dr, mi = load_drjit(), load_mitsuba()
        # 1 - cos^2 from the logarithm is accurate for narrow lobes.
        square = 1 - dr.exp(2 / (self.exponent + 1) * dr.log(dr.maximum(1 - place.x, 1e-30)))
        across, (sine, cosine) = dr.safe_sqrt(square), dr.sincos(2 * math.pi * place.y)
        half = mi.Vector3f(across * cosine, across * sine, dr.safe_sqrt(1 - square))
        return mi.reflect(view, half)

    def _lobe(self, view: Lanes, light: Lanes) -> Lanes:
        """cos^p of the half vector, from its sine: for large p the cosine has lost the relevant
        digits.
        """
        dr = load_drjit()
        half = dr.normalize(view + light)
        return dr.exp(0.5 * self.exponent * _log_complement(half.x * half.x + half.y * half.y))


@dataclass(frozen=True)
class GgxLobe:
    """GGX with Mitsuba's facets.

    Attributes
    ----------
    alpha : float or Dr.Jit array
        Roughness in (0, 1].
    f0 : float or Dr.Jit array
        Reflectance at normal incidence in [0, 1], for Schlick's Fresnel term.
    """

    alpha: Lanes
    f0: Lanes

    def value(self, view: Lanes, light: Lanes) -> Lanes:
        """Evaluate the lobe; see `SpecularLobe`.

        Parameters
        ----------
        view, light : Dr.Jit vectors
            Unit directions in the local frame.

        Returns
        -------
        Dr.Jit array
            f_r in 1/sr.
        """
        dr = load_drjit()
        half = dr.normalize(view + light)
        facets = self._facets()
        grazing = 1 - dr.clip(dr.dot(view, half), 0, 1)
        square = grazing * grazing
        fresnel = self.f0 + (1 - self.f0) * square * square * grazing
        shown = facets.smith_g1(view, half) * facets.smith_g1(light, half)
        return (
            facets.eval(half)
            * shown
            * fresnel
            / (4 * dr.maximum(view.z, 1e-9) * dr.maximum(light.z, 1e-9))
        )

    def density(self, view: Lanes, light: Lanes) -> Lanes:
        """Return the density of `sample`; see `SpecularLobe`.

        Parameters
        ----------
        view, light : Dr.Jit vectors
            Unit directions in the local frame.

        Returns
        -------
        Dr.Jit array
            Per steradian.
        """
        dr = load_drjit()
        half = dr.normalize(view + light)
        return self._facets().pdf(view, half) / (4 * dr.maximum(dr.dot(view, half), 1e-6))

    def sample(self, view: Lanes, place: Lanes) -> Lanes:
        """Sample a direction to the light; see `SpecularLobe`.

        Parameters
        ----------
        view : Dr.Jit vector
            Unit direction to the camera, local frame.
        place : Dr.Jit point
            Two uniform random numbers.

        Returns
        -------
        Dr.Jit vector
            Unit direction in the local frame.
        """
        half, _ = self._facets().sample(view, place)
        return load_mitsuba().reflect(view, half)

    def _facets(self) -> Lanes:
        mi = load_mitsuba()
        return mi.MicrofacetDistribution(mi.MicrofacetType.GGX, self.alpha, True)


@dataclass(frozen=True)
class MaterialLobes:
    """A diffuse lobe with a specular lobe on top, or none.

    Attributes
    ----------
    sigma : float or Dr.Jit array
        Slope deviation of Oren-Nayar in radians; 0 is Lambertian.
    strength : float or Dr.Jit array
        Factor of the specular lobe.
    gloss : SpecularLobe or None
        The specular lobe.
    """

    sigma: Lanes = 0.0
    strength: Lanes = 0.0
    gloss: SpecularLobe | None = None

    def values(self, view: Lanes, light: Lanes) -> tuple[Lanes, Lanes]:
        """Evaluate both lobes; see `Lobes`.

        Parameters
        ----------
        view, light : Dr.Jit vectors
            Unit directions in the local frame.

        Returns
        -------
        diffuse, specular : Dr.Jit array
            f_r cos_light of each lobe; 0 below the horizon.
        """
        dr, mi = load_drjit(), load_mitsuba()
        lit = (view.z > 1e-9) & (light.z > 1e-9)
        diffuse = dr.select(lit, oren_nayar(self.sigma, view, light) * light.z, 0)
        if self.gloss is None:
            return mi.Float(diffuse), mi.Float(0)
        return mi.Float(diffuse), mi.Float(
            dr.select(lit, self.strength * self.gloss.value(view, light) * light.z, 0)
        )

    def density(self, view: Lanes, light: Lanes) -> Lanes:
        """Return the density of `sample`; see `Lobes`.

        Parameters
        ----------
        view, light : Dr.Jit vectors
            Unit directions in the local frame.

        Returns
        -------
        Dr.Jit array
            Per steradian.
        """
        dr = load_drjit()
        diffuse = dr.maximum(light.z, 0) / math.pi
        if self.gloss is None:
            return diffuse
        return dr.select(
            (view.z > 1e-9) & (light.z > 1e-9), 0.5 * (diffuse + self.gloss.density(view, light)), 0
        )

    def sample(self, view: Lanes, choice: Lanes, place: Lanes) -> Lanes:
        """Sample a direction to the light; see `Lobes`.

        Parameters
        ----------
        view : Dr.Jit vector
            Unit direction to the camera, local frame.
        choice, place : Dr.Jit array and point
            One and two uniform random numbers.

        Returns
        -------
        Dr.Jit vector
            Unit direction in the local frame.
        """
        dr, mi = load_drjit(), load_mitsuba()
        diffuse = mi.warp.square_to_cosine_hemisphere(place)
        if self.gloss is None:
            return diffuse
        return dr.select(choice < 0.5, diffuse, self.gloss.sample(view, place))


@dataclass(frozen=True)
class PlasticLobes:
    """Mitsuba's rough plastic with uniform parameters.

    Attributes
    ----------
    plugin : mitsuba.BSDF
        The plugin.
    drawn : MaterialLobes
        Similar lobes that directions are sampled from: the plugin would sample few directions from
        the specular lobe, which is weak but narrow.
    """

    plugin: Lanes
    drawn: MaterialLobes

    def values(self, view: Lanes, light: Lanes) -> tuple[Lanes, Lanes]:
        """Evaluate both lobes; see `Lobes`.

        Parameters
        ----------
        view, light : Dr.Jit vectors
            Unit directions in the local frame.

        Returns
        -------
        diffuse, specular : Dr.Jit array
            f_r cos_light of each lobe; 0 below the horizon.
        """
        mi = load_mitsuba()
        parts = (mi.BSDFFlags.DiffuseReflection, mi.BSDFFlags.GlossyReflection)
        contexts = [mi.BSDFContext(mi.TransportMode.Radiance, int(part)) for part in parts]
        diffuse, gloss = (
            self.plugin.eval(context, _interaction(view), light).x for context in contexts
        )
        return diffuse, gloss

    def density(self, view: Lanes, light: Lanes) -> Lanes:
        """Return the density of `sample`; see `Lobes`.

        Parameters
        ----------
        view, light : Dr.Jit vectors
            Unit directions in the local frame.

        Returns
        -------
        Dr.Jit array
            Per steradian.
        """
        return self.drawn.density(view, light)

    def sample(self, view: Lanes, choice: Lanes, place: Lanes) -> Lanes:
        """Sample a direction to the light; see `Lobes`.

        Parameters
        ----------
        view : Dr.Jit vector
            Unit direction to the camera, local frame.
        choice, place : Dr.Jit array and point
            One and two uniform random numbers.

        Returns
        -------
        Dr.Jit vector
            Unit direction in the local frame.
        """
        return self.drawn.sample(view, choice, place)


def rows_of(colour: Lanes) -> np.ndarray:
    """Convert a colour or vector with one entry per lane to an array.

    Component by component: Dr.Jit converts a whole one by a kernel that is compiled anew for every
    number of lanes.

    Parameters
    ----------
    colour : Dr.Jit colour or vector
        N lanes.

    Returns
    -------
    (N, 3) ndarray
        One row per lane.
    """
    load_drjit().eval(colour)
    return np.stack([np.array(part, float) for part in colour], axis=1)


def lobes_of(material: Material, reflectance: SurfaceReflectance) -> Lobes:
    """Return the lobes of a material at points, one lane each.

    Parameters
    ----------
    material : Material
        The material.
    reflectance : SurfaceReflectance
        Its parameters at the points.

    Returns
    -------
    Lobes
        The lobes.

    Raises
    ------
    InputError
        If Mitsuba is not installed.
    """
    dr, mi = load_drjit(), load_mitsuba()
    sigma, f0, strength, gloss = (
        mi.Float(material.sigma),
        mi.Float(material.f0),
        lanes(reflectance.strength),
        lanes(reflectance.gloss),
    )
    # Opaque values are not constants of a kernel: the next scene reuses the compiled kernel.
    dr.make_opaque(sigma, f0)
    if material.model == "blinn_phong":
        return MaterialLobes(0.0, strength, BlinnPhongLobe(gloss))
    facets = MaterialLobes(0.0, strength, GgxLobe(gloss, f0))
    if material.model == "roughplastic":
        return PlasticLobes(rough_plastic(float(material.gloss), material.ior), facets)
    if material.model == "ggx":
        return facets
    return MaterialLobes(sigma if material.model == "oren_nayar" else 0.0)


def rough_plastic(alpha: float, ior: float, albedo: Any = 1.0) -> Lanes:
    """Load Mitsuba's plugin with the conventions of `scene.materials`.

    Parameters
    ----------
    alpha, ior : float
        Roughness and index of refraction.
    albedo : float or dict, optional
        Diffuse reflectance: a number, or a texture as a dictionary.

    Returns
    -------
    mitsuba.BSDF
        The plugin.
    """
    diffuse = albedo if isinstance(albedo, dict) else {"type": "rgb", "value": [float(albedo)] * 3}
    plastic = {
        "type": "roughplastic",
        "distribution": "ggx",
        "alpha": alpha,
        "int_ior": ior,
        "ext_ior": 1.0,
        "nonlinear": False,
    }
    return load_mitsuba().load_dict({**plastic, "diffuse_reflectance": diffuse})


def oren_nayar(sigma: Lanes, view: Lanes, light: Lanes) -> Lanes:
    """Return f_r of a white rough diffuse surface.

    Parameters
    ----------
    sigma : float or Dr.Jit array
        Slope deviation in radians; the number 0 is Lambertian.
    view, light : Dr.Jit vectors
        Unit directions in the local frame.

    Returns
    -------
    float or Dr.Jit array
        f_r in 1/sr.
    """
    if isinstance(sigma, int | float) and sigma == 0:
        return 1 / math.pi
    dr = load_drjit()
    square = sigma * sigma
    flat = 1 - 0.5 * square / (square + 0.33)
    # sin a sin b cos d is the product of the projected directions; tan b / sin b divides by the
    # larger cosine.
    together = dr.maximum(view.x * light.x + view.y * light.y, 0) / dr.maximum(
        dr.maximum(view.z, light.z), 1e-9
    )
    return (flat + 0.45 * square / (square + 0.09) * together) / math.pi


def _log_complement(share: Lanes) -> Lanes:
    """log(1 - share) for a share in [0, 1], accurate for small shares (W. Kahan's method)."""
    dr = load_drjit()
    rest = dr.maximum(1 - share, 1e-30)
    lost = dr.select(rest == 1, 1, 1 - rest)
    return dr.select(rest == 1, -share, dr.log(rest) * share / lost)


def _interaction(view: Lanes) -> Lanes:
    """A surface point that has only a viewing direction."""
    dr, mi = load_drjit(), load_mitsuba()
    point = dr.zeros(mi.SurfaceInteraction3f, dr.width(view))
    point.wi = view
    return point
