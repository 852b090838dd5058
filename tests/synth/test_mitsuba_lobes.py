"""Lighting of a surface by Mitsuba's kernels against closed forms, quadrature of the core's models,
and Mitsuba's own path tracer.
"""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mitsuba", reason="needs the extra `synth`")

from isc_core.errors import Cancelled, InputError
from isc_core.progress import Monitor
from isc_core.shading.brdf.blinn_phong import BlinnPhong
from isc_core.shading.brdf.energy import directional_albedo
from isc_core.shading.brdf.ggx import Ggx
from isc_core.shading.brdf.lambert import Lambert
from isc_core.shading.brdf.model import Model
from isc_core.shading.brdf.oren_nayar import OrenNayar
from isc_core.shading.environment_map import directions, shading_under, solid_angles
from isc_core.shading.radiance import directional, radiance
from isc_core.shading.spherical_harmonics import real_sh
from synth.rendering import Lit, RenderOptions, light_surface
from synth.rendering.irradiance import unoccluded_panel, unoccluded_shading
from synth.scene import Scene
from synth.scene.camera import Camera
from synth.scene.lights import (
    DirectionalLight,
    EnvironmentLight,
    Light,
    PanelLight,
    PointLight,
    panel_toward_origin,
)
from synth.scene.materials import Material
from synth.scene.meshes import Mesh, swept
from synth.scene.surface import Surface, find_surface
from synth.scene.tracing import Tracer
from synth.scene.variant import is_vectorised
from synth.validation.checks.pixel_test import PixelTestOptions, pixel_test

WHITE = np.ones((1, 1, 3))
MATERIALS: dict[str, tuple[Material, Model, Model]] = {
    "oren_nayar": (Material(WHITE, "oren_nayar", sigma=0.5), OrenNayar(1.0, 0.5), BlinnPhong(0.0)),
    "blinn_phong 20": (Material(WHITE, "blinn_phong", 20.0, 0.4), Lambert(), BlinnPhong(0.4, 20.0)),
    "blinn_phong 2000": (
        Material(WHITE, "blinn_phong", 2000.0, 0.1),
        Lambert(),
        BlinnPhong(0.1, 2000.0),
    ),
    "ggx .05": (Material(WHITE, "ggx", 0.05, 1.0), Lambert(), Ggx(0.05, 0.04)),
    "ggx .5": (Material(WHITE, "ggx", 0.5, 2.0, ior=1.8), Lambert(), Ggx(0.5, (0.8 / 2.8) ** 2)),
}
SUN = DirectionalLight(np.array([0.6, 0.0, 0.8]), np.array([1.0, 2.0, 3.0]))
LAMP = PointLight(np.array([-1.5, 1.0, 2.5]), np.array([3.0, 2.0, 1.0]))
PANEL = panel_toward_origin((1.2, 1.4, 1.8), (1.0, 0.6), (8.0, 6.0, 4.0))


def kernels_or_skip() -> None:
    if not is_vectorised():
        pytest.skip("Mitsuba's kernels need CUDA or libLLVM 19 or later")


def ball(rows: int = 97, bumps: float = 0.0) -> Mesh:
    """A unit sphere with exact normals, or a star with `bumps`."""
    polar, turn = np.meshgrid(
        np.linspace(0, np.pi, rows), np.linspace(0, 2 * np.pi, 2 * rows - 1), indexing="ij"
    )
    radius = 1 + bumps * np.sin(5 * turn) * np.sin(polar) ** 2
    mesh = swept(
        np.stack([np.sin(polar) * np.sin(turn), np.cos(polar), np.sin(polar) * np.cos(turn)], -1)
        * radius[..., None]
    )
    return mesh if bumps else Mesh(mesh.vertices, mesh.vertices, mesh.uv, mesh.faces)


def seen(mesh: Mesh, material: Material, size: int = 24) -> tuple[Surface, Tracer]:
    tracer = Tracer(mesh)
    return find_surface(
        Scene(mesh, material, (SUN,), Camera(size, size, size * 0.38)), tracer
    ), tracer


