"""A scene: one object of one material under some lights before one camera; everything as plain
numbers.
"""

from dataclasses import dataclass

from .camera import Camera
from .lights import Light
from .materials import Material
from .meshes import Mesh


@dataclass(frozen=True)
class Scene:
    """`mesh`: the object, object units, in the camera's frame, within about 1 of the origin.

    `lights`: one or more.
    """

    mesh: Mesh
    material: Material
    lights: tuple[Light, ...]
    camera: Camera
