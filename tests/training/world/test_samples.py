"""Photos and their truth stay together through turns, mirrors, scales and cameras."""

import math
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("torch")

import torch
from scipy import ndimage
from torch.nn import functional

from isc_core.networks import scene_network as core
from isc_core.scene.light_estimate import PLACES
from tests.training.world.analytic_views import ellipsoid_view
from tests.training.world.test_recipes import ATLAS, bank
from training.world.lighting import basis_of
from training.world.lit_pictures import LitPictures, make_pictures
from training.world.recipes import Shares
from training.world.samples import (
    OBJECT,
    OUTPUT,
    Draw,
    PhotoRenderer,
    Sample,
    draw_batch,
    draw_placement,
)
from training.world.tensor_batch import Pool
from training.world.view_batches import PreparedView, ViewStore, prepared

PHOTOS = 2  # of each picture, one after the other

HARMONICS = Shares(kinds=(1, 0, 0), lights=(1, 0, 0, 0, 0))
LAMP = Shares(kinds=(1, 0, 0), lights=(0, 0, 1, 0, 0))
HALVES = ((0.9, 0.9, 0.9), (0.5, 0.9, 0.8), (0.9, 0.6, 0.5))


pytestmark = pytest.mark.usefixtures("one_torch_thread")


def some_views(count: int) -> list[PreparedView]:
    halves = (HALVES * count)[:count]
    return [
        prepared(ellipsoid_view(np.random.default_rng(k), half)) for k, half in enumerate(halves)
    ]


