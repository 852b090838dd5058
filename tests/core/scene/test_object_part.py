"""A small object in a large frame: the same result, in its place, from a part of the photo."""

from dataclasses import replace

import numpy as np
import pytest

from isc_core.decomposition.pipeline import Settings, decompose
from isc_core.errors import InputError
from isc_core.imaging.bounding_box import FramePart
from isc_core.photo import Photo
from isc_core.photo.camera import Camera, CameraSource
from isc_core.photo.highlight_marks import HighlightMarks
from isc_core.photo.photo import PhotoSource
from isc_core.scene.known_inputs import KnownInputs
from isc_core.scene.object_part import object_part
from isc_core.scene.part_of_result import cut_result, placed_result
from tests.core.ball_scene import ball

FRAME, PLACE = (400, 560), (230, 390)  # rows and columns; the ball's centre
CAMERA = Camera(700.0, (280.0, 200.0), CameraSource.OPTION)


def photo(frame: tuple[int, int] = FRAME, place: tuple[float, float] = PLACE) -> Photo:
    """A ball of 80 pixels; the background is bright."""
    d = ball(frame, 40.0, place)
    image = np.where(d.mask[..., None], d.image, 0.8).astype(np.float32)
    source = PhotoSource("0" * 64, frame[::-1], 8, "srgb", "file")
    return Photo(image, d.mask, 1e-3, np.zeros_like(d.mask), source)


@pytest.mark.parametrize("size", [0, 80, 50, 31])
def test_its_maps_are_those_of_the_whole_photo(size: int) -> None:
    whole = photo()
    part, expected = object_part(whole, size), whole.resized_to_object(size)
    assert not part.source.is_whole
    assert not part.target.is_whole
    assert part.target.shape == expected.mask.shape
    assert part.photo.mask.sum() == whole.mask.sum()
    assert part.maps.scale == expected.scale
    placed = part.target.placed(part.maps.mask)
    differing = placed ^ expected.mask
    assert differing.sum() <= (0 if size in (0, 80) else 0.01 * expected.mask.sum())
    both = placed & expected.mask
    image = part.target.placed(part.maps.image)
    # a shift by 1/50 of a pixel
    tolerance = 0 if size in (0, 80) else 0.01
    np.testing.assert_allclose(image[both], expected.image[both], atol=tolerance)


def test_an_object_that_fills_the_frame_is_not_cut_out() -> None:
    near = photo((96, 120), (44, 66))
    part = object_part(near, 0)
    assert part.photo is near
    assert part.target.corner == (0, 0)
    d = ball()
    assert part.placed(d) is d
    inputs = KnownInputs(height=d.height)
    assert part.known(inputs) is inputs


@pytest.mark.parametrize(("x", "y"), [(45, 45), (515, 45), (45, 355), (515, 355)])
def test_objects_at_the_edges_of_the_frame(x: int, y: int) -> None:
    """With a size whose last row and column extend past the frame."""
    whole = photo(place=(y, x))
    part, expected = object_part(whole, 53), whole.resized_to_object(53)
    assert not part.target.is_whole
    placed = part.target.placed(part.maps.mask)
    assert placed.shape == expected.mask.shape
    assert (placed ^ expected.mask).sum() <= 0.02 * expected.mask.sum()


def test_a_result_is_cut_and_placed_again() -> None:
    d = replace(
        ball(FRAME, 40.0, PLACE),
        camera=CAMERA,
        visibility=np.ones((*FRAME, 3), np.float32),
        indirect=np.zeros((*FRAME, 3), np.float32),
    )
    part = FramePart.around(d.mask, 5)
    near = cut_result(d, part)
    assert near.mask.shape == (89, 89)
    assert near.camera is not None
    assert near.camera.principal_point == (280.0 - part.corner[0], 200.0 - part.corner[1])
    again = placed_result(near, part)
    assert again.camera == CAMERA
    for name in ("image", "specular", "shading", "normal", "height", "mask", "confidence"):
        np.testing.assert_array_equal(getattr(again, name), getattr(d, name))
    np.testing.assert_array_equal(again.visibility, d.visibility)
    np.testing.assert_array_equal(again.view, d.view)


@pytest.fixture(scope="module")
def settings() -> Settings:
    return Settings(max_size=0, threads=1, detail=0)


def test_the_place_in_the_frame_does_not_matter(settings: Settings) -> None:
    """Shape and light are those of the photo that a user crops; the maps are in their place."""
    whole = photo()
    part = object_part(whole, 0)
    found, cropped = decompose(whole, settings), decompose(part.photo, settings)
    assert not part.source.is_whole
    assert found.mask.shape == FRAME
    assert found.identity_errors().broken() == ()
    np.testing.assert_array_equal(found.mask, whole.mask)
    for name in ("image", "diffuse", "reflectance", "normal", "height", "confidence"):
        np.testing.assert_array_equal(part.source.cut(getattr(found, name)), getattr(cropped, name))
        outside = getattr(found, name)[~found.mask]
        assert (outside == ((0, 0, 1) if name == "normal" else 0)).all()
    np.testing.assert_array_equal(found.illumination, cropped.illumination)
    box = found.provenance.input["crop_box"]
    assert box == [PLACE[1] - 39, PLACE[0] - 39, 79, 79]


def test_camera_marks_and_known_shape_move_with_it(settings: Settings) -> None:
    whole = photo()
    d = ball(FRAME, 40.0, PLACE)
    x, y = PLACE[1] + 10.5, PLACE[0] - 3.5
    marked = replace(whole, camera=CAMERA, marks=HighlightMarks(((x, y),), ()))
    found = decompose(marked, settings)
    assert found.camera == CAMERA
    assert found.provenance.input["marked_highlights"] == [[int(x), int(y)]]
    facing = (found.normal * found.view).sum(-1)
    assert facing[found.mask].min() > 0

    known = decompose(whole, settings, known=KnownInputs(height=d.height))
    error = known.height[d.mask] - d.height[d.mask]
    assert np.ptp(error) < 1e-3


def test_a_known_shape_of_another_size_is_refused(settings: Settings) -> None:
    with pytest.raises(InputError, match="the shape map is 88 x 88 but the photo 560 x 400"):
        decompose(photo(), settings, known=KnownInputs(height=np.zeros((88, 88))))


def test_a_part_is_found_for_every_size() -> None:
    """Some factors have no pixel of the maps that begins where one of the photo does nearby."""
    whole = photo()
    for size in range(30, 80):
        part = object_part(whole, size)
        assert not part.source.is_whole
        assert 0.98 * size <= max(part.maps.box[2:]) <= size
        for start in part.source.corner:
            assert abs(start * part.maps.scale - round(start * part.maps.scale)) <= 0.02
