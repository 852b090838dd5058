"""Recipes: a member of a family is the same wherever it appears, a scene whenever it is made, and
held-out members never appear in train.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from isc_core.errors import InputError
from synth.albedos import ALBEDOS
from synth.capture.recipe import (
    FamilyMember,
    PictureSettings,
    Recipe,
    Sources,
    build,
    camera_around,
    photograph,
)
from synth.capture.sensor import Sensor
from synth.dataset.splits import SPLITS, Choices, Pools, make_pools
from synth.light_rigs import RIGS
from synth.scene import Scene
from synth.scene.lights import EnvironmentLight, PanelLight
from synth.scene.materials import DIFFUSE_MODELS, MODELS
from synth.shapes import SHAPES

SMALL = PictureSettings(size=32, samples=4, renderer="arrays")
RECIPE = Recipe(
    7,
    FamilyMember("lathe", 3),
    FamilyMember("blinn_phong", 2),
    "blinn_phong",
    "print",
    FamilyMember("area", 1),
    SMALL,
)
ASPECTS = ("shape", "material", "light")


def radiance(scene: Scene) -> np.ndarray:
    """Of the scene's first light."""
    light = scene.lights[0]
    assert isinstance(light, PanelLight | EnvironmentLight)
    return light.radiance


@pytest.fixture(scope="module")
def pools() -> Pools:
    return make_pools(Choices(), Sources())


@pytest.fixture(scope="module")
def names(pools: Pools) -> dict[str, dict[str, set[str]]]:
    """The members that appear in 3000 scenes, by split and aspect."""
    found: dict[str, dict[str, set[str]]] = {
        split: {aspect: set() for aspect in ASPECTS} for split in SPLITS
    }
    for seed in range(3000):
        recipe = pools.recipe(seed, SMALL, Sources())
        for aspect in ASPECTS:
            found[pools.split_of(seed)][aspect].add(getattr(recipe, aspect).name)
    return found


@pytest.mark.slow
def test_a_member_is_the_same_in_every_scene() -> None:
    one = build(RECIPE)
    other = build(
        replace(
            RECIPE,
            seed=8,
            material=FamilyMember("ggx", 4),
            model="ggx",
            light=FamilyMember("sh", 0),
        )
    )
    assert np.array_equal(one.mesh.vertices, other.mesh.vertices)
    assert one.camera.pixels_per_unit != other.camera.pixels_per_unit, (
        "framing belongs to the scene"
    )
    repainted = build(replace(RECIPE, shape=FamilyMember("blobby", 0), light=FamilyMember("sh", 0)))
    assert np.array_equal(one.material.albedo, repainted.material.albedo)
    assert np.array_equal(one.material.gloss, repainted.material.gloss)
    lit = build(replace(RECIPE, shape=FamilyMember("blobby", 0), material=FamilyMember("ggx", 4)))
    assert np.array_equal(radiance(one), radiance(lit))


def test_members_of_a_family_differ() -> None:
    meshes = [
        build(replace(RECIPE, shape=FamilyMember("lathe", number))).mesh.vertices
        for number in range(3)
    ]
    assert not np.array_equal(meshes[0], meshes[1])
    assert not np.array_equal(meshes[1], meshes[2])
    paints = [
        build(replace(RECIPE, material=FamilyMember("blinn_phong", number))).material.albedo
        for number in range(2)
    ]
    assert not np.array_equal(paints[0], paints[1])


def test_streams_of_a_member_and_of_a_scene_are_independent() -> None:
    part = FamilyMember("lathe", 3)
    drawn = [
        part.generator("shape").random(4),
        part.generator("light").random(4),
        FamilyMember("blobby", 3).generator("shape").random(4),
    ]
    drawn += [np.random.default_rng(RECIPE.stream(number)).random(4) for number in range(4)]
    assert len({tuple(values) for values in drawn}) == len(drawn)
    assert np.array_equal(part.generator("shape").random(4), drawn[0])


