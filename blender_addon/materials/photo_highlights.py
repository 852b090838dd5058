"""The photo's own highlights as a layer of the material, as the photo's camera saw them.

The layer is emission that only the camera sees, so it is exact from the photo's view and in the
photo's light, and wrong elsewhere: highlights would not follow a moving lamp. It is therefore
turned off as soon as light, camera or object pose differ from those with which it was first shown.
While it is on, the BSDF's own highlights are off.
"""

import hashlib
import json
from collections.abc import Iterator
from typing import Any

import bpy

from ..datablocks.nodes import add_node, connect
from .dichromatic import HIGHLIGHTS, highlights_group
from .edit_nodes import dichromatic_node, surface_node

IMAGE, _SEEN = "isc_highlights", "isc_highlights_seen"
_SUM, _TEXTURE = "Photo Highlights", "Highlights of the Photo"
_DIGITS = 5


def can_show_highlights(material: bpy.types.Material) -> bool:
    """Return whether a material has an image of the photo's highlights.

    Parameters
    ----------
    material : bpy.types.Material
        The material.

    Returns
    -------
    bool
    """
    return surface_node(material) is not None and material.get(IMAGE) is not None


def show_highlights(material: bpy.types.Material) -> None:
    """Add the layer; nothing changes where it exists, or without an image.

    Parameters
    ----------
    material : bpy.types.Material
        A local material of ISC.
    """
    tree, surface, group = material.node_tree, surface_node(material), dichromatic_node(material)
    if surface is None or group is None or not can_show_highlights(material):
        return
    output = _output(surface)
    if output is None or tree.nodes.get(_SUM) is not None:
        return
    x, y = surface.location
    texture = add_node(tree, "TexImage", (x - 700, y - 700), name=_TEXTURE, label=_TEXTURE)
    texture.image, texture.extension = material[IMAGE], "EXTEND"
    layer = add_node(tree, "Group", (x - 300, y - 700), name=HIGHLIGHTS, width=220)
    layer.node_tree = highlights_group()
    layer.inputs["Specular Gain"].default_value = group.inputs["Specular Gain"].default_value
    total = add_node(tree, "AddShader", (x + 250, y - 500), name=_SUM, label=_SUM)
    connect(
        tree,
        (texture.outputs["Color"], layer.inputs["Specular Image"]),
        (surface.outputs["BSDF"], total.inputs[0]),
        (layer.outputs["Surface"], total.inputs[1]),
        (total.outputs["Shader"], output.inputs["Surface"]),
    )
    group.inputs["Photo Highlights"].default_value = 1.0
    reset_view(material)


def hide_highlights(material: bpy.types.Material) -> None:
    """Remove the layer, and restore the highlights of the BSDF.

    Parameters
    ----------
    material : bpy.types.Material
        A local material of ISC.
    """
    tree, surface, group = material.node_tree, surface_node(material), dichromatic_node(material)
    reset_view(material)
    if surface is None or group is None:
        return
    output = _output(surface)
    group.inputs["Photo Highlights"].default_value = 0.0
    for name in (_TEXTURE, HIGHLIGHTS, _SUM):
        if (node := tree.nodes.get(name)) is not None:
            tree.nodes.remove(node)
    if output is not None:
        tree.links.new(surface.outputs["BSDF"], output.inputs["Surface"])


def reset_view(material: bpy.types.Material) -> None:
    """Make the layer valid for the next view.

    Parameters
    ----------
    material : bpy.types.Material
        A local material of ISC.
    """
    if _SEEN in material:
        del material[_SEEN]


def has_view_changed(
    material: bpy.types.Material, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph
) -> bool:
    """Return whether light, camera or pose differ from those with which the layer was first shown.

    Parameters
    ----------
    material : bpy.types.Material
        A material with the layer; stores the view in which it is first shown.
    scene : bpy.types.Scene
        The scene.
    depsgraph : bpy.types.Depsgraph
        The evaluated scene, which has the values of the frame, also while it is rendered.

    Returns
    -------
    bool
        False where no object of the scene has the material.
    """
    objects = [
        obj
        for obj in scene.objects
        if obj.type == "MESH" and any(slot.material == material for slot in obj.material_slots)
    ]
    if not objects:
        return False
    seen, known = _fingerprint(scene, objects, depsgraph), dict(material.get(_SEEN, {}))
    if scene.name not in known:
        material[_SEEN] = known | {scene.name: seen}
        return False
    return bool(known[scene.name] != seen)


def _output(surface: bpy.types.Node) -> bpy.types.Node | None:
    """The output that the surface reaches, through the layer or directly."""
    for link in surface.outputs["BSDF"].links:
        node = link.to_node
        if node.type == "OUTPUT_MATERIAL":
            return node
        if node.name == _SUM:
            following = (one.to_node for one in node.outputs["Shader"].links)
            return next((one for one in following if one.type == "OUTPUT_MATERIAL"), None)
    return None


def _fingerprint(scene: bpy.types.Scene, objects: list[Any], depsgraph: bpy.types.Depsgraph) -> str:
    camera, world = (
        block and block.evaluated_get(depsgraph) for block in (scene.camera, scene.world)
    )
    parts: list[Any] = [_matrix(obj.evaluated_get(depsgraph)) for obj in objects]
    if camera is not None:
        parts.append(_matrix(camera))
    if camera is not None and camera.type == "CAMERA":  # Blender looks from any object
        lens = camera.data
        parts += [lens.type, lens.lens, lens.ortho_scale, lens.shift_x, lens.shift_y]
    lamps = [obj.evaluated_get(depsgraph) for obj in scene.objects if obj.type == "LIGHT"]
    for lamp in (one for one in lamps if not one.hide_render):
        light = lamp.data
        parts += [_matrix(lamp), light.type, light.energy, list(light.color)]
    if world is not None and world.node_tree is not None:
        parts += [world.name, *_world_values(world.node_tree)]
    text = json.dumps(parts, default=lambda value: list(value))
    return hashlib.sha256(text.encode()).hexdigest()


def _matrix(obj: Any) -> list[float]:
    return [round(value, _DIGITS) for row in obj.matrix_world for value in row]


def _world_values(tree: bpy.types.NodeTree) -> Iterator[Any]:
    for link in tree.links:
        yield [link.from_node.name, link.from_socket.name, link.to_node.name, link.to_socket.name]
    for node in tree.nodes:
        if node.type in ("TEX_ENVIRONMENT", "TEX_IMAGE"):
            yield node.image.name if node.image is not None else ""
        for socket in node.inputs:
            if not socket.is_linked and socket.type in ("VALUE", "VECTOR", "RGBA"):
                value = socket.default_value
                yield value if isinstance(value, float) else list(value)