def lit(
    mesh: Mesh,
    material: Material,
    *lights: Light,
    size: int = 24,
    samples: int = 64,
    seed: int = 0,
    bounces: int = 0,
) -> tuple[Surface, Lit]:
    kernels_or_skip()
    surface, tracer = seen(mesh, material, size)
    options = RenderOptions(samples=samples, seed=seed, bounces=bounces, renderer="mitsuba")
    return surface, light_surface(surface, material, lights, tracer, options)


def sky(rows: int = 16, seed: int = 0) -> EnvironmentLight:
    """Noise with a bright window."""
    picture = 0.2 + np.random.default_rng(seed).random((rows, 2 * rows, 3))
    picture[rows // 4, rows + 2 : rows + 5] = (30, 20, 10)
    return EnvironmentLight(picture)


@pytest.mark.parametrize("name", MATERIALS)
def test_a_light_from_afar_gives_the_models_radiance_without_noise(name: str) -> None:
    material, body, gloss = MATERIALS[name]
    surface, found = lit(ball(), material, SUN)
    for part, model, strength in (
        (found.shading, body, 1.0),
        (found.specular, gloss, 2.0 if name == "ggx .5" else 1.0),
    ):
        expected = strength * radiance(
            model, surface.normal, surface.view, directional(SUN.direction, SUN.irradiance)
        )
        near_horizon = np.abs(surface.normal @ SUN.direction) < 0.02
        np.testing.assert_allclose(
            part[~near_horizon], expected[~near_horizon], atol=1e-4 * max(expected.max(), 1e-9)
        )
    assert not found.shading_variance.any() and not found.specular_variance.any()


def test_a_point_light_falls_off_with_the_square_of_its_distance() -> None:
    surface, found = lit(ball(), MATERIALS["blinn_phong 20"][0], LAMP)
    toward = LAMP.position - surface.position
    square = (toward**2).sum(axis=1, keepdims=True)
    expected = (
        np.maximum((surface.normal * toward).sum(axis=1, keepdims=True), 0)
        / square**1.5
        * LAMP.intensity
        / np.pi
    )
    away = np.abs((surface.normal * toward).sum(axis=1)) > 0.05
    np.testing.assert_allclose(found.shading[away], expected[away], atol=1e-4 * expected.max())


@pytest.mark.slow
def test_under_smooth_light_a_diffuse_ball_is_the_closed_form_without_noise() -> None:
    # Degree by degree the clamped cosine keeps pi, 2 pi / 3, pi / 4 of the light; the matt body
    # divides by pi.
    light = np.random.default_rng(3).normal(size=(9, 3)) * 0.1
    light[0] = 3.0
    rows = 96
    picture = real_sh(directions(rows)) @ light
    assert (picture > 0).all()
    surface, found = lit(ball(), Material(WHITE, "lambert"), EnvironmentLight(picture))
    kept = np.array([1] + [2 / 3] * 3 + [1 / 4] * 5)[:, None]
    expected = real_sh(surface.normal) @ (kept * light)
    np.testing.assert_allclose(found.shading, expected, rtol=5e-4)
    assert np.sqrt(found.shading_variance).max() < 1e-4 * expected.min()


@pytest.mark.slow
@pytest.mark.parametrize("name", MATERIALS)
def test_a_panel_is_the_quadrature_of_the_models(name: str) -> None:
    material, body, gloss = MATERIALS[name]
    surface, found = lit(ball(), material, PANEL, size=12, samples=512)
    step = (np.arange(96) + 0.5) / 48 - 1
    places = (
        PANEL.centre
        + np.repeat(step, 96)[:, None] * PANEL.right
        + np.tile(step, 96)[:, None] * PANEL.up
    )
    toward = places - surface.position[:, None]
    square = (toward**2).sum(axis=-1)
    toward /= np.sqrt(square)[..., None]
    weight = (
        np.maximum(np.einsum("npk,nk->np", toward, surface.normal), 0)
        * np.maximum(-toward @ PANEL.normal, 0)
        / square
        * PANEL.area
        / len(places)
    )
    strength = 2.0 if name == "ggx .5" else 1.0
    for part, variance, model, factor in (
        (found.shading, found.shading_variance, body, 1.0),
        (found.specular, found.specular_variance, gloss, strength),
    ):
        values = model.value(surface.normal[:, None], surface.view[:, None], toward)
        expected = factor * (values * weight).sum(axis=1)[:, None] * PANEL.radiance
        accept(part - expected, variance, 512, tolerance=2e-3 * max(expected.max(), 1e-9))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["blinn_phong 20", "blinn_phong 2000", "ggx .05", "ggx .5"])
