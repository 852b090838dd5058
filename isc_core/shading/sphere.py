"""The normals of a sphere, which shows a light from all visible directions.

Equation: a sphere of radius 1 has the normal (x, y, sqrt(1 - x^2 - y^2)).
"""

import numpy as np


def sphere_normals(size: int, radius: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return the normals and coverage of a sphere in the centre of a square picture.

    Parameters
    ----------
    size : int
        Of the picture, pixels.
    radius : float, optional
        Pixels; by default the sphere fills 90 % of the side.

    Returns
    -------
    normal : (size, size, 3) ndarray
        Outside the outline that of the outline, for pixels that are partly covered.
    coverage : (size, size) ndarray
        In [0, 1].
    """
    radius = 0.45 * size if radius is None else radius
    axis = (np.arange(size) + 0.5 - size / 2) / radius
    x, y = np.meshgrid(axis, -axis)
    distance = np.hypot(x, y)
    shrink = np.minimum(1, 1 / np.maximum(distance, 1e-9))
    normal = np.stack([x * shrink, y * shrink, np.sqrt(np.maximum(0, 1 - distance**2))], -1)
    return normal, np.clip((1 - distance) * radius + 0.5, 0, 1)
