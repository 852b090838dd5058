"""The cover of the maps' pixels, and the opacity of a soft rim."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from isc_core.errors import InputError
from isc_core.imaging.bounding_box import FramePart
from isc_core.io.limits import Limits
from isc_core.photo.grabcut import encoded_mask
from isc_core.result_files.mesh.object_cover import object_cover, read_cover
from isc_core.scene.part_of_result import ResultPart
from tests.core.ball_scene import ball


def halved(source: str) -> ResultPart:
    """A ball in maps of half the photo's size."""
    d = ball((96, 120), 40.0, (44.0, 66.0))
    given = {**d.provenance.input, "scale": 0.5, "mask_from": source}
    return ResultPart.of(replace(d, provenance=replace(d.provenance, input=given)))


def ramp(width: float) -> np.ndarray:
    """The cover of the photo's pixels; the rim of the ball is that many of its pixels wide."""
    row, column = (np.indices((192, 240)) + 0.5) / 2 - 0.5
    away = np.hypot(row - 44, column - 66)
    return np.clip((0.99 * 40 - away) / (width / 2) + 0.5, 0, 1)


def test_the_cover_is_the_mean_over_a_pixel_near_the_object(tmp_path: Path) -> None:
    d, cover = halved("file"), ramp(4)
    cover[:20, :20] = 1  # another thing
    (tmp_path / "mask.png").write_bytes(encoded_mask(cover))
    found = object_cover(d, read_cover(tmp_path / "mask.png", {}))
    assert found is not None and found.share.shape == d.mask.shape
    mean = cover.reshape(96, 2, 120, 2).mean((1, 3))
    near = np.hypot(*(np.indices(d.mask.shape) - np.array([44, 66])[:, None, None])) < 42
    assert np.abs(found.share - mean)[near].max() < 0.004
    assert found.share[:8, :8].max() == 0
    soft = (found.share > 0.02) & (found.share < 0.98)
    assert soft.sum() > 200
    assert found.alpha(FramePart.whole((96, 120))) is None, "an outline is opaque"


def test_the_mask_of_a_large_photo_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "mask.png"
    path.write_bytes(encoded_mask(ramp(4)))
    monkeypatch.setattr("isc_core.result_files.mesh.object_cover.DEFAULT_LIMITS", Limits(1000))
    cover = read_cover(path, {"size": [240, 192]})
    assert cover is not None and cover.shape == (192, 240)
    with pytest.raises(InputError, match="exceed the limit"):
        read_cover(path, {"size": [24, 19]})


def test_a_hard_mask_or_that_of_another_photo_has_no_coverage(tmp_path: Path) -> None:
    d = halved("file")
    assert read_cover(tmp_path / "mask.png", {}) is None and object_cover(d, None) is None
    assert object_cover(d, ramp(4)[:100]) is None
    assert object_cover(d, ramp(4) > 0.5) is None


def test_the_opacity_of_a_soft_rim_is_the_cover() -> None:
    d, cover = halved("file"), ramp(30)
    found = object_cover(d, cover)
    assert found is not None
    alpha, fine = (found.alpha(FramePart.whole(shape)) for shape in ((96, 120), (192, 240)))
    assert alpha is not None and fine is not None
    mean = cover.reshape(96, 2, 120, 2).mean((1, 3))
    partly = (mean > 0.1) & (mean < 0.9)
    assert np.abs(alpha / 255 - mean)[partly].max() < 0.01
    assert (alpha[mean == 1] == 255).all()
    assert np.abs(fine / 255 - cover)[(cover > 0.1) & (cover < 0.9)].max() < 0.01


def test_where_the_rim_is_hard_it_stays_opaque() -> None:
    """Fur on the right, an outline on the left: there the cover is that of the outline alone."""
    cover = np.where(np.arange(240) > 132, ramp(30), ramp(2))
    found = object_cover(halved("alpha"), cover)
    assert found is not None
    alpha = found.alpha(FramePart.whole((96, 120)))
    assert alpha is not None
    left = alpha[:, :56]
    assert (left == 255).all() and (alpha[:, 76:] < 128).any()