@pytest.mark.slow
@pytest.mark.parametrize("perspective", [False, True])
def test_the_object_fills_the_picture(perspective: bool) -> None:
    for shape in SHAPES:
        recipe = replace(
            RECIPE,
            shape=FamilyMember(shape, 1),
            picture=replace(SMALL, size=200, perspective=perspective),
        )
        scene = build(recipe)
        assert scene.camera.perspective == perspective
        distance = scene.camera.distance
        x, y, z = scene.mesh.vertices.T
        reach = np.abs([x, y]) / (1 - z / distance) * scene.camera.pixels_per_unit / 200
        assert 0.85 <= 2 * reach.max() <= 0.90
        if not perspective:
            assert abs(x.max() + x.min()) < 1e-9 and abs(y.max() + y.min()) < 1e-9


def test_a_camera_frames_a_mesh_that_is_near_it() -> None:
    mesh = build(RECIPE).mesh
    near = camera_around(mesh, 64, 0.9, perspective=True)
    assert near.pixels_per_unit < camera_around(mesh, 64, 0.9).pixels_per_unit * 1.2


@pytest.mark.slow
def test_the_same_recipe_gives_the_same_truth_well_exposed() -> None:
    pytest.importorskip("mitsuba", reason="needs the extra `synth`")
    _, one = photograph(RECIPE)
    scene, other = photograph(RECIPE)
    for name, values in one.arrays().items():
        np.testing.assert_allclose(other.arrays()[name], values, rtol=1e-6, atol=0, err_msg=name)
    assert 0.5 <= np.quantile(one.diffuse[one.mask], 0.995) <= 0.75
    brighter = replace(RECIPE, picture=replace(SMALL, exposure=0.3))
    scene_darker, darker = photograph(brighter)
    assert np.quantile(darker.diffuse[darker.mask], 0.995) == pytest.approx(0.3, rel=1e-5)
    gain = radiance(scene) / radiance(scene_darker)
    assert np.allclose(
        gain, (one.diffuse[one.mask] / darker.diffuse[darker.mask]).mean(), rtol=1e-4
    ), "the lights are those of the maps"


@pytest.mark.slow
def test_an_object_that_mirrors_more_than_it_scatters_is_not_burnt_out() -> None:
    pytest.importorskip("mitsuba", reason="needs the extra `synth`")
    dark = replace(
        RECIPE,
        shape=FamilyMember("height_field", 15),
        material=FamilyMember("blinn_phong", 17),
        albedo="grey",
        light=FamilyMember("sh", 3),
    )
    burnt = photograph(replace(dark, picture=replace(SMALL, exposure=0.75)))[1]
    truth = photograph(dark)[1]
    assert (burnt.image[burnt.mask] > 1).mean() > 0.3
    assert 0.09 < (truth.image[truth.mask] > 1).mean() < 0.11, "a tenth, to a pixel"


@pytest.mark.slow
def test_the_sensor_works_on_the_scene_of_the_seed() -> None:
    pytest.importorskip("mitsuba", reason="needs the extra `synth`")
    noisy = replace(RECIPE, picture=replace(SMALL, exposure=2.0, sensor=Sensor(noise=0.01, bits=8)))
    truth, other = photograph(noisy)[1], photograph(replace(noisy, seed=8))[1]
    assert truth.image.max() <= 1 < (truth.diffuse + truth.specular).max()
    assert truth.residual[truth.mask].any()
    assert not np.array_equal(truth.residual, other.residual)


@pytest.mark.slow
def test_what_is_held_out_is_never_in_train(names: dict[str, dict[str, set[str]]]) -> None:
    own = {
        "test_objects": {"shape"},
        "test_materials": {"material"},
        "test_lights": {"light"},
        "test": set(ASPECTS),
    }
    assert set(own) | {"train"} == set(SPLITS)
    for split, held_out in own.items():
        for aspect in ASPECTS:
            shared = names[split][aspect] & names["train"][aspect]
            assert (
                not shared if aspect in held_out else names[split][aspect] <= names["train"][aspect]
            ), (split, aspect)


@pytest.mark.slow
def test_train_and_test_show_every_family(names: dict[str, dict[str, set[str]]]) -> None:
    for split in SPLITS:
        for aspect, families in {
            "shape": SHAPES,
            "material": MODELS,
            "light": ("point", "directional", "area", "sh"),
        }.items():
            assert {name.rstrip("0123456789") for name in names[split][aspect]} == set(families), (
                split,
                aspect,
            )


