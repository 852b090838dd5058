"""How an object stands before the camera: as a photographer places it, seen a little from above and
not quite from the front.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from synth.scene.meshes import Mesh


def posed(
    mesh: Mesh,
    rng: np.random.Generator,
    above: tuple[float, float],
    aside: float,
    roll: float = 5.0,
) -> Mesh:
    """A mesh that stood upright and looked toward +z, turned at random, centred, and scaled so that
    its larger picture extent is 2.

    `above`: from how far above it is seen, least and most. `aside`: how far it turns to either side
    at most; `roll`: how far it leans in the picture at most. All in degrees.
    """
    angles = (rng.uniform(-aside, aside), rng.uniform(*above), rng.uniform(-roll, roll))
    return mesh.rotated(Rotation.from_euler("yxz", angles, degrees=True).as_matrix()).fitted()
