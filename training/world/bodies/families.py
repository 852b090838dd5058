"""Bodies of the shape families of `synth`, rotated at random."""

from zlib import crc32

import numpy as np
from scipy.spatial.transform import Rotation

from synth.scene.meshes import Mesh
from synth.shapes import make_shape

CREDIT = "made by synth.shapes"


def family_body(family: str, number: int) -> Mesh:
    """Make a body of a shape family; the same for the same number.

    Parameters
    ----------
    family : str
        One of `synth.shapes.SHAPES`.
    number : int
        Number of the body, the random seed.

    Returns
    -------
    Mesh
        Centred, longest side 2.
    """
    rng = np.random.default_rng([crc32(b"body"), crc32(family.encode()), number])
    shape = make_shape(family, rng)
    # A relief is a surface without a back: it keeps facing the viewer, within 30 degrees.
    rotation = Rotation.random(random_state=int(rng.integers(2**31)))
    if family == "height_field":
        rotation = Rotation.from_euler("xyz", rng.uniform(-30, 30, 3), degrees=True)
    mesh = shape.rotated(rotation.as_matrix())
    low, high = mesh.vertices.min(0), mesh.vertices.max(0)
    vertices = (mesh.vertices - (low + high) / 2) * (2 / (high - low).max())
    return Mesh(vertices, mesh.normals, mesh.uv, mesh.faces)
