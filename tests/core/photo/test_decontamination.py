"""The rim of a found mask without the background in it."""

import numpy as np
import pytest
from scipy import ndimage

from isc_core.photo.decontamination import estimate_foreground, unmixed


def composite(
    side: int = 60, width: int = 3, wider: float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Image, cover and the disc's own colours, before a background of another colour."""
    y, x = np.mgrid[:side, :side] - side / 2
    cover = np.clip(0.5 + (0.3 * side + wider - np.hypot(x, y)) / width, 0, 1).astype(np.float32)
    front = np.array([0.7, 0.2, 0.1]) * (1 + 0.3 * x / side)[..., None]
    back = np.array([0.05, 0.3, 0.6]) * (1 + 0.2 * y / side)[..., None]
    image = cover[..., None] * front + (1 - cover[..., None]) * back
    return image.astype(np.float32), cover, front


def test_the_rim_gets_the_objects_colours() -> None:
    image, cover, front = composite()
    rim = (cover >= 0.5) & (cover < 1)
    before = np.abs(image - front)[rim].mean()
    after = np.abs(estimate_foreground(image, cover) - front)[rim].mean()
    assert after < 0.25 * before


def test_everything_else_stays_as_it_is() -> None:
    image, cover, _ = composite()
    found = estimate_foreground(image, cover)
    others = (cover < 0.5) | (cover == 1)
    assert np.array_equal(found[others], image[others]) and (found >= 0).all()
    hard = (cover >= 0.5).astype(np.float32)
    assert estimate_foreground(image, hard) is image


def test_in_place_gives_the_same_in_the_image_itself() -> None:
    image, cover, _ = composite()
    kept = image.copy()
    copied = estimate_foreground(image, cover)
    assert np.array_equal(image, kept)
    assert estimate_foreground(image, cover, in_place=True) is image
    assert np.array_equal(image, copied)


@pytest.mark.parametrize(("side", "scale"), [(100, 1), (800, 2)])
@pytest.mark.parametrize("radius", [-0.5, 0.5, 1.0])
def test_the_outermost_pixels_of_an_inexact_mask_stay_within_inner_colours(
    side: int, scale: int, radius: float
) -> None:
    """The mask of a large photo is found at a smaller size."""
    image, _, front = composite(side, scale)
    _, wrong, _ = composite(side, scale, radius * scale)
    outer = (wrong >= 0.5) & ~ndimage.binary_erosion(wrong >= 0.5, iterations=scale)
    before, after = (
        np.abs(found(image, wrong) - front)[outer].mean()
        for found in (unmixed, estimate_foreground)
    )
    assert after < 0.85 * before


def test_a_mask_without_inner_pixels_keeps_its_colours() -> None:
    image, cover, _ = composite()
    line = np.zeros_like(cover)
    line[30, 10:50] = 0.8
    np.testing.assert_array_equal(estimate_foreground(image, line), unmixed(image, line))
