"""Joint MDR on scenes with known parts: grey albedo under a light, which colour cannot tell from a
highlight, and diffuse objects.
"""

from dataclasses import replace

import numpy as np
import pytest

from isc_core.decomposition.joint import (
    JointOptions,
    ResidualHighlights,
    detect_residual_highlights,
    inpaint_albedo,
    joint,
    supported_layers,
)
from isc_core.decomposition.mdr import mdr
from isc_core.decomposition.models import DecompositionTask, Settings
from isc_core.decomposition.pipeline import decompose
from isc_core.decomposition.task import SceneEstimate
from isc_core.photo import Photo, PhotoSource
from isc_core.scene.decomposition import Decomposition
from isc_core.scene.diagnostics import JointOutcome, PhotoColours
from isc_core.scene.known_inputs import SceneConstraints
from isc_core.shading.brdf.ggx import Ggx
from isc_core.shading.radiance import directional, radiance
from isc_core.shading.spherical_harmonics import light_to_reference
from tests.core.ball_scene import ball

TO_LIGHT = np.array([-0.42, 0.5, 0.757])
TO_LIGHT /= np.linalg.norm(TO_LIGHT)


def grey_ball(gloss: float, alpha: float = 0.1) -> Decomposition:
    """A ball of two grey albedos; `gloss`: irradiance of the light that the gloss mirrors."""
    d = ball((92, 100), 42.0, (46, 50))
    inside = d.mask[..., None]
    reflectance = np.where(inside, 0.25 + 0.6 * d.reflectance[..., :1], 0) * np.ones(3, np.float32)
    shine = radiance(
        Ggx(alpha, 0.04),
        d.normal.astype(float),
        np.array([0.0, 0, 1]),
        directional(TO_LIGHT, max(gloss, 1e-6)),
    )
    diffuse, specular = (
        reflectance * d.shading,
        np.where(inside, shine if gloss else 0, 0).astype(np.float32),
    )
    scale = np.float32(1 / (diffuse + specular).max())
    return replace(
        d,
        image=scale * (diffuse + specular),
        diffuse=scale * diffuse,
        specular=scale * specular,
        reflectance=reflectance,
    )


def photo_of(d: Decomposition) -> Photo:
    source = PhotoSource("0" * 64, (d.image.shape[1], d.image.shape[0]), 12, "linear", "file")
    return Photo(d.image.astype(np.float32), d.mask, 1 / 4095, np.zeros(d.mask.shape, bool), source)


def task_of(d: Decomposition) -> DecompositionTask:
    """With the true shape and light, so that nothing but the separation is requested; or without
    them.
    """
    photo = photo_of(d)
    truth = SceneConstraints(d.height.astype(float), light_to_reference(d.illumination))
    return DecompositionTask(photo, photo, Settings(illumination="laboratory"), truth)


def without_colours(image: np.ndarray) -> np.ndarray:
    return np.repeat(image[..., 1:2], 3, axis=2)


@pytest.fixture(scope="module")
def glossy() -> tuple[Decomposition, SceneEstimate]:
    d = grey_ball(20)
    return d, joint(task_of(d))


def error(d: Decomposition, answer: SceneEstimate) -> float:
    return float(np.square(answer.split.diffuse - d.diffuse)[d.mask].mean())


@pytest.mark.slow
def test_a_highlight_on_grey_paint_is_taken_off(
    glossy: tuple[Decomposition, SceneEstimate],
) -> None:
    d, answer = glossy
    nothing = float(np.square(d.specular)[d.mask].mean())
    assert error(d, mdr(task_of(d))) > 0.5 * nothing
    assert error(d, answer) < 0.5 * nothing
    assert answer.diagnostics.joint == JointOutcome.INPAINTED


