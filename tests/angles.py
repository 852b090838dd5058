"""Angles between directions, without the loss of digits of an arc cosine near 1."""

from typing import Any

import numpy as np


def degrees_between(one: Any, other: Any) -> Any:
    """Angle between vectors, 2 atan2(|u - v|, |u + v|) of their directions u and v.

    Parameters
    ----------
    one, other : array_like
        Vectors (..., 3) of any length above 0.

    Returns
    -------
    ndarray or float
        Angle in degrees, in [0, 180], of the shape of the inputs without the last axis.
    """
    u, v = (np.asarray(a, float) / np.linalg.norm(a, axis=-1, keepdims=True) for a in (one, other))
    return np.degrees(
        2 * np.arctan2(np.linalg.norm(u - v, axis=-1), np.linalg.norm(u + v, axis=-1))
    )
