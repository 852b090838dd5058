"""Laws that lit views obey in any light."""

import math
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("torch")

import torch
from scipy.spatial.transform import Rotation

from isc_core.shading.brdf.ggx import Ggx
from isc_core.shading.spherical_harmonics import real_sh
from tests.training.world.analytic_views import ellipsoid_view
from tests.training.world.test_recipes import ATLAS, bank
from training.world.lighting import (
    Lights,
    Material,
    basis_of,
    light_coefficients,
    light_views,
)
from training.world.lit_pictures import make_pictures
from training.world.pictures import stacked
from training.world.recipes import Shares, draw_recipe
from training.world.reflectance import reflected_share
from training.world.view_batches import ViewBatch, batch_of, prepared

FLOOR = 1e-4  # of the shading
ALPHAS = torch.tensor([0.06, 0.2, 0.55, 0.16])
HALVES = ((0.9, 0.9, 0.9), (0.5, 0.9, 0.7))
VIEWS = [ellipsoid_view(np.random.default_rng(k), half) for k, half in enumerate(HALVES)]


@pytest.fixture(scope="module")
def views() -> ViewBatch:
    return batch_of([prepared(view) for view in VIEWS])


def glossy(views: ViewBatch) -> Material:
    batch, pixels = views.thickness.shape
    generator = torch.Generator().manual_seed(3)
    return Material(
        torch.rand(batch, pixels, 3, generator=generator),
        torch.full((batch, pixels), 0.2),
        torch.full((batch, pixels, 3), 0.05),
        torch.tensor([0.0, 0.04]),
        torch.tensor([0.3, 0.0]),
        torch.zeros(batch),
    )


def in_light(seed: int) -> Lights:
    generator = torch.Generator().manual_seed(seed)
    turns = Rotation.random(2, random_state=seed).as_matrix()
    return Lights(
        torch.rand(2, len(ALPHAS), 3, 8, 16, generator=generator),
        ALPHAS,
        torch.from_numpy(turns).float(),
        torch.tensor([[3, 20, 9], [5, 1, 30]]),
        torch.rand(2, 3, 3, generator=generator),
        torch.tensor([[math.inf, 3, math.inf]] * 2),
        torch.tensor([[0.01, 0.01, 0.3]] * 2),
        torch.zeros(2, 9, 3),
        torch.zeros(2),
        torch.full((2,), 0.5),
    )


def dark(lights: Lights) -> Lights:
    return replace(lights, surroundings=0 * lights.surroundings, power=0 * lights.power)


def on_body(views: ViewBatch) -> torch.Tensor:
    return views.index < 160 * 160


def test_twice_the_light_is_twice_as_bright(views: ViewBatch) -> None:
    lights, material = in_light(0), glossy(views)
    double = replace(lights, surroundings=2 * lights.surroundings, power=2 * lights.power)
    once, twice = light_views(views, material, lights), light_views(views, material, double)
    for name in ("diffuse", "specular", "shading"):
        torch.testing.assert_close(
            getattr(twice, name), 2 * getattr(once, name), rtol=1e-5, atol=2 * FLOOR
        )


def test_the_light_of_two_sources_adds_up(views: ViewBatch) -> None:
    lights, material = in_light(1), glossy(views)
    whole = light_views(views, material, lights)
    around = light_views(views, material, replace(lights, power=0 * lights.power))
    lamps = light_views(views, material, replace(lights, surroundings=0 * lights.surroundings))
    for name in ("diffuse", "specular", "shading"):
        parts = getattr(around, name) + getattr(lamps, name)
        torch.testing.assert_close(getattr(whole, name), parts, rtol=1e-4, atol=3 * FLOOR)


def test_without_light_the_floor_is_left(views: ViewBatch) -> None:
    lit = light_views(views, glossy(views), dark(in_light(2)))
    assert (lit.shading == FLOOR).all() and (lit.specular == 0).all()
    assert lit.coefficients.isfinite().all()


def test_uniform_surroundings_shade_a_convex_body_evenly(views: ViewBatch) -> None:
    """But for what a normal sees of the part of the sphere behind the body, a fifth at most."""
    lights = dark(in_light(3))
    lights = replace(lights, surroundings=torch.ones_like(lights.surroundings))
    lit = light_views(views, glossy(views), lights)
    body, z = on_body(views), views.normal[..., 2]
    front = lit.shading[body & (z > 0.5)]
    assert (front - 1).abs().max() < 0.06 and abs(front.mean() - 1) < 0.02
    side = lit.shading[body & (z < 0.1)]
    assert side.min() > 0.78 and side.max() < 0.95
    toward = torch.tensor([0.0, 0, 1])
    assert (basis_of(toward) @ lit.coefficients).abs().max() < 0.05
    assert lit.coefficients[:, [1, 3, 4, 5, 7, 8]].abs().max() < 0.05


