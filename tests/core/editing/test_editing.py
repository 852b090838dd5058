"""Edits: doing nothing changes nothing, layers stay apart, lights turn as rotations do, colours
change and textures do not.
"""

from dataclasses import replace

import numpy as np
import pytest

from isc_core.editing.blinn_phong_extension import Gloss, change_gloss, remapped
from isc_core.editing.chroma import from_oklab, to_oklab
from isc_core.editing.clusters import find_clusters
from isc_core.editing.dichromatic import DichromaticEdit, LayerEdit, edit_layers, masked_blur
from isc_core.editing.edited import light_color
from isc_core.editing.highlights import add_highlight
from isc_core.editing.recolour import ColourEdit, recolour
from isc_core.editing.relight import NewLight, Relighting, relight
from isc_core.errors import InputError
from isc_core.imaging.luminance import LUMINANCE, luminance, white_of
from isc_core.lobe_fitting.light_direction import explain_specular
from isc_core.scene.decomposition import Decomposition
from isc_core.scene.lobe_fit import Interval, LobeFit, LobeFitOutcome, LobeLight
from isc_core.shading.environment_map import directions, solid_angles
from isc_core.shading.lights import DirectionalLight, sphere_directions, toward, turn, turned_light
from isc_core.shading.lobe_rendering import Lobe, lobe_in_environment, lobe_under
from isc_core.shading.spherical_harmonics import real_sh
from tests.angles import degrees_between
from tests.core.ball_scene import LIGHT, ball


@pytest.fixture(scope="module")
def scene() -> Decomposition:
    """A ball with a residual where the highlight clips."""
    d = ball()
    residual = np.minimum(0.9 - d.diffuse - d.specular, 0) * d.mask[..., None]
    return replace(d, residual=residual, image=d.diffuse + d.specular + residual)


def test_edits_at_defaults_return_a_bit_identical_image(scene: Decomposition) -> None:
    for edit in (
        edit_layers(scene, DichromaticEdit()),
        recolour(scene, ColourEdit()),
        recolour(scene, ColourEdit(hue=360.0)),
        relight(scene, NewLight(coefficients=scene.illumination)),
        relight(
            scene,
            NewLight(coefficients=turned_light(scene.illumination, turn(yaw=360, pitch=-720))),
        ),
        change_gloss(scene, Gloss()),
        add_highlight(scene, DirectionalLight(toward(0, 0, 1)), level=0.0),
    ):
        assert np.array_equal(edit.image, scene.image)
        assert np.array_equal(edit.diffuse, scene.diffuse)
        assert np.array_equal(edit.specular, scene.specular)


@pytest.mark.slow
def test_no_edit_changes_the_scene_or_pixels_outside_the_mask(scene: Decomposition) -> None:
    before = scene.image.copy()
    sun = DirectionalLight(toward(-1, 1, 1), ambient=np.full(3, 0.2))
    for edit in (
        edit_layers(scene, DichromaticEdit(LayerEdit(2, 1.3, 0.5), LayerEdit(0.5, 0.6, 2))),
        recolour(scene, ColourEdit(hue=100, saturation=1.4, value=0.8)),
        relight(scene, NewLight(directional=sun), Relighting("render", Lobe(30))),
        change_gloss(scene, Gloss(exponent=200, present=60, metal=0.5)),
        add_highlight(scene, sun),
    ):
        assert not edit.image[~scene.mask].any()
        assert not np.array_equal(edit.image[scene.mask], scene.image[scene.mask])
        assert np.isfinite(edit.image).all() and (edit.image >= 0).all()
        assert edit.image.dtype == np.float32
    assert np.array_equal(scene.image, before)


# --- dichromatic ----------------------------------------------------------------------------------


def test_removing_a_layer_leaves_the_other(scene: Decomposition) -> None:
    diffuse_only = edit_layers(scene, DichromaticEdit(specular=LayerEdit(gain=0)))
    lit = scene.specular.any(-1)
    assert np.array_equal(diffuse_only.image[lit], scene.diffuse[lit])
    assert not diffuse_only.specular.any()
    gloss = edit_layers(scene, DichromaticEdit(diffuse=LayerEdit(gain=0)))
    assert np.array_equal(gloss.specular, scene.specular) and not gloss.diffuse.any()


