"""The recovered light as a world: an environment map that gives a white surface the recovered
shading.

The map is laid out as in `isc_core.shading.environment_map`: its middle column is light from the
viewer's side. Blender takes the middle column for +X of the mapped direction. The Mapping node
rotates between the two, and can rotate the light further: `isc_rotation` stores the node's rotation
of the recovered light, in degrees about Z.

"Sun" in the Mix node: 0 is the environment map, 1 the uniform light that complements a sun.
"""

from dataclasses import dataclass
from math import radians
from typing import Any

import bpy
import numpy as np

from ..datablocks.nodes import add_node, connect, node_tree
from ..datablocks.provenance import KEY, datablock_name, find_tagged, is_isc_datablock, tag

ROTATION = 90.0  # degrees about Z
_OWN_WORLD = "isc_world"  # of an object
MAPPING, SUN, BACKGROUND = "ISC Rotation", "ISC Sun", "ISC Light"


def world_of(obj: bpy.types.Object) -> bpy.types.World | None:
    """Return the recovered light of an object.

    Parameters
    ----------
    obj : bpy.types.Object
        An object of ISC.

    Returns
    -------
    bpy.types.World or None
        Its own: a full copy of a scene has copies of both. None where it was deleted.
    """
    own = obj.get(_OWN_WORLD)
    if own is not None and own.library is None:
        return own
    return find_tagged(bpy.data.worlds, obj[KEY], "world")


def keep_world(obj: bpy.types.Object, world: bpy.types.World) -> None:
    """Store the light of an object in it: it is saved and appended with it even if no scene uses
    it.

    Parameters
    ----------
    obj : bpy.types.Object
        An object of ISC.
    world : bpy.types.World
        Its light.
    """
    obj[_OWN_WORLD] = world


def ensure_world(
    key: str,
    environment_map: bpy.types.Image,
    ambient: np.ndarray,
    sun: bool,
    world: bpy.types.World | None = None,
) -> bpy.types.World:
    """Create or update the world of a photo; rotation and strength that the user has set stay.

    Parameters
    ----------
    key : str
        Name of the photo.
    environment_map : bpy.types.Image
        Equirectangular radiance.
    ambient : (3,) ndarray
        Uniform shading in addition to a sun.
    sun : bool
        Whether to show the uniform light instead of the environment map.
    world : bpy.types.World, optional
        The world to update; None creates one.

    Returns
    -------
    bpy.types.World
        The world.
    """
    if world is None:
        world = tag(bpy.data.worlds.new(datablock_name(key)), key, "world")
    if not _show_map(world, environment_map):
        _add_nodes(world, environment_map)
    set_sun_mix(world, ambient, sun)
    if hasattr(world, "cycles"):
        # The default of 1024 columns takes longer to tabulate than a small render.
        world.cycles.sampling_method = "MANUAL"
        world.cycles.sample_map_resolution = 4 * environment_map.size[0]
    world["isc_rotation"] = ROTATION
    world["isc_rotation_about"] = (
        "degrees about Z by which the Mapping node rotates the map's middle column "
        "toward the viewer (-Y)"
    )
    return world


def _show_map(world: bpy.types.World, environment_map: bpy.types.Image) -> bool:
    """Replace the map of a world, whose light the user may have turned or made stronger; False if
    a node is missing.
    """
    nodes = node_tree(world).nodes
    if any(name not in nodes for name in (MAPPING, SUN, BACKGROUND)):
        return False
    if world.get("isc_rotation") != ROTATION:  # of another version
        return False
    texture = next((node for node in nodes if node.type == "TEX_ENVIRONMENT"), None)
    if texture is None:
        return False
    if texture.image is None or is_isc_datablock(texture.image):  # else it is the user's own
        texture.image = environment_map
    return True


def _add_nodes(world: bpy.types.World, environment_map: bpy.types.Image) -> None:
    tree = node_tree(world)
    tree.nodes.clear()
    coordinates = add_node(tree, "TexCoord", (-900, 0))
    rotation = add_node(tree, "Mapping", (-700, 0), name=MAPPING, label="Light Rotation")
    texture = add_node(tree, "TexEnvironment", (-450, 0), image=environment_map)
    mix = add_node(tree, "Mix", (-150, 0), name=SUN, label="Sun: Uniform Light", data_type="RGBA")
    light = add_node(tree, "Background", (50, 0), name=BACKGROUND)
    output = add_node(tree, "OutputWorld", (250, 0))
    rotation.inputs["Rotation"].default_value = (0, 0, radians(ROTATION))
    first = next(socket for socket in mix.inputs if socket.type == "RGBA")
    connect(
        tree,
        (coordinates.outputs["Generated"], rotation.inputs["Vector"]),
        (rotation.outputs["Vector"], texture.inputs["Vector"]),
        (texture.outputs["Color"], first),
        (next(socket for socket in mix.outputs if socket.type == "RGBA"), light.inputs["Color"]),
        (light.outputs["Background"], output.inputs["Surface"]),
    )


@dataclass(frozen=True, eq=False)
class SunMix:
    """What a world shows.

    Attributes
    ----------
    sun : bool
        Whether the uniform light that complements a sun, instead of the environment map.
    ambient : (3,) ndarray
        That light, shown or not.
    """

    sun: bool
    ambient: np.ndarray


def sun_mix(world: bpy.types.World | None) -> SunMix | None:
    """Return what a world shows.

    Parameters
    ----------
    world : bpy.types.World or None

    Returns
    -------
    SunMix or None
        None where the world or its Mix node is missing.
    """
    mix = _mix_node(world)
    if mix is None:
        return None
    factor, ambient = _mix_inputs(mix)
    return SunMix(factor.default_value > 0.5, np.array(ambient.default_value[:3]))


def set_sun_mix(world: bpy.types.World | None, ambient: np.ndarray, sun: bool) -> None:
    """Show the environment map, or the uniform light that complements a sun.

    Does nothing where the world or its Mix node is missing.

    Parameters
    ----------
    world : bpy.types.World or None
        The world.
    ambient : (3,) ndarray
        Uniform shading in addition to the sun.
    sun : bool
        Whether to show the uniform light.
    """
    mix = _mix_node(world)
    if mix is not None:
        factor, second = _mix_inputs(mix)
        factor.default_value, second.default_value = float(sun), (*map(float, ambient), 1.0)


def _mix_node(world: bpy.types.World | None) -> bpy.types.Node | None:
    mix = world.node_tree.nodes.get(SUN) if world and world.node_tree else None
    return mix if mix is not None and mix.type == "MIX" else None


def _mix_inputs(mix: bpy.types.Node) -> tuple[Any, Any]:
    """The sockets of the factor and of the uniform light."""
    factor = next(socket for socket in mix.inputs if socket.type == "VALUE")
    _, ambient = (socket for socket in mix.inputs if socket.type == "RGBA")
    return factor, ambient