@pytest.mark.slow
def test_the_layers_sum_up_and_are_not_negative(
    glossy: tuple[Decomposition, SceneEstimate],
) -> None:
    d, answer = glossy
    split = answer.split
    assert np.abs(split.diffuse + split.specular + split.residual - d.image)[d.mask].max() < 1e-5
    assert min(split.diffuse.min(), split.specular.min()) > -1e-6
    assert split.confidence.min() >= 0 and split.confidence.max() <= 1
    assert not (split.diffuse[~d.mask].any() or split.specular[~d.mask].any())


@pytest.mark.slow
def test_the_same_again(glossy: tuple[Decomposition, SceneEstimate]) -> None:
    d, answer = glossy
    again = joint(task_of(d))
    np.testing.assert_array_equal(again.height, answer.height)
    np.testing.assert_array_equal(again.split.diffuse, answer.split.diffuse)


@pytest.mark.slow
def test_a_matt_object_is_what_mdr_makes_of_it() -> None:
    d = grey_ball(0)
    found, start = joint(task_of(d)), mdr(task_of(d))
    np.testing.assert_array_equal(found.split.diffuse, start.split.diffuse)
    np.testing.assert_array_equal(found.height, start.height)
    assert found.diagnostics.joint == JointOutcome.UNCHANGED


@pytest.mark.slow
def test_a_step_that_does_not_lower_the_energy_is_not_taken() -> None:
    d = grey_ball(20)
    start = supported_layers(d.image, mdr(task_of(d)).split, d.mask).residual
    assert start is not None and start.unreliable.any()
    found = joint(task_of(d), JointOptions(change_of_variables=-1e6))
    np.testing.assert_array_equal(found.split.diffuse, start.diffuse)
    assert found.diagnostics.joint == JointOutcome.REMOVED


def test_paint_is_continued_under_the_highlight() -> None:
    mask = np.zeros((40, 40), bool)
    mask[4:36, 4:36] = True
    unreliable = np.zeros_like(mask)
    unreliable[15:25, 15:25] = True
    shading = np.linspace(0.5, 1, 40)[None, :, None] * np.ones((40, 40, 3))
    diffuse = np.where(mask[..., None], 0.4 * shading, 0)
    image = diffuse + 0.3 * unreliable[..., None]
    found = inpaint_albedo(ResidualHighlights(image, unreliable), shading, image, mask)
    np.testing.assert_allclose(found, diffuse, atol=1e-6)


def test_what_colour_has_taken_off_is_not_taken_twice() -> None:
    d = grey_ball(20)
    found = detect_residual_highlights(d.image, d.diffuse, d.mask)
    assert found is None
    assert detect_residual_highlights(d.image, d.image, d.mask) is not None


def test_what_the_network_takes_off_a_grey_photo_is_grey() -> None:
    d = grey_ball(20)
    image = without_colours(d.image)
    found = detect_residual_highlights(image, image, d.mask)
    assert found is not None
    np.testing.assert_array_equal(found.diffuse, without_colours(found.diffuse))
    assert (found.diffuse[d.mask] < image[d.mask]).any()
    coloured = detect_residual_highlights(d.image, d.image, d.mask)
    assert coloured is not None and np.ptp(coloured.diffuse[d.mask], axis=1).any()


def test_a_grey_photo_is_explained_without_colours() -> None:
    """With highlights that the network finds, some of them clipped."""
    d = grey_ball(20)
    image = np.minimum(without_colours(d.image), np.float32(0.5))
    clipped = d.mask & (image[..., 0] >= 0.5)
    photo = replace(photo_of(d), image=image, clipped=clipped)
    found = decompose(photo, Settings(threads=1))
    diagnostics = found.provenance.diagnostics
    assert clipped.any() and found.specular.any()
    assert diagnostics.photo_colours == PhotoColours.GREY
    for name in ("diffuse", "specular", "residual", "shading", "reflectance"):
        layer = getattr(found, name)
        np.testing.assert_array_equal(layer, without_colours(layer), err_msg=name)
    assert not np.ptp(found.illumination, axis=1).any()