def test_a_gain_is_linear(scene: Decomposition) -> None:
    clear = replace(
        scene, residual=np.zeros_like(scene.residual), image=scene.diffuse + scene.specular
    )
    images = [
        edit_layers(clear, DichromaticEdit(specular=LayerEdit(gain=g))).image for g in (1, 2, 3)
    ]
    assert np.abs(images[2] - images[1] - (images[1] - images[0])).max() < 1e-6
    assert np.abs(images[1] - images[0] - clear.specular).max() < 1e-6


def test_gamma_keeps_the_hue_and_the_white(scene: Decomposition) -> None:
    edit = edit_layers(scene, DichromaticEdit(diffuse=LayerEdit(gamma=2.0)))
    old, new = scene.diffuse[scene.mask], edit.diffuse[scene.mask]
    assert np.abs(new * old.max(-1, keepdims=True) - old * new.max(-1, keepdims=True)).max() < 1e-5
    white = np.percentile(old.max(-1), 99.5)
    level = old.max(-1) / white
    assert new.max(-1) / white == pytest.approx(level**2, abs=1e-5)


def test_sharpening_stays_inside_the_mask_and_flat_is_flat() -> None:
    mask = np.zeros((40, 40), bool)
    mask[8:30, 10:33] = True
    assert masked_blur(mask * 0.7, mask, 3.0)[mask] == pytest.approx(0.7)
    flat = replace(
        ball(), mask=np.ones((96, 120), bool), diffuse=np.full((96, 120, 3), 0.4, np.float32)
    )
    edit = edit_layers(flat, DichromaticEdit(diffuse=LayerEdit(sharpen=3.0)))
    assert edit.diffuse == pytest.approx(0.4, abs=1e-6)
    d = ball()
    contrast = [
        edit_layers(d, DichromaticEdit(diffuse=LayerEdit(sharpen=s))).diffuse[d.mask].std()
        for s in (-1, 0, 1)
    ]
    assert contrast[0] < contrast[1] < contrast[2]


# --- recolouring ----------------------------------------------------------------------------------


def test_oklab_is_there_and_back_and_grey_has_no_chroma() -> None:
    color = np.random.default_rng(0).uniform(0, 2, (100, 3))
    assert from_oklab(to_oklab(color)) == pytest.approx(color, abs=1e-9)
    assert to_oklab(np.ones(3)) == pytest.approx([1, 0, 0], abs=1e-4)
    assert to_oklab(np.array([1.0, 0, 0])) == pytest.approx([0.628, 0.2249, 0.1258], abs=1e-3)


def test_recolouring_leaves_gloss_shading_and_texture(scene: Decomposition) -> None:
    edit = recolour(scene, ColourEdit(hue=70, saturation=0.8))
    assert np.array_equal(edit.specular, scene.specular)
    new = edit.diffuse[scene.mask] / scene.shading[scene.mask] * light_color(scene)
    old = scene.reflectance[scene.mask] * light_color(scene)
    assert luminance(new) == pytest.approx(luminance(old), rel=1e-4)
    assert np.abs(new - old).max() > 0.05


def test_a_target_colour_is_reached_at_the_texture_s_luminance(scene: Decomposition) -> None:
    target = np.array([0.05, 0.2, 0.1])
    edit = recolour(scene, ColourEdit(target=target))
    new = edit.diffuse[scene.mask] / scene.shading[scene.mask] * light_color(scene)
    chroma = new / new.sum(-1, keepdims=True)
    assert chroma == pytest.approx(np.broadcast_to(target / target.sum(), chroma.shape), abs=0.02)
    bright = (
        recolour(scene, ColourEdit(target=target, target_luminance=True)).diffuse[scene.mask]
        / scene.shading[scene.mask]
    )
    assert luminance(bright * light_color(scene)).mean() == pytest.approx(
        target @ LUMINANCE, rel=0.01
    )


