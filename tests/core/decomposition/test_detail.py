"""The stage of fine relief: what it may change, at every size."""

from dataclasses import replace

import numpy as np
import pytest

import isc_core
from isc_core.decomposition.detail import Pyramid, fine_relief
from isc_core.decomposition.layers import normals_and_shading
from isc_core.decomposition.pipeline import decompose
from isc_core.decomposition.settings import Settings
from isc_core.errors import Cancelled, InputError
from isc_core.imaging.blocks import block_means
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
    _, shading = normals_and_shading(height + bumps, LIGHT, inside)
    return 0.5 * shading, inside, height


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


@pytest.mark.parametrize("tile", [24, 128, 336])
def test_tiles_of_any_size_give_the_same_relief(tile: int) -> None:
    pyramid = Pyramid.of(*ball(400), LIGHT)
    whole = pyramid.relief(4096, tile=512)
    assert np.array_equal(whole, pyramid.relief(4096, tile=tile))
    assert whole.any()


def test_tiles_smaller_than_their_overlap_are_refused() -> None:
    pyramid = Pyramid.of(*ball(97), LIGHT)
    with pytest.raises(InputError, match=r"tiles of 16 pixels are smaller than their overlap"):
        pyramid.relief(4096, tile=16)


def test_the_place_in_the_frame_does_not_matter() -> None:
    diffuse, mask, height = ball(120)
    pads = ((5, 30), (11, 2))
    moved = fine_relief(
        np.pad(diffuse, (*pads, (0, 0))), np.pad(mask, pads), np.pad(height, pads), LIGHT, 4096
    )
    assert np.array_equal(moved[5:-30, 11:-2], fine_relief(diffuse, mask, height, LIGHT, 4096))


def test_edges_of_paint_are_no_relief_and_relief_beside_them_stays() -> None:
    diffuse, mask, height = ball(240)
    smooth = 0.5 * normals_and_shading(height, LIGHT, mask)[1]
    columns = np.arange(240)
    paint = np.where((columns // 40 % 2)[:, None], (0.9, 0.4, 0.3), (0.3, 0.5, 0.9))
    bumps, plain, printed, both = (
        Pyramid.of(image, mask, height, LIGHT).relief(4096)
        for image in (diffuse, smooth, paint * smooth, paint * diffuse)
    )
    assert (printed - plain)[mask].std() < 0.2 * bumps[mask].std()
    away = mask & (np.abs(columns % 40 - 20) < 12)
    assert np.corrcoef(both[away], bumps[away])[0, 1] > 0.9


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
@pytest.mark.parametrize("illumination", ["natural", "laboratory"])
def test_nothing_is_added_in_other_illuminations(illumination: str) -> None:
    with_relief, without = (solved(96, detail=n, illumination=illumination) for n in (1024, 0))
    assert np.array_equal(with_relief.height, without.height)


@pytest.mark.slow
def test_the_overall_shape_does_not_depend_on_the_size_of_the_maps() -> None:
    small, large = (solved(240, detail=0, max_size=size) for size in (96, 0))
    assert small.mask.shape[0] < large.mask.shape[0]
    assert np.array_equal(small.illumination, large.illumination)


def test_too_little_memory_is_refused_with_the_amount() -> None:
    diffuse, mask, _ = ball(500)
    source = PhotoSource("", mask.shape[::-1], 8, "srgb", "file")
    photo = Photo(diffuse.astype(np.float32), mask, 1 / 3300, np.zeros_like(mask), source)
    with pytest.raises(InputError, match=r"need about 0\.4 GB of memory, more than the 0\.2 GB"):
        decompose(photo, Settings(model="sirfs"), memory=200_000_000)


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


def test_one_paint_has_one_probability_under_lights_of_several_colours() -> None:
    _, mask, height = ball(240)
    light = LIGHT + np.outer(np.eye(9)[2], (0.6, 0, -0.6))  # red from one side, blue from the other
    bumps = np.random.default_rng(4).normal(size=mask.shape) * 0.2
    diffuse = 0.5 * normals_and_shading(height + bumps, light, mask)[1]
    evidence = Pyramid.of(diffuse, mask, height, light).evidence()
    assert evidence is not None
    spread = np.ptp(evidence.along[evidence.along != 0])
    assert spread < 0.02


def test_two_paints_have_probabilities_of_their_own() -> None:
    diffuse, mask, height = ball(300)
    smooth = 0.5 * normals_and_shading(height, LIGHT, mask)[1]
    left = (np.arange(300) < 150)[:, None]
    dots = np.exp(0.03 * np.random.default_rng(5).normal(size=(300, 300)))[..., None]
    both = np.where(left, diffuse, (0.9, 0.5, 0.3) * smooth * dots)
    evidence = Pyramid.of(both, mask, height, LIGHT).evidence()
    whole = Pyramid.of(diffuse, mask, height, LIGHT).evidence()
    assert evidence is not None and whole is not None
    middle = evidence.along.shape[0] // 2
    relief, paint = evidence.along[middle, middle - 4], evidence.along[middle, middle + 4]
    assert relief == pytest.approx(float(whole.along[middle, middle]), abs=0.4)
    assert relief > paint + 0.3
