"""The object's material: the group "ISC Dichromatic" fed by the recovered maps, ready to be edited.

The group's node is called like the group. What people set on it stays when the object is built
again: gains and recolouring are theirs; maps, roughness and level follow the result.
"""

from dataclasses import dataclass
from typing import Literal

import bpy

from .dichromatic import DICHROMATIC, HIGHLIGHTS, dichromatic_group, highlights_group
from .mesh import UV
from .nodes import add_node, node_tree
from .provenance import find, label, mark

SpecularFrom = Literal["lobe", "image", "none"]


@dataclass(frozen=True)
class Maps:
    """The images of a material;

    None where there is none. `base_color`, `specular`: colours. `variation`: of the specular level.
    """

    base_color: bpy.types.Image
    specular: bpy.types.Image | None
    variation: bpy.types.Image | None
    normal: bpy.types.Image | None


@dataclass(frozen=True)
class Gloss:
    """`level` >= 0, 1 is plastic; `roughness` in [0, 1]; where the gloss comes from."""

    level: float
    roughness: float
    source: SpecularFrom


def ensure_material(key: str, maps: Maps, gloss: Gloss) -> bpy.types.Material:
    """The image's material with these maps."""
    material = find(bpy.data.materials, key, "material") or mark(
        bpy.data.materials.new(label(key)), key, "material"
    )
    kept = _settings(material)
    tree = node_tree(material)
    tree.nodes.clear()
    group = add_node(
        tree, "Group", (0, 200), name=DICHROMATIC, width=220, node_tree=dichromatic_group()
    )
    output = add_node(tree, "OutputMaterial", (600, 200))
    if hasattr(material, "cycles"):
        material.cycles.emission_sampling = (
            "NONE"  # the photo's highlights light nothing: rays toward them would only add noise
        )
    _texture(tree, maps.base_color, group.inputs["Reflectance"], (-500, 400))
    surface = group.outputs["Surface"]
    if gloss.source == "image" and maps.specular is not None:
        surface = _add_highlights(tree, surface, maps.specular)
    if gloss.source == "lobe" and maps.variation is not None:
        _texture(tree, maps.variation, group.inputs["Specular Image"], (-500, 100))
    if maps.normal is not None:
        bump = add_node(tree, "NormalMap", (-200, -200), uv_map=UV)
        _texture(tree, maps.normal, bump.inputs["Color"], (-500, -200))
        tree.links.new(bump.outputs["Normal"], group.inputs["Normal"])
    tree.links.new(surface, output.inputs["Surface"])
    for name, value in kept.items():
        group.inputs[name].default_value = value
    group.inputs["Specular Level"].default_value = gloss.level if gloss.source == "lobe" else 0.0
    group.inputs["Roughness"].default_value = gloss.roughness
    set_specular_gain(material, group.inputs["Specular Gain"].default_value)
    return material


def dichromatic_node(material: bpy.types.Material) -> bpy.types.Node | None:
    """The node of the group "ISC Dichromatic" in a material, or None."""
    nodes = material.node_tree.nodes if material.node_tree else ()
    groups = (node for node in nodes if node.type == "GROUP" and node.node_tree)
    return next((node for node in groups if node.node_tree.get("isc_group") == DICHROMATIC), None)


def shows_highlights(material: bpy.types.Material) -> bool:
    """Whether the photo's own highlights stand in for the gloss."""
    nodes = material.node_tree.nodes if material.node_tree else ()
    return any(
        node.type == "GROUP" and node.node_tree and node.node_tree.get("isc_group") == HIGHLIGHTS
        for node in nodes
    )


def set_specular_gain(material: bpy.types.Material, gain: float) -> None:
    """Sets the gain of the gloss wherever it comes from: the lobe or the photo's highlights."""
    for node in material.node_tree.nodes:
        if node.type == "GROUP" and node.node_tree and "Specular Gain" in node.inputs:
            node.inputs["Specular Gain"].default_value = gain


def _settings(material: bpy.types.Material) -> dict[str, float]:
    """What people may have set on the group's node."""
    node = dichromatic_node(material)
    theirs = ("Diffuse Gain", "Specular Gain", "Hue", "Saturation", "Value")
    return (
        {}
        if node is None
        else {name: node.inputs[name].default_value for name in theirs if name in node.inputs}
    )


def _texture(
    tree: bpy.types.NodeTree,
    image: bpy.types.Image,
    target: bpy.types.NodeSocket,
    place: tuple[float, float],
) -> None:
    node = add_node(tree, "TexImage", place, image=image, extension="EXTEND")
    tree.links.new(node.outputs["Color"], target)


def _add_highlights(
    tree: bpy.types.NodeTree, surface: bpy.types.NodeSocket, image: bpy.types.Image
) -> bpy.types.NodeSocket:
    shine = add_node(
        tree, "Group", (0, -50), name=HIGHLIGHTS, width=220, node_tree=highlights_group()
    )
    both = add_node(tree, "AddShader", (350, 200))
    _texture(tree, image, shine.inputs["Specular Image"], (-500, 100))
    tree.links.new(surface, both.inputs[0])
    tree.links.new(shine.outputs["Surface"], both.inputs[1])
    return both.outputs["Shader"]
