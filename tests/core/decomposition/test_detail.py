"""The stage of fine relief: what it may change, at every size."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

import isc_core
from isc_core.decomposition import detail
from isc_core.decomposition.detail import fine_relief, shading_gain, slopes
from isc_core.decomposition.layers import shaded
from isc_core.decomposition.pipeline import decompose
from isc_core.decomposition.settings import Settings
from isc_core.errors import Cancelled, InputError
from isc_core.imaging.blocks import block_means
from isc_core.imaging.tiles import Tile, tiles_of
from isc_core.photo import Photo, PhotoSource
from isc_core.progress import Monitor
from isc_core.scene.decomposition import Decomposition
from isc_core.scene.known_inputs import KnownInputs

LIGHT = np.random.default_rng(3).normal(0, 0.2, (9, 3))


def ball(side: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Diffuse image, mask and height of a bumpy ball that is given as a smooth one."""
    y, x = np.mgrid[:side, :side] - (side - 1) / 2
    radius = 0.4 * side
    inside = x**2 + y**2 < radius**2
    height = np.sqrt(np.maximum(radius**2 - x**2 - y**2, 1.0))
    bumps = np.random.default_rng(seed).normal(size=(side, side)) * 0.2
    _, shading = shaded(height + bumps, LIGHT, inside)
    return 0.5 * shading, inside, height


def test_gain_is_the_derivative_of_log_shading() -> None:
    y, x = np.mgrid[:24, :24].astype(float)
    mask, height = np.ones((24, 24), bool), 0.3 * x - 0.2 * y
    gain = shading_gain(slopes(height), LIGHT)[12, 12]
    for axis, move in enumerate((x, y)):
        ahead, behind = (
            np.log(shaded(height + s * 1e-4 * move, LIGHT, mask, np.float64)[1][12, 12]).mean()
            for s in (1, -1)
        )
        assert gain[axis] == pytest.approx((ahead - behind) / 2e-4, abs=2e-3)


@pytest.mark.parametrize("side", [97, 200, 400])
def test_relief_has_no_low_frequencies(side: int) -> None:
    diffuse, mask, height = ball(side)
    relief = fine_relief(diffuse, mask, height, LIGHT, 4096)
    assert relief.shape == mask.shape and not relief[~mask].any() and relief.any()
    inner = np.pad(relief, ((0, -side % 64), (0, -side % 64)))
    for _ in range(6 if side > 300 else 5):
        inner = block_means(inner, 2)
    assert np.abs(inner).max() < 0.5 * np.abs(relief).max()


def test_a_level_that_is_not_asked_for_adds_nothing() -> None:
    diffuse, mask, height = ball(400)
    coarse = fine_relief(diffuse, mask, height, LIGHT, 200)
    fine = fine_relief(diffuse, mask, height, LIGHT, 4096)
    change = fine - coarse
    assert np.abs(coarse).max() > 0 and np.abs(change).max() > 0
    assert not fine_relief(diffuse, mask, height, LIGHT, 100).any()


@pytest.mark.parametrize("tile", [80, 128, 336])
def test_tiles_of_any_size_give_the_same_relief(tile: int) -> None:
    diffuse, mask, height = ball(400)
    whole = fine_relief(diffuse, mask, height, LIGHT, 4096, tile=512)
    assert np.array_equal(whole, fine_relief(diffuse, mask, height, LIGHT, 4096, tile=tile))
    assert whole.any()


def test_tiles_smaller_than_their_overlap_are_refused() -> None:
    diffuse, mask, height = ball(97)
    with pytest.raises(InputError, match=r"tiles of 72 pixels are smaller than their overlap"):
        fine_relief(diffuse, mask, height, LIGHT, 4096, tile=72)


def test_the_place_in_the_frame_does_not_matter() -> None:
    diffuse, mask, height = ball(120)
    pads = ((5, 30), (11, 2))
    moved = fine_relief(
        np.pad(diffuse, (*pads, (0, 0))), np.pad(mask, pads), np.pad(height, pads), LIGHT, 4096
    )
    assert np.array_equal(moved[5:-30, 11:-2], fine_relief(diffuse, mask, height, LIGHT, 4096))


def test_cancelling_stops_it() -> None:
    diffuse, mask, height = ball(97)
    with pytest.raises(Cancelled):
        fine_relief(diffuse, mask, height, LIGHT, 4096, Monitor(cancelled=lambda: True))


def solved(side: int, **settings: object) -> Decomposition:
    diffuse, mask, _ = ball(side)
    chosen = Settings(model="sirfs", **settings)  # type: ignore[arg-type]
    return isc_core.decompose(diffuse.astype(np.float32), mask, settings=chosen)


@pytest.mark.slow
def test_detail_changes_normals_and_keeps_the_light_and_the_identities() -> None:
    with_relief, without = (solved(160, detail=finest) for finest in (1024, 0))
    mask = with_relief.mask
    assert np.array_equal(with_relief.illumination, without.illumination)
    assert not np.array_equal(with_relief.normal[mask], without.normal[mask])
    product = with_relief.reflectance * with_relief.shading
    assert np.abs(product - with_relief.diffuse)[mask].max() < 1e-5


@pytest.mark.slow
def test_the_overall_shape_does_not_depend_on_the_size_of_the_maps() -> None:
    small, large = (solved(240, detail=0, max_size=size) for size in (96, 0))
    assert small.mask.shape[0] < large.mask.shape[0]
    assert np.array_equal(small.illumination, large.illumination)


@pytest.mark.slow
def test_less_memory_gives_the_same_result_until_it_is_too_little(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    diffuse, mask, _ = ball(500)
    sides = []

    def noted(mask: np.ndarray, side: int, *rest: int) -> Iterator[Tile]:
        sides.append(side)
        return tiles_of(mask, side, *rest)

    monkeypatch.setattr(detail, "tiles_of", noted)
    source = PhotoSource("", mask.shape[::-1], 8, "srgb", "file")
    image, none = diffuse.astype(np.float32), np.zeros_like(mask)
    photo, settings = Photo(image, mask, 1 / 3300, none, source), Settings(model="sirfs")
    much, little = (decompose(photo, settings, memory=size) for size in (2**31, 380_000_000))
    assert max(sides) == 768 and min(sides) < 400
    for name in ("height", "normal", "reflectance"):
        assert np.array_equal(getattr(much, name), getattr(little, name))
    with pytest.raises(InputError, match=r"need about 0\.4 GB of memory, more than the 0\.2 GB"):
        decompose(photo, settings, memory=200_000_000)


@pytest.mark.slow
def test_a_known_shape_stays_as_it_is() -> None:
    diffuse, mask, height = ball(96)
    result = isc_core.decompose(
        diffuse.astype(np.float32),
        mask,
        settings=Settings(model="sirfs"),
        known=KnownInputs(height=height),
    )
    given = height[mask] - height[mask].min()
    assert np.abs(result.height[mask] - given).max() < 1e-3


@pytest.mark.parametrize("wrong", [-1, 5000])
def test_unusable_detail_is_refused(wrong: int) -> None:
    with pytest.raises(InputError, match=r"--detail .*at most 4096"):
        replace(Settings(), detail=wrong).check()
