"""A still life: objects made from photos among other objects, in a light that no photo had.

A table with two books, a mirror ball and a candle; a low warm lamp from the right, where the photos
had theirs at the upper left, and a cool one behind. Reflections in the ball and shadows of one
object on another show that all of it is one scene.
"""

from collections.abc import Callable, Sequence

import bpy
from mathutils import Vector

from .studio_photos import add_paper, add_toward, new_material, set_room

# Place on the table and scale, for each object; the third stands on the books.
_PLACES = (
    ((-0.2, 0.3), 1.0),
    ((-2.5, 0.5), 0.85),
    ((1.75, 1.05), 0.95),
    ((1.45, -1.15), 0.55),
    ((-1.35, -1.25), 0.6),
)
_BOOK = 0.28  # thickness
_LAMPS = (
    ((4.6, -2.6, 2.2), 1.0, 600.0, (1.0, 0.78, 0.55)),
    ((-4.5, 2.0, 4.0), 2.5, 160.0, (0.55, 0.72, 1.0)),
    ((-3.0, -5.0, 3.0), 2.0, 110.0, (1.0, 1.0, 1.0)),
)


def still_life(
    objects: Sequence[bpy.types.Object], stand: Callable[[bpy.types.Object, Vector], None]
) -> None:
    """Arrange five objects in the current scene, with light and camera.

    Parameters
    ----------
    objects : sequence of bpy.types.Object
        The objects, upright.
    stand : callable
        Puts an object on a place of the table.
    """
    add_paper()
    for obj, ((x, y), scale) in zip(objects, _PLACES, strict=True):
        obj.scale = (scale, scale, scale)
        stand(obj, Vector((x, y, 0)))
    objects[2].location.z += 2 * _BOOK
    _add_books(Vector((1.8, 1.05, 0)))
    _add_ball(Vector((0.62, -1.6, 0.32)), 0.32)
    _add_candle(Vector((3.05, -0.1, 0)))
    middle = Vector((0.1, 0, 0.95))
    for place, size, watts, color in _LAMPS:
        light = bpy.data.lights.new("lamp", "AREA")
        light.size, light.energy, light.color = size, watts, color
        add_toward("lamp", light, Vector(place), middle)
    camera = bpy.data.cameras.new("camera")
    camera.lens = 60
    scene = bpy.context.scene
    scene.camera = add_toward("camera", camera, Vector((0.1, -11.5, 2.9)), middle)
    set_room((0.02, 0.025, 0.04))


def _add_books(place: Vector) -> None:
    for number, (color, turn) in enumerate((((0.28, 0.05, 0.05), 0.15), ((0.05, 0.12, 0.2), -0.1))):
        middle = place + Vector((0, 0, (number + 0.5) * _BOOK))
        bpy.ops.mesh.primitive_cube_add(size=1, location=middle, rotation=(0, 0, turn))
        book = bpy.context.object
        book.scale = (1.9, 1.4, _BOOK)
        book.modifiers.new("Bevel", "BEVEL").width = 0.03
        book.data.materials.append(new_material("book", color, 0.6))


def _add_ball(place: Vector, radius: float) -> None:
    bpy.ops.mesh.primitive_uv_sphere_add(radius=radius, location=place, segments=64, ring_count=32)
    ball = bpy.context.object
    ball.data.shade_smooth()
    metal = new_material("metal", (0.9, 0.9, 0.9), 0.04)
    metal.node_tree.nodes["Principled BSDF"].inputs["Metallic"].default_value = 1
    ball.data.materials.append(metal)


def _add_candle(place: Vector) -> None:
    middle = place + Vector((0, 0, 0.5))
    bpy.ops.mesh.primitive_cylinder_add(radius=0.2, depth=1.0, location=middle, vertices=64)
    candle = bpy.context.object
    candle.data.shade_smooth()
    candle.modifiers.new("Bevel", "BEVEL").width = 0.02
    candle.data.materials.append(new_material("wax", (0.8, 0.72, 0.55), 0.4))
    flame = place + Vector((0, 0, 1.2))
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.06, location=flame, segments=32, ring_count=16)
    fire = bpy.context.object
    fire.scale.z = 2.0
    glow = new_material("flame", (1, 0.6, 0.2), 0.5)
    surface = glow.node_tree.nodes["Principled BSDF"].inputs
    surface["Emission Color"].default_value = (1, 0.42, 0.08, 1)
    surface["Emission Strength"].default_value = 5
    fire.data.materials.append(glow)
