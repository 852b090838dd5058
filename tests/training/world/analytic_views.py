"""Views of bodies that need no rays: ellipsoids before an orthographic camera."""

import numpy as np

from training.world.views import SIDE, View, spread_directions


def ellipsoid_view(
    rng: np.random.Generator, half: tuple[float, float, float] = (0.9, 0.9, 0.9)
) -> View:
    """A view of an ellipsoid.

    Parameters
    ----------
    rng : numpy.random.Generator
    half : tuple of float
        Its half axes along x, y and z.

    Returns
    -------
    View
    """
    across = (np.arange(SIDE) + 0.5) * (2 / SIDE) - 1
    x, y = np.meshgrid(across / half[0], -across / half[1])
    mask = x**2 + y**2 < 0.999
    place = np.stack([x, y, np.sqrt(np.maximum(1 - x**2 - y**2, 0))], -1)[mask]
    normal = place / half
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    depth, directions = half[2] * place[:, 2], spread_directions(rng)
    return View(
        "ellipsoid",
        "made",
        mask,
        normal.astype(np.float16),
        depth.astype(np.float16),
        (2 * depth).astype(np.float16),
        np.packbits(normal @ directions.T > 0, axis=1),
        directions.astype(np.float32),
        np.inf,
        np.zeros(3, np.float32),
    )
