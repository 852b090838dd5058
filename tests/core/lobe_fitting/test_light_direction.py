"""The optimal light direction: recovered where one light made the image, undetermined elsewhere."""

from dataclasses import replace

import numpy as np
import pytest

from isc_core.editing.spheres import render_sphere
from isc_core.lobe_fitting.light_direction import (
    explain_shading,
    explain_specular,
    lobe_light,
    main_light,
)
from isc_core.scene.decomposition import Decomposition
from isc_core.scene.lobe_fit import CONVENTION, Interval, LobeFit, LobeFitOutcome, LobeLight
from isc_core.shading.lights import DirectionalLight, toward
from tests.core.ball_scene import ball

LIGHTS = [(0.4, 0.5, 0.77), (-0.7, 0.2, 0.5), (0.1, 0.9, 0.3), (0.0, 0.0, 1.0), (0.8, -0.3, -0.2)]


def lit(scene: Decomposition, light: DirectionalLight) -> Decomposition:
    shading = np.where(scene.mask[..., None], light.shading(scene.normal), 0).astype(np.float32)
    return replace(scene, shading=shading, diffuse=scene.reflectance * shading)


def glossy(
    scene: Decomposition, light: np.ndarray, exponent: float, strength: np.ndarray
) -> Decomposition:
    specular = lobe_light(scene.normal, light, exponent)[..., None] * strength
    return replace(scene, specular=np.where(scene.mask[..., None], specular, 0).astype(np.float32))


def degrees(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.rad2deg(np.arccos(np.clip(a @ b, -1, 1))))


@pytest.mark.parametrize("exposure", [1e-6, 1e6])
def test_the_exposure_does_not_matter(exposure: float) -> None:
    d, factor = ball((48, 60), 20.0, (22.0, 33.0)), np.float32(exposure)
    other = replace(
        d, image=factor * d.image, specular=factor * d.specular, shading=factor * d.shading
    )
    for explain in (explain_shading, explain_specular):
        one, same = explain(d), explain(other)
        assert same.determined and same.explained == pytest.approx(one.explained, abs=1e-4)
        assert same.cone == pytest.approx(one.cone, rel=0.02, abs=0.01)
        assert degrees(one.light.direction, same.light.direction) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("direction", LIGHTS)
def test_a_lambert_ball_tells_its_light(direction: tuple[float, float, float]) -> None:
    true = DirectionalLight(
        toward(*direction), np.array([3.0, 2.5, 2.0]), np.array([0.1, 0.12, 0.2])
    )
    found = explain_shading(lit(ball(), true))
    assert degrees(found.light.direction, true.direction) < 1
    assert found.light.irradiance == pytest.approx(true.irradiance, rel=0.03)
    assert found.light.ambient == pytest.approx(true.ambient, abs=0.02)
    assert found.explained > 0.99
    assert found.cone < 1
    assert found.determined


@pytest.mark.slow
@pytest.mark.parametrize(
    ("direction", "exponent"),
    [(LIGHTS[0], 60.0), (LIGHTS[1], 12.0), (LIGHTS[2], 300.0), (LIGHTS[3], 60.0)],
)
def test_a_lobe_tells_its_light_and_exponent(
    direction: tuple[float, float, float], exponent: float
) -> None:
    light, strength = toward(*direction), np.array([0.5, 0.45, 0.4])
    found = explain_specular(glossy(ball(), light, exponent, strength))
    assert degrees(found.light.direction, light) < 1
    assert found.exponent == pytest.approx(exponent, rel=0.05)
    assert found.light.irradiance == pytest.approx(strength, rel=0.05)
    assert found.explained > 0.99
    assert found.determined


def test_outliers_hardly_move_the_light() -> None:
    true = DirectionalLight(toward(0.5, 0.4, 0.7))
    scene = lit(ball(), true)
    shading = scene.shading.copy()
    shading[30:36, 50:56] = 8.0
    assert (
        degrees(explain_shading(replace(scene, shading=shading)).light.direction, true.direction)
        < 3
    )


