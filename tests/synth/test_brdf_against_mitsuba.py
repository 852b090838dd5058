"""The reflectance models of the core against pixels that Mitsuba rendered: the lobes as its plugin,
and its own rough conductor.
"""

import numpy as np
import pytest

pytest.importorskip("mitsuba", reason="needs the extra `synth`")

from isc_core.errors import InputError
from isc_core.shading.brdf.blinn_phong import BlinnPhong
from isc_core.shading.brdf.energy import directional_albedo
from isc_core.shading.brdf.ggx import Ggx
from isc_core.shading.brdf.lambert import Lambert
from isc_core.shading.brdf.model import Model
from isc_core.shading.brdf.oren_nayar import OrenNayar
from synth.rendering.bsdf_plugin import register
from synth.scene.variant import is_vectorised, load_mitsuba
from tests.synth.small_scenes import mitsuba_camera

SIZE, HALF = 24, 1.1
SUN = np.array([0.6, 0.0, 0.8])
LAMP = np.array([-1.5, 2.0, 2.5])
LIGHTS = {
    "directional": {
        "type": "directional",
        "direction": [-0.6, 0.0, -0.8],
        "irradiance": {"type": "rgb", "value": 1.0},
    },
    "point": {
        "type": "point",
        "position": [-1.5, 2.0, 2.5],
        "intensity": {"type": "rgb", "value": 1.0},
    },
}
BLACK, GREY = ({"type": "rgb", "value": [value] * 3} for value in (0.0, 0.5))
LOBES: dict[str, tuple[dict[str, object], Model]] = {
    "blinn_phong 8": (
        {"model": "blinn_phong", "albedo": BLACK, "gloss": 8.0, "strength": 0.3},
        BlinnPhong(0.3, 8.0),
    ),
    "blinn_phong 2000": (
        {"model": "blinn_phong", "albedo": BLACK, "gloss": 2000.0, "strength": 0.3},
        BlinnPhong(0.3, 2000.0),
    ),
    "ggx .05": (
        {"model": "ggx", "albedo": BLACK, "gloss": 0.05, "strength": 1.0, "ior": 1.5},
        Ggx(0.05, 0.04),
    ),
    "ggx .6": (
        {"model": "ggx", "albedo": BLACK, "gloss": 0.6, "strength": 1.0, "ior": 1.5},
        Ggx(0.6, 0.04),
    ),
    "lambert": ({"model": "lambert", "albedo": GREY}, Lambert(0.5)),
    "oren_nayar": ({"model": "oren_nayar", "albedo": GREY, "sigma": 0.4}, OrenNayar(0.5, 0.4)),
}


def rendered(bsdf: dict[str, object], light: dict[str, object], samples: int = 1) -> np.ndarray:
    """A unit sphere by Mitsuba's `direct` integrator, through pixel centres."""
    mi = load_mitsuba()
    sensor = mitsuba_camera(SIZE, HALF, samples)
    sphere = {"type": "sphere", "bsdf": bsdf}
    integrator = {"type": "direct", "hide_emitters": True}
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": integrator,
            "sphere": sphere,
            "light": light,
            "sensor": sensor,
        }
    )
    return np.array(mi.render(scene, spp=samples, seed=1))


def sphere_normals() -> tuple[np.ndarray, np.ndarray]:
    """Which pixels see the sphere except for its edge, and the normals there."""
    across = ((np.arange(SIZE) + 0.5) * 2 / SIZE - 1) * HALF
    x, y = np.meshgrid(across, -across)
    inside = x**2 + y**2 < 0.97
    return inside, np.stack([x, y, np.sqrt(np.maximum(1 - x**2 - y**2, 0))], -1)[inside]


