"""A body: a named mesh in a common size."""

from dataclasses import dataclass
from enum import StrEnum

from synth.scene.meshes import Mesh

from .geometry.creases import creased
from .geometry.surface import Surface, fitted, welded
from .geometry.winding import consistently_wound


class Source(StrEnum):
    """Where bodies come from."""

    FURNITURE = "furniture"
    URDF = "urdf"
    SCAN = "scan"
    BUILT = "built"
    FAMILY = "family"


@dataclass(frozen=True)
class Body:
    """A body for training.

    Attributes
    ----------
    name : str
        Unique and stable: "furniture/BlendSwap-CC-0/vase-3", "urdf/0007", "built/cloth/0012".
    source : Source
        Where it comes from.
    mesh : Mesh
        Centred, longest side 2, y up; normals smooth except across sharp edges.
    """

    name: str
    source: Source
    mesh: Mesh


def finished(surface: Surface) -> Mesh:
    """Make the mesh of a body: welded, consistently wound, fitted, with normals.

    Parameters
    ----------
    surface : Surface
        Finite, with a longest side above 0.

    Returns
    -------
    Mesh
        As in `Body`.
    """
    return creased(consistently_wound(fitted(welded(surface)[0])))
