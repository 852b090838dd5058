"""Shen & Cai 2009: the statistics it uses, and the exact gain of a made scene."""

from pathlib import Path

import cv2
import numpy as np
from scipy import ndimage

from isc_core.separation.published import shen_2009
from isc_core.separation.published.shen_2009 import VARIANTS, Shen2009Options
from tests.core.separation.scenes import assert_layers_hold, read, spots


def relative_error(folder: Path, options: Shen2009Options) -> float:
    """Squared error of diffuse inside the object's mask over that of leaving its highlights in."""
    image, truth = read(folder / "original.png"), read(folder / "diffuse.png")
    mask = cv2.imread(str(folder / "mask.png"), cv2.IMREAD_GRAYSCALE) > 0
    split = shen_2009.separate(image, mask, options)
    assert_layers_hold(split, image, mask)
    return float(np.mean((split.diffuse - truth)[mask] ** 2) / np.mean((image - truth)[mask] ** 2))


def test_statistics_of_the_mask_are_better_than_those_of_the_frame(shared: Path) -> None:
    apple = shared / "data/mit_berkeley_train/laboratory/apple"
    frame, paper, improved = (
        relative_error(apple, VARIANTS[name]) for name in ("sihr", "paper", "improved")
    )
    assert improved < 0.8 < paper < 2.7 < frame < 7.4


def test_the_gain_makes_colour_continue_across_the_rim() -> None:
    image, _, mask = spots((0.3,))
    split = shen_2009.separate(image, mask, VARIANTS["paper"])
    low = image.min(axis=2)
    excess = np.maximum(low - low.mean() - 0.5 * low.std(ddof=1), 0)
    inside = excess > 0.1 * excess.max()
    ring = ndimage.binary_dilation(inside, np.ones((5, 5))) & ~inside
    jump = split.diffuse[inside].mean(axis=0) - split.diffuse[ring].mean(axis=0)
    assert np.abs(jump).max() < 1e-6
    assert np.allclose(
        split.specular[..., 0] * excess.max(), excess * split.specular.max(), atol=1e-6
    )