def expected(model: Model, kind: str, normal: np.ndarray) -> np.ndarray:
    toward = np.broadcast_to(SUN, normal.shape) if kind == "directional" else LAMP - normal
    square = (toward**2).sum(axis=1)
    toward = toward / np.sqrt(square)[:, None]
    irradiance = np.maximum((normal * toward).sum(axis=1), 0) / (
        1 if kind == "directional" else square
    )
    return model.value(normal, np.array([0.0, 0.0, 1.0]), toward) * irradiance


@pytest.mark.parametrize("kind", LIGHTS)
@pytest.mark.parametrize("name", LOBES)
def test_each_pixel_of_the_plugin_is_the_models_value(name: str, kind: str) -> None:
    parameters, model = LOBES[name]
    inside, normal = sphere_normals()
    picture = rendered({"type": register(), **parameters}, LIGHTS[kind])[inside]
    value = expected(model, kind, normal)
    assert value.max() > 1e-3
    np.testing.assert_allclose(picture, np.repeat(value[:, None], 3, 1), atol=2e-5 * value.max())


@pytest.mark.parametrize("alpha", [0.05, 0.3])
def test_a_rough_conductor_of_mitsuba_that_mirrors_all_light_is_ggx(alpha: float) -> None:
    inside, normal = sphere_normals()
    conductor = {
        "type": "roughconductor",
        "material": "none",
        "distribution": "ggx",
        "alpha": alpha,
    }
    picture = rendered(conductor, LIGHTS["directional"])[inside][:, 0]
    value = expected(Ggx(alpha, 1.0), "directional", normal)
    np.testing.assert_allclose(picture, value, atol=1e-4 * value.max())


def test_the_plugin_evaluates_either_lobe_alone_and_they_add_up() -> None:
    mi = load_mitsuba()
    plugin = mi.load_dict(
        {"type": register(), "model": "ggx", "albedo": GREY, "gloss": 0.3, "strength": 0.7}
    )
    point = mi.SurfaceInteraction3f()
    point.wi = mi.Vector3f(0.0, 0.6, 0.8)
    light = mi.Vector3f(0.28, 0.0, 0.96)
    parts = [mi.BSDFFlags.DiffuseReflection, mi.BSDFFlags.GlossyReflection]
    contexts = [mi.BSDFContext(mi.TransportMode.Radiance, int(part)) for part in parts]
    body, gloss = (
        float(np.ravel(plugin.eval(context, point, light, True))[0]) for context in contexts
    )
    up, view, toward = np.array([0.0, 0, 1]), np.array([0.0, 0.6, 0.8]), np.array([0.28, 0.0, 0.96])
    assert body == pytest.approx(0.5 / np.pi * 0.96, rel=1e-5)
    assert gloss == pytest.approx(
        0.7 * float(Ggx(0.3, 0.04).value(up, view, toward)) * 0.96, rel=1e-5
    )


@pytest.mark.parametrize("name", ["blinn_phong 8", "ggx .6"])
def test_under_a_white_environment_mitsuba_sees_the_energy_of_the_lobe(name: str) -> None:
    if not is_vectorised():
        pytest.skip("thousands of paths through Python need CUDA or libLLVM 19 or later")
    parameters, model = LOBES[name]
    picture = rendered(
        {"type": register(), **parameters},
        {"type": "constant", "radiance": {"type": "rgb", "value": 1.0}},
        samples=512,
    )
    inside, normal = sphere_normals()
    # A pixel near the edge spans many views.
    some = np.flatnonzero(normal[:, 2] > 0.6)[::12]
    kept = np.array([float(directional_albedo(model, cosine)) for cosine in normal[some, 2]])
    assert picture[inside][some, 0].mean() == pytest.approx(kept.mean(), rel=0.02)
    np.testing.assert_allclose(picture[inside][some, 0], kept, rtol=0.15)


@pytest.mark.parametrize("model", ["roughplastic", "phong"])
def test_the_plugin_refuses_models_that_it_has_not(model: str) -> None:
    with pytest.raises((InputError, RuntimeError), match="blinn_phong, ggx"):
        load_mitsuba().load_dict({"type": register(), "model": model})
