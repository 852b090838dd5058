"""Recipes are those that the shares ask for, and paint what they say."""

import math
from dataclasses import replace
from enum import IntEnum

import numpy as np
import pytest

pytest.importorskip("torch")

import torch

from tests.training.world.analytic_views import ellipsoid_view
from training.world.patterns import Atlas
from training.world.pictures import Bank, lights_of, lit_pictures, material_of, stacked
from training.world.recipes import (
    LAMPS,
    Kind,
    LightKind,
    Paint,
    Recipe,
    Shares,
    draw_recipe,
    lamp_places,
)
from training.world.view_batches import batch_of, prepared
from training.world.views import spread_directions

MAPS = 14
DIRECTIONS = spread_directions(np.random.default_rng(0))
GREY = np.random.default_rng(0).integers(0, 256, (MAPS, 8, 8)).astype(np.uint8)
ATLAS = Atlas(GREY, np.arange(MAPS).astype(np.uint8), np.ones(MAPS, bool))


def bank() -> Bank:
    maps = torch.rand(3, 6, 3, 8, 16, generator=torch.Generator().manual_seed(0))
    return Bank(maps, torch.from_numpy(ATLAS.maps[:, None]).float() / 255)


def only(kind: type[IntEnum], one: int) -> tuple[float, ...]:
    return tuple(float(each == one) for each in kind)


def drawn(
    seed: int, shares: Shares, count: int = 40, up: tuple[float, ...] = (0, 0, 0)
) -> list[Recipe]:
    rng, known = np.random.default_rng(seed), np.array([0, 2])
    return [draw_recipe(DIRECTIONS, np.array(up), ATLAS, known, rng, shares) for _ in range(count)]


def test_recipes_are_possible_and_repeat_with_the_seed() -> None:
    for one, again in zip(drawn(1, Shares()), drawn(1, Shares()), strict=True):
        for name, value in vars(one).items():
            np.testing.assert_array_equal(value, getattr(again, name))
        for name in ("base", "colours", "strengths", "front"):
            assert (getattr(one, name) >= 0).all() and (getattr(one, name) <= 1).all()
        assert 0.02 < one.alpha < 0.7 and one.environment in (0, 2)
        assert (one.maps < MAPS).all() and np.isfinite(one.frames).all()
        np.testing.assert_allclose(one.turn @ one.turn.T, np.eye(3), atol=1e-9)
        assert (one.power >= 0).all() and (one.ambient > 0).all() and (one.distance > 1.5).all()


@pytest.mark.parametrize("light", LightKind)
def test_lamps_are_as_many_as_the_kind_of_light_says(light: LightKind) -> None:
    counts = {
        LightKind.HARMONICS: {0},
        LightKind.AROUND: {0},
        LightKind.ONE_LAMP: {1},
        LightKind.LAMPS: {2, 3, 4},
        LightKind.LABORATORY: {1},
    }
    recipes = drawn(2, Shares(kinds=(1, 0, 0), lights=only(LightKind, light)))
    found = {int((one.power.max(1) > 0).sum()) for one in recipes}
    assert found == counts[light]
    assert {one.given for one in recipes} == {float(light == LightKind.HARMONICS)}


def test_what_an_ablation_sets_to_zero_does_not_occur() -> None:
    plain = Shares(kinds=(1, 0, 0), paints=only(Paint, Paint.FEW), printed=0, matte=1, coated=0)
    for one in drawn(3, plain):
        assert one.kind == Kind.OPAQUE and one.strengths[2] == 0
        assert not one.front.any() and one.coat == 0


def test_mirrors_and_glass_are_lit_by_their_surroundings() -> None:
    for kind in (Kind.MIRROR, Kind.GLASS):
        for one in drawn(4, Shares(kinds=only(Kind, kind))):
            assert one.kind == kind and one.given == 0 and one.coat == 0
    assert all(one.front.min() > 0.1 for one in drawn(4, Shares(kinds=only(Kind, Kind.MIRROR))))


def test_lamps_are_apart_and_the_first_is_in_front() -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        places = lamp_places(DIRECTIONS, rng, LAMPS)
        towards = DIRECTIONS[places]
        assert len(set(places.tolist())) == LAMPS and towards[0, 2] > 0.17
        apart = (towards @ towards.T)[np.triu_indices(LAMPS, 1)]
        assert apart.max() < math.cos(math.radians(30)) and towards[:, 2].min() > -0.3


