"""The renderer in plain arrays against closed forms, quadrature, Mitsuba's own material, and its
own statistics.
"""

import numpy as np
import pytest

pytest.importorskip("mitsuba", reason="needs the extra `synth`")

from isc_core.errors import Cancelled
from isc_core.progress import Monitor
from isc_core.shading.brdf import blinn_phong, ggx, lambert, oren_nayar
from isc_core.shading.brdf.energy import directional_albedo
from isc_core.shading.brdf.model import Model
from isc_core.shading.environment_map import directions, shading_under, solid_angles
from isc_core.shading.radiance import DistantLights, radiance
from synth.rendering import Lit, RenderOptions, array_lobes, light_surface
from synth.rendering.light_sampling import EnvironmentSampler, PanelSampler, sampler_of
from synth.rendering.reflection import Points, Reflection
from synth.rendering.rough_plastic import RoughPlastic, fresnel
from synth.scene.lights import (
    DirectionalLight,
    EnvironmentLight,
    Light,
    PanelLight,
    PointLight,
    panel_toward_origin,
)
from synth.scene.materials import Material
from synth.scene.variant import load_mitsuba
from synth.validation.checks.pixel_test import PixelTestOptions, pixel_test
from tests.synth.small_scenes import (
    GREY,
    Seen,
    ball,
    environment,
    lights,
    materials,
    seen,
    skittle,
    toward,
)

MODELS: dict[str, tuple[Model, Model | None]] = {
    "lambert": (lambert.Lambert(), None),
    "oren_nayar": (oren_nayar.OrenNayar(1.0, 0.5), None),
    "blinn_phong": (lambert.Lambert(), blinn_phong.BlinnPhong(0.1, 60.0)),
    "ggx": (lambert.Lambert(), ggx.Ggx(0.3, 0.04)),
}


@pytest.fixture(scope="module")
def sphere() -> Seen:
    return seen(ball(181))


@pytest.fixture(scope="module")
def waisted() -> Seen:
    return seen(skittle())


def lit(scene: Seen, material: Material, *lights: Light, samples: int = 32, **options: int) -> Lit:
    surface = scene.surface
    paint = material.at(surface.uv)
    surface = type(surface)(
        surface.mask, surface.position, surface.normal, surface.view, surface.uv, paint
    )
    return light_surface(
        surface,
        material,
        lights,
        scene.tracer,
        RenderOptions(samples=samples, renderer="arrays", **options),
    )


def points_seen_from(view: np.ndarray, strength: float, gloss: float, count: int = 1) -> Points:
    """Points at the origin whose normal is z."""
    up = np.broadcast_to([0.0, 0.0, 1.0], (count, 3))
    return Points(
        np.zeros((count, 3)),
        up,
        np.broadcast_to(view, (count, 3)),
        np.full(count, strength),
        np.full(count, gloss),
    )


@pytest.mark.parametrize("model", MODELS)
def test_a_distant_light_matches_the_reflectance_model(sphere: Seen, model: str) -> None:
    light = DirectionalLight(toward(-0.3, 0.4, 0.8), np.array([3.0, 2.0, 1.0]))
    result = lit(sphere, materials()[model], light)
    arriving = DistantLights(light.direction[None], light.irradiance[None])
    surface = sphere.surface
    body, gloss = MODELS[model]
    # Where the light grazes, the mesh's facets shade each other.
    clear = (surface.normal @ light.direction > 0.05) | (surface.normal @ light.direction < 0)
    wanted = radiance(body, surface.normal, surface.view, arriving)
    np.testing.assert_allclose(result.shading[clear], wanted[clear], rtol=1e-6)
    wanted = (
        radiance(gloss, surface.normal, surface.view, arriving) if gloss else np.zeros_like(wanted)
    )
    np.testing.assert_allclose(result.specular[clear], wanted[clear], rtol=1e-6)
    assert not result.shading_variance.any()
    assert not result.specular_variance.any()


