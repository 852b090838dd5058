"""The programs on size, last digits and cost, with a pipeline whose answer is known."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.detail import stability
from benchmarks.detail.settings import settings_of
from isc_core.decomposition.settings import Settings
from isc_core.errors import InputError
from isc_core.photo import Photo


def tilted(degrees: float, photo: Photo) -> SimpleNamespace:
    """A result whose normals all lean to the right."""
    angle = np.radians(degrees)
    normal = photo.mask[..., None] * np.array([np.sin(angle), 0, np.cos(angle)])
    return SimpleNamespace(normal=normal.astype(np.float32), mask=photo.mask)


def test_the_overall_shape_is_compared_at_one_size(monkeypatch: pytest.MonkeyPatch) -> None:
    def decompose(photo: Photo, settings: Settings) -> SimpleNamespace:
        degrees = 5 if settings.max_size == stability.LARGE else 2
        return tilted(degrees, photo.resized_to_object(settings.max_size))

    monkeypatch.setattr(stability, "decompose", decompose)
    monkeypatch.setattr(stability, "LARGE", 96)
    monkeypatch.setattr(stability, "SMALL", 48)
    change = stability.shape_change(stability.ball(0.003), Settings())
    assert change == pytest.approx(3, abs=0.01)


def test_last_digits_change_the_photo_and_little(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []

    def decompose(photo: Photo, settings: Settings) -> SimpleNamespace:
        seen.append(photo.image)
        return tilted(len(seen), photo)

    monkeypatch.setattr(stability, "decompose", decompose)
    photo = stability.ball(0.003)
    assert stability.digit_change(photo, Settings()) == pytest.approx(1, abs=0.01)
    assert not np.array_equal(seen[0], seen[1])
    assert np.allclose(seen[0], seen[1], rtol=1e-6, atol=0)


def test_the_ball_has_the_requested_area_and_both_halves_vary() -> None:
    photo = stability.ball(0.02)
    assert photo.mask.sum() == pytest.approx(20000, rel=0.05)
    middle = photo.mask.shape[1] // 2
    row = photo.image[photo.mask.shape[0] // 2, :, 0]
    for half in (row[middle - 40 : middle - 5], row[middle + 5 : middle + 40]):
        assert np.diff(half).std() > 0.005


def test_settings_take_the_type_of_their_default() -> None:
    found = settings_of(["max_size=0", "full_size=true", "model=sirfs"], Settings())
    assert (found.max_size, found.full_size, found.model) == (0, True, "sirfs")
    with pytest.raises(InputError, match="NAME one of"):
        settings_of(["size=3"], Settings())
    with pytest.raises(InputError, match="give a number for max_size"):
        settings_of(["max_size=big"], Settings())