def test_the_light_of_a_body_does_not_depend_on_others_in_the_batch() -> None:
    """Half of the directions are hidden, so that the body lights itself."""
    views = [prepared(replace(one, visible=one.visible & np.uint8(0xAA))) for one in VIEWS]
    small, shares = views[1], Shares(kinds=(1, 0, 0), lights=(0, 0, 0, 1, 0))
    assert len(small.index) < 0.7 * len(views[0].index)
    rng = np.random.default_rng(4)
    recipes = [draw_recipe(v.directions, v.up, ATLAS, np.arange(1), rng, shares) for v in views]
    alone = make_pictures(batch_of([small]), stacked(recipes[1:]), bank())
    beside = make_pictures(batch_of(views), stacked(recipes), bank()).chosen(torch.tensor([1]))
    for name in ("layers", "ground"):
        torch.testing.assert_close(getattr(alone, name), getattr(beside, name))


def test_harmonics_that_are_given_are_the_shading(views: ViewBatch) -> None:
    rng = np.random.default_rng(4)
    harmonics = torch.from_numpy(rng.normal(0, 0.5, (2, 9, 3))).float()
    lights = replace(in_light(4), harmonics=harmonics, given=torch.ones(2))
    lit = light_views(views, glossy(views), lights)
    for k, normal in enumerate(views.normal.double().numpy()):
        wanted = np.exp(real_sh(normal) @ harmonics[k].double().numpy())
        np.testing.assert_allclose(lit.shading[k].numpy(), wanted, rtol=2e-5)
    assert (lit.specular == 0).all()
    torch.testing.assert_close(lit.coefficients, harmonics)


def test_the_basis_is_the_libraries() -> None:
    normal = np.random.default_rng(5).normal(size=(50, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    np.testing.assert_allclose(basis_of(torch.from_numpy(normal)).numpy(), real_sh(normal))


@pytest.mark.parametrize("angle", [90.0, 37.0])
def test_body_camera_and_light_turned_together_change_nothing(
    views: ViewBatch, angle: float
) -> None:
    lights, material = in_light(6), glossy(views)
    turn = torch.from_numpy(Rotation.from_euler("z", angle, degrees=True).as_matrix()).float()
    turned = replace(
        views,
        **{
            name: getattr(views, name) @ turn.T
            for name in ("normal", "position", "toward", "directions")
        },
    )
    before = light_views(views, material, lights)
    after = light_views(turned, material, replace(lights, turn=lights.turn @ turn.T))
    for name in ("diffuse", "specular", "shading"):
        torch.testing.assert_close(
            getattr(after, name), getattr(before, name), rtol=2e-3, atol=1e-4
        )
    probe = torch.randn(40, 3, generator=torch.Generator().manual_seed(0))
    probe = torch.nn.functional.normalize(probe, dim=1)
    probe[:, 2] = probe[:, 2].abs()
    # The fit's normals do not turn with it; it is one of all normals all the same.
    torch.testing.assert_close(
        basis_of(probe @ turn.T) @ after.coefficients,
        basis_of(probe) @ before.coefficients,
        rtol=0,
        atol=0.1,
    )


def test_harmonics_of_smooth_light_are_those_of_its_shading(views: ViewBatch) -> None:
    lights = dark(in_light(7))
    lights = replace(lights, surroundings=torch.ones_like(lights.surroundings))
    lights.surroundings[:, :, :, :4] *= 2  # from above
    lights = replace(lights, turn=torch.eye(3).expand(2, 3, 3))
    lit = light_views(views, glossy(views), lights)
    fitted = torch.exp(basis_of(views.normal) @ light_coefficients(views, lights))
    body = on_body(views) & (views.normal[..., 2] > 0.2)
    ratio = (fitted / lit.shading)[body]
    assert ratio.min() > 0.93 and ratio.max() < 1.1
    assert (lit.coefficients[:, 1] > 0.2).all()  # above is y


@pytest.mark.parametrize("alpha", [0.1, 0.3, 0.7])
@pytest.mark.parametrize("cosine", [0.15, 0.5, 1.0])
def test_the_share_of_uniform_light_is_the_integral_of_the_lobe(
    alpha: float, cosine: float
) -> None:
    side = 400
    up, turn = np.meshgrid((np.arange(side) + 0.5) / side, (np.arange(side) + 0.5) * np.pi / side)
    across = np.sqrt(1 - up**2)
    light = np.stack([across * np.cos(turn), across * np.sin(turn), up], -1)
    view = np.array([math.sqrt(1 - cosine**2), 0, cosine])
    lobe = Ggx(alpha, 0.06).value(np.array([0, 0, 1.0]), view, light)
    wanted = 2 * np.pi * (lobe * up).mean()
    numbers = torch.full((1, 3), 0.06), torch.tensor([[cosine]]), torch.tensor([[alpha]])
    assert reflected_share(*numbers)[0, 0].item() == pytest.approx(wanted, rel=0.03)
    assert (reflected_share(0 * numbers[0], *numbers[1:]) == 0).all()
