"""What lies under clipped highlights: stripes go on, plain paint stays smooth."""

import numpy as np
import pytest

from isc_core.inpainting.pull_push import fill
from isc_core.separation.support import clipped_texture
from isc_core.separation.support.clipped_texture import inpaint_clipped

SIDE = 96


def ball(stripes: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Diffuse image and log shading of a red ball, striped by a contrast, and its mask."""
    line = np.linspace(-1.1, 1.1, SIDE)
    x, y = np.meshgrid(line, -line)
    mask = x**2 + y**2 < 1
    z = np.sqrt(np.clip(1 - x**2 - y**2, 0, 1))
    shading = 0.2 + 0.8 * np.clip(-0.35 * x + 0.45 * y + 0.82 * z, 0, 1)
    paint = np.array([0.5, 0.2, 0.15]) * np.exp(stripes * np.sign(np.sin(24 * x)))[..., None]
    diffuse = np.where(mask[..., None], paint * shading[..., None], 0).astype(np.float32)
    return diffuse, np.repeat(np.log(shading)[..., None], 3, axis=2), mask


def lit(diffuse: np.ndarray, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The photo with a clipped highlight, the smooth fill under it, and where it clips."""
    rows, columns = np.mgrid[:SIDE, :SIDE]
    clipped = (np.hypot(rows - 40, columns - 42) < 9) & mask
    photo = np.where(clipped[..., None], np.float32(1), diffuse)
    smooth = np.where(clipped[..., None], fill(diffuse, mask & ~clipped), diffuse)
    return photo, smooth, clipped


def error(found: np.ndarray, diffuse: np.ndarray) -> float:
    return float(np.square(found - diffuse).sum())


def test_stripes_go_on_under_a_clipped_highlight() -> None:
    diffuse, log_shading, mask = ball(0.4)
    photo, smooth, clipped = lit(diffuse, mask)
    found = inpaint_clipped(smooth, photo, clipped, mask, log_shading)
    assert error(found, diffuse) < 0.5 * error(smooth, diffuse)


@pytest.mark.parametrize("apart", [False, True])
def test_holes_of_a_large_object_are_filled_from_their_surroundings(
    apart: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(clipped_texture, "_CELL", 8)
    diffuse, log_shading, mask = ball(0.4)
    photo, smooth, clipped = lit(diffuse, mask)
    if apart:
        clipped[70, 30:33] = True
        photo[70, 30:33] = 1
    found = inpaint_clipped(smooth, photo, clipped, mask, log_shading, 100)
    assert error(found, diffuse) < 0.5 * error(smooth, diffuse)
    np.testing.assert_array_equal(found[~clipped], smooth[~clipped])
    assert apart == bool((found[70, 30:33] != smooth[70, 30:33]).any())


@pytest.mark.slow
def test_paint_far_from_a_hole_does_not_matter_on_a_large_object() -> None:
    side = 560
    rng = np.random.default_rng(3)
    mask, clipped = np.ones((side, side), bool), np.zeros((side, side), bool)
    clipped[100:106, 100:109] = True
    stripes = np.sin(np.arange(side) / 3) > 0
    diffuse = np.broadcast_to(0.2 + 0.3 * stripes[:, None, None], (side, side, 3))
    diffuse = (diffuse + rng.uniform(0, 0.05, diffuse.shape)).astype(np.float32)
    changed = diffuse.copy()
    changed[450:, 450:] = rng.uniform(0, 1, (side - 450, side - 450, 3))

    def filled(paint: np.ndarray, **options: int) -> np.ndarray:
        hole = clipped[..., None]
        given, photo = np.where(hole, 0, paint), np.where(hole, 1, paint)
        flat = np.zeros_like(paint)
        return inpaint_clipped(given, photo, clipped, mask, flat, **options)[clipped]

    near = {"largest_whole": side**2 - 1}
    np.testing.assert_array_equal(filled(diffuse, **near), filled(changed, **near))
    assert (filled(diffuse) != filled(changed)).any()


def test_plain_paint_is_not_worse_than_the_smooth_fill() -> None:
    diffuse, log_shading, mask = ball(0)
    photo, smooth, clipped = lit(diffuse, mask)
    found = inpaint_clipped(smooth, photo, clipped, mask, log_shading)
    assert error(found, diffuse) <= error(smooth, diffuse) * (1 + 1e-5)


@pytest.mark.parametrize("stripes", [0.0, 0.4])
def test_only_clipped_pixels_change_and_stay_within_the_image(stripes: float) -> None:
    diffuse, log_shading, mask = ball(stripes)
    photo, smooth, clipped = lit(diffuse, mask)
    found = inpaint_clipped(smooth, photo, clipped, mask, log_shading)
    np.testing.assert_array_equal(found[~clipped], smooth[~clipped])
    assert (found >= 0).all() and (found <= photo).all()


def test_nothing_known_or_nothing_clipped_leaves_the_layer() -> None:
    diffuse, log_shading, mask = ball(0)
    for clipped in (mask, np.zeros_like(mask)):
        found = inpaint_clipped(diffuse, diffuse, clipped, mask, log_shading)
        np.testing.assert_array_equal(found, diffuse)


def test_the_answer_repeats_bit_for_bit() -> None:
    diffuse, log_shading, mask = ball(0.4)
    photo, smooth, clipped = lit(diffuse, mask)
    one, again = (inpaint_clipped(smooth, photo, clipped, mask, log_shading) for _ in range(2))
    np.testing.assert_array_equal(one, again)


def test_the_fill_of_a_grey_photo_is_grey() -> None:
    """The shading that a network expects differs a little between the channels."""
    diffuse, log_shading, mask = ball(0.4)
    diffuse = np.repeat(diffuse[..., :1], 3, axis=2)
    photo, smooth, clipped = lit(diffuse, mask)
    found = inpaint_clipped(smooth, photo, clipped, mask, log_shading * [1, 1.1, 0.9])
    assert (found[clipped] != smooth[clipped]).any()
    np.testing.assert_array_equal(found, np.repeat(found[..., :1], 3, axis=2))
