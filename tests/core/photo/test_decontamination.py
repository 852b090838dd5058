"""The rim of a found mask without the background in it."""

import numpy as np

from isc_core.photo.decontamination import estimate_foreground


def composite(side: int = 60) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Image, cover and the disc's own colours, before a background of another colour."""
    y, x = np.mgrid[:side, :side] - side / 2
    cover = np.clip(0.5 + (0.3 * side - np.hypot(x, y)) / 3, 0, 1).astype(np.float32)
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
