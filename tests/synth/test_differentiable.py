"""Derivatives of a rendered pixel that Dr.Jit carries through the plugin, against the hand-written
gradients of `isc_core.shading.brdf`.
"""

import numpy as np
import pytest

pytest.importorskip("mitsuba", reason="needs the extra `synth`")

from isc_core.shading.brdf.blinn_phong import BlinnPhong
from isc_core.shading.brdf.ggx import Ggx
from isc_core.shading.brdf.lambert import Lambert
from synth.rendering.bsdf_plugin import register
from synth.scene.variant import is_vectorised, load_mitsuba
from tests.synth.small_scenes import mitsuba_camera

SIZE = 16
SUN = np.array([0.6, 0.0, 0.8])
VIEW = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module", autouse=True)
def _gradients() -> None:
    if not is_vectorised():
        pytest.skip("scalar variants carry no gradients: needs CUDA or libLLVM 19 or later")


def pixels() -> tuple[np.ndarray, np.ndarray]:
    """Which pixels are well inside a unit sphere, and the normals there."""
    across = (np.arange(SIZE) + 0.5) * 2 / SIZE - 1
    x, y = np.meshgrid(across, -across)
    inside = x**2 + y**2 < 0.9
    return inside, np.stack([x, y, np.sqrt(np.maximum(1 - x**2 - y**2, 0))], -1)[inside]


def derivative(parameters: dict[str, object], name: str) -> np.ndarray:
    """How a picture (SIZE, SIZE, 3) of a sphere in the sun changes with a parameter of the plugin,
    by forward differentiation.
    """
    import drjit as dr

    mi = load_mitsuba()
    sensor = mitsuba_camera(SIZE)
    sun = {
        "type": "directional",
        "direction": (-SUN).tolist(),
        "irradiance": {"type": "rgb", "value": 1.0},
    }
    sphere = {"type": "sphere", "bsdf": {"type": register(), **parameters}}
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "direct"},
            "sphere": sphere,
            "sun": sun,
            "sensor": sensor,
        }
    )
    found = mi.traverse(scene)
    key = next(key for key in found.keys() if key.startswith(f"sphere.bsdf.{name}"))  # noqa: SIM118
    change = mi.Float(0.0)
    dr.enable_grad(change)
    found[key] = found[key] + change
    found.update()
    picture = mi.render(scene, params=found, spp=1)
    dr.forward(change)
    return np.array(dr.grad(picture))


def check(parameters: dict[str, object], name: str, by_parameter: np.ndarray) -> None:
    inside, normal = pixels()
    wanted = by_parameter * np.maximum(normal @ SUN, 0)
    found = derivative(parameters, name)[inside][:, 1]
    assert np.abs(wanted).max() > 1e-4
    np.testing.assert_allclose(found, wanted, atol=1e-3 * np.abs(wanted).max())


@pytest.mark.parametrize("alpha", [0.1, 0.5])
def test_by_the_roughness_of_facets(alpha: float) -> None:
    normal = pixels()[1]
    wanted = 0.8 * Ggx(alpha, 0.04).gradient(normal, VIEW, SUN).alpha
    check({"model": "ggx", "gloss": alpha, "strength": 0.8, "ior": 1.5}, "gloss", wanted)


@pytest.mark.parametrize("exponent", [10.0, 300.0])
def test_by_the_exponent(exponent: float) -> None:
    normal = pixels()[1]
    check(
        {"model": "blinn_phong", "gloss": exponent, "strength": 0.8},
        "gloss",
        BlinnPhong(0.8, exponent).gradient(normal, VIEW, SUN).exponent,
    )


def test_by_the_strength() -> None:
    normal = pixels()[1]
    check(
        {"model": "blinn_phong", "gloss": 20.0, "strength": 0.8},
        "strength",
        BlinnPhong(0.8, 20.0).gradient(normal, VIEW, SUN).strength,
    )


def test_by_the_albedo() -> None:
    normal = pixels()[1]
    grey = {"type": "rgb", "value": [0.4, 0.4, 0.4]}
    check(
        {"model": "ggx", "albedo": grey, "gloss": 0.3, "strength": 0.8},
        "albedo",
        Lambert(0.4).gradient(normal, VIEW, SUN).albedo,
    )
