"""What in an answer contradicts one small lamp and a light of one colour."""

from collections.abc import Sequence

import numpy as np
import pytest

from isc_core.decomposition import Separation
from isc_core.models import Answer
from isc_core.models.doubts import colour_spread, doubted, highlight_spread
from isc_core.photo import Photo, PhotoSource
from isc_core.sirfs.frames import light_to_reference

SIZE = 64


def sphere() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mask (H, W), unit normals (H, W, 3) and height (H, W) of a ball."""
    y, x = (np.mgrid[:SIZE, :SIZE] - (SIZE - 1) / 2) / (0.45 * SIZE)
    inside = x**2 + y**2 < 0.95
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0.05))
    return inside, np.dstack([x, -y, z]), 0.45 * SIZE * z


def seen(halves: Sequence[Sequence[float]], light: np.ndarray | None = None) -> tuple[Photo, Answer, np.ndarray]:
    """A ball with a highlight around each of the half vectors, its answer, and its normals."""
    mask, normal, height = sphere()
    units = [np.array(half) / np.linalg.norm(half) for half in halves]
    specular = sum((np.maximum(normal @ half, 0) ** 200 for half in units), np.zeros(mask.shape))
    maps = [np.where(mask, values, 0) for values in (0.5, specular, 0)]
    layers = [np.repeat(values[..., None], 3, axis=2).astype(np.float32) for values in maps]
    split = Separation(layers[0], layers[1], layers[2], np.where(mask, 0.8, 0).astype(np.float32))
    light = np.zeros((9, 3)) if light is None else light
    source = PhotoSource("0" * 64, mask.shape, 12, "linear", "file")
    photo = Photo(layers[0] + layers[1], mask, 1 / 4095, np.zeros(mask.shape, bool), source)
    return photo, Answer(split, height, light_to_reference(light), {"converged": True}), normal


def test_one_highlight_is_near_and_two_are_far_apart() -> None:
    one, two = seen([(0.3, 0.3, 1)]), seen([(0.6, 0, 1), (-0.6, 0, 1)])
    (near, far) = (highlight_spread(answer, normal, photo) for photo, answer, normal in (one, two))
    assert near < 12 and far > 21
    assert highlight_spread(seen([])[1], one[2], seen([])[0]) == 0


def test_a_turned_photo_has_the_same_spread() -> None:
    photo, answer, normal = seen([(0.5, 0.1, 1), (-0.3, 0.4, 1)])
    turned_photo, turned, turned_normal = seen([(-0.1, 0.5, 1), (-0.4, -0.3, 1)])  # by a quarter
    assert highlight_spread(answer, normal, photo) == pytest.approx(highlight_spread(turned, turned_normal, turned_photo), rel=1e-6)


def test_the_colours_of_shading_spread_as_their_chromaticities_do() -> None:
    grey = np.linspace(0.2, 1, 50)[:, None]
    assert colour_spread(grey * [0.9, 0.5, 0.3]) == pytest.approx(0, abs=1e-12)
    assert colour_spread(grey) == 0 and colour_spread(np.zeros((9, 3))) == 0
    half = np.repeat([[1.2, 1.0, 0.8], [0.8, 1.0, 1.2]], 30, axis=0)
    assert colour_spread(half) == pytest.approx(0.2 * np.sqrt(2))


def test_an_answer_without_doubts_stays_and_one_with_them_is_less_sure() -> None:
    colours = np.zeros((9, 3))
    colours[3] = (1.2, 0, -1.2)  # red from the right, blue from the left
    one, two = [(0.3, 0.3, 1)], [(0.6, 0, 1), (-0.6, 0, 1)]
    for case, words in ((seen(one), []), (seen(two), ["several lights"]), (seen([], colours), ["several lamps"])):
        photo, answer, _ = case
        found = doubted(photo, answer)
        assert found.status["converged"] and len(found.status["doubts"]) == len(words)
        assert all(word in line for word, line in zip(words, found.status["doubts"], strict=True))
        np.testing.assert_allclose(found.split.confidence, answer.split.confidence * (0.5 if words else 1))
        np.testing.assert_array_equal(found.split.diffuse, answer.split.diffuse)
