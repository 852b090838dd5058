"""A scene as plain numbers: one object of one material, lights, and a camera."""

from dataclasses import dataclass

from .camera import Camera
from .lights import Light
from .materials import Material
from .meshes import Mesh


@dataclass(frozen=True)
class Scene:
    """A scene.

    Attributes
    ----------
    mesh : Mesh
        The object, object units, camera frame, within about 1 of the origin.
    material : Material
        Its material.
    lights : tuple of Light
        At least one.
    camera : Camera
        The camera.
    """

    mesh: Mesh
    material: Material
    lights: tuple[Light, ...]
    camera: Camera