def test_no_colour_is_brighter_than_the_original_or_the_white_of_the_photo(
    scene: Decomposition,
) -> None:
    seen = scene.reflectance * light_color(scene)
    for bits in (8, 32):
        given = replace(scene, provenance=replace(scene.provenance, input={"bit_depth": bits}))
        edit = recolour(given, ColourEdit(target=np.array([0.0, 0.0, 1.0])))
        new = edit.diffuse[scene.mask] / scene.shading[scene.mask] * light_color(scene)
        white = 1.0 if bits == 8 else white_of(scene.image, scene.mask)
        assert (
            new.max()
            <= max(seen.max(), white / white_of(scene.shading / light_color(scene), scene.mask))
            * 1.001
        )
        assert luminance(new) == pytest.approx(luminance(seen[scene.mask]), rel=1e-4)


def pale(scene: Decomposition, bits: int, level: float) -> Decomposition:
    """The scene in grey, pale in the shadow; its brightest diffuse light is `level`."""
    lit = scene.shading[..., 1:2] > np.median(scene.shading[scene.mask, 1])
    grey = np.where(lit, 0.45, 0.95).astype(np.float32)
    reflectance = np.where(scene.mask[..., None], grey, 0) * np.ones(3, np.float32)
    gain = level / float((reflectance * scene.shading).max())
    diffuse = (gain * reflectance * scene.shading).astype(np.float32)
    return replace(
        scene,
        reflectance=reflectance,
        shading=(gain * scene.shading).astype(np.float32),
        diffuse=diffuse,
        image=diffuse + scene.specular,
        residual=0 * diffuse,
        provenance=replace(scene.provenance, input={"bit_depth": bits}),
    )


@pytest.mark.parametrize(
    "change",
    [
        ColourEdit(target=np.array([0.02, 0.05, 0.6])),
        ColourEdit(target=np.array([0.02, 0.05, 0.6]), saturation=2.0),
    ],
)
def test_a_new_colour_becomes_paler_instead_of_clipping(
    scene: Decomposition, change: ColourEdit
) -> None:
    given = pale(scene, bits=8, level=0.98)
    edit, inside = recolour(given, change), given.mask
    new, old = edit.diffuse[inside], given.diffuse[inside]
    assert new.max() <= 1.0001
    assert luminance(new) == pytest.approx(luminance(old), rel=0.1), "as bright in the picture"
    level, bluer = old.max(-1), (new[:, 2] / new[:, 0]) / (old[:, 2] / old[:, 0])
    assert bluer.min() > 0.95, "no other hue"
    assert np.median(bluer[level < np.median(level)]) > 1.5, "the colour is there in less light"
    assert not edit.notes
    floats = recolour(pale(scene, bits=32, level=0.98), change)
    assert floats.diffuse.max() > 1.2, "floats have no white"


def test_a_value_that_makes_the_object_brighter_than_white_is_noted(scene: Decomposition) -> None:
    given = pale(scene, bits=8, level=0.98)
    (note,) = recolour(given, ColourEdit(value=1.8)).notes
    assert "of the object is brighter than white and is clipped" in note
    assert not recolour(given, ColourEdit(value=0.8)).notes
    assert not recolour(pale(scene, bits=32, level=0.98), ColourEdit(value=1.8)).notes


def test_evenly_grey_paint_takes_colour(scene: Decomposition) -> None:
    grey = np.where(scene.mask[..., None], 0.2, 0).astype(np.float32) * np.ones(3, np.float32)
    diffuse = (grey * scene.shading).astype(np.float32)
    even = replace(
        scene,
        reflectance=grey,
        diffuse=diffuse,
        image=diffuse + scene.specular,
        residual=0 * diffuse,
    )
    red = recolour(even, ColourEdit(target=np.array([1.0, 0.0, 0.0]))).diffuse[scene.mask].mean(0)
    assert red[0] > 2 * red[1:].max()


