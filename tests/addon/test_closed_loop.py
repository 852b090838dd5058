"""The closed loop on an exact result: renders match the maps, under its own light and another."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.blender import closed_loop
from benchmarks.blender.closed_loop_cases import RelitTruth
from blender_addon.files.result_arrays import ResultArrays, read_result
from isc_core.evaluation.metrics import psnr
from isc_core.shading.environment_map import directions, shading_under

SAMPLES = 16


@pytest.fixture
def result(bump_folder: Path, blender: Any) -> ResultArrays:
    return read_result(bump_folder)


@pytest.mark.slow
def test_renders_match_the_recovered_maps(result: ResultArrays, tmp_path: Path) -> None:
    renders = closed_loop.Renders(result, tmp_path / "renders.npz", SAMPLES)
    row = closed_loop.loop_row("bump", renders)
    assert row.shading < 0.08
    assert row.inner <= row.shading
    assert row.diffuse > 30
    assert row.diffuse > row.diffuse_usual, (
        "Blender's usual filter smooths what the photo's camera has smoothed already"
    )
    assert row.image > 30
    assert row.image > row.no_gloss + 3, "the photo has a highlight, the diffuse object has none"
    assert (
        closed_loop.Renders(result, tmp_path / "renders.npz", SAMPLES).kept.keys()
        == renders.kept.keys()
    )
    assert closed_loop.loop_table([row]).count("\n") == 3


@pytest.mark.parametrize("light", ["sun", "sky"])
def test_a_new_light_has_the_given_strength_and_direction(result: ResultArrays, light: str) -> None:
    """A shallow dome has no shadows under light from the front: diffuse radiance is albedo *
    irradiance / pi.
    """
    from benchmarks.blender.renders import RenderVariant, render

    toward, irradiance, height = (
        np.array([0.48, -0.36, 0.8]),
        np.array([2.0, 1.5, 1.0]),
        directions(16)[..., :1],
    )
    sky = (
        np.full((16, 32, 3), 0.1)
        if light == "sun"
        else (1 + 0.8 * height) * np.array([0.2, 0.5, 0.8])
    )
    sun = irradiance if light == "sun" else np.zeros(3)
    normal = result.normal[result.mask].astype(float)
    truth = np.zeros_like(result.diffuse)
    shading = shading_under(sky, normal) + sun / np.pi * np.maximum(normal @ toward, 0)[:, None]
    truth[result.mask] = result.reflectance[result.mask] * shading
    got, _ = render(
        result,
        RenderVariant(own_shadows=False, relit=RelitTruth(light, sky, toward, sun, truth, truth)),
        SAMPLES,
    )
    assert (
        psnr(
            truth,
            got / result.reflectance_scale,
            result.mask,
            peak=closed_loop.white(truth, result.mask),
        )
        > 30
    )
    assert closed_loop.gain(truth, got, result.mask) == pytest.approx(
        1 / result.reflectance_scale, rel=0.02
    )


def test_emissive_materials_are_detected(result: ResultArrays) -> None:
    from benchmarks.blender.renders import emitting_nodes
    from blender_addon.scene import BuildOptions, build_object

    assert emitting_nodes(build_object(result, BuildOptions(specular_from="image")).material)
    for gloss in ("lobe", "none"):
        assert not emitting_nodes(build_object(result, BuildOptions(specular_from=gloss)).material)  # type: ignore[arg-type]


def test_own_shadows_are_on_in_shared_scenes_only(result: ResultArrays) -> None:
    from blender_addon.scene import BuildOptions, build_object

    def shadows(**options: Any) -> tuple[bool, bool]:
        obj = build_object(result, BuildOptions(**options)).object
        return obj.visible_shadow, obj.visible_diffuse

    assert shadows(name="alone") == (False, False)
    assert shadows(name="alone", own_shadows=True) == (True, True)
    assert shadows(name="alone") == (True, True), "built again, it stays as it was set"
    assert shadows(name="among others", own_scene=False) == (True, True)
    assert shadows(name="among others", own_scene=False, own_shadows=False) == (False, False)


def test_only_the_scale_of_a_relit_image_is_free() -> None:
    rng = np.random.default_rng(0)
    truth, mask = rng.uniform(0, 1, (8, 9, 3)), np.ones((8, 9), bool)
    seen = truth + rng.normal(0, 0.05, truth.shape)
    assert closed_loop.scaled_psnr(truth, seen, mask) == pytest.approx(
        closed_loop.scaled_psnr(truth, 7 * seen, mask)
    )
    assert (
        closed_loop.scaled_psnr(truth, seen * [1, 0.5, 0.5], mask)
        < closed_loop.scaled_psnr(truth, seen, mask) - 3
    )
    assert closed_loop.relative_rms(1.1 * truth, truth, mask) == pytest.approx(0.1)
