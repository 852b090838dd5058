"""Grey and toned photos: the solver gets a grey photo, and the result explains the toned one."""

import numpy as np
import pytest

from isc_core.decomposition.models import DecompositionTask, SceneEstimate, Settings
from isc_core.decomposition.pipeline import decompose
from isc_core.decomposition.toning import solve_toned
from isc_core.imaging.luminance import luminance
from isc_core.imaging.srgb import srgb_to_linear
from isc_core.photo import Photo, PhotoSource
from isc_core.result_files.diagnostics_json import diagnostics_from_json
from isc_core.result_files.diagnostics_text import note_lines
from isc_core.scene.decomposition import Separation
from isc_core.scene.diagnostics import Diagnostics, PhotoColours

SIZE = 48
SEPIA = np.array([1.351, 1.203, 0.937])  # rows of the usual filter, of equal channels


def lit_ball() -> tuple[np.ndarray, np.ndarray]:
    """Codes (SIZE, SIZE) of a two-coloured ball, and its mask."""
    across = (np.arange(SIZE) + 0.5) * 2.2 / SIZE - 1.1
    right, down = np.meshgrid(across, across)
    mask = right**2 + down**2 < 1
    up = np.sqrt(np.clip(1 - right**2 - down**2, 0, 1))
    shading = np.clip(0.3 + 0.5 * up - 0.3 * down, 0, None)
    return np.rint(255 * np.sqrt(shading * np.where(right > 0, 0.8, 0.4))) * mask, mask


def photo_like(name: str) -> Photo:
    codes, mask = lit_ball()
    coloured = {
        "grey": codes[..., None] * np.ones(3),
        "sepia": np.clip(codes[..., None] * SEPIA, 0, 255),
        "tinted black": np.array([30.0, 20, 10]) + codes[..., None] * np.array([0.8, 0.75, 0.7]),
    }[name]
    image = srgb_to_linear(np.rint(coloured) / 255).astype(np.float32) * mask[..., None]
    source = PhotoSource("0" * 64, (SIZE, SIZE), 8, "srgb", "file")
    return Photo(image, mask, 1 / 255 / 12.92, np.zeros_like(mask), source)


def halved(task: DecompositionTask) -> SceneEstimate:
    """A model that gives each of two layers a half of the light."""
    half = task.maps.image / 2
    split = Separation(half, half, 0 * half, np.ones(task.maps.mask.shape, np.float32))
    return SceneEstimate(split, np.zeros(half.shape[:2]), np.zeros((9, 3)), Diagnostics())


@pytest.mark.parametrize("name", ["sepia", "tinted black"])
def test_a_toned_photo_is_solved_as_grey_and_keeps_its_tone(name: str) -> None:
    photo, seen = photo_like(name), []

    def model(task: DecompositionTask) -> SceneEstimate:
        seen.append(task)
        return halved(task)

    found = solve_toned(DecompositionTask(photo, photo, Settings(light_colour="toned")), model)
    inside = photo.mask
    assert seen[0].one_scale
    grey = seen[0].working.image
    np.testing.assert_array_equal(grey, np.repeat(grey[..., :1], 3, axis=-1))
    np.testing.assert_allclose(grey[inside][:, 0], luminance(photo.image[inside]), rtol=1e-6)
    both = found.split.diffuse + found.split.specular
    np.testing.assert_allclose(both[inside], photo.image[inside], rtol=1e-5)
    assert found.diagnostics.photo_colours is PhotoColours.TONED


@pytest.mark.parametrize(
    ("name", "expected"), [("grey", PhotoColours.GREY), ("sepia", PhotoColours.COLOURED)]
)
def test_only_a_grey_photo_is_recognised(name: str, expected: PhotoColours) -> None:
    photo = photo_like(name)
    found = solve_toned(DecompositionTask(photo, photo, Settings()), halved)
    assert found.diagnostics.photo_colours is expected
    np.testing.assert_array_equal(found.split.diffuse, photo.image / 2)


def test_the_note_is_one_line_and_survives_the_file() -> None:
    for colours, told in ((PhotoColours.GREY, 1), (PhotoColours.TONED, 1), (None, 0)):
        diagnostics = Diagnostics(photo_colours=colours)
        assert diagnostics_from_json(diagnostics.to_json()).photo_colours is colours
        lines = note_lines(diagnostics)
        assert len(lines) == told and all("\n" not in line for line in lines)


@pytest.mark.slow
def test_light_of_grey_and_toned_photos_is_white_and_their_shapes_agree() -> None:
    grey = decompose(photo_like("grey"), Settings("sirfs", threads=1))
    toned = decompose(photo_like("sepia"), Settings("sirfs", threads=1, light_colour="toned"))
    for one in (grey, toned):
        np.testing.assert_allclose(one.illumination, one.illumination[:, :1] * np.ones(3))
    cosine = np.einsum("hwc,hwc->hw", grey.normal, toned.normal)[grey.mask]
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean() < 5
    colour = toned.reflectance[toned.mask].mean(axis=0)
    tone = photo_like("sepia").image[toned.mask].mean(axis=0)
    np.testing.assert_allclose(colour / colour.sum(), tone / tone.sum(), rtol=0.05)