def test_a_region_is_where_paint_changes(scene: Decomposition) -> None:
    region = np.zeros(scene.mask.shape)
    region[:, :60] = 1
    edit = recolour(scene, ColourEdit(hue=90), region)
    assert np.array_equal(edit.image[:, 60:], scene.image[:, 60:])
    assert not np.array_equal(edit.image[:, :60], scene.image[:, :60])


def test_clusters_are_the_paints_and_the_same_each_time(scene: Decomposition) -> None:
    found = find_clusters(scene, 2, seed=5)
    red = scene.reflectance[..., 0] > 0.3
    agreement = (found.labels[scene.mask] == 0) == red[scene.mask]
    assert agreement.mean() in (0.0, 1.0)
    assert np.array_equal(found.labels, find_clusters(scene, 2, seed=5).labels)
    assert found.shares.sum() == pytest.approx(1) and found.shares[0] >= found.shares[1]
    assert len(find_clusters(scene, 6).shares) == 2  # there are no more albedos
    for other in range(4):
        assert len(find_clusters(scene, 3, seed=other).shares) == 2
    weights = found.weight(1) + found.weight(2)
    assert weights[scene.mask] == pytest.approx(1, abs=1e-6)


def test_one_grey_paint_is_one_cluster(scene: Decomposition) -> None:
    grey = replace(
        scene,
        reflectance=np.where(scene.mask[..., None], 0.4, scene.reflectance * 0),
        shading=scene.shading * 0 + 0.5,
    )
    assert len(find_clusters(grey, 5).shares) == 1


# --- lights ---------------------------------------------------------------------------------------


def test_a_turned_light_shades_turned_normals() -> None:
    normals = sphere_directions(200)
    rotation = turn(33.0, -71.0, 140.0)
    turned = real_sh(normals) @ turned_light(LIGHT, rotation)
    assert np.abs(turned - real_sh(normals @ rotation) @ LIGHT).max() < 1e-12


def test_turns_compose_and_come_back() -> None:
    first, second = turn(20, 30, 40), turn(-50, 10, 5)
    twice = turned_light(turned_light(LIGHT, first), second)
    assert np.abs(twice - turned_light(LIGHT, second @ first)).max() < 1e-12
    assert np.abs(turned_light(turned_light(LIGHT, first), first.T) - LIGHT).max() < 1e-12
    assert np.array_equal(turned_light(LIGHT, turn(360, 360, -360)), LIGHT)


@pytest.mark.parametrize(
    ("angles", "start", "end"),
    [
        ((90, 0, 0), (0, 0, 1), (1, 0, 0)),
        ((0, 90, 0), (0, 1, 0), (0, 0, 1)),
        ((0, 0, 90), (1, 0, 0), (0, 1, 0)),
    ],
)
def test_yaw_pitch_and_roll_rotate_in_the_documented_directions(
    angles: tuple, start: tuple, end: tuple
) -> None:
    assert np.array_equal(turn(*angles) @ np.array(start, float), np.array(end, float))


def test_relighting_is_reflectance_times_shading(scene: Decomposition) -> None:
    sun = DirectionalLight(toward(0.3, 0.2, 0.9), np.array([3.0, 2.0, 1.0]), np.full(3, 0.1))
    edit = relight(scene, NewLight(directional=sun), Relighting("remove"))
    expected = scene.reflectance[scene.mask] * sun.shading(scene.normal[scene.mask])
    assert edit.diffuse[scene.mask] == pytest.approx(expected, abs=1e-5)
    assert not edit.specular.any()


def test_a_uniform_sky_shades_evenly_and_a_balanced_light_is_as_bright(
    scene: Decomposition,
) -> None:
    env_map = np.broadcast_to([0.5, 0.5, 0.5], (16, 32, 3))
    even = relight(scene, NewLight(environment=env_map), Relighting("remove"))
    assert even.diffuse[scene.mask] == pytest.approx(0.5 * scene.reflectance[scene.mask], rel=0.01)
    balanced = relight(scene, NewLight(environment=env_map), Relighting("remove", balanced=True))
    assert luminance(balanced.diffuse[scene.mask]).sum() == pytest.approx(
        luminance(scene.diffuse[scene.mask]).sum(), rel=1e-3
    )