def test_bodies_on_a_table_are_lit_from_above_it() -> None:
    up = np.array([0.1, 0.8, 0.5]) / np.linalg.norm([0.1, 0.8, 0.5])
    recipes = drawn(6, Shares(stretch=0.0), 60, tuple(up))
    standing = [one for one in recipes if one.standing]
    assert 15 < len(standing) < 50
    for one in standing:
        np.testing.assert_allclose(one.turn @ up, (0, 1, 0), atol=1e-9)
        assert (DIRECTIONS[one.lamp] @ up > 0).all() and (one.table > 0).all()
        np.testing.assert_allclose(one.table_light, (DIRECTIONS[one.lamp] @ up) @ one.power)
    assert not any(one.standing for one in drawn(6, Shares(), up=(0, 1, -0.3)))
    assert not any(one.standing or one.table.any() for one in drawn(6, Shares()))


def test_lamps_are_above_the_table_of_a_stretched_body() -> None:
    up = np.array([0.1, 0.8, 0.5]) / np.linalg.norm([0.1, 0.8, 0.5])
    for one in drawn(8, Shares(stretch=0.6), 200, tuple(up)):
        if one.standing:
            lamps = DIRECTIONS[one.lamp] * one.stretch
            table = up / one.stretch
            height = lamps @ table / np.linalg.norm(lamps, axis=1) / np.linalg.norm(table)
            assert (height > 0).all()
            np.testing.assert_allclose(one.table_light, height @ one.power)


def test_a_table_shows_what_falls_on_it() -> None:
    up = (0.0, 0.8, 0.6)
    recipes = [one for one in drawn(7, Shares(), 60, up) if one.standing][:6]
    numbers = stacked(recipes)
    white = replace(bank(), maps=torch.ones(3, 6, 3, 32, 64))
    around = lights_of(numbers, white).surroundings
    for k, one in enumerate(recipes):
        lit = one.table * (one.ambient + one.table_light)
        for level in range(6):
            above, below = around[k, level, :, 0, 0], around[k, level, :, -1, 0]
            blur = 0.04 * torch.from_numpy(np.abs(lit - one.ambient))
            assert ((above - one.ambient).abs() < blur + 1e-3).all()
            assert ((below - lit).abs() < blur + 1e-3).all()


def test_painted_views_follow_their_recipes() -> None:
    recipes = drawn(5, Shares(), 6)
    views = batch_of([prepared(ellipsoid_view(np.random.default_rng(k))) for k in range(6)])
    numbers = stacked(recipes)
    material, lights = material_of(views, numbers, bank()), lights_of(numbers, bank())
    assert material.albedo.min() >= 0 and material.albedo.max() <= 0.95
    assert material.alpha.min() >= 0.03 and material.alpha.max() <= 0.8
    for k, one in enumerate(recipes):
        if one.kind == Kind.MIRROR:
            assert not material.albedo[k].any()
        elif not one.strengths.any():
            np.testing.assert_allclose(material.albedo[k, 0], one.base, rtol=1e-6)
            assert (material.albedo[k] == material.albedo[k, :1]).all()
        np.testing.assert_allclose(lights.power[k], one.power, rtol=1e-6)
    lit = lit_pictures(views, numbers, bank())
    for part in (lit.diffuse, lit.specular, lit.shading, lit.coefficients):
        assert part.isfinite().all()
    assert lit.diffuse.min() >= 0 and lit.specular.min() >= 0


def test_recipes_without_patterns_at_hand_still_work() -> None:
    atlas = Atlas(GREY[:1], np.zeros(1, np.uint8), np.ones(1, bool))
    one = draw_recipe(
        DIRECTIONS, np.zeros(3), atlas, np.array([0]), np.random.default_rng(0), Shares()
    )
    assert (one.maps == 0).all()


def test_prints_are_white_on_a_strong_colour_or_the_reverse() -> None:
    def saturation(colour: np.ndarray) -> float:
        return 1 - float(colour.min() / colour.max())

    recipes = drawn(4, Shares(kinds=(1, 0, 0), white=1.0))
    pairs = [(one.base, one.colours[1]) for one in recipes]
    for base, ink in pairs:
        white, strong = sorted((base, ink), key=saturation)
        assert saturation(white) < 0.2 and white.max() > 0.45 and saturation(strong) > 0.4
    assert 0 < sum(saturation(base) < 0.2 for base, _ in pairs) < len(pairs) / 2
    assert all(one.strengths[1] > 0.6 for one in recipes)
    for one, other in zip(drawn(5, Shares()), drawn(5, Shares(white=0.0)), strict=True):
        np.testing.assert_array_equal(one.colours, other.colours)
