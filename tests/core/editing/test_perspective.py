"""Edits of results with a perspective camera: highlights are at the mirror direction."""

from dataclasses import replace

import numpy as np
import pytest

from isc_core.editing.blinn_phong_extension import Gloss, change_gloss
from isc_core.editing.highlights import add_highlight
from isc_core.editing.recolour import ColourEdit, recolour
from isc_core.editing.relight import NewLight, Relighting, relight
from isc_core.lobe_fitting.light_direction import explain_specular
from isc_core.scene.decomposition import Decomposition
from isc_core.shading.environment_map import directions
from isc_core.shading.lights import DirectionalLight, turn, turned_light
from isc_core.shading.lobe_rendering import Lobe, lobe_in_environment, lobe_under
from tests.angles import degrees_between
from tests.core.perspective_scene import bump_before_camera

LIGHT = DirectionalLight(np.array([-0.35, 0.35, 0.87]) / np.linalg.norm([-0.35, 0.35, 0.87]))


def mirrored(d: Decomposition) -> np.ndarray:
    """Directions (H, W, 3) that the surface mirrors to the camera."""
    return np.asarray(2 * (d.normal * d.view).sum(-1, keepdims=True) * d.normal - d.view)


def angle_of_peak(d: Decomposition, layer: np.ndarray) -> float:
    """Degrees between `LIGHT` and what the brightest pixels of a layer mirror."""
    level = np.where(d.mask, layer.sum(-1), 0)
    weight = np.where(level > 0.8 * level.max(), level, 0)[..., None]
    mean = (weight * mirrored(d)).sum((0, 1))
    return float(degrees_between(mean, LIGHT.direction))


def test_a_new_highlight_mirrors_its_light_to_the_camera() -> None:
    d = bump_before_camera()
    edit = add_highlight(d, LIGHT, Lobe(100.0))
    assert angle_of_peak(d, edit.specular) < 3
    flat = lobe_under(Lobe(100.0), d.normal, LIGHT)
    assert angle_of_peak(d, flat) > 8, "seen from far away it would be elsewhere"


def test_the_light_of_a_specular_layer_is_found_before_the_camera() -> None:
    d = bump_before_camera()
    seen = add_highlight(d, LIGHT, Lobe(100.0)).specular
    fit = explain_specular(replace(d, specular=seen))
    assert fit.determined
    assert degrees_between(fit.light.direction, LIGHT.direction) < 4


def test_a_lobe_mirrors_the_environment_for_the_perspective_camera() -> None:
    d = bump_before_camera()
    rows = 32
    environment = np.zeros((rows, 2 * rows, 3))
    environment[directions(rows) @ LIGHT.direction > np.cos(np.radians(8))] = 1.0
    layer = np.zeros_like(d.image)
    layer[d.mask] = lobe_in_environment(
        Lobe(100.0), d.normal[d.mask].astype(float), environment, d.view_inside
    )
    assert angle_of_peak(d, layer) < 4


def test_one_view_is_that_of_all_normals() -> None:
    d = bump_before_camera()
    environment = np.random.default_rng(0).random((8, 16, 3))
    normal, view = d.normal[d.mask].astype(float), np.array([0.6, 0.0, 0.8])
    one = lobe_in_environment(Lobe(30.0), normal, environment, view)
    every = lobe_in_environment(Lobe(30.0), normal, environment, np.tile(view, (len(normal), 1)))
    np.testing.assert_array_equal(one, every)
    assert np.abs(one - lobe_in_environment(Lobe(30.0), normal, environment)).max() > 0.05


@pytest.mark.parametrize("highlights", ["keep", "scale", "render"])
def test_relighting_and_other_edits_work(highlights: str) -> None:
    bare = bump_before_camera()
    seen = add_highlight(bare, LIGHT, Lobe(100.0)).specular
    d = replace(bare, specular=seen, image=bare.image + seen)
    turned = NewLight(
        coefficients=turned_light(d.illumination, turn(yaw=30)), rotation=turn(yaw=30)
    )
    edit = relight(d, turned, Relighting(highlights))
    assert np.isfinite(edit.diffuse).all()
    assert edit.specular.any()
    same = relight(d, NewLight(coefficients=d.illumination))
    np.testing.assert_allclose(same.diffuse, d.diffuse, atol=1e-6)
    for other in (
        change_gloss(d, Gloss(exponent=30.0, method="render")),
        change_gloss(d, Gloss(metal=0.5)),
        recolour(d, ColourEdit(hue=40.0)),
    ):
        assert np.isfinite(other.image).all()