@pytest.mark.slow
def test_highlights_are_kept_scaled_removed_or_rendered(scene: Decomposition) -> None:
    light = NewLight(coefficients=turned_light(scene.illumination, turn(yaw=80)))
    kept, scaled, removed = (
        relight(scene, light, Relighting(how)) for how in ("keep", "scale", "remove")
    )
    assert np.array_equal(kept.specular, scene.specular) and not removed.specular.any()
    ratio = kept.diffuse[scene.mask] / scene.diffuse[scene.mask]
    assert scaled.specular[scene.mask] == pytest.approx(
        scene.specular[scene.mask] * np.minimum(ratio, 4), abs=1e-5
    )
    assert relight(scene, light).notes
    rendered = relight(
        scene,
        NewLight(coefficients=scene.illumination),
        Relighting("render", Lobe(40), exposure=2.0),
    )
    assert luminance(rendered.specular[scene.mask]).sum() == pytest.approx(
        2 * luminance(scene.specular[scene.mask]).sum(), rel=1e-3
    )


def fitted(scene: Decomposition, determined: bool) -> Decomposition:
    alpha = 0.2 if determined else None
    outcome = LobeFitOutcome.DETERMINED if determined else LobeFitOutcome.SMOOTH_LIGHT
    return replace(
        scene,
        brdf=LobeFit("ggx: of the test", outcome, alpha, None, (), None, None, 0.9, scene.specular),
    )


@pytest.mark.slow
def test_a_fitted_lobe_is_rendered_and_an_undetermined_one_is_not(scene: Decomposition) -> None:
    light = NewLight(coefficients=turned_light(scene.illumination, turn(yaw=80)))
    by_fit = relight(fitted(scene, True), light)
    assert not any("no lobe" in note for note in by_fit.notes)
    assert np.array_equal(
        by_fit.specular, relight(scene, light, Relighting("render", Lobe(alpha=0.2))).specular
    )
    assert np.array_equal(
        relight(fitted(scene, False), light).specular,
        relight(scene, light, Relighting("scale")).specular,
    )
    bound = replace(
        scene,
        brdf=LobeFit(
            "ggx: of the test",
            LobeFitOutcome.NARROW,
            0.2,
            None,
            (),
            None,
            None,
            0.9,
            scene.specular,
        ),
    )
    assert np.array_equal(relight(bound, light).specular, by_fit.specular)
    sharper = change_gloss(fitted(scene, True), Gloss(exponent=100))
    assert np.array_equal(
        sharper.specular,
        change_gloss(scene, Gloss(exponent=100, present=Lobe(alpha=0.2).nearest_exponent)).specular,
    )


@pytest.mark.slow
@pytest.mark.parametrize("lobe", ["fitted", "none"])
def test_the_smallest_change_of_light_changes_least(scene: Decomposition, lobe: str) -> None:
    d = fitted(scene, lobe == "fitted")
    before = d.image[d.mask]
    for yaw, exposure, most in ((0.01, 1.0, 0.002), (0.0, 1.0001, 0.002), (1.0, 1.0, 0.2)):
        rotation = turn(yaw=yaw)
        light = NewLight(coefficients=turned_light(d.illumination, rotation), rotation=rotation)
        assert (
            np.abs(relight(d, light, Relighting(exposure=exposure)).image[d.mask] - before).max()
            < most * before.max()
        )


@pytest.mark.slow
def test_highlights_move_with_the_light_that_is_turned(scene: Decomposition) -> None:
    d, centres = fitted(scene, True), []
    columns = np.indices(d.mask.shape)[1]
    for yaw in (0.0, 30.0, 60.0):
        rotation = turn(yaw=yaw)
        new = relight(
            d, NewLight(coefficients=turned_light(d.illumination, rotation), rotation=rotation)
        ).specular
        weight = luminance(new) ** 2
        centres.append((weight * columns).sum() / weight.sum())
        assert luminance(new).max() <= 4 * luminance(d.specular).max()
    assert centres[0] + 3 < centres[1] < centres[2] - 3


