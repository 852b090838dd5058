"""What the tests of separation methods share: a made scene, real photos with their truth, and what
holds for every split.
"""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from isc_core.imaging.bounding_box import mask_slices
from isc_core.scene.decomposition import Separation

PAINTS = np.array([[0.7, 0.2, 0.1], [0.15, 0.55, 0.2], [0.1, 0.25, 0.6]])


def glossy_disc(height: float = 0.5) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Image, true diffuse (both (H, W, 3)) and mask of a shaded disc in sectors of three paints; a
    white highlight on each paint.
    """
    y, x = np.mgrid[-1:1:96j, -1:1:120j]
    mask = x**2 + y**2 < 0.9
    angle = np.arctan2(y, x)
    shading = 0.35 + 0.65 * np.sqrt(np.clip(1 - x**2 - y**2, 0, 1))
    diffuse = PAINTS[np.digitize(angle, [-np.pi / 3, np.pi / 3])] * (shading * mask)[..., None]
    centres = [(0.5 * np.cos(t), 0.5 * np.sin(t)) for t in (-2 * np.pi / 3, 0.0, 2 * np.pi / 3)]
    specular = sum(height * np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / 0.015) for cx, cy in centres)
    return diffuse + (specular * mask)[..., None], diffuse, mask


def read(path: Path) -> np.ndarray:
    """A photo (H, W, 3) as stored, over its largest code."""
    stored = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)[..., ::-1]
    return stored / np.iinfo(stored.dtype).max


def highlight_photo(shared: Path, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Image, true diffuse and the full mask of one of the photos with published figures."""
    image, truth = (
        read(shared / "data/highlight" / file) for file in (f"{name}.bmp", f"{name}_gt.bmp")
    )
    return image, truth, np.ones(image.shape[:2], bool)


def laboratory_photo(shared: Path, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Image, true diffuse and mask of an object of the laboratory set, cut to the mask's box."""
    folder = shared / "data/mit_berkeley_train/laboratory" / name
    mask = cv2.imread(str(folder / "mask.png"), cv2.IMREAD_GRAYSCALE) > 0
    box = mask_slices(mask)
    return read(folder / "original.png")[box], read(folder / "diffuse.png")[box], mask[box]


def psnr(split: Separation, truth: np.ndarray) -> float:
    """Of the diffuse image over all pixels, dB, for values in [0, 1]."""
    return float(-10 * np.log10(np.mean((split.diffuse - truth) ** 2)))


def error_ratio(split: Separation, image: np.ndarray, truth: np.ndarray, mask: np.ndarray) -> float:
    """Squared error of the diffuse image inside the mask over that of leaving the photo as it is."""
    return float(np.mean((split.diffuse - truth)[mask] ** 2) / np.mean((image - truth)[mask] ** 2))


def assert_layers_hold(
    split: Separation, image: np.ndarray, mask: np.ndarray, *, tinted: bool = False
) -> None:
    """The identities and ranges of every split;

    `image` may be anything outside the mask. `tinted`: specular light need not be white.
    """
    total = split.diffuse + split.specular + split.residual
    assert np.abs(total[mask] - image[mask]).max() <= 1e-6 * image[mask].max()
    assert (split.diffuse >= 0).all() and (split.diffuse[mask] <= image[mask] * (1 + 1e-6)).all()
    assert (split.specular >= 0).all() and (tinted or np.ptp(split.specular, axis=2).max() == 0)
    for layer in (split.diffuse, split.specular, split.residual, split.confidence):
        assert layer.dtype == np.float32 and np.isfinite(layer).all() and not layer[~mask].any()
    assert (split.confidence >= 0).all() and (split.confidence <= 1).all()


def assert_scale_and_surroundings_do_not_matter(
    separate: Callable[..., Separation], options: object, scale: float, least: float
) -> None:
    """A wider frame, unknown outside the mask, and another exposure give the same specular layer,
    of at least `least` on the disc.
    """
    image, _, mask = glossy_disc()
    split = separate(image, mask, options)
    assert split.specular.max() > least
    padded = np.pad(image, [(13, 5), (7, 11), (0, 0)], constant_values=np.nan)
    wide = separate(scale * padded, np.pad(mask, [(13, 5), (7, 11)]), options)
    assert np.allclose(wide.specular[13:-5, 7:-11] / scale, split.specular, atol=2e-6)


def assert_any_mask_and_noise_keep_the_layers_sound(
    separate: Callable[..., Separation], options: object
) -> None:
    """Noise with grey and black stripes under a scattered mask, and under a mask of one pixel."""
    random = np.random.default_rng(3)
    image = random.random((40, 50, 3)) ** 3
    image[20:24] = image[20:24, :, :1]  # grey
    image[30:33] = 0
    single = np.zeros((40, 50), bool)
    single[3, 4] = True
    for mask in (random.random((40, 50)) > 0.4, single):
        split = separate(np.where(mask[..., None], image, np.nan), mask, options)
        assert_layers_hold(split, image, mask)


def assert_clipped_cores_are_filled_and_inform_nobody(
    separate: Callable[..., Separation], at_most: float
) -> None:
    """Clipped pixels get a diffuse layer with at most this error ratio, no confidence, and have no
    influence on others.
    """
    scene, diffuse, mask = glossy_disc(0.9)
    image = np.minimum(scene, 0.95)
    clipped = (scene > 0.95).any(axis=2)
    assert clipped.sum() > 20
    split = separate(image, mask, clipped=clipped)
    assert_layers_hold(split, image, mask)
    assert not split.confidence[clipped].any()
    wild = separate(np.where(clipped[..., None], [0.9, 0.0, 0.0], image), mask, clipped=clipped)
    assert np.array_equal(wild.specular[mask & ~clipped], split.specular[mask & ~clipped])
    assert error_ratio(split, scene, diffuse, clipped) < at_most