def test_a_near_light_falls_off_with_the_square_of_its_distance(sphere: Seen) -> None:
    light = PointLight(np.array([0.5, 0.8, 2.5]), np.array([4.0, 5.0, 6.0]))
    result = lit(sphere, materials()["lambert"], light)
    surface = sphere.surface
    away = light.position - surface.position
    square = (away**2).sum(1)
    cosine = (surface.normal * away).sum(1) / np.sqrt(square)
    wanted = np.maximum(cosine, 0)[:, None] / np.pi * light.intensity / square[:, None]
    clear = np.abs(cosine) > 0.05
    np.testing.assert_allclose(result.shading[clear], wanted[clear], rtol=1e-6)


def test_the_white_furnace_has_no_noise(sphere: Seen) -> None:
    result = lit(sphere, materials()["lambert"], EnvironmentLight(np.ones((8, 16, 3))))
    # Facets stand in the way of grazing light, which counts for little.
    np.testing.assert_allclose(result.shading, 1, atol=2e-3)
    assert np.sqrt(result.shading_variance.max()) < 2e-3


@pytest.mark.slow
def test_a_diffuse_ball_under_an_environment_matches_the_closed_form(sphere: Seen) -> None:
    light = environment()
    result = lit(sphere, materials()["lambert"], light)
    fine = np.repeat(np.repeat(light.radiance, 8, 0), 8, 1)
    np.testing.assert_allclose(
        result.shading, shading_under(fine, sphere.surface.normal), rtol=5e-3
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", ["oren_nayar", "blinn_phong", "ggx"])
def test_lobes_under_an_environment_match_quadrature(sphere: Seen, name: str) -> None:
    light, rows = environment(), 128
    result = lit(sphere, materials()[name], light, samples=256)
    fine = np.repeat(np.repeat(light.radiance, rows // 16, 0), rows // 16, 1)
    arriving = DistantLights(
        directions(rows).reshape(-1, 3), (fine * solid_angles(rows)[..., None]).reshape(-1, 3)
    )
    chosen = np.random.default_rng(0).choice(len(sphere.surface.position), 36, replace=False)
    surface = sphere.surface
    for model, mean, variance in zip(
        MODELS[name],
        (result.shading, result.specular),
        (result.shading_variance, result.specular_variance),
        strict=True,
    ):
        if model is None:
            continue
        values = model.value(
            surface.normal[chosen, None], surface.view[chosen, None], arriving.directions
        )
        cosine = np.maximum(surface.normal[chosen] @ arriving.directions.T, 0)
        wanted = (values * cosine) @ arriving.irradiance
        difference = (mean[chosen] - wanted).reshape(6, 6, 3)
        test = pixel_test(
            difference,
            variance[chosen].reshape(6, 6, 3),
            PixelTestOptions(0.01, 2e-3 * wanted.max(), 256),
        )
        assert test.accepted, test.text()


@pytest.mark.slow
def test_the_gloss_of_a_panel_is_that_of_quadrature(sphere: Seen) -> None:
    panel = panel_toward_origin((-1.5, 1.5, 2.0), (1.5, 1.0), (5, 4, 3))
    result = lit(sphere, materials()["ggx"], panel, samples=256)
    surface, steps = sphere.surface, (np.arange(60) + 0.5) / 30 - 1
    across, along = (part.reshape(-1, 1) for part in np.meshgrid(steps, steps))
    toward_panel = (panel.centre + across * panel.right + along * panel.up) - surface.position[
        :, None
    ]
    square = (toward_panel**2).sum(-1)
    direction = toward_panel / np.sqrt(square)[..., None]
    values = ggx.Ggx(0.3, 0.04).value(surface.normal[:, None], surface.view[:, None], direction)
    solid = np.maximum(-(direction @ panel.normal), 0) * panel.area / len(across) / square
    cosine = np.maximum((direction * surface.normal[:, None]).sum(-1), 0)
    wanted = (values * cosine * solid).sum(1)[:, None] * panel.radiance
    test = pixel_test(
        surface.image(result.specular - wanted),
        surface.image(result.specular_variance),
        PixelTestOptions(0.01, 2e-3 * wanted.max(), 256),
    )
    assert test.accepted, test.text()


@pytest.mark.parametrize("cosine", [0.95, 0.3])
@pytest.mark.parametrize(
    ("model", "gloss"), [("blinn_phong", 20.0), ("blinn_phong", 800.0), ("ggx", 0.4), ("ggx", 0.05)]
)
def test_directions_drawn_by_the_gloss_integrate_it(
    model: str, gloss: float, cosine: float
) -> None:
    """The mean of f cos / density over sampled directions is the albedo of the lobe."""
    material = Material(GREY, model, gloss, 1.0)
    reflection = Reflection(material)
    view = np.array([np.sqrt(1 - cosine**2), 0, cosine])
    light = reflection.draw(np.random.default_rng(0), points_seen_from(view, 1.0, gloss), 40000)[0]
    np.testing.assert_allclose(np.linalg.norm(light, axis=1), 1, atol=1e-9)
    above = light[light[:, 2] > 1e-9]
    points = points_seen_from(view, 1.0, gloss, len(above))
    shares = reflection.gloss(points, above) * above[:, 2] / reflection.density(points, above)
    estimate, spread = shares.sum() / len(light), np.sqrt((shares**2).sum()) / len(light)
    lobe = (
        blinn_phong.BlinnPhong(1.0, gloss)
        if model == "blinn_phong"
        else ggx.Ggx(gloss, material.f0)
    )
    assert abs(estimate - float(directional_albedo(lobe, cosine))) < 4 * spread
    assert spread < 0.01 * estimate


def test_directions_toward_an_environment_integrate_its_light() -> None:
    light = environment()
    sampler = EnvironmentSampler(light)
    drawn = sampler.draw(np.random.default_rng(0), np.zeros((1, 3)), 20000)[0]
    found = sampler.seen(np.zeros((len(drawn), 3)), drawn)
    assert (found.density > 0).all()
    total = (found.radiance / found.density[:, None]).mean(0)
    np.testing.assert_allclose(
        total, (light.radiance * solid_angles(16)[..., None]).sum((0, 1)), rtol=0.03
    )


def test_an_environment_is_looked_up_in_the_direction_of_its_pixels() -> None:
    light = environment(rows=8)
    found = EnvironmentSampler(light).seen(np.zeros((128, 3)), directions(8).reshape(-1, 3))
    np.testing.assert_array_equal(found.radiance, light.radiance.reshape(-1, 3))


def test_a_panel_fills_its_solid_angle_and_has_a_back() -> None:
    panel = PanelLight(
        np.array([0.0, 0, 2]), np.array([0.7, 0, 0]), np.array([0, -0.4, 0]), np.ones(3)
    )  # shines toward -z
    sampler = PanelSampler(panel)
    place = np.zeros((1, 3))
    drawn = sampler.draw(np.random.default_rng(0), place, 20000)[0]
    found = sampler.seen(np.zeros((len(drawn), 3)), drawn)
    wanted = 4 * np.arctan(0.7 * 0.4 / (2 * np.sqrt(0.7**2 + 0.4**2 + 4)))
    np.testing.assert_allclose((1 / found.density).mean(), wanted, rtol=1e-3)
    behind = sampler.seen(np.array([[0.0, 0, 3]]), np.array([[0.0, 0, -1]]))
    assert not behind.radiance.any() and not behind.density.any()
    missed = sampler.seen(place, toward(0.5, 0, 1)[None])
    assert not missed.radiance.any()


def test_lights_that_are_black_or_without_size_are_not_sampled() -> None:
    assert sampler_of(EnvironmentLight(np.zeros((4, 8, 3)))) is None
    assert sampler_of(lights()["point"]) is None


@pytest.mark.parametrize("alpha", [0.05, 0.3])
def test_rough_plastic_is_mitsubas(alpha: float) -> None:
    mi, ior = load_mitsuba(), 1.5
    white = {"type": "rgb", "value": 1.0}
    plugin = {
        "type": "roughplastic",
        "distribution": "ggx",
        "alpha": alpha,
        "int_ior": ior,
        "ext_ior": 1.0,
    }
    theirs = mi.load_dict({**plugin, "nonlinear": False, "diffuse_reflectance": white})
    rng = np.random.default_rng(0)
    view = rng.normal(size=(60, 3)) * (1, 1, 0.5)
    light = np.where(
        np.arange(60)[:, None] < 30,
        view * (-1, -1, 1) + 0.1 * rng.normal(size=(60, 3)),
        rng.normal(size=(60, 3)),
    )
    view, light = (np.concatenate([part[:, :2], np.abs(part[:, 2:])], 1) for part in (view, light))
    view, light = (part / np.linalg.norm(part, axis=1, keepdims=True) for part in (view, light))
    ours = RoughPlastic(alpha, ior)
    for part, flag in (
        (ours.diffuse, mi.BSDFFlags.DiffuseReflection),
        (ours.gloss, mi.BSDFFlags.GlossyReflection),
    ):
        context = mi.BSDFContext()
        context.type_mask = flag
        wanted = []
        for a, b in zip(view.tolist(), light.tolist(), strict=True):
            point = mi.SurfaceInteraction3f()
            point.wi = mi.Vector3f(*a)
            wanted.append(float(np.ravel(theirs.eval(context, point, mi.Vector3f(*b)))[0]))
        np.testing.assert_allclose(
            part(np.array([0.0, 0, 1]), view, light) * light[:, 2], wanted, rtol=1e-3, atol=1e-7
        )


def test_fresnel_at_known_angles() -> None:
    assert fresnel(np.array(1.0), 1.5) == pytest.approx(0.04)
    assert fresnel(np.array(0.0), 1.5) == pytest.approx(1)
    brewster = np.cos(np.arctan(1.5))  # there only one polarisation is mirrored
    assert fresnel(np.array(brewster), 1.5) == pytest.approx(((1 - 1.5**2) / (1 + 1.5**2)) ** 2 / 2)


def test_full_shadow_is_black_and_nothing_is_negative(waisted: Seen) -> None:
    for light in (lights()["panel"], lights()["directional"], environment()):
        result = lit(waisted, materials()["blinn_phong"], light)
        assert result.specular.min() >= 0
        assert result.shading.min() > -0.01 * result.shading.max()
    behind = panel_toward_origin((0, 0, -3), (1, 1), (5, 5, 5))
    result = lit(waisted, materials()["blinn_phong"], behind)
    assert not result.shading[waisted.surface.normal[:, 2] > 0.5].any()


def test_the_object_shadows_itself(waisted: Seen) -> None:
    above = DirectionalLight(toward(0, 1, 0.05), np.ones(3))
    result = lit(waisted, materials()["lambert"], above)
    lambertian = np.maximum(waisted.surface.normal @ above.direction, 0) / np.pi
    shadowed = (result.shading[:, 0] == 0) & (lambertian > 0.05)
    assert 0.02 < shadowed.mean() < 0.5
    np.testing.assert_allclose(
        result.shading[~shadowed & (lambertian > 0.05), 0],
        lambertian[~shadowed & (lambertian > 0.05)],
        rtol=1e-6,
    )


@pytest.mark.parametrize("samples", [2, 3, 5])
def test_few_samples_have_a_variance_too(waisted: Seen, samples: int) -> None:
    result = lit(waisted, materials()["ggx"], environment(), samples=samples)
    # The body has none where no sample met a shadow.
    for variance, share in ((result.shading_variance, 0.1), (result.specular_variance, 0.8)):
        assert np.isfinite(variance).all()
        assert (variance.max(1) > 0).mean() > share


@pytest.mark.slow
@pytest.mark.parametrize("light", ["panel", "environment"])
def test_the_variance_is_that_of_repeated_renders(waisted: Seen, light: str) -> None:
    runs = [
        lit(waisted, materials()["blinn_phong"], lights()[light], samples=16, seed=seed)
        for seed in range(20)
    ]
    for mean, variance in (("shading", "shading_variance"), ("specular", "specular_variance")):
        between = np.var([getattr(run, mean) for run in runs], axis=0, ddof=1).mean()
        claimed = np.mean([getattr(run, variance) for run in runs])
        assert 0.8 < claimed / between < 1.25


def test_the_seed_decides_and_threads_do_not(
    waisted: Seen, monkeypatch: pytest.MonkeyPatch
) -> None:
    material = materials()["ggx"]
    both = (lights()["panel"], lights()["environment"])
    first, again, other = (
        lit(waisted, material, *both, samples=8, seed=seed) for seed in (1, 1, 2)
    )
    monkeypatch.setattr(array_lobes, "THREADS", 1)
    alone = lit(waisted, material, *both, samples=8, seed=1)
    for result in (again, alone):
        np.testing.assert_array_equal(result.shading, first.shading)
        np.testing.assert_array_equal(result.specular, first.specular)
    assert not np.array_equal(other.specular, first.specular)


def test_two_lights_add_up(waisted: Seen) -> None:
    material, (one, two) = materials()["blinn_phong"], (lights()["directional"], lights()["point"])
    together, apart = (
        lit(waisted, material, one, two),
        (lit(waisted, material, one), lit(waisted, material, two)),
    )
    np.testing.assert_allclose(together.shading, apart[0].shading + apart[1].shading)
    np.testing.assert_allclose(together.specular, apart[0].specular + apart[1].specular)


def test_a_white_object_in_a_white_environment_loses_no_light_with_bounces(waisted: Seen) -> None:
    """The furnace test of a concave object: shadowed light returns by interreflection."""
    white, light = Material(np.ones((2, 2, 3)), "lambert"), EnvironmentLight(np.ones((8, 16, 3)))
    dark, once, often = (
        lit(waisted, white, light, samples=64, bounces=bounces).shading for bounces in (0, 1, 8)
    )
    assert dark.mean() < 0.97
    assert dark.mean() < once.mean() < often.mean()
    np.testing.assert_allclose(often.mean(), 1, atol=3e-3)


def test_bounced_light_has_the_colour_of_the_surface_it_met(waisted: Seen) -> None:
    red, light = (
        Material(np.full((2, 2, 3), (0.8, 0.0, 0.4)), "blinn_phong", 50.0, 0.0),
        EnvironmentLight(np.ones((8, 16, 3))),
    )
    gained = (lit(waisted, red, light, bounces=1).shading - lit(waisted, red, light).shading).mean(
        0
    )
    assert gained[1] == pytest.approx(0, abs=1e-12)
    assert gained[2] == pytest.approx(gained[0] / 2, rel=1e-9)
    assert gained[0] > 0.01


def test_progress_rises_and_cancel_stops(waisted: Seen, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(array_lobes, "CHUNK", 512)
    shown: list[float] = []
    options = RenderOptions(samples=8, renderer="arrays", bounces=1)
    surface, material, both = (
        waisted.surface,
        materials()["lambert"],
        (lights()["panel"], lights()["environment"]),
    )
    light_surface(
        surface,
        material,
        both,
        waisted.tracer,
        options,
        Monitor(lambda event: shown.append(event.fraction)),
    )
    assert len(shown) > 10
    assert shown == sorted(shown)
    assert shown[0] >= 0 and shown[-1] <= 1
    with pytest.raises(Cancelled):
        light_surface(
            surface, material, both, waisted.tracer, options, Monitor(cancelled=lambda: True)
        )