def test_the_highlights_of_all_lamps_move(scene: Decomposition) -> None:
    lobe, unknown = Lobe(alpha=0.2), Interval(np.zeros(3), np.full(3, np.inf))
    lamps = [(toward(-0.6, 0.5, 0.6), 0.02), (toward(0.7, 0.3, 0.6), 0.014)]

    def layer(rotation: np.ndarray) -> np.ndarray:
        lit = [s * lobe_under(lobe, scene.normal, DirectionalLight(rotation @ l)) for l, s in lamps]
        return np.where(scene.mask[..., None], np.sum(lit, axis=0), 0).astype(np.float32)

    present, rotation = layer(np.eye(3)), turn(yaw=20)
    lights = tuple(LobeLight(l, 5.0, np.full(3, s), unknown) for l, s in lamps)
    found = LobeFit(
        "ggx: of the test", LobeFitOutcome.DETERMINED, 0.2, None, lights, None, None, 1.0, present
    )
    d = replace(scene, specular=present, image=scene.diffuse + present, brdf=found)
    light = NewLight(coefficients=turned_light(d.illumination, rotation), rotation=rotation)
    error = np.square(relight(d, light).specular - layer(rotation)).sum()
    assert error < 0.02 * np.square(layer(rotation)).sum()


def test_exposure_scales_highlights_as_everything_else(scene: Decomposition) -> None:
    light = NewLight(coefficients=scene.illumination)
    edit = relight(scene, light, Relighting("scale", exposure=8.0))
    assert np.allclose(edit.specular, 8 * scene.specular, rtol=1e-4)


@pytest.mark.slow
def test_highlights_are_removed_and_rendered_in_the_present_light_too(scene: Decomposition) -> None:
    light = NewLight(coefficients=scene.illumination)
    removed, rendered = (
        relight(scene, light, Relighting("remove")),
        relight(scene, light, Relighting("render", Lobe(200))),
    )
    assert not removed.specular.any() and np.array_equal(removed.diffuse, scene.diffuse)
    assert not np.allclose(rendered.specular, scene.specular, atol=0.01) and np.array_equal(
        rendered.diffuse, scene.diffuse
    )
    assert not np.array_equal(relight(scene, light, Relighting(lobe=Lobe(200))).image, scene.image)


# --- clipped highlights ---------------------------------------------------------------------------


def test_a_clipped_highlight_stays_white_on_other_paint(scene: Decomposition) -> None:
    """Light lost to clipping had the old albedo's colour: it does not determine the new one's."""
    light, full = scene.diffuse + scene.specular, 0.4
    d = replace(
        scene,
        residual=np.minimum(full - light, 0) * scene.mask[..., None],
        image=np.minimum(light, full) * scene.mask[..., None],
    )
    clipped = (d.residual < 0).all(-1) & (d.specular > full).all(-1)
    assert clipped.sum() > 5
    for edit in (
        recolour(d, ColourEdit(hue=180)),
        edit_layers(d, DichromaticEdit(diffuse=LayerEdit(gain=0.05))),
    ):
        assert (edit.image[clipped] >= full - 1e-6).all()
        assert (edit.image[clipped] <= 1.5 * full).all()


def test_what_was_cut_off_neither_stays_dark_in_more_light_nor_glows_in_less(
    scene: Decomposition,
) -> None:
    clipped = (scene.residual < -1e-3).any(-1)
    images = [
        edit_layers(scene, DichromaticEdit(LayerEdit(gain=g), LayerEdit(gain=g))).image
        for g in (0.1, 0.9, 0.999, 1.001, 2.0)
    ]
    for less, more in zip(images, images[1:], strict=False):
        assert (more[clipped] >= less[clipped] - 1e-6).all()
    assert images[4][clipped] == pytest.approx(2 * scene.image[clipped], rel=1e-5)
    assert images[0][clipped] == pytest.approx(
        0.1 * (scene.diffuse + scene.specular)[clipped], rel=1e-5
    )


