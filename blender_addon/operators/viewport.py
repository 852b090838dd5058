"""Show a new object in the user's 3D view: selected, active, framed, in Material Preview.

A photo shows one side. A view from another side is rotated to that side, slightly from the right
and from above, so that the shape is visible, too.
"""

from math import cos, radians
from typing import Any

import bpy
from mathutils import Euler, Quaternion, Vector

from ..scene.built_object import BuiltObject

_PLAIN = {"WIREFRAME", "SOLID"}
_FRONT = Vector((0, -1, 0))  # of an object, in its own axes
_MAX_ASIDE = radians(35)
_RIGHT, _ABOVE = radians(20), radians(12)


def invoking_view(context: Any) -> int:
    """Return which 3D view an operator was started from.

    Parameters
    ----------
    context : bpy.types.Context
        Blender's context.

    Returns
    -------
    int
        Address of the area; 0 where it was started elsewhere.
    """
    area = context.area
    return area.as_pointer() if area is not None and area.type == "VIEW_3D" else 0


def find_view(window: Any, address: int) -> Any:
    """Find a 3D view.

    Parameters
    ----------
    window : bpy.types.Window
        The window.
    address : int
        As `invoking_view` returns it.

    Returns
    -------
    bpy.types.Area or None
        The view of that address if it is still open, otherwise the largest one.
    """
    views = [area for area in window.screen.areas if area.type == "VIEW_3D"]
    return next(
        (area for area in views if area.as_pointer() == address),
        max(views, key=lambda area: area.width * area.height, default=None),
    )


def activate(context: Any, built: BuiltObject, *others: BuiltObject) -> None:
    """Select objects alone and make one active, in the window's scene or in its own.

    Parameters
    ----------
    context : bpy.types.Context
        Blender's context.
    built : BuiltObject
        The object that becomes active.
    *others : BuiltObject
        Selected as well; in the same scene.
    """
    if context.window is not None and context.window.scene != built.scene:
        context.window.scene = built.scene
    layer = built.scene.view_layers[0] if context.window is None else context.window.view_layer
    layer.update()  # so that it includes what was linked a moment ago
    if built.object.name not in layer.objects:
        return
    for other in list(layer.objects.selected):
        other.select_set(False, view_layer=layer)
    for one in (built, *others):
        one.object.select_set(True, view_layer=layer)
    layer.objects.active = built.object


def show(context: Any, built: BuiltObject, own_scene: bool, address: int = 0) -> None:
    """Show an object in a 3D view: in Material Preview, and framed.

    Its own scene is seen through the photo's camera, in the scene's light. In another scene, the
    view turns to the object's front.

    Parameters
    ----------
    context : bpy.types.Context
        Blender's context; nothing happens without a window.
    built : BuiltObject
        The object, active.
    own_scene : bool
        Whether the scene is the object's own.
    address : int, optional
        The view, as `invoking_view` returns it.
    """
    window = context.window
    area = None if window is None else find_view(window, address)
    if area is None:
        return
    space = area.spaces.active
    if space.shading.type in _PLAIN:
        space.shading.type = "MATERIAL"
    if own_scene:
        space.shading.use_scene_world = space.shading.use_scene_lights = True
        space.region_3d.view_perspective = "CAMERA"
    elif space.region_3d.view_perspective != "CAMERA" or not space.lock_camera:
        space.region_3d.view_rotation = front_view(
            space.region_3d.view_rotation, built.object.matrix_world.to_quaternion()
        )
        _frame(context, window, area)


def front_view(view: Quaternion, rotation: Quaternion) -> Quaternion:
    """Return the rotation of a view that shows the front of an object.

    Parameters
    ----------
    view : Quaternion
        Rotation of the view so far; kept if it shows the front.
    rotation : Quaternion
        Rotation of the object.

    Returns
    -------
    Quaternion
        The rotation.
    """
    toward_viewer = view @ Vector((0, 0, 1))
    if toward_viewer.dot(rotation @ _FRONT) >= cos(_MAX_ASIDE):
        return view.copy()
    return rotation @ Euler((radians(90) - _ABOVE, 0, _RIGHT)).to_quaternion()


def _frame(context: Any, window: Any, area: Any) -> None:
    region = next(region for region in area.regions if region.type == "WINDOW")
    with context.temp_override(window=window, area=area, region=region):
        if bpy.ops.view3d.view_selected.poll():
            bpy.ops.view3d.view_selected()
