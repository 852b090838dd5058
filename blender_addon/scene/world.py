"""The recovered light as a world: an environment image that gives a white surface the recovered
shading.

The image is laid out as `isc_core.environment` says, its middle column is what the viewer's side
shines; Blender takes the middle column for +X of the mapped direction. The Mapping node turns
between the two, and turns the light where people want it turned: `isc_rotation` says by how many
degrees about Z the node turns as recovered.

"Sun" in the mix node: 0 is the environment, 1 the even light that remains when a sun lamp stands
for the rest.
"""

from math import radians

import bpy
import numpy as np

from .nodes import add_node, connect, node_tree
from .provenance import find, label, mark

ROTATION = 90.0  # degrees about Z
MAPPING, SUN, BACKGROUND = "ISC Rotation", "ISC Sun", "ISC Light"


def ensure_world(key: str, sky: bpy.types.Image, ambient: np.ndarray, sun: bool) -> bpy.types.World:
    """The image's world.

    `ambient`: (3,), the shading that a sun leaves to the rest, which is shown instead of the sky if
    `sun`.
    """
    world = find(bpy.data.worlds, key, "world") or mark(
        bpy.data.worlds.new(label(key)), key, "world"
    )
    tree = node_tree(world)
    tree.nodes.clear()
    place = add_node(tree, "TexCoord", (-900, 0))
    turn = add_node(tree, "Mapping", (-700, 0), name=MAPPING, label="Rotation of the light")
    picture = add_node(tree, "TexEnvironment", (-450, 0), image=sky)
    mix = add_node(tree, "Mix", (-150, 0), name=SUN, label="Sun: even light", data_type="RGBA")
    light = add_node(tree, "Background", (50, 0), name=BACKGROUND)
    out = add_node(tree, "OutputWorld", (250, 0))
    turn.inputs["Rotation"].default_value = (0, 0, radians(ROTATION))
    first = next(socket for socket in mix.inputs if socket.type == "RGBA")
    connect(
        tree,
        (place.outputs["Generated"], turn.inputs["Vector"]),
        (turn.outputs["Vector"], picture.inputs["Vector"]),
        (picture.outputs["Color"], first),
        (next(socket for socket in mix.outputs if socket.type == "RGBA"), light.inputs["Color"]),
        (light.outputs["Background"], out.inputs["Surface"]),
    )
    mix_sun(world, ambient, sun)
    if hasattr(
        world, "cycles"
    ):  # its own choice is 1024 columns, which take longer to tabulate than a small render
        world.cycles.sampling_method, world.cycles.sample_map_resolution = "MANUAL", 4 * sky.size[0]
    world["isc_rotation"] = ROTATION
    world["isc_rotation_about"] = (
        "degrees about Z, by which the Mapping node brings the image's middle column toward the viewer (-Y)"
    )
    return world


def mix_sun(world: bpy.types.World | None, ambient: np.ndarray, sun: bool) -> None:
    """Shows the even light `ambient` (3,) that a sun leaves to the rest, or the environment;
    nothing where world or node are gone.
    """
    mix = world.node_tree.nodes.get(SUN) if world else None
    if mix is not None and mix.type == "MIX":
        factor = next(socket for socket in mix.inputs if socket.type == "VALUE")
        _, second = (socket for socket in mix.inputs if socket.type == "RGBA")
        factor.default_value, second.default_value = float(sun), (*map(float, ambient), 1.0)