# --- gloss ----------------------------------------------------------------------------------------


def test_a_lobe_in_a_sky_with_one_bright_spot_is_the_lobe_under_that_light() -> None:
    rows = 32
    env_map = np.zeros((rows, 2 * rows, 3))
    env_map[10, 36] = 5.0
    sun = DirectionalLight(directions(rows)[10, 36], env_map[10, 36] * solid_angles(rows)[10, 36])
    normals = sphere_directions(400)[:190]
    for lobe in (Lobe(30.0), Lobe(alpha=0.3)):
        expected = lobe_under(lobe, normals, sun)
        assert lobe_in_environment(lobe, normals, env_map) == pytest.approx(
            expected, abs=0.03 * expected.max()
        )


def test_remapping_makes_one_exponent_of_another(scene: Decomposition) -> None:
    z = np.where(scene.mask, scene.normal[..., 2], 0)[..., None]
    wide, sharp = (np.repeat((p + 8) * z.astype(float) ** p, 3, 2) for p in (20, 80))
    ones = np.ones_like(scene.mask)
    assert np.abs(remapped(wide, ones, 20, 80) - sharp).max() < 0.05 * sharp.max()
    assert np.array_equal(remapped(wide, ones, 20, 20), wide)


def test_a_wider_lobe_does_not_lift_the_edge_at_which_a_highlight_was_cut_off() -> None:
    y, x = np.mgrid[-1:1:61j, -1:1:61j]
    full = np.exp(-(x**2 + y**2) / 0.1)
    found = np.repeat(np.where(full > 0.05, full, 0)[..., None], 3, 2)
    wider = remapped(found, np.ones(full.shape, bool), 60, 24)[..., 0]
    edge = (full > 0.05) & (full < 0.07)
    assert wider[edge].max() < 0.18 * wider.max() and not wider[full <= 0.05].any()
    assert wider[(full > 0.5) & (full < 0.6)].min() > 0.6 * wider.max()


@pytest.mark.slow
def test_a_new_highlight_has_the_direction_of_its_light_and_keeps_the_energy(
    scene: Decomposition,
) -> None:
    light = DirectionalLight(toward(-0.6, 0.4, 0.7))
    edit = add_highlight(scene, light, Lobe(60.0), replacing=True)
    assert luminance(edit.specular).sum() == pytest.approx(
        luminance(scene.specular).sum(), rel=1e-4
    )
    found = explain_specular(replace(scene, specular=edit.specular))
    assert degrees_between(found.light.direction, light.direction) < 1
    assert found.exponent == pytest.approx(60, rel=0.05)
    added = add_highlight(scene, light, level=0.5)
    assert (added.specular >= scene.specular).all()
    assert (added.specular - scene.specular).max() == pytest.approx(
        0.5 * np.percentile(scene.image[scene.mask].max(-1), 99.5), rel=0.1
    )


def test_a_light_from_behind_gives_no_highlight_and_a_note(scene: Decomposition) -> None:
    edit = add_highlight(scene, DirectionalLight(toward(0, 0, -1)), level=1.0)
    assert np.array_equal(edit.image, scene.image) and edit.notes


def test_glossier_is_narrower_rougher_is_wider(scene: Decomposition) -> None:
    areas = []
    for exponent in (20.0, 60.0, 240.0):
        layer = change_gloss(scene, Gloss(exponent=exponent, present=60)).specular[..., 0]
        areas.append(int((layer > 0.3 * layer.max()).sum()))
    assert areas[0] > areas[1] > areas[2] > 0


def test_metal_has_no_body_and_the_colour_of_the_paint(scene: Decomposition) -> None:
    edit = change_gloss(scene, Gloss(metal=1.0))
    assert not edit.diffuse.any()
    red = scene.mask & (scene.reflectance[..., 0] > 0.3)
    color = edit.specular[red].sum(0)
    assert color[0] > 2 * color[2]


