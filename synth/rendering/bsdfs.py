"""The lobes of `materials` on Mitsuba's arrays: how much they reflect, and random directions toward
which they reflect most.

Directions are in the local frame of a point, z along its normal: `view` toward the camera, `light`
toward the light, both unit vectors of Dr.Jit, or of numbers in a scalar variant. Parameters are
numbers or arrays with an entry for each lane; all may carry gradients. They share no code with
`isc_core.shading.brdf`, so that each is the other's test.

Equation: values are f_r cos_light. A gloss is sampled by half vectors: with the density p(h) per
solid angle of h, the light's is p(h) / (4 view . h), in proportion to cos^p of the normal for
Blinn-Phong, and to the facets that the view sees for GGX.

Citation: E. Heitz, "Sampling the GGX distribution of visible normals", Journal of Computer Graphics
Techniques 7(4), 2018 (no DOI), as Mitsuba does it; the models' own stand in `isc_core.shading.brdf`.

Limits: reflection only. Half of the directions are drawn for the diffuse and half for the gloss,
whatever their strengths.
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
    """The `drjit` module. Raises `InputError` where Mitsuba is not installed."""
    load_mitsuba()
    import drjit

    return drjit


class Lobes(Protocol):
    """What a point reflects, diffuse and gloss apart."""

    def values(self, view: Lanes, light: Lanes) -> tuple[Lanes, Lanes]:
        """f_r cos_light of the diffuse for albedo 1, and of the gloss; 0 below the horizon."""
        ...

    def density(self, view: Lanes, light: Lanes) -> Lanes:
        """How densely `sample` draws this direction, per steradian."""
        ...

    def sample(self, view: Lanes, choice: Lanes, place: Lanes) -> Lanes:
        """A direction for the uniform random numbers `choice` and `place` (two)."""
        ...


class SpecularLobe(Protocol):
    """A glossy lobe of strength 1.

    All three as in `Lobes`, but for f_r without the cosine, where view and light are above the
    horizon.
    """

    def value(self, view: Lanes, light: Lanes) -> Lanes: ...

    def density(self, view: Lanes, light: Lanes) -> Lanes: ...

    def sample(self, view: Lanes, place: Lanes) -> Lanes: ...


@dataclass(frozen=True)
class BlinnPhongLobe:
    """`exponent`: > 0. The scale is "normalised"."""

    exponent: Lanes

    def value(self, view: Lanes, light: Lanes) -> Lanes:
        return (self.exponent + 8) / (8 * math.pi) * self._lobe(view, light)

    def density(self, view: Lanes, light: Lanes) -> Lanes:
        dr = load_drjit()
        across = dr.maximum(dr.dot(view, dr.normalize(view + light)), 1e-6)
        return (self.exponent + 1) / (2 * math.pi) * self._lobe(view, light) / (4 * across)

    def sample(self, view: Lanes, place: Lanes) -> Lanes:
        dr, mi = load_drjit(), load_mitsuba()
        # 1 - cos^2 by way of the logarithm keeps its digits where the lobe is narrow.
        square = 1 - dr.exp(2 / (self.exponent + 1) * dr.log(dr.maximum(1 - place.x, 1e-30)))
        across, (sine, cosine) = dr.safe_sqrt(square), dr.sincos(2 * math.pi * place.y)
        half = mi.Vector3f(across * cosine, across * sine, dr.safe_sqrt(1 - square))
        return mi.reflect(view, half)

    def _lobe(self, view: Lanes, light: Lanes) -> Lanes:
        """cos^p of the half vector, from its sine: for large p the cosine has lost the digits that
        count.
        """
        dr = load_drjit()
        half = dr.normalize(view + light)
        return dr.exp(0.5 * self.exponent * _log_complement(half.x * half.x + half.y * half.y))


@dataclass(frozen=True)
class GgxLobe:
    """`alpha` in (0, 1] of Mitsuba's facets; `f0` in [0, 1] of Schlick's Fresnel term."""

    alpha: Lanes
    f0: Lanes

    def value(self, view: Lanes, light: Lanes) -> Lanes:
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
        dr = load_drjit()
        half = dr.normalize(view + light)
        return self._facets().pdf(view, half) / (4 * dr.maximum(dr.dot(view, half), 1e-6))

    def sample(self, view: Lanes, place: Lanes) -> Lanes:
        half, _ = self._facets().sample(view, place)
        return load_mitsuba().reflect(view, half)

    def _facets(self) -> Lanes:
        mi = load_mitsuba()
        return mi.MicrofacetDistribution(mi.MicrofacetType.GGX, self.alpha, True)


@dataclass(frozen=True)
class MaterialLobes:
    """A diffuse diffuse of slope deviation `sigma` (radians; 0 is Lambert) under `strength` times a
    gloss, or none.
    """

    sigma: Lanes = 0.0
    strength: Lanes = 0.0
    gloss: SpecularLobe | None = None

    def values(self, view: Lanes, light: Lanes) -> tuple[Lanes, Lanes]:
        dr, mi = load_drjit(), load_mitsuba()
        lit = (view.z > 1e-9) & (light.z > 1e-9)
        diffuse = dr.select(lit, oren_nayar(self.sigma, view, light) * light.z, 0)
        if self.gloss is None:
            return mi.Float(diffuse), mi.Float(0)
        return mi.Float(diffuse), mi.Float(
            dr.select(lit, self.strength * self.gloss.value(view, light) * light.z, 0)
        )

    def density(self, view: Lanes, light: Lanes) -> Lanes:
        dr = load_drjit()
        diffuse = dr.maximum(light.z, 0) / math.pi
        if self.gloss is None:
            return diffuse
        return dr.select(
            (view.z > 1e-9) & (light.z > 1e-9), 0.5 * (diffuse + self.gloss.density(view, light)), 0
        )

    def sample(self, view: Lanes, choice: Lanes, place: Lanes) -> Lanes:
        dr, mi = load_drjit(), load_mitsuba()
        diffuse = mi.warp.square_to_cosine_hemisphere(place)
        if self.gloss is None:
            return diffuse
        return dr.select(choice < 0.5, diffuse, self.gloss.sample(view, place))


@dataclass(frozen=True)
class PlasticLobes:
    """Mitsuba's rough plastic, `plugin`, whose parameters are uniform. `drawn`: lobes alike, whose
    directions are taken: the plugin would draw few for the gloss, which is faint and bright at
    once.
    """

    plugin: Lanes
    drawn: MaterialLobes

    def values(self, view: Lanes, light: Lanes) -> tuple[Lanes, Lanes]:
        mi = load_mitsuba()
        parts = (mi.BSDFFlags.DiffuseReflection, mi.BSDFFlags.GlossyReflection)
        contexts = [mi.BSDFContext(mi.TransportMode.Radiance, int(part)) for part in parts]
        diffuse, gloss = (
            self.plugin.eval(context, _interaction(view), light).x for context in contexts
        )
        return diffuse, gloss

    def density(self, view: Lanes, light: Lanes) -> Lanes:
        return self.drawn.density(view, light)

    def sample(self, view: Lanes, choice: Lanes, place: Lanes) -> Lanes:
        return self.drawn.sample(view, choice, place)


def rows_of(colour: Lanes) -> np.ndarray:
    """A colour or vector with an entry for each lane as an array (N, 3).

    Part by part: Dr.Jit turns a whole one by a kernel that has the number of lanes in it, and is
    compiled anew for every other number.
    """
    load_drjit().eval(colour)
    return np.stack([np.array(part, float) for part in colour], axis=1)


def lobes_of(material: Material, reflectance: SurfaceReflectance) -> Lobes:
    """The lobes of a material at points whose reflectance is known, a lane each.

    Raises `InputError` where Mitsuba is not installed.
    """
    dr, mi = load_drjit(), load_mitsuba()
    sigma, f0, strength, gloss = (
        mi.Float(material.sigma),
        mi.Float(material.f0),
        lanes(reflectance.strength),
        lanes(reflectance.gloss),
    )
    # What is opaque is no constant of a kernel, so that the next scene finds the kernel compiled.
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
    """Mitsuba's plugin as `materials` means it, with a white diffuse unless told otherwise (a number,
    or a texture as a dictionary).
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
    """f_r of a white rough diffuse surface, `sigma` in radians; the number 0 is Lambert's."""
    if isinstance(sigma, int | float) and sigma == 0:
        return 1 / math.pi
    dr = load_drjit()
    square = sigma * sigma
    flat = 1 - 0.5 * square / (square + 0.33)
    # sin a sin b cos d is the product of the directions' shadows on the surface, tan b / sin b
    # divides by the larger cosine.
    together = dr.maximum(view.x * light.x + view.y * light.y, 0) / dr.maximum(
        dr.maximum(view.z, light.z), 1e-9
    )
    return (flat + 0.45 * square / (square + 0.09) * together) / math.pi


def _log_complement(share: Lanes) -> Lanes:
    """log(1 - share) for a share in [0, 1], with all its digits where the share is small (W.

    Kahan's way).
    """
    dr = load_drjit()
    rest = dr.maximum(1 - share, 1e-30)
    lost = dr.select(rest == 1, 1, 1 - rest)
    return dr.select(rest == 1, -share, dr.log(rest) * share / lost)


def _interaction(view: Lanes) -> Lanes:
    """A point of a surface of which nothing counts but the direction it is seen from."""
    dr, mi = load_drjit(), load_mitsuba()
    point = dr.zeros(mi.SurfaceInteraction3f, dr.width(view))
    point.wi = view
    return point
