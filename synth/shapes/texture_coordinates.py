"""Texture coordinates without a seam: the front takes most of the texture, which is mirrored
behind.

Equation: from a direction, at the angle t from +z: (u, v) = 1/2 + a(t) (x, -y) / |(x, y)|, a = t /
(2 T) up to T, then falling to 0 at pi: an azimuthal equidistant projection. From the front: t =
asin(|(x, y)| / r), T = pi / 2, which is the same for a sphere.

Citation: J. P. Snyder, "Map projections: a working manual", USGS Professional Paper 1395 (1987),
doi:10.3133/pp1395.

Limits: patterns are stretched up to T / sin(T) along the rim; from the front they are stretched by
1 / cos on slopes steeper than a sphere's.
"""

import numpy as np

# How far around an object its front reaches: all that is visible at a turn of 30 degrees.
_FRONT = np.radians(120)
_EDGE = 0.495  # largest radius in the texture: u wraps around, and its ends do not match


def from_directions(directions: np.ndarray) -> np.ndarray:
    """Return texture coordinates of directions.

    Parameters
    ----------
    directions : (N, 3) ndarray
        Unit vectors in the frame in which the object faces +z, y up.

    Returns
    -------
    (N, 2) ndarray
        u and v in [0, 1].
    """
    angle = np.arccos(np.clip(directions[:, 2], -1, 1))
    return _around(
        directions[:, :2], np.minimum(angle / _FRONT, (np.pi - angle) / (np.pi - _FRONT))
    )


def from_the_front(vertices: np.ndarray) -> np.ndarray:
    """Return texture coordinates of positions as seen from the front.

    Parameters
    ----------
    vertices : (N, 3) ndarray
        Positions in the camera frame.

    Returns
    -------
    (N, 2) ndarray
        u and v in [0, 1]; equal for positions behind each other.
    """
    low, high = vertices[:, :2].min(0), vertices[:, :2].max(0)
    away = vertices[:, :2] - (low + high) / 2
    radius = np.linalg.norm(away, axis=1)
    return _around(away, np.arcsin(np.clip(radius / (1.02 * radius.max()), 0, 1)) / (np.pi / 2))


def _around(away: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Coordinates at `radius`, in [0, 1], from the texture's centre in the direction of `away` (N,
    2), y up.
    """
    length = np.linalg.norm(away, axis=1)
    return np.clip(
        0.5 + away * (_EDGE * radius / np.where(length > 0, length, 1))[:, None] * (1, -1), 0, 1
    )
