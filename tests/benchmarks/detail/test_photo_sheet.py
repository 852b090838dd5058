"""The sheet of photos: its crops are at 1:1, and its figures are those of relief put in."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("mitsuba")

from benchmarks.detail.photo_sheet import Crop, added, row_of
from isc_core.errors import InputError

SIDE = 60


def result(slope: np.ndarray, reflectance: np.ndarray) -> SimpleNamespace:
    """A result whose normals lean to the right by `slope`, an angle in radians."""
    normal = np.dstack([np.sin(slope), np.zeros_like(slope), np.cos(slope)])
    mask = np.ones(slope.shape, bool)
    mask[:, :20] = False
    maps = {"normal": normal, "reflectance": np.repeat(reflectance[..., None], 3, axis=2)}
    return SimpleNamespace(**maps, image=maps["reflectance"], mask=mask)


def crop(found: SimpleNamespace, x: int = 30, y: int = 10) -> Crop:
    return Crop.of(found, (x, y), SIDE)  # type: ignore[arg-type]


def waves(amplitude: float) -> np.ndarray:
    return amplitude * np.sin(2 * np.pi / 4 * np.arange(120)) * np.ones((100, 1))


def test_the_figures_are_those_of_the_relief_put_in() -> None:
    smooth = crop(result(waves(0), 0.4 * np.exp(waves(0.2))))
    assert added(smooth, smooth) == pytest.approx((0, 1))
    rough = crop(result(waves(np.radians(8)), 0.4 * np.exp(waves(0.1))))
    angle, contrast = added(smooth, rough)
    assert angle == pytest.approx(8 / 2**0.5, rel=0.03)
    assert contrast == pytest.approx(0.5, rel=0.02)


def test_a_slow_change_of_the_normals_is_not_fine() -> None:
    tilt = np.radians(0.1) * np.arange(120) * np.ones((100, 1))
    flat, tilted = (crop(result(slope, np.full((100, 120), 0.4))) for slope in (0 * tilt, tilt))
    assert added(flat, tilted)[0] < 0.3


def test_a_crop_is_not_resized_and_white_outside_the_mask() -> None:
    part = crop(result(waves(0), np.full((100, 120), 0.4)), 0, 40)
    row = row_of(part, part)
    assert row.shape == (SIDE, 5 * SIDE + 4 * 4, 3)
    assert (row[:, :20] == 255).all() and (row[:, SIDE : SIDE + 24] == 255).all()
    np.testing.assert_array_equal(row[0, SIDE + 34], [128, 128, 255])


def test_a_crop_outside_the_maps_or_the_object_is_refused() -> None:
    found = result(waves(0), np.full((100, 120), 0.4))
    with pytest.raises(InputError, match="120 x 100"):
        crop(found, 61, 0)
    with pytest.raises(InputError, match="no pixel"):
        Crop.of(found, (0, 0), 20)  # type: ignore[arg-type]
