"""Photos of balls in front of a wall, with their masks."""

import numpy as np


def balls(
    places: tuple[tuple[float, float, float], ...], size: tuple[int, int] = (150, 200)
) -> tuple[np.ndarray, list[np.ndarray]]:
    """A noisy photo of shaded balls (x, y, radius) in front of a pale wall, and their masks."""
    rows, columns = size
    y, x = np.mgrid[:rows, :columns]
    wall = 0.45 + 0.1 * y / rows
    light = wall[..., None] * np.array([0.95, 1.0, 1.05])
    masks = []
    for cx, cy, radius in places:
        u, v = (x - cx) / radius, (y - cy) / radius
        inside = u**2 + v**2 < 1
        up = np.sqrt(np.clip(1 - u**2 - v**2, 0, 1))
        shade = 0.1 + 0.9 * np.clip(0.5 * up - 0.5 * u - 0.6 * v, 0, 1)
        shadow = np.exp(-(((x - cx) / radius) ** 2) - ((y - cy - radius) / (0.25 * radius)) ** 2)
        light = light * (1 - 0.5 * shadow)[..., None]
        ball = shade[..., None] * np.array([0.6, 0.12, 0.08])
        light = np.where(inside[..., None], ball, light)
        masks.append(inside)
    noise = np.random.default_rng(0).normal(0, 0.004, light.shape)
    return np.clip(light + noise, 0, 1).astype(np.float32), masks


ONE, TWO = ((100, 75, 45),), ((50, 80, 32), (150, 75, 34))


def overlap(a: np.ndarray, b: np.ndarray) -> float:
    """Intersection over union of two masks."""
    return float((a & b).sum() / (a | b).sum())
