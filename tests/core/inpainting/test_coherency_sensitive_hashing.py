"""Coherency Sensitive Hashing: matches near the exhaustive optimum, exact distances, and only
sources that are allowed.
"""

import threading

import numpy as np
import pytest
from scipy import ndimage

from isc_core.errors import InputError
from isc_core.inpainting import walsh_hadamard
from isc_core.inpainting.coherency_sensitive_hashing import (
    CshOptions,
    CshSearch,
    Patches,
    patches_touching,
    patches_within,
)
from isc_core.numerics.thread_pool import ThreadPool


def texture(height: int, width: int, seed: int) -> np.ndarray:
    """An image (height, width, 3) with shapes of all sizes, edges and a little noise."""
    rng = np.random.default_rng(seed)
    image = np.zeros((height, width, 3))
    for sigma in (1.0, 3.0, 9.0):
        noise = ndimage.gaussian_filter(
            rng.normal(size=(height, width, 3)), (sigma, sigma, 0), mode="wrap"
        )
        image += np.sign(noise) * np.abs(noise / noise.std()) ** 0.3
    return np.clip(0.5 + 0.1 * image + 0.01 * rng.normal(size=image.shape), 0, 1)


def seen_later(image: np.ndarray) -> np.ndarray:
    """The same scene turned, enlarged and with other noise."""
    turn = np.array([[0.99, 0.06, 0], [-0.06, 0.99, 0], [0, 0, 1]]) / [[1.03], [1.03], [1]]
    moved = ndimage.affine_transform(image, turn, offset=(2, 3, 0), order=1, mode="reflect")
    return moved + 0.01 * np.random.default_rng(9).normal(size=image.shape)


def everywhere(image: np.ndarray) -> Patches:
    return patches_within(image, np.ones(image.shape[:2], bool))


def vectors(patches: Patches, which: np.ndarray) -> np.ndarray:
    rows, columns = patches.rows[which], patches.columns[which]
    cells = [patches.image[rows + a, columns + b] for a in range(8) for b in range(8)]
    return np.stack(cells, axis=1).reshape(len(which), -1).astype(np.float64)


def exhaustive(source: Patches, target: Patches, which: np.ndarray) -> np.ndarray:
    """The smallest distance (not squared) of each target patch of `which` to all source patches."""
    wanted, offered = vectors(target, which), vectors(source, np.arange(len(source)))
    squares = (wanted**2).sum(axis=1)[:, None] - 2 * wanted @ offered.T + (offered**2).sum(axis=1)
    return np.sqrt(np.maximum(squares.min(axis=1), 0))


@pytest.mark.slow
@pytest.mark.parametrize("case", ["later view", "other half"])
def test_mean_distance_is_near_the_exhaustive_optimum(case: str) -> None:
    image = texture(140, 200, seed=1)
    first, second = (
        (image, seen_later(image)) if case == "later view" else (image[:, :100], image[:, 100:])
    )
    source, target = everywhere(first), everywhere(second)
    which = np.random.default_rng(2).choice(len(target), 400, replace=False)
    found = np.sqrt(CshSearch(source).match(target).distance[which]).mean()
    assert found <= 1.05 * exhaustive(source, target, which).mean()


def test_one_table_is_worse_than_many() -> None:
    source, target = everywhere(texture(80, 90, 1)), everywhere(texture(80, 90, 2))
    few, many = (CshSearch(source, CshOptions(tables=k)).match(target).distance for k in (1, 8))
    assert (many <= few).all() and many.mean() < 0.95 * few.mean()


def test_distances_are_those_of_the_matches() -> None:
    source, target = everywhere(texture(50, 60, 1)), everywhere(texture(40, 70, 2))
    matches = CshSearch(source).match(target)
    true = ((vectors(target, np.arange(len(target))) - vectors(source, matches.source)) ** 2).sum(
        axis=1
    )
    assert np.allclose(matches.distance, true, rtol=1e-4)


def test_an_image_finds_itself() -> None:
    patches = everywhere(texture(60, 70, 1))
    matches = CshSearch(patches).match(patches)
    assert np.array_equal(matches.source, np.arange(len(patches))) and not matches.distance.any()