def test_a_white_environment_shows_the_energy_of_the_lobe(name: str) -> None:
    material, _, gloss = MATERIALS[name]
    surface, found = lit(
        ball(), material, EnvironmentLight(np.ones((16, 32, 3))), size=12, samples=512
    )
    some = surface.normal[:, 2] > 0.3
    strength = 2.0 if name == "ggx .5" else 1.0
    expected = (
        strength
        * np.array(
            [float(directional_albedo(gloss, cosine)) for cosine in surface.normal[some, 2]]
        )[:, None]
    )
    difference, variance = found.specular[some, :1] - expected, found.specular_variance[some, :1]
    accept(difference, variance, 512, tolerance=1e-3 * expected.max())
    np.testing.assert_allclose(found.shading, 1.0, rtol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["oren_nayar", "blinn_phong 20", "ggx .5"])
def test_an_environment_matches_quadrature_of_the_models(name: str) -> None:
    material, body, gloss = MATERIALS[name]
    light = sky()
    surface, found = lit(ball(), material, light, size=12, samples=2048)
    rows, finer = len(light.radiance), 6
    toward = directions(rows * finer).reshape(-1, 3)
    power = (
        light.radiance[..., 0].repeat(finer, axis=0).repeat(finer, axis=1)
        * solid_angles(rows * finer)
    ).ravel()
    strength = 2.0 if name == "ggx .5" else 1.0
    for part, variance, model, factor in (
        (found.shading, found.shading_variance, body, 1.0),
        (found.specular, found.specular_variance, gloss, strength),
    ):
        expected = np.array(
            [
                factor
                * (model.value(normal, view, toward) * np.maximum(toward @ normal, 0))
                @ power
                for normal, view in zip(surface.normal, surface.view, strict=True)
            ]
        )
        accept(
            (part[:, 0] - expected)[:, None],
            variance[:, :1],
            2048,
            tolerance=2e-3 * max(expected.max(), 1e-9),
        )


def accept(difference: np.ndarray, variance: np.ndarray, samples: int, tolerance: float) -> None:
    """Each point up to its noise.

    Lists of points have no neighbours, so only the test of single pixels counts.
    """
    result = pixel_test(
        difference[None],
        variance[None],
        PixelTestOptions(level=1e-3, tolerance=tolerance, samples=samples),
    )
    assert result.beyond == 0, result.text()
    # All points together: a small bias that no single one shows. Those of different points are
    # independent.
    bias, noise = np.abs(difference[:, 0].mean()), np.sqrt(variance[:, 0].sum()) / len(variance)
    assert bias <= 4.5 * noise + tolerance / 4


@pytest.mark.slow
@pytest.mark.parametrize("light", [PANEL, sky()], ids=["panel", "sky"])
@pytest.mark.parametrize("name", ["ggx .05", "oren_nayar"])
def test_two_seeds_differ_by_their_noise_and_one_seed_does_not(name: str, light: Light) -> None:
    material = MATERIALS[name][0]
    renders = [lit(ball(bumps=0.25), material, light, seed=seed)[1] for seed in (0, 1, 0)]
    for part in ("shading", "specular"):
        first, second, again = (getattr(render, part) for render in renders)
        np.testing.assert_array_equal(first, again)
        variance = sum(getattr(render, f"{part}_variance") for render in renders[:2])
        accept(
            (first - second)[:, :1], variance[:, :1], 64, tolerance=1e-4 * max(first.max(), 1e-9)
        )
        if part == "shading":
            assert (first != second).any()
            shadowed = variance[:, 0] > 1e-10
            z = (first - second)[shadowed, 0] / np.sqrt(variance[shadowed, 0])
            assert 0.8 < z.std() < 1.15