def test_metal_reflects_the_environment_by_the_new_lobe(scene: Decomposition) -> None:
    matt = replace(scene, specular=np.zeros_like(scene.specular))

    def reflected(**gloss: float) -> np.ndarray:
        return change_gloss(matt, Gloss(metal=1.0, **gloss)).specular

    assert np.array_equal(reflected(present=20, sharper=10), reflected(exponent=200))
    assert not np.array_equal(reflected(exponent=200), reflected(exponent=20))
    fit = LobeFit(
        "blinn_phong: of the test",
        LobeFitOutcome.DETERMINED,
        float(np.sqrt(2 / 202)),
        None,
        (),
        None,
        None,
        0.9,
        scene.specular,
    )
    matt = replace(matt, brdf=fit)
    assert reflected() == pytest.approx(reflected(exponent=200), abs=1e-6)


def test_gloss_is_remapped_where_no_light_explains_it(scene: Decomposition) -> None:
    outcome = LobeFitOutcome.NO_SPECULAR
    brdf = LobeFit("ggx: of the test", outcome, None, None, (), None, None, 0.0, scene.specular)
    d = replace(scene, brdf=brdf)
    rendered = change_gloss(d, Gloss(sharper=2.0, method="render"))
    assert np.array_equal(rendered.specular, change_gloss(d, Gloss(sharper=2.0)).specular)
    assert any("no single light explains" in note for note in rendered.notes)


def test_gloss_under_a_black_light_is_an_error(scene: Decomposition) -> None:
    black = DirectionalLight(toward(0, 0, 1), np.zeros(3))
    with pytest.raises(InputError, match="the light is black"):
        change_gloss(scene, Gloss(sharper=2.0, method="render"), black)


def test_gloss_of_a_diffuse_object_is_an_error(scene: Decomposition) -> None:
    diffuse_only = replace(
        scene,
        specular=np.zeros_like(scene.specular),
        residual=np.zeros_like(scene.residual),
        image=scene.diffuse,
    )
    edit = change_gloss(diffuse_only, Gloss(exponent=100))
    assert np.array_equal(edit.image, diffuse_only.image) and "no specular light" in edit.notes[0]


# --- what cannot be -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "make",
    [
        lambda: LayerEdit(gain=-1),
        lambda: LayerEdit(gamma=0),
        lambda: LayerEdit(radius=float("nan")),
        lambda: Gloss(exponent=0.5),
        lambda: Gloss(metal=1.5),
        lambda: Gloss(method="magic"),
        lambda: ColourEdit(saturation=-1),
        lambda: ColourEdit(target=np.array([2.0, 0, 0])),
        lambda: ColourEdit(target_luminance=True),
        lambda: Lobe(alpha=2.0),
        lambda: toward(0, 0, 0),
        lambda: DirectionalLight(np.array([1.0, 1, 1])),
        lambda: DirectionalLight(toward(0, 0, 1), irradiance=-np.ones(3)),
        lambda: NewLight(),
        lambda: NewLight(environment=np.ones((4, 9, 3))),
        lambda: NewLight(environment=np.ones(3)),
        lambda: NewLight(environment=np.ones((4, 8))),
        lambda: Relighting("somehow"),
        lambda: Relighting(exposure=0),
        lambda: turned_light(LIGHT, 2 * np.eye(3)),
        lambda: turn(yaw=float("inf")),
        lambda: find_clusters(ball(), 0),
        lambda: find_clusters(ball(), 2).weight(3),
        lambda: recolour(ball(), ColourEdit(hue=3), np.ones((3, 3))),
        lambda: recolour(ball(), ColourEdit(hue=3), np.zeros((96, 120))),
        lambda: relight(ball(), NewLight(directional=DirectionalLight(toward(0, 0, -1)))),
    ],
)
def test_impossible_parameters_are_one_clear_error(make: object) -> None:
    with pytest.raises(InputError) as refused:
        make()  # type: ignore[operator]
    assert "\n" not in str(refused.value)
