"""Random objects of known shape, one family per module; `make_shape` makes one by its family's
name.

Every mesh is in object units and in the camera frame (x right, y up, z toward the viewer), posed as
a photographer would, centred, and 2 units wide or high, whichever is larger. Vertex normals are
unit, outward and smooth; texture coordinates have no seam on the visible side.
"""

from collections.abc import Callable

import numpy as np

from isc_core.errors import InputError

from ..scene.meshes import Mesh
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
    """Make a random object.

    Parameters
    ----------
    name : str
        Its family, one of `SHAPES`.
    rng : numpy.random.Generator
        Random numbers; the same state gives the same mesh.

    Returns
    -------
    Mesh
        The object.

    Raises
    ------
    InputError
        For an unknown name.
    """
    if name not in _MAKERS:
        raise InputError(f"unknown shape {name!r}: choose {', '.join(SHAPES)}")
    return _MAKERS[name](rng)