def draw(seed: int, shares: Shares, count: int = 3, plain: bool = False) -> Draw:
    rng = np.random.default_rng(seed)
    views, places = some_views(count), np.array([0, 1, 2])
    one = draw_batch(views, np.arange(count), PHOTOS * count, ATLAS, places, rng, shares, plain)
    return replace(one, shares=(torch.arange(PHOTOS * count) // PHOTOS + 0.5) / count)


def finished(one: Draw, seed: int = 0) -> Sample:
    torch.manual_seed(seed)
    return PhotoRenderer(bank(), 16)(one, store(one))


def store(one: Draw) -> ViewStore:
    return ViewStore(some_views(len(one.chosen)))


def placed(one: Draw, **changes: float | list[float]) -> Draw:
    """The draw with its placements changed."""
    count = len(one.placements["angle"])
    new = {
        name: torch.tensor(value).float().expand(count, *torch.tensor(value).shape)
        for name, value in changes.items()
    }
    return replace(one, placements=one.placements | new)


STRAIGHT = {
    "angle": 0.0,
    "mirror": 1.0,
    "length": float(OBJECT),
    "shift": [0.0, 0.0],
    "cut": [0.0] * 4,
    "mask_error": 0.0,
    "mask_shift": [0.0, 0.0],
}


def inner(known: torch.Tensor, pixels: int = 2) -> np.ndarray:
    """Known pixels (B, H, W), those at the edge left out, whose values are partly guessed."""
    ball = ndimage.generate_binary_structure(2, 1)
    return np.stack(
        [ndimage.binary_erosion(one > 0, ball, iterations=pixels) for one in known[:, 0].numpy()]
    )


@pytest.mark.parametrize("seed", range(3))
def test_samples_are_finite_and_their_normals_unit(seed: int) -> None:
    sample = finished(draw(seed, Shares()))
    for name, part in vars(sample).items():
        assert part.isfinite().all(), name
    length = sample.normal.norm(dim=1, keepdim=True)[sample.known > 0]
    assert (length - 1).abs().max() < 1e-4
    assert sample.photo.shape == (3 * PHOTOS, 3, OUTPUT, OUTPUT) and (sample.photo >= 0).all()
    assert set(sample.mask.unique().tolist()) <= {0.0, 1.0} and (sample.known <= sample.mask).all()
    assert not (sample.photo * (1 - sample.mask)).any()
    assert (sample.ratio >= 0).all()
    assert ((sample.place >= -1) & (sample.place < len(PLACES))).all()
    assert ((sample.place >= 0) == (sample.count > 0)).all()


@pytest.mark.parametrize("seed", range(4))
def test_the_light_and_the_normals_of_a_placed_photo_give_its_shading(seed: int) -> None:
    """Under harmonics, log shading = basis(normal) light, whatever the angle and the mirror."""
    sample = finished(draw(seed, HARMONICS))
    light = sample.light.view(-1, 3, 9)
    found = torch.einsum("bhwk,bck->bchw", basis_of(sample.normal.permute(0, 2, 3, 1)), light)
    off = (found - sample.log_shading).abs().amax(1).numpy()
    where = inner(sample.known)
    assert where.sum() > 9000
    assert np.median(off[where]) < 0.002 and np.quantile(off[where], 0.99) < 0.02
    assert off[where].max() < 0.1


@pytest.mark.parametrize("angle", [0.0, 90.0, 200.0, -33.0])
@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_normals_turn_with_the_picture(angle: float, mirror: float) -> None:
    """A ball's normals are its places; on a turned ellipsoid they lean as its outline does."""
    one = placed(
        draw(1, HARMONICS, 3), **STRAIGHT | {"angle": math.radians(angle), "mirror": mirror}
    )
    sample = finished(one)
    where = inner(sample.known)
    rows, columns = np.nonzero(where[0])
    place = np.stack([columns + 0.5 - OUTPUT / 2, OUTPUT / 2 - rows - 0.5], 1) / (OBJECT / 2)
    ball = sample.normal[0, :2].numpy()[:, rows, columns].T
    assert np.abs(ball - place).max() < 0.03
    # The slim ellipsoid's long axis, y, is where its cover reaches farthest.
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    axis = np.array([-s * mirror, c])
    rows, columns = np.nonzero(where[PHOTOS])
    place = np.stack([columns + 0.5 - OUTPUT / 2, OUTPUT / 2 - rows - 0.5], 1)
    spread = np.linalg.eigh(np.cov(place.T))[1][:, 1]
    assert abs(spread @ axis) > 0.999


def test_a_mirrored_photo_has_mirrored_truth() -> None:
    """The convention of light and places is the one that the core uses to average both."""
    for shares in (HARMONICS, LAMP):
        one = draw(3, shares, 4, plain=True)
        one = replace(
            one, cameras=one.cameras | {k: 0 * one.cameras[k] for k in ("noise", "floor")}
        )
        seen = finished(placed(one, **STRAIGHT))
        mirrored = finished(placed(one, **STRAIGHT | {"mirror": -1.0}))
        for name, sign in (("photo", 1), ("log_shading", 1), ("ratio", 1), ("normal", -1)):
            flipped = getattr(mirrored, name).flip(-1)
            signs = torch.tensor([sign, 1, 1]).view(1, 3, 1, 1)
            both = (seen.known * mirrored.known.flip(-1)).expand_as(flipped) > 0
            off = (flipped * signs - getattr(seen, name)).abs()[both]
            assert off.quantile(0.98) < 0.02, name
        flips = torch.tensor([1, 1, 1, -1, -1, 1, 1, -1, 1.0]).repeat(3)
        torch.testing.assert_close(mirrored.light * flips, seen.light, rtol=1e-3, atol=0.03)
        torch.testing.assert_close(mirrored.count, seen.count)
        lit = seen.place >= 0
        towards = torch.tensor(PLACES)[seen.place[lit]] * torch.tensor([-1.0, 1, 1])
        again = torch.tensor(PLACES)[mirrored.place[lit]]
        assert ((towards * again).sum(1) > math.cos(math.radians(12))).all()
    np.testing.assert_array_equal(core._MIRROR_SIGNS, flips[:9])


def test_lamps_turn_with_the_picture() -> None:
    """Lambert's brightest place on a ball lies toward the lamp, in any placement."""
    one = draw(7, replace(LAMP, matte=1.0), 6)
    one = replace(one, recipes=one.recipes | {"ambient": 0.02 * one.recipes["ambient"]})
    one = replace(one, recipes=one.recipes | {"bounce": 0 * one.recipes["bounce"]})
    sample = finished(one)
    for k in (k for k in range(6 * PHOTOS) if k // PHOTOS % 3 == 0):  # the balls
        assert sample.count[k] == 1
        shading = np.where(inner(sample.known[k : k + 1])[0], sample.log_shading[k].mean(0), -9)
        row, column = np.unravel_index(shading.argmax(), shading.shape)
        toward = PLACES[int(sample.place[k])]
        assert sample.normal[k, :, row, column].numpy() @ toward > math.cos(math.radians(15))


@pytest.mark.parametrize("length", [98.0, 112.0, 116.0])
@pytest.mark.parametrize("angle", [0.0, 50.0])
def test_an_object_is_as_long_as_its_placement_says(length: float, angle: float) -> None:
    straight = STRAIGHT | {"angle": math.radians(angle), "length": length, "shift": [3.0, -2.0]}
    sample = finished(placed(draw(2, HARMONICS, 3), **straight))
    for known in sample.known[:, 0].numpy():
        rows, columns = np.nonzero(known)
        sides = np.ptp(rows) + 1, np.ptp(columns) + 1
        assert max(sides) == pytest.approx(length, abs=2)
        middle = (columns.min() + columns.max()) / 2, (rows.min() + rows.max()) / 2
        assert middle == pytest.approx((63.5 + 3, 63.5 - 2), abs=1)


@pytest.mark.parametrize("error", [-2.0, -0.7, 0.0, 1.5, 2.0])
def test_a_wrong_mask_is_wrong_by_its_shift_and_three_pixels_at_most(error: float) -> None:
    right = finished(placed(draw(4, HARMONICS, 3), **STRAIGHT))
    wrong = finished(
        placed(draw(4, HARMONICS, 3), **STRAIGHT | {"mask_error": error, "mask_shift": [1.0, -0.5]})
    )
    for true, given in zip(right.known[:, 0].numpy(), wrong.mask[:, 0].numpy(), strict=True):
        outside = ndimage.distance_transform_edt(true == 0)
        inside = ndimage.distance_transform_edt(true > 0)
        assert max(outside[given > 0].max(), inside[given == 0].max()) < 3.2 + math.hypot(1, 0.5)
        if abs(error) == 2:
            assert np.sign(given.sum() - true.sum()) == np.sign(error)


def test_a_frame_cuts_photo_and_truth() -> None:
    cut = [10.0, 8.0, 20.0, 0.0]
    sample = finished(placed(draw(5, HARMONICS, 3), **STRAIGHT | {"length": 160.0, "cut": cut}))
    for part in (sample.mask, sample.known, sample.photo):
        assert not part[..., :10].any() and not part[..., -20:].any() and not part[..., :8, :].any()
        assert part[:, :, 60, 60].any()


def test_log_shading_is_relative_to_the_mean_of_the_photo() -> None:
    """Brightness of log shading: photo = albedo exp(log shading), over the photo's mean."""
    one = draw(6, replace(HARMONICS, matte=1.0), 3, plain=True)
    clean = {name: 0 * one.cameras[name] for name in ("noise", "floor", "blur", "clips")}
    one = placed(replace(one, cameras=one.cameras | clean), **STRAIGHT)
    white = one.recipes | {
        "base": torch.full((3, 3), 0.5),
        "strengths": 0 * one.recipes["strengths"],
    }
    sample = finished(replace(one, recipes=white))
    where = inner(sample.known)
    for k in range(len(sample.photo)):
        known = sample.mask[k, 0] > 0
        image = sample.photo[k] / sample.photo[k].mean(0)[known].mean()
        ratio = (torch.log(image) - sample.log_shading[k]).numpy()[:, where[k]]
        np.testing.assert_allclose(ratio, math.log(0.5), atol=0.01)
        assert (sample.ratio[k] < 1e-3).all()


def test_a_smaller_photo_shows_the_same() -> None:
    one = placed(draw(2, HARMONICS, 3, plain=True), **STRAIGHT)
    torch.manual_seed(0)
    small = PhotoRenderer(bank(), 16, OUTPUT // 2)(one, store(one))
    large = finished(one)
    both = inner(functional.avg_pool2d(large.known, 2).floor()) & inner(small.known)
    off = (functional.avg_pool2d(large.normal, 2) - small.normal).norm(dim=1).numpy()
    assert np.quantile(off[both], 0.99) < 0.03
    torch.testing.assert_close(small.light[:, 1:9], large.light[:, 1:9])


def test_a_stretched_ball_is_an_ellipse_with_its_normals() -> None:
    aspect = 1.4
    one = placed(draw(2, HARMONICS, 3, plain=True), **STRAIGHT)
    factors = torch.tensor([math.sqrt(aspect), 1 / math.sqrt(aspect), 1]).expand(3, 3)
    sample = finished(replace(one, recipes=one.recipes | {"stretch": factors}))
    known = sample.known[0, 0] > 0  # the first view is a ball
    rows, columns = (known.any(axis).sum().item() for axis in (1, 0))
    assert columns / rows == pytest.approx(aspect, rel=0.03)
    across = (torch.arange(OUTPUT) + 0.5 - OUTPUT / 2) * (2 / OBJECT)
    y, x = -across[:, None] * aspect, across[None]
    inside = (x**2 + y**2 < 0.9) & known
    # the surface x^2 + y^2 + (z a)^2 = 1 in units of half the width, y scaled by the aspect
    true = torch.stack(torch.broadcast_tensors(x, y * aspect, torch.sqrt(1 - x**2 - y**2)))
    true[2] *= math.sqrt(aspect)
    true = functional.normalize(true.nan_to_num(), dim=0)
    off = (true - sample.normal[0]).norm(dim=0)[inside]
    assert off.mean() < 0.03


def test_a_pool_keeps_the_latest_pictures() -> None:
    parts = [
        make_pictures(store(one).batch(one.chosen), one.recipes, bank())
        for one in map(numbered, range(4))
    ]
    pool = Pool[LitPictures](4)
    with pytest.raises(ValueError, match="empty"):
        pool.picked(torch.zeros(1))
    for part in parts:
        pool.exchange(part)
    kept = pool.picked(torch.arange(4) / 4 + 0.1)
    assert {tuple(one) for one in kept.coefficients[:, 0].tolist()} == {
        tuple(one) for part in parts[2:] for one in part.coefficients[:, 0].tolist()
    }


def numbered(number: int) -> Draw:
    return draw(number, HARMONICS, 2)


def test_placements_fit_the_frame() -> None:
    rng = np.random.default_rng(0)
    placements = [draw_placement(rng) for _ in range(300)]
    whole = [one for one in placements if not one.cut.any()]
    assert 0.85 < len(whole) / 300 < 0.98
    assert all(one.length / 2 + np.abs(one.shift).max() <= OUTPUT / 2 for one in whole)
    assert {one.mirror for one in placements} == {-1.0, 1.0}
