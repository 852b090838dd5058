"""Estimates with a perspective camera: the identities, the light, the lobe, and the choice of the
camera.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from benchmarks.decomposition.perspective import measured
from benchmarks.decomposition.perspective_bodies import traced_body
from isc_core.decomposition.perspective import lobe_before_camera, with_camera
from isc_core.decomposition.pipeline import Settings, assemble, decompose
from isc_core.errors import InputError
from isc_core.io.focal_length import pixels_of_35mm
from isc_core.lobe_fitting import fit_lobe
from isc_core.photo.camera import Camera, CameraSource
from isc_core.scene.decomposition import Provenance
from isc_core.scene.known_inputs import KnownInputs
from isc_core.scene.lobe_fit import LobeFitOptions
from isc_core.shading.brdf.blinn_phong import BlinnPhong
from isc_core.shading.lights import VIEW, turned_light
from isc_core.shading.perspective import (
    lifted_normals,
    object_axis,
    rotation_between,
    view_directions,
)
from isc_core.shading.radiance import directional, radiance
from isc_core.shading.spherical_harmonics import normal_from_reference, real_sh
from isc_core.shading.surface_stencils import normals
from tests.core.ball_scene import LIGHT
from tests.core.perspective_scene import (
    CAMERA,
    SHAPE,
    bump_before_camera,
    bump_estimate,
    bump_height,
    bump_photo,
)


def test_the_identities_hold_before_a_camera() -> None:
    d = bump_before_camera()
    assert d.identity_errors().broken() == ()
    assert d.camera == CAMERA
    facing = (d.normal * d.view).sum(-1)
    assert facing[d.mask].min() > 0
    np.testing.assert_allclose(
        d.confidence[d.mask], np.sqrt(np.clip(facing, 0, 1))[d.mask], rtol=1e-6
    )


def test_the_light_is_the_nearest_on_the_new_normals() -> None:
    """No other light explains the solver's shading better; the turned one explains it less well."""
    flat, d = bump_before_camera(None), bump_before_camera()
    turn = rotation_between(VIEW, -object_axis(CAMERA, d.mask))
    turned = turned_light(LIGHT, turn)
    seen = np.log(flat.shading[d.mask].astype(float))

    def error(light: np.ndarray) -> float:
        return float(((real_sh(d.normal[d.mask].astype(float)) @ light - seen) ** 2).mean())

    best = error(d.illumination)
    assert best < error(turned)
    assert best < error(LIGHT)
    for seed in range(5):
        step = np.random.default_rng(seed).normal(0, 0.02, (9, 3))
        assert best < error(d.illumination + step)


def test_a_flat_object_keeps_the_turned_light() -> None:
    """One normal does not determine nine coefficients: those of the solver remain."""
    photo = bump_photo()
    estimate = replace(bump_estimate(photo), height=np.zeros(SHAPE))
    d = assemble(photo, estimate, Provenance())
    turn = rotation_between(VIEW, -object_axis(CAMERA, d.mask))
    np.testing.assert_allclose(d.illumination, turned_light(LIGHT, turn), atol=1e-3)


def test_a_known_light_is_kept() -> None:
    photo = bump_photo()
    d = assemble(photo, bump_estimate(photo), Provenance(), known_light=True)
    np.testing.assert_allclose(d.illumination, LIGHT, atol=1e-12)
    assert d.identity_errors().broken() == ()


def test_the_lobes_light_makes_the_highlight_where_it_was() -> None:
    """A lamp's highlight on the surface before the camera: the fit, whose normals and views are
    the solver's, is off by the angle to the object; turned, it is not.
    """
    row, column = np.indices((180, 252)).astype(float)
    height = 43 * (1 - ((row - 73) ** 2 + (column - 175) ** 2) / 54**2)
    mask, camera = height > 0.05, CAMERA.scaled(3)
    normal = lifted_normals(height, camera, object_axis(camera, mask))
    toward = np.array([-0.35, 0.35, 0.87]) / np.linalg.norm([-0.35, 0.35, 0.87])
    view = view_directions(camera, mask.shape)
    seen = radiance(BlinnPhong(0.5, 60.0), normal, view, directional(toward, 1.0))
    fit = fit_lobe(
        np.where(mask[..., None], seen, 0).astype(np.float32),
        normal_from_reference(normals(height)),
        mask,
        options=LobeFitOptions("blinn_phong", most_lights=1),
    )
    estimate = replace(bump_estimate(bump_photo()), height=height, brdf=fit)
    turned = lobe_before_camera(estimate, camera, normal, mask)
    assert turned is not None

    def off(direction: np.ndarray) -> float:
        return float(np.degrees(np.arccos(np.clip(direction @ toward, -1, 1))))

    assert off(fit.lights[0].direction) > 10
    assert off(turned.lights[0].direction) < 3
    assert np.linalg.norm(turned.lights[0].direction) == pytest.approx(1)
    assert turned.alpha == fit.alpha


@pytest.mark.parametrize(
    ("camera", "known", "expected"),
    [
        ("auto", False, CAMERA),
        ("auto", True, None),
        ("orthographic", False, None),
        (
            "40",
            True,
            Camera.of_frame(pixels_of_35mm(40, SHAPE[::-1]), SHAPE[::-1], CameraSource.OPTION),
        ),
    ],
)
def test_the_settings_choose_the_camera(camera: str, known: bool, expected: Camera | None) -> None:
    photo = bump_photo()
    assert with_camera(photo, Settings(camera=camera), known).camera == expected


@pytest.mark.parametrize("camera", ["0", "-28", "wide", "nan", "inf", "7.9", "3001", "28 mm", ""])
def test_other_cameras_are_refused(camera: str) -> None:
    with pytest.raises(InputError, match="choose auto, orthographic, or a focal length") as caught:
        Settings(camera=camera).check()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("model", ["naive", "sirfs"])
def test_a_photo_without_camera_is_decomposed_as_before(model: str) -> None:
    settings = Settings(model=model, threads=1, max_size=24)
    plain = decompose(bump_photo(None), settings)
    chosen = decompose(bump_photo(), replace(settings, camera="orthographic"))
    known: Any = KnownInputs(height=bump_height())
    for name in ("normal", "shading", "reflectance", "illumination", "height", "confidence"):
        assert np.array_equal(getattr(plain, name), getattr(chosen, name)), name
    assert plain.camera is chosen.camera is None
    if model == "sirfs":
        assert decompose(bump_photo(), settings, known=known).camera is None


@pytest.mark.parametrize("full_size", [False, True])
def test_every_size_of_maps_has_its_camera(full_size: bool) -> None:
    settings = Settings(model="naive", threads=1, max_size=20, full_size=full_size)
    d = decompose(bump_photo(), settings)
    assert d.camera is not None
    scale = d.provenance.input["scale"]
    assert (scale == 1) == full_size
    assert d.camera.focal_length == pytest.approx(62 * scale)
    assert d.identity_errors().broken() == ()
    assert d.provenance.settings["camera"] == "auto"


@pytest.mark.slow
def test_normals_and_shape_of_a_ball_beside_the_middle_improve() -> None:
    errors = measured(traced_body("ball", True, 0), "sirfs")
    orthographic, *_, shipped = errors["normals"]
    assert shipped < 0.8 * orthographic
    assert errors["shape"][-1] < errors["shape"][0]