@pytest.mark.slow
@pytest.mark.parametrize("model", ["blinn_phong", "roughplastic"])
def test_light_between_parts_of_the_object_is_that_of_mitsubas_path_tracer(model: str) -> None:
    kernels_or_skip()
    from synth.rendering.bsdf_plugin import register
    from synth.rendering.bsdfs import rough_plastic
    from synth.scene.variant import load_mitsuba

    mi = load_mitsuba()
    material = Material(
        np.full((1, 1, 3), 0.8), model, *((30.0, 0.3) if model == "blinn_phong" else (0.3, 1.0))
    )
    grey = {"type": "rgb", "value": [0.8] * 3}
    plugin = {
        "type": register(),
        "model": "blinn_phong",
        "albedo": grey,
        "gloss": 30.0,
        "strength": 0.3,
    }
    surface, found = lit(
        ball(bumps=0.35),
        material,
        EnvironmentLight(np.ones((8, 16, 3))),
        size=16,
        samples=256,
        bounces=2,
    )
    mesh = seen(ball(bumps=0.35), material, 16)[1].shape
    mesh.set_bsdf(mi.load_dict(plugin) if model == "blinn_phong" else rough_plastic(0.3, 1.5, grey))
    scene = mi.load_dict({"type": "scene", "object": mesh, "sky": {"type": "constant"}})
    samples = 256
    count = len(surface.position) * samples
    origin, toward = (
        np.repeat(part.T, samples, axis=1).astype(np.float32)
        for part in (surface.position + surface.view, -surface.view)
    )
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(0, count)
    integrator = mi.load_dict({"type": "path", "max_depth": 4, "rr_depth": 100})
    colour = integrator.sample(
        scene, sampler, mi.RayDifferential3f(mi.Point3f(origin), mi.Vector3f(toward))
    )[0]
    paths = np.array(colour)[0].reshape(-1, samples)
    total = 0.8 * found.shading[:, 0] + found.specular[:, 0]
    variance = (
        0.8 * found.shading_variance[:, 0]
        + found.specular_variance[:, 0]
        + paths.var(axis=1) / (samples - 1)
    )
    accept((total - paths.mean(axis=1))[:, None], variance[:, None], samples, tolerance=1e-4)
    assert total.mean() == pytest.approx(paths.mean(), rel=3e-3)
    assert (
        total.mean()
        > 1.01
        * (
            0.8
            * lit(ball(bumps=0.35), material, EnvironmentLight(np.ones((8, 16, 3))), size=16)[
                1
            ].shading
        ).mean()
    )


