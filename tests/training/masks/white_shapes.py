"""Ingredients of simple composites."""

import numpy as np

from training.masks.ingredients import LENGTH, SIDE
from training.masks.packs import Ingredients


def ingredients() -> Ingredients:
    """White discs and bars, and black backgrounds."""
    cutouts = np.zeros((2, 4, SIDE, SIDE), np.uint8)
    y, x = np.mgrid[:SIDE, :SIDE] - SIDE / 2 + 0.5
    cutouts[0, 3] = 255 * (x**2 + y**2 < (LENGTH / 2) ** 2)
    cutouts[1, 3] = 255 * ((abs(x) < LENGTH / 2) & (abs(y) < LENGTH / 6))
    cutouts[:, :3] = 255 * (cutouts[:, 3:] > 0)
    dark = np.zeros((3, 32, 64, 3), np.float16)
    return Ingredients(cutouts, dark, np.zeros((2, 16, 16), np.uint8))