def test_sources_lie_in_their_mask_and_targets_touch_theirs() -> None:
    image = texture(60, 80, 3)
    hole = np.zeros((60, 80), bool)
    hole[20:30, 30:45] = True
    usable = ~hole
    usable[:, 60:] = False
    source, target = patches_within(image, usable), patches_touching(image, hole)
    assert len(target) == (10 + 7) * (15 + 7)
    matches = CshSearch(source).match(target)
    for row, column in zip(
        source.rows[matches.source], source.columns[matches.source], strict=True
    ):
        assert usable[row : row + 8, column : column + 8].all()
    assert len(source) == sum(
        usable[r : r + 8, c : c + 8].all() for r in range(53) for c in range(73)
    )


def test_the_threads_of_a_search_end_with_it() -> None:
    before = set(threading.enumerate())
    search = CshSearch(everywhere(texture(60, 70, 1)), CshOptions(tables=2, threads=3))
    search.match(everywhere(texture(60, 70, 2)))
    started = set(threading.enumerate()) - before
    assert started
    del search
    for thread in started:
        thread.join(10)
        assert not thread.is_alive()


def test_same_seed_same_matches_and_no_worse_than_the_start() -> None:
    source, target = everywhere(texture(60, 70, 1)), everywhere(texture(60, 70, 2))
    search = CshSearch(source, CshOptions(tables=2))
    once, again = search.match(target), search.match(target)
    assert np.array_equal(once.source, again.source)
    for threads in (1, 5):
        assert np.array_equal(
            CshSearch(source, CshOptions(tables=2, threads=threads)).match(target).source,
            once.source,
        )
    good = CshSearch(source, CshOptions(tables=8)).match(target)
    assert (search.match(target, start=good.source).distance <= good.distance * (1 + 1e-6)).all()


def test_projections_keep_distances_and_bound_them() -> None:
    patches = everywhere(texture(24, 90, 4))
    all_cells = vectors(patches, np.arange(len(patches)))
    whole = walsh_hadamard.project(patches.image, patches.rows, patches.columns, np.arange(192))
    true = ((all_cells[1:] - all_cells[0]) ** 2).sum(axis=1)
    assert np.allclose(((whole[1:] - whole[0]) ** 2).sum(axis=1), true, rtol=1e-3)
    chosen = walsh_hadamard.strongest(patches.image, patches.rows, patches.columns, 24)
    assert chosen[0] % 64 == 0 and len(set(chosen)) == 24
    bound = walsh_hadamard.project(patches.image, patches.rows, patches.columns, chosen)
    part = ((bound[1:] - bound[0]) ** 2).sum(axis=1)
    assert np.allclose(bound[:, :-1], whole[:, chosen], atol=1e-5)
    assert np.allclose((bound**2).sum(axis=1), (all_cells**2).sum(axis=1), rtol=1e-4)
    assert (part <= true * (1 + 1e-4)).all() and part.sum() > 0.6 * true.sum()
    mixed = np.random.default_rng(0).permutation(len(patches))
    again = walsh_hadamard.project(
        patches.image, patches.rows[mixed], patches.columns[mixed], chosen, ThreadPool(3)
    )
    assert np.array_equal(again, bound[mixed])


def test_one_channel_and_small_images() -> None:
    grey = texture(60, 61, 5)[..., :1]
    patches = everywhere(grey)
    assert np.mean(CshSearch(patches).match(patches).source == np.arange(len(patches))) > 0.95
    tiny = everywhere(texture(8, 8, 5))
    assert len(tiny) == 1 and CshSearch(tiny).match(tiny).distance[0] == 0


@pytest.mark.parametrize(
    "change",
    [
        {"tables": 0},
        {"projections": 200},
        {"hashed": 30},
        {"candidates": 0},
        {"occupancy": 0},
        {"seed": -1},
    ],
)
def test_refuses_options_out_of_range(change: dict[str, int]) -> None:
    with pytest.raises(InputError, match="must"):
        CshSearch(everywhere(texture(20, 20, 1)), CshOptions(**change))


def test_refuses_an_image_without_a_whole_patch() -> None:
    with pytest.raises(InputError, match="no source patch"):
        CshSearch(everywhere(texture(7, 50, 1)))
