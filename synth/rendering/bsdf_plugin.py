"""The lobes of `scene.materials` as a plugin for Mitsuba's own integrators: `{"type":
"isc_material", "model": "ggx", ...}`.

Parameters, as in `scene.materials`: `model` (lambert, oren_nayar, blinn_phong or ggx; roughplastic
is Mitsuba's own); the textures or numbers `albedo` (colour), `gloss` and `strength`; the numbers
`ior` and `sigma`. `mitsuba.traverse` exposes the textures, which may carry gradients.

Equation: f_r = albedo * diffuse + strength * specular. Component 0 is the diffuse lobe
(DiffuseReflection), component 1 the specular lobe (GlossyReflection): a `BSDFContext` with one of
these flags evaluates one lobe alone.

Citation: W. Jakob et al., Mitsuba 3 renderer, 2022, https://mitsuba-renderer.org.

Limits: CUDA and LLVM variants; a scalar one evaluates it ray by ray through Python, for tiny images
only. One-sided.
"""

from typing import Any

from isc_core.errors import InputError

from ..scene.materials import MODELS
from ..scene.variant import load_mitsuba
from .bsdfs import BlinnPhongLobe, GgxLobe, Lanes, MaterialLobes, load_drjit

NAME = "isc_material"
_PLASTIC = "roughplastic"


def register() -> str:
    """Register the plugin with Mitsuba's current variant; repeated calls are harmless.

    Returns
    -------
    str
        Its name.

    Raises
    ------
    InputError
        If Mitsuba is not installed.
    """
    mi = load_mitsuba()
    methods = {
        "__init__": _init,
        "traverse": _traverse,
        "sample": _sample,
        "eval": _eval,
        "pdf": _pdf,
        "eval_pdf": _eval_pdf,
        "to_string": _to_string,
    }
    mi.register_bsdf(NAME, type("IscMaterial", (mi.BSDF,), methods))
    return NAME


def _init(self: Any, properties: Any) -> None:
    mi = load_mitsuba()
    mi.BSDF.__init__(self, properties)
    self.model = str(properties.get("model", "blinn_phong"))
    if self.model not in MODELS or self.model == _PLASTIC:
        known = ", ".join(name for name in MODELS if name != _PLASTIC)
        raise InputError(f"the plugin {NAME} has no model {self.model!r}: choose {known}")
    self.albedo = properties.get_texture("albedo", 0.5)
    self.gloss = properties.get_texture("gloss", 100.0)
    self.strength = properties.get_texture("strength", 0.1)
    ior = float(properties.get("ior", 1.5))
    self.f0 = ((ior - 1) / (ior + 1)) ** 2
    sigma = float(properties.get("sigma", 0.3))
    self.sigma = sigma if self.model == "oren_nayar" else 0.0
    self.m_components = [
        mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide,
        mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide,
    ]
    self.m_flags = self.m_components[0] | self.m_components[1]


def _traverse(self: Any, callback: Any) -> None:
    for name in ("albedo", "gloss", "strength"):
        callback.put(name, getattr(self, name), load_mitsuba().ParamFlags.Differentiable)


def _lobes(self: Any, point: Any, active: Lanes) -> MaterialLobes:
    if self.model not in ("blinn_phong", "ggx"):
        return MaterialLobes(self.sigma)
    gloss = self.gloss.eval_1(point, active)
    lobe = BlinnPhongLobe(gloss) if self.model == "blinn_phong" else GgxLobe(gloss, self.f0)
    return MaterialLobes(0.0, self.strength.eval_1(point, active), lobe)


def _sample(
    self: Any, context: Any, point: Any, choice: Lanes, place: Lanes, active: Lanes = True
) -> tuple[Any, Lanes]:
    dr, mi = load_drjit(), load_mitsuba()
    light = _lobes(self, point, active).sample(point.wi, choice, place)
    density = _pdf(self, context, point, light, active)
    drawn = dr.zeros(mi.BSDFSample3f)
    drawn.wo, drawn.pdf, drawn.eta = light, density, 1.0
    drawn.sampled_type, drawn.sampled_component = mi.UInt32(int(self.m_flags)), mi.UInt32(0)
    value = _eval(self, context, point, light, active)
    return drawn, dr.select(density > 0, value / dr.select(density > 0, density, 1), 0)


def _eval(self: Any, context: Any, point: Any, light: Lanes, active: Lanes = True) -> Lanes:
    mi, dr = load_mitsuba(), load_drjit()
    diffuse, gloss = _lobes(self, point, active).values(point.wi, light)
    total = mi.Color3f(0)
    if context.is_enabled(mi.BSDFFlags.DiffuseReflection, 0):
        total += self.albedo.eval(point, active) * diffuse
    if context.is_enabled(mi.BSDFFlags.GlossyReflection, 1):
        total += gloss
    return dr.select(active, total, 0)


def _pdf(self: Any, context: Any, point: Any, light: Lanes, active: Lanes = True) -> Lanes:
    del context
    dr = load_drjit()
    density = _lobes(self, point, active).density(point.wi, light)
    return dr.select(active & (point.wi.z > 0) & (light.z > 0), density, 0)


def _eval_pdf(
    self: Any, context: Any, point: Any, light: Lanes, active: Lanes = True
) -> tuple[Lanes, Lanes]:
    return _eval(self, context, point, light, active), _pdf(self, context, point, light, active)


def _to_string(self: Any) -> str:
    return f"IscMaterial[{self.model}]"
