"""Lights of the kind that stand around real objects: a soft sky with a warm horizon, and softboxes."""

from typing import Any

import numpy as np


def soft_sky(rows: int = 64) -> np.ndarray:
    """An environment of low frequencies, (rows, 2 rows, 3) float32, linear radiance, row 0 straight up: sky, horizon, ground, a window."""
    polar = (np.arange(rows) + 0.5) * np.pi / rows
    turn = (np.arange(2 * rows) + 0.5) * np.pi / rows
    up = np.cos(polar)[:, None, None]
    sky, horizon, ground = np.array([0.30, 0.42, 0.62]), np.array([0.62, 0.55, 0.46]), np.array([0.20, 0.15, 0.11])
    height = np.clip(up, 0, 1) ** 0.6
    below = np.clip(-up, 0, 1) ** 0.5
    gradient = np.where(up >= 0, horizon + (sky - horizon) * height, horizon + (ground - horizon) * below)
    window = np.exp(3 * (np.sin(polar)[:, None] * np.cos(turn - 0.5 * np.pi)[None] - 1))[..., None] * np.array([0.75, 0.55, 0.35])
    return np.ascontiguousarray(gradient + window, np.float32)


def softbox(mi: Any, origin: tuple[float, float, float], size: tuple[float, float], radiance: tuple[float, float, float]) -> dict[str, Any]:
    """A rectangular area light at `origin` that faces the object at the centre; `size`: width and height, in object units."""
    place = mi.ScalarTransform4f().look_at(origin=list(origin), target=[0, 0, 0], up=[0, 1, 0])
    return {
        "type": "rectangle",
        "to_world": place @ mi.ScalarTransform4f().scale([0.5 * size[0], 0.5 * size[1], 1]),
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": list(radiance)}},
    }
