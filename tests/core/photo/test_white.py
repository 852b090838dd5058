"""The white of float files: what no camera records is limited, and all else stays."""

from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from hypothesis import given
from hypothesis import strategies as st

import isc_core
from isc_core.decomposition.settings import Settings
from isc_core.io.reading_notes import ReadingNoteKind
from isc_core.photo import read_photo
from isc_core.photo.white import HEADROOM, limit_to_white
from tests.angles import degrees_between

SIDE = 72
rows, columns = (np.mgrid[:SIDE, :SIDE] + 0.5 - SIDE / 2) / (0.42 * SIDE)
MASK = rows**2 + columns**2 < 1


def ball(highlight: float) -> tuple[np.ndarray, np.ndarray]:
    """A lit red ball with a white highlight of a fortieth of its area, and its diffuse layer."""
    front = np.sqrt(np.maximum(1 - rows**2 - columns**2, 0))
    shading = np.maximum(0.5 * front - 0.4 * rows - 0.2 * columns, 0) + 0.15
    diffuse = shading[..., None] * np.array([0.7, 0.2, 0.1]) * MASK[..., None]
    spot = np.exp(-((rows + 0.4) ** 2 + (columns + 0.2) ** 2) / 0.012) * MASK
    return (diffuse + highlight * spot[..., None]).astype(np.float32), diffuse.astype(np.float32)


@given(exposure=st.sampled_from([2.0**-20, 2.0**-3, 1.0, 2.0**10]), seed=st.integers(0, 99))
def test_limits_the_brightest_light_alone(exposure: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    light = rng.uniform(0.2, 1, (12, 15, 3)).astype(np.float32)
    light[3, 4] *= 1e4
    light[0, 0] *= 1e5  # outside
    mask = np.ones(light.shape[:2], bool)
    mask[0] = False
    limited, above = limit_to_white(exposure * light, mask)
    assert np.argwhere(above).tolist() == [[3, 4]]
    white = HEADROOM * np.percentile(exposure * light[mask].max(axis=1), 80)
    assert limited[3, 4].max() == pytest.approx(white, rel=1e-6)
    ratio = limited[3, 4] / light[3, 4]
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-6)
    assert (limited[~above] == exposure * light[~above]).all()


def test_ordinary_light_is_returned_as_it_is() -> None:
    light, _ = ball(5.0)
    limited, above = limit_to_white(light, MASK)
    assert limited is light and not above.any()
    black = np.zeros_like(light)
    assert limit_to_white(black, MASK)[0] is black


def test_codes_are_never_limited(tmp_path: Path) -> None:
    photo = np.full((SIDE, SIDE, 3), 2, np.uint8)
    photo[30, 30] = 255
    np.save(tmp_path / "photo.npy", photo)
    np.save(tmp_path / "mask.npy", (255 * MASK).astype(np.uint8))
    read = read_photo(tmp_path / "photo.npy", tmp_path / "mask.npy")
    assert read.image[30, 30].max() == 1
    assert not read.original.notes


def test_the_file_has_a_note_and_clipped_pixels(tmp_path: Path) -> None:
    light, _ = ball(5000.0)
    with OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGB": light}) as file:
        file.write(str(tmp_path / "photo.exr"))
    np.save(tmp_path / "mask.npy", (255 * MASK).astype(np.uint8))
    photo = read_photo(tmp_path / "photo.exr", tmp_path / "mask.npy")
    assert [note.kind for note in photo.original.notes] == [ReadingNoteKind.ABOVE_WHITE]
    assert photo.clipped.any() and not photo.clipped[~MASK].any()
    assert photo.image.max() < 100


def test_a_highlight_of_a_renderer_is_a_highlight_like_others() -> None:
    usual, diffuse = ball(10.0)
    extreme, _ = ball(5000.0)
    settings = Settings(model="joint", max_size=SIDE)
    first, second = (isc_core.decompose(one, MASK, settings=settings) for one in (usual, extreme))
    for result in (first, second):
        total = result.diffuse + result.specular + result.residual
        np.testing.assert_allclose(total[MASK], result.image[MASK], rtol=1e-5, atol=1e-6)
    wrong = np.abs(second.diffuse - diffuse)[MASK].max(axis=1)
    assert np.quantile(wrong, 0.99) < diffuse.max()
    front = np.sqrt(np.maximum(1 - rows**2 - columns**2, 0))
    true = np.stack([columns, -rows, front], axis=2)[MASK]
    errors = [degrees_between(one.normal[MASK], true).mean() for one in (first, second)]
    assert errors[1] < errors[0] + 8
    assert not second.provenance.diagnostics.warnings