def test_the_lobes_do_not_change_when_the_points_are_taken_in_pieces(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    material = MATERIALS["ggx .5"][0]
    whole = lit(ball(), material, SUN, LAMP)[1]
    monkeypatch.setattr("synth.rendering.mitsuba_lobes._POINTS", 50)
    pieces = lit(ball(), material, SUN, LAMP)[1]
    np.testing.assert_allclose(pieces.specular, whole.specular, rtol=1e-6)


def test_gloss_and_strength_are_those_of_each_point() -> None:
    kernels_or_skip()
    surface, tracer = seen(ball(), MATERIALS["ggx .05"][0])
    material = MATERIALS["ggx .05"][0]
    options = RenderOptions(renderer="mitsuba")
    gloss, strength = (
        np.linspace(low, high, len(surface.position)) for low, high in ((0.05, 0.6), (0.0, 2.0))
    )
    varied = replace(
        surface, reflectance=replace(surface.reflectance, gloss=gloss, strength=strength)
    )
    found = light_surface(varied, material, (SUN,), tracer, options)
    expected = strength[:, None] * radiance(
        Ggx(gloss, 0.04), surface.normal, surface.view, directional(SUN.direction, SUN.irradiance)
    )
    np.testing.assert_allclose(found.specular, expected, atol=1e-4 * expected.max())


def test_lights_add_up_and_black_ones_give_nothing() -> None:
    material = MATERIALS["blinn_phong 20"][0]
    black = EnvironmentLight(np.zeros((8, 16, 3)))
    one, other = (lit(ball(), material, light)[1] for light in (SUN, LAMP))
    both = lit(ball(), material, SUN, black, LAMP)[1]
    np.testing.assert_allclose(both.shading, one.shading + other.shading, rtol=1e-6)
    np.testing.assert_allclose(both.specular, one.specular + other.specular, rtol=1e-6)


@pytest.mark.parametrize("samples", [2, 3, 5])
def test_few_samples_still_have_a_variance(samples: int) -> None:
    _, found = lit(ball(), MATERIALS["ggx .5"][0], sky(), samples=samples)
    assert np.isfinite(found.shading).all() and np.isfinite(found.specular).all()
    assert (found.specular_variance > 0).mean() > 0.9


def test_it_stops_when_cancelled() -> None:
    kernels_or_skip()
    surface, tracer = seen(ball(), MATERIALS["ggx .5"][0])
    with pytest.raises(Cancelled):
        light_surface(
            surface,
            MATERIALS["ggx .5"][0],
            (sky(),),
            tracer,
            RenderOptions(renderer="mitsuba"),
            Monitor(cancelled=lambda: True),
        )


@pytest.mark.slow
def test_shading_without_shadows_is_the_integral_over_pixels_of_constant_radiance() -> None:
    picture = sky().radiance
    normal = np.random.default_rng(1).normal(size=(300, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    fine = shading_under(picture.repeat(12, axis=0).repeat(12, axis=1), normal)
    np.testing.assert_allclose(unoccluded_shading(picture, normal), fine, rtol=2e-4)
    assert unoccluded_shading(picture, normal[:0]).shape == (0, 3)


@pytest.mark.slow
def test_a_panel_without_shadows_is_its_quadrature_also_where_the_horizon_cuts_it() -> None:
    random = np.random.default_rng(2)
    position, normal = random.uniform(-1, 1, size=(2, 200, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    panel = PanelLight(
        np.array([0.5, 1.0, 2.0]),
        np.array([0.8, 0.0, 0.0]),
        np.array([0.0, 0.4, 0.3]),
        np.array([1.0, 2.0, 3.0]),
    )
    step = (np.arange(200) + 0.5) / 100 - 1
    places = (
        panel.centre
        + np.repeat(step, 200)[:, None] * panel.right
        + np.tile(step, 200)[:, None] * panel.up
    )
    expected = np.zeros(200)
    for k in range(200):
        toward = places - position[k]
        square = (toward**2).sum(axis=1)
        expected[k] = (
            (
                np.maximum(toward @ normal[k], 0)
                * np.maximum(-toward @ panel.normal, 0)
                / square**2
            ).mean()
            * panel.area
            / np.pi
        )
    assert (expected == 0).any()
    np.testing.assert_allclose(
        unoccluded_panel(panel, position, normal),
        expected[:, None] * panel.radiance,
        atol=1e-4 * expected.max(),
    )


def test_without_llvm_the_message_names_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    surface, tracer = seen(ball(rows=9), Material(WHITE, "lambert"), 8)
    monkeypatch.setattr("synth.rendering.mitsuba_lobes.is_vectorised", lambda: False)
    with pytest.raises(InputError, match="libllvm19"):
        light_surface(
            surface, Material(WHITE, "lambert"), (SUN,), tracer, RenderOptions(renderer="mitsuba")
        )
