"""Scenes, photos with ground truth and assertions that the tests of separation methods share."""

from pathlib import Path

import cv2
import numpy as np

from isc_core.imaging.bounding_box import mask_slices
from isc_core.scene.decomposition import Separation

ALBEDOS = np.array([[0.7, 0.2, 0.1], [0.15, 0.55, 0.2], [0.1, 0.25, 0.6]])
RED, WHITE = np.array([0.5, 0.06, 0.05]), np.array([0.8, 0.78, 0.76])
BALL_SIDE = 96


Scene = tuple[np.ndarray, np.ndarray, np.ndarray]  # image, true diffuse (H, W, 3), mask (H, W)


def glossy_disc(height: float = 0.5) -> Scene:
    """A shaded disc in sectors of three albedos; a white highlight on each."""
    y, x = np.mgrid[-1:1:96j, -1:1:120j]
    mask = x**2 + y**2 < 0.9
    angle = np.arctan2(y, x)
    shading = 0.35 + 0.65 * np.sqrt(np.clip(1 - x**2 - y**2, 0, 1))
    diffuse = ALBEDOS[np.digitize(angle, [-np.pi / 3, np.pi / 3])] * (shading * mask)[..., None]
    centres = [(0.5 * np.cos(t), 0.5 * np.sin(t)) for t in (-2 * np.pi / 3, 0.0, 2 * np.pi / 3)]
    specular = sum(height * np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / 0.015) for cx, cy in centres)
    return diffuse + (specular * mask)[..., None], diffuse, mask


def disc_of_two() -> Scene:
    """A shaded disc of two albedos with one white highlight."""
    y, x = np.mgrid[-1:1:80j, -1:1:100j]
    mask = x**2 + y**2 < 0.9
    shading = 0.4 + 0.6 * np.sqrt(np.clip(1 - x**2 - y**2, 0, 1))
    specular = 0.5 * np.exp(-((x - 0.4) ** 2 + (y + 0.2) ** 2) / 0.02)
    albedo = np.where((x > 0)[..., None], [0.7, 0.25, 0.15], [0.2, 0.6, 0.15])
    diffuse = albedo * (shading * mask)[..., None]
    return diffuse + (specular * mask)[..., None], diffuse, mask


def gaussian_plate() -> Scene:
    """Two shaded albedos side by side, a smooth white highlight on each."""
    y, x = np.mgrid[:60, :100].astype(float)
    specular = sum(0.4 * np.exp(-((x - at) ** 2 + (y - 30) ** 2) / 60) for at in (25, 75))
    albedo = np.where((x < 50)[..., None], [0.7, 0.3, 0.1], [0.2, 0.3, 0.6])
    diffuse = albedo * (0.5 + 0.5 * y / 60)[..., None]
    return diffuse + specular[..., None], diffuse, np.ones(y.shape, bool)


def conical_plate(radius: float = 5) -> Scene:
    """Two shaded albedos side by side, a conical white highlight on each."""
    y, x = np.mgrid[:50, :90].astype(float)
    specular = sum(0.4 * np.clip(1 - np.hypot(x - at, y - 25) / radius, 0, 1) for at in (22, 67))
    albedo = np.where((x < 45)[..., None], [0.7, 0.3, 0.1], [0.2, 0.3, 0.6])
    diffuse = albedo * (0.6 + 0.4 * y / 50)[..., None]
    return diffuse + specular[..., None], diffuse, np.ones(y.shape, bool)


def spots(heights: tuple[float, ...] = (0.3, 0.4)) -> Scene:
    """An even orange plate with conical white highlights in a row."""
    y, x = np.mgrid[:60, : 60 * len(heights)].astype(float)
    specular = sum(
        h * np.clip(1 - np.hypot(x - 30 - 60 * k, y - 30) / 12, 0, 1) for k, h in enumerate(heights)
    )
    diffuse = np.broadcast_to([0.6, 0.3, 0.1], (*y.shape, 3))
    return diffuse + specular[..., None], diffuse, np.ones(y.shape, bool)


def ball(stripe: float = 0.0, gloss: float = 0.0) -> Scene:
    """Photo, diffuse image and mask of a red ball with a white stripe of a width, and a highlight
    of a strength.
    """
    line = np.linspace(-1.1, 1.1, BALL_SIDE)
    x, y = np.meshgrid(line, -line)
    mask = x**2 + y**2 < 1
    z = np.sqrt(np.clip(1 - x**2 - y**2, 0, 1))
    shading = 0.15 + 0.85 * np.clip(-0.35 * x + 0.45 * y + 0.82 * z, 0, 1)
    paint = np.where((np.abs(x - 0.2) < stripe / 2)[..., None], WHITE, RED)
    diffuse = np.where(mask[..., None], paint * shading[..., None], 0)
    spot = gloss * np.exp(-((x + 0.2) ** 2 + (y - 0.25) ** 2) / 0.012)
    photo = diffuse + np.where(mask, spot, 0)[..., None]
    return photo.astype(np.float32), diffuse.astype(np.float32), mask


def read(path: Path) -> np.ndarray:
    """A photo (H, W, 3) as stored, over its largest code."""
    stored = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)[..., ::-1]
    return stored / np.iinfo(stored.dtype).max


def highlight_photo(shared: Path, name: str) -> Scene:
    """Image, true diffuse and the full mask of one of the photos with published figures."""
    folder = shared / "data/highlight"
    image, truth = (read(folder / file) for file in (f"{name}.bmp", f"{name}_gt.bmp"))
    return image, truth, np.ones(image.shape[:2], bool)


def laboratory_photo(shared: Path, name: str) -> Scene:
    """Image, true diffuse and mask of an object of the laboratory set, cut to the mask's box."""
    folder = shared / "data/mit_berkeley_train/laboratory" / name
    mask = cv2.imread(str(folder / "mask.png"), cv2.IMREAD_GRAYSCALE) > 0
    box = mask_slices(mask)
    return read(folder / "original.png")[box], read(folder / "diffuse.png")[box], mask[box]


def psnr(split: Separation, truth: np.ndarray) -> float:
    """PSNR of the diffuse image over all pixels in dB, for values in [0, 1]."""
    return float(-10 * np.log10(np.mean((split.diffuse - truth) ** 2)))


def error_ratio(split: Separation, image: np.ndarray, truth: np.ndarray, mask: np.ndarray) -> float:
    """Squared error of the diffuse image inside the mask over that of the unchanged photo."""
    return float(np.mean((split.diffuse - truth)[mask] ** 2) / np.mean((image - truth)[mask] ** 2))


def assert_layers_hold(
    split: Separation, image: np.ndarray, mask: np.ndarray, *, tinted: bool = False
) -> None:
    """Assert the identities and ranges of a separation inside the mask.

    `tinted`: specular light need not be white.
    """
    total = split.diffuse + split.specular + split.residual
    assert np.abs(total[mask] - image[mask]).max() <= 1e-6 * image[mask].max()
    assert (split.diffuse >= 0).all() and (split.diffuse[mask] <= image[mask] * (1 + 1e-6)).all()
    assert (split.specular >= 0).all() and (tinted or np.ptp(split.specular, axis=2).max() == 0)
    for layer in (split.diffuse, split.specular, split.residual, split.confidence):
        assert layer.dtype == np.float32 and np.isfinite(layer).all() and not layer[~mask].any()
    assert (split.confidence >= 0).all() and (split.confidence <= 1).all()
