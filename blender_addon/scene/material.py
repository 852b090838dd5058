"""The object's material: the group "ISC Dichromatic" with the recovered maps, ready to be edited.

The group's node has the group's name. When the object is built again, gains and colour edits on the
node are kept; maps, roughness and level follow the result.
"""

from dataclasses import dataclass
from typing import Literal

import bpy

from .dichromatic import DICHROMATIC, HIGHLIGHTS, dichromatic_group, highlights_group
from .mesh import UV
from .nodes import add_node, node_tree
from .provenance import datablock_name, find_tagged, tag

SpecularSource = Literal["lobe", "image", "none"]


@dataclass(frozen=True)
class MaterialMaps:
    """The images of a material.

    Attributes
    ----------
    base_color : bpy.types.Image
        Reflectance.
    specular : bpy.types.Image or None
        The photo's highlights.
    variation : bpy.types.Image or None
        Spatial factor of the specular level.
    normal : bpy.types.Image or None
        Tangent-space normal map.
    """

    base_color: bpy.types.Image
    specular: bpy.types.Image | None
    variation: bpy.types.Image | None
    normal: bpy.types.Image | None


@dataclass(frozen=True)
class SpecularSettings:
    """The specular part of a material.

    Attributes
    ----------
    level : float
        Level of the lobe, 0 or more; 1 is plastic.
    roughness : float
        Roughness of the lobe, in [0, 1].
    source : str
        "lobe", "image" or "none".
    """

    level: float
    roughness: float
    source: SpecularSource


def ensure_material(key: str, maps: MaterialMaps, specular: SpecularSettings) -> bpy.types.Material:
    """Create or update the material of a photo.

    Parameters
    ----------
    key : str
        Name of the photo.
    maps : MaterialMaps
        Its images.
    specular : SpecularSettings
        Its specular part.

    Returns
    -------
    bpy.types.Material
        The material.
    """
    material = find_tagged(bpy.data.materials, key, "material") or tag(
        bpy.data.materials.new(datablock_name(key)), key, "material"
    )
    kept = _edited_values(material)
    tree = node_tree(material)
    tree.nodes.clear()
    group = add_node(
        tree, "Group", (0, 200), name=DICHROMATIC, width=220, node_tree=dichromatic_group()
    )
    output = add_node(tree, "OutputMaterial", (600, 200))
    if hasattr(material, "cycles"):
        # The photo's highlights emit no light: rays toward them would only add noise.
        material.cycles.emission_sampling = "NONE"
    _add_texture(tree, maps.base_color, group.inputs["Reflectance"], (-500, 400))
    surface = group.outputs["Surface"]
    if specular.source == "image" and maps.specular is not None:
        surface = _add_highlights(tree, surface, maps.specular)
    if specular.source == "lobe" and maps.variation is not None:
        _add_texture(tree, maps.variation, group.inputs["Specular Image"], (-500, 100))
    if maps.normal is not None:
        normal_map = add_node(tree, "NormalMap", (-200, -200), uv_map=UV)
        _add_texture(tree, maps.normal, normal_map.inputs["Color"], (-500, -200))
        tree.links.new(normal_map.outputs["Normal"], group.inputs["Normal"])
    tree.links.new(surface, output.inputs["Surface"])
    for name, value in kept.items():
        group.inputs[name].default_value = value
    level = specular.level if specular.source == "lobe" else 0.0
    group.inputs["Specular Level"].default_value = level
    group.inputs["Roughness"].default_value = specular.roughness
    set_specular_gain(material, group.inputs["Specular Gain"].default_value)
    return material


def dichromatic_node(material: bpy.types.Material) -> bpy.types.Node | None:
    """Find the node of the group "ISC Dichromatic" in a material.

    Parameters
    ----------
    material : bpy.types.Material
        The material.

    Returns
    -------
    bpy.types.Node or None
        The node.
    """
    nodes = material.node_tree.nodes if material.node_tree else ()
    groups = (node for node in nodes if node.type == "GROUP" and node.node_tree)
    return next((node for node in groups if node.node_tree.get("isc_group") == DICHROMATIC), None)


def shows_highlights(material: bpy.types.Material) -> bool:
    """Return whether a material shows the photo's own highlights instead of the lobe.

    Parameters
    ----------
    material : bpy.types.Material
        The material.

    Returns
    -------
    bool
    """
    nodes = material.node_tree.nodes if material.node_tree else ()
    return any(
        node.type == "GROUP" and node.node_tree and node.node_tree.get("isc_group") == HIGHLIGHTS
        for node in nodes
    )


def set_specular_gain(material: bpy.types.Material, gain: float) -> None:
    """Set the gain of the lobe and of the photo's highlights.

    Parameters
    ----------
    material : bpy.types.Material
        The material.
    gain : float
        Factor, 0 or more.
    """
    for node in material.node_tree.nodes:
        if node.type == "GROUP" and node.node_tree and "Specular Gain" in node.inputs:
            node.inputs["Specular Gain"].default_value = gain


def _edited_values(material: bpy.types.Material) -> dict[str, float]:
    """The values on the group's node that belong to the user."""
    node = dichromatic_node(material)
    if node is None:
        return {}
    names = ("Diffuse Gain", "Specular Gain", "Hue", "Saturation", "Value")
    return {name: node.inputs[name].default_value for name in names if name in node.inputs}


def _add_texture(
    tree: bpy.types.NodeTree,
    image: bpy.types.Image,
    target: bpy.types.NodeSocket,
    location: tuple[float, float],
) -> None:
    node = add_node(tree, "TexImage", location, image=image, extension="EXTEND")
    tree.links.new(node.outputs["Color"], target)


def _add_highlights(
    tree: bpy.types.NodeTree, surface: bpy.types.NodeSocket, image: bpy.types.Image
) -> bpy.types.NodeSocket:
    highlights = add_node(
        tree, "Group", (0, -50), name=HIGHLIGHTS, width=220, node_tree=highlights_group()
    )
    total = add_node(tree, "AddShader", (350, 200))
    _add_texture(tree, image, highlights.inputs["Specular Image"], (-500, 100))
    tree.links.new(surface, total.inputs[0])
    tree.links.new(highlights.outputs["Surface"], total.inputs[1])
    return total.outputs["Shader"]
