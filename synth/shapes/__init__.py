"""Random objects of known shape, one family a file; `make_shape` makes one by its family's name.

Every mesh is in object units and in the camera's frame (x right, y up, z toward the viewer), posed
as a photographer would, centred, and as wide or high as 2, whichever is larger. Vertex normals are
unit, outward and smooth; texture coordinates have no seam on the side that the viewer sees.
"""

from collections.abc import Callable

import numpy as np

from isc_core.errors import InputError
from synth.scene.meshes import Mesh

from .blobby import blobby
from .displaced import displaced
from .extruded import extruded
from .lathe import lathe
from .reliefs import relief
from .superquadric import superquadric

_MAKERS: dict[str, Callable[[np.random.Generator], Mesh]] = {
    "superquadric": superquadric,
    "blobby": blobby,
    "displaced": displaced,
    "lathe": lathe,
    "extruded": extruded,
    "height_field": relief,
}
SHAPES: tuple[str, ...] = tuple(_MAKERS)


def make_shape(name: str, rng: np.random.Generator) -> Mesh:
    """A random object of the family `name`, one of `SHAPES`; the same state of `rng` gives the same
    mesh.

    Raises `InputError` for an unknown name.
    """
    if name not in _MAKERS:
        raise InputError(f"unknown shape {name!r}: choose {', '.join(SHAPES)}")
    return _MAKERS[name](rng)