def test_held_out_materials_have_every_albedo_and_most_are_glossy(pools: Pools) -> None:
    recipes = [pools.recipe(seed, SMALL, Sources()) for seed in range(1000)]
    held_out = {
        recipe.albedo for recipe in recipes if pools.split_of(recipe.seed) == "test_materials"
    }
    assert held_out == set(ALBEDOS)
    assert 0.1 < np.mean([recipe.model in DIFFUSE_MODELS for recipe in recipes]) < 0.25


def test_a_scene_depends_on_its_seed_alone(pools: Pools) -> None:
    again = make_pools(Choices(), Sources())
    assert [pools.recipe(seed, SMALL, Sources()) for seed in (3, 99)] == [
        again.recipe(seed, SMALL, Sources()) for seed in (3, 99)
    ]
    assert pools.split_of(13) == pools.split_of(3) == "test_objects"


def test_fewer_albedos_leave_the_names_of_materials() -> None:
    """blinn_phong08 is the same material whether all families were allowed or one."""
    few = make_pools(Choices(albedos=("print",)), Sources())
    all_of_them = {m.part.name: m.albedo for m in make_pools(Choices(), Sources()).material}
    assert all(all_of_them[m.part.name] == "print" for m in few.material)
    assert len(few.material) == len(all_of_them) / len(ALBEDOS)


def test_splits_that_cannot_be_made_are_left_out_or_refused() -> None:
    image = Sources(albedo_image=Path(__file__), mesh=Path(__file__))
    only = Choices(shapes=("mesh",), albedos=("image",))
    assert set(make_pools(only, image).pattern) == {"train", "test_materials", "test_lights"}
    with pytest.raises(InputError, match="test_objects is not possible"):
        make_pools(replace(only, splits=("train", "test_objects")), image)
    assert set(make_pools(Choices(splits=("test",)), Sources()).pattern) == {"test"}


@pytest.mark.parametrize(
    ("choices", "message"),
    [
        ({"shapes": ("teapot",)}, f"unknown shape 'teapot': choose {', '.join(SHAPES)}"),
        ({"materials": ("velvet",)}, "unknown material 'velvet': choose lambert"),
        ({"albedos": ("tartan",)}, "unknown albedo 'tartan': choose uniform"),
        ({"lights": ("laser",)}, f"unknown light 'laser': choose {', '.join(RIGS)}"),
        ({"splits": ("dev",)}, "unknown split 'dev': choose train"),
        ({"shapes": ()}, "at least one"),
        ({"shapes": ("lathe", "lathe")}, "once"),
    ],
)
def test_unknown_names_are_refused_with_the_known_ones(
    choices: dict[str, tuple[str, ...]], message: str
) -> None:
    with pytest.raises(InputError) as refused:
        Choices(**choices)
    assert message in str(refused.value)


@pytest.mark.parametrize(
    "choices",
    [
        {"shapes": ("mesh",)},
        {"shapes": ("height",)},
        {"albedos": ("image",)},
        {"lights": ("natural",)},
    ],
)
def test_families_of_files_need_their_files(choices: dict[str, tuple[str, ...]]) -> None:
    with pytest.raises(InputError, match="read from"):
        make_pools(Choices(**choices), Sources())


@pytest.mark.parametrize(
    "wrong",
    [
        {"size": 4},
        {"size": 5000},
        {"samples": 1},
        {"bounces": 9},
        {"exposure": 0.0},
        {"exposure": np.nan},
    ],
)
def test_impossible_pictures_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError):
        PictureSettings(**wrong)


@pytest.mark.slow
def test_natural_lights_differ_by_their_number(shared: Path) -> None:
    sources = Sources(natural_lights=shared / "data" / "mit_berkeley_train")
    lights = make_pools(Choices(lights=("natural",)), sources).light
    assert len(lights) > 100
    one, other = (
        radiance(build(replace(RECIPE, light=m.part, sources=sources))) for m in lights[:2]
    )
    assert not np.allclose(one, other)
