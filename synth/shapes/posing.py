"""Pose of an object before the camera: as in a product photo, seen from slightly above and not
quite from the front.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from ..scene.meshes import Mesh


def posed(
    mesh: Mesh,
    rng: np.random.Generator,
    above: tuple[float, float],
    aside: float,
    roll: float = 5.0,
) -> Mesh:
    """Rotate a mesh at random, centre it, and scale its larger extent in the picture to 2.

    Parameters
    ----------
    mesh : Mesh
        Upright, facing +z.
    rng : numpy.random.Generator
        Random numbers.
    above : (float, float)
        Least and largest elevation of the camera, degrees.
    aside : float
        Largest turn to either side, degrees.
    roll : float, optional
        Largest roll in the picture, degrees.

    Returns
    -------
    Mesh
        The posed mesh.
    """
    angles = (rng.uniform(-aside, aside), rng.uniform(*above), rng.uniform(-roll, roll))
    return mesh.rotated(Rotation.from_euler("yxz", angles, degrees=True).as_matrix()).fitted()
