"""Balls of known material: glossy ones under directional lights, mirrors in an environment."""

import numpy as np

SIDE = 150


def ball() -> tuple[np.ndarray, np.ndarray]:
    """Normals (SIDE, SIDE, 3) and mask of a ball."""
    y, x = np.mgrid[1 : -1 : SIDE * 1j, -1 : 1 : SIDE * 1j] / 0.9
    mask = x**2 + y**2 < 0.99
    return np.stack([x, y, np.sqrt(np.maximum(1 - x**2 - y**2, 0))], -1) * mask[..., None], mask


def under_lights(
    *lamps: tuple[float, float, float], albedo: tuple[float, float, float] = (0.5, 0.3, 0.2)
) -> tuple[np.ndarray, np.ndarray]:
    """A glossy coloured ball."""
    normal, mask = ball()
    image = 0.06 * np.ones((SIDE, SIDE, 3)) * albedo
    for lamp in lamps:
        toward = np.array(lamp) / np.linalg.norm(lamp)
        half = toward + (0, 0, 1)
        image += np.maximum(normal @ toward, 0)[..., None] * albedo
        image += 1.2 * np.maximum(normal @ (half / np.linalg.norm(half)), 0)[..., None] ** 150
    return (image * mask[..., None]).astype(np.float32), mask


def mirror_ball(surroundings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A mirror, seen from far away."""
    normal, mask = ball()
    seen = 2 * normal[..., 2:] * normal - (0, 0, 1)
    rows = np.clip(
        np.arccos(np.clip(seen[..., 1], -1, 1)) / np.pi * len(surroundings),
        0,
        len(surroundings) - 1,
    ).astype(int)
    turn = np.mod(np.arctan2(seen[..., 0], -seen[..., 2]), 2 * np.pi) / (2 * np.pi)
    columns = np.minimum(turn * surroundings.shape[1], surroundings.shape[1] - 1).astype(int)
    image = np.minimum(surroundings[rows, columns], np.quantile(surroundings, 0.98))
    return (image * mask[..., None]).astype(np.float32), mask