@pytest.mark.slow
def test_the_cone_holds_what_noise_in_blocks_does() -> None:
    """Errors that whole regions share move the direction by about what the cone says, not by the
    tiny error of single pixels.
    """
    generator = np.random.default_rng(3)
    true = DirectionalLight(toward(0.4, 0.5, 0.7))
    scene = lit(ball(), true)
    moved, cones = [], []
    for _ in range(6):
        patches = np.kron(generator.normal(0, 0.08, (12, 12)), np.ones((8, 10)))[..., None]
        found = explain_shading(
            replace(
                scene,
                shading=np.where(scene.mask[..., None], np.maximum(scene.shading + patches, 0), 0),
            )
        )
        moved.append(degrees(found.light.direction, true.direction))
        cones.append(found.cone)
    assert 0.4 < np.sqrt(np.mean(np.square(moved)) / 2) / np.mean(cones) < 2.5


def test_flat_light_and_no_gloss_are_undetermined() -> None:
    scene = ball()
    flat = replace(
        scene,
        shading=np.full_like(scene.shading, 0.5) * scene.mask[..., None].astype(np.float32),
        specular=np.zeros_like(scene.specular),
    )
    for found in (explain_shading(flat), explain_specular(flat)):
        assert found.explained == 0
        assert not found.determined


@pytest.mark.slow
def test_noise_everywhere_is_no_highlight() -> None:
    scene = ball()
    noise = np.random.default_rng(1).uniform(0, 0.2, (*scene.mask.shape, 1)) * scene.mask[..., None]
    clumps = replace(scene, specular=np.repeat(noise**4, 3, 2).astype(np.float32))
    assert explain_specular(clumps).explained < 0.5


def test_the_sphere_is_brightest_where_it_faces_the_light() -> None:
    color, coverage = render_sphere(DirectionalLight(toward(0.5, 0.5, 0.7)), size=101)
    row, column = np.unravel_index(int(np.argmax(color[..., 0] * (coverage == 1))), coverage.shape)
    assert [float(column - 50), float(50 - row)] == pytest.approx([0.5 / 0.995 * 45] * 2, abs=2)
    assert color.max() == pytest.approx(1.0, abs=1e-3)
    glint, _ = render_sphere(DirectionalLight(toward(0.5, 0.5, 0.7)), size=101, exponent=60.0)
    assert (glint >= color).all() and glint.max() > 1.05


@pytest.mark.slow
def test_specks_of_a_matt_object_tell_no_light() -> None:
    """Where the fit of the lobe says that there are next to no highlights, two faint pixels are no
    direction.
    """
    scene = ball()
    specks = np.zeros_like(scene.specular)
    specks[30:32, 40] = 0.01
    fit = LobeFit.without_lobe("ggx", LobeFitOutcome.NO_SPECULAR, specks.shape)
    diffuse_only = replace(scene, specular=specks, brdf=fit)
    assert not explain_specular(diffuse_only).determined
    assert explain_specular(replace(diffuse_only, brdf=None)).exponent is not None, (
        "without a fit whatever there is is explained"
    )


def test_the_main_light_is_that_of_a_lobe_which_explains_highlights_and_shading() -> None:
    true = DirectionalLight(toward(0.4, 0.5, 0.77), np.full(3, 3.0), np.full(3, 0.1))
    scene = lit(ball(), true)
    shading = explain_shading(scene).light.direction

    def main(direction: np.ndarray, explained: float) -> np.ndarray:
        one = np.ones(3)
        lamp = LobeLight(direction, 10.0, one, Interval(one, one))
        fit = LobeFit(
            CONVENTION["ggx"], LobeFitOutcome.DETERMINED, 0.2, Interval(0.1, 0.3), (lamp,), None,
            None, explained, np.zeros_like(scene.specular),
        )  # fmt: skip
        return main_light(replace(scene, brdf=fit)).light.direction

    near, far = toward(0.5, 0.5, 0.77), toward(-0.8, 0.1, 0.5)
    assert np.array_equal(main(near, 0.9), near)
    assert np.array_equal(main(near, 0.3), shading)  # its highlights lie elsewhere
    assert np.array_equal(main(far, 0.9), shading)  # nor does it light the object
