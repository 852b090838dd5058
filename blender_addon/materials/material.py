"""The object's material: one Principled BSDF with the recovered textures, ready to be edited.

The node of the group "ISC Dichromatic" holds the edits; `material_edits` writes them into the BSDF
and its textures. When the object is built again, gains and colour edits are kept, with their
keyframes and drivers; textures, roughness and level follow the result.
"""

from dataclasses import dataclass
from typing import Literal

import bpy

from ..datablocks.mesh import UV
from ..datablocks.nodes import add_node, connect, node_tree
from ..datablocks.provenance import datablock_name, tag
from .dichromatic import DICHROMATIC, HIGHLIGHTS, dichromatic_group
from .edit_nodes import BASE_COLOR, LEVEL_FACTOR, OWN_LEVEL, SURFACE, dichromatic_node
from .gloss_edits import FITTED_GLOSS, GlossBasis, store_base_colors
from .material_edits import bake_edits, begin_bake, discard_edits
from .photo_highlights import show_highlights

SpecularSource = Literal["lobe", "image", "none"]
_EDITED = ("Diffuse Gain", "Specular Gain", "Hue", "Saturation", "Value", "Gloss Gain")
# Values of the fit, the user's where they are no longer what the material stores of the fit.
_FITTED = ("Specular Level", "Roughness")


@dataclass(frozen=True)
class MaterialMaps:
    """The images of a material.

    Attributes
    ----------
    base_color : bpy.types.Image
        Base colour, of what is under the specular layer.
    specular : bpy.types.Image or None
        The photo's highlights.
    variation : bpy.types.Image or None
        Spatial factor of the specular level.
    normal : bpy.types.Image or None
        Tangent-space normal map.
    alpha : bpy.types.Image or None
        Opacity; None for an opaque object.
    basis : GlossBasis or None
        What the base colour under another gloss follows from; None without a specular layer.
    """

    base_color: bpy.types.Image
    specular: bpy.types.Image | None
    variation: bpy.types.Image | None
    normal: bpy.types.Image | None
    alpha: bpy.types.Image | None = None
    basis: GlossBasis | None = None


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
        "lobe", "image" (the photo's highlights until light, camera or pose change) or "none".
    """

    level: float
    roughness: float
    source: SpecularSource


def ensure_material(
    key: str,
    maps: MaterialMaps,
    specular: SpecularSettings,
    material: bpy.types.Material | None = None,
) -> bpy.types.Material:
    """Create or update the material of a photo.

    Parameters
    ----------
    key : str
        Name of the photo.
    maps : MaterialMaps
        Its images.
    specular : SpecularSettings
        Its specular part.
    material : bpy.types.Material, optional
        The material to update; None creates one.

    Returns
    -------
    bpy.types.Material
        The material.
    """
    if material is None:
        material = tag(bpy.data.materials.new(datablock_name(key)), key, "material")
    update_material(material, maps, specular)
    return material


def update_material(
    material: bpy.types.Material, maps: MaterialMaps, specular: SpecularSettings
) -> None:
    """Give a material the textures and the gloss of a result; edits are kept.

    Parameters
    ----------
    material : bpy.types.Material
        A local material of ISC.
    maps : MaterialMaps
        Its images.
    specular : SpecularSettings
        Its specular part.
    """
    kept = _edited_values(material)
    tree = node_tree(material)
    discard_edits(material)
    edits = _clear(material)
    if hasattr(material, "cycles"):
        # The photo's highlights emit no light: rays toward them would only add noise.
        material.cycles.emission_sampling = "NONE"
    group = _add_surface(tree, maps, edits, with_variation=specular.source != "none")
    _set_values(material, group, specular, kept)
    if maps.specular is not None:
        material["isc_highlights"] = maps.specular
    store_base_colors(material, maps.base_color, maps.basis)
    if specular.source == "image":
        show_highlights(material)
    if bpy.app.background:
        bake_edits(material)
    else:
        begin_bake(material)  # colours that take longer are baked later, as after edits


def shows_highlights(material: bpy.types.Material) -> bool:
    """Return whether a material shows the photo's own highlights instead of its own.

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
    """Set the gain of the highlights, of the surface's and of the photo's.

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


def _clear(material: bpy.types.Material) -> bpy.types.Node | None:
    """Remove all nodes but that of the edits: Blender removes keyframes and drivers with a node."""
    nodes, kept = material.node_tree.nodes, dichromatic_node(material)
    if kept is not None and kept.node_tree != dichromatic_group():  # of an earlier version
        kept = None
    for node in [node for node in nodes if node != kept]:
        nodes.remove(node)
    if kept is not None:
        kept.inputs["Photo Highlights"].default_value = 0.0
    return kept


def _edited_values(material: bpy.types.Material) -> dict[str, float]:
    """The values on the group's node that belong to the user."""
    node = dichromatic_node(material)
    if node is None:
        return {}
    names = [name for name in _EDITED if name in node.inputs]
    if FITTED_GLOSS in material:
        fit = zip(_FITTED, material[FITTED_GLOSS], strict=True)
        names += [name for name, value in fit if node.inputs[name].default_value != value]
    return {name: node.inputs[name].default_value for name in names}


def _set_values(
    material: bpy.types.Material,
    group: bpy.types.Node,
    specular: SpecularSettings,
    kept: dict[str, float],
) -> None:
    """Set the values of the fit, then those of the user; without highlights there is no level."""
    inputs, matte = group.inputs, specular.source == "none"
    for name, value in zip(_FITTED, (specular.level, specular.roughness), strict=True):
        inputs[name].default_value = value
    if matte:
        inputs["Specular Level"].default_value = 0.0
    material[FITTED_GLOSS] = [inputs[name].default_value for name in _FITTED]
    for name, value in kept.items():
        if not (matte and name == "Specular Level"):
            inputs[name].default_value = value


def _add_surface(
    tree: bpy.types.NodeTree,
    maps: MaterialMaps,
    group: bpy.types.Node | None,
    *,
    with_variation: bool,
) -> bpy.types.Node:
    """Add the nodes, framed; returns that of the edits, which may exist."""
    textures, edits, surface = (
        add_node(tree, "NodeFrame", (0, 0), label=label, name=label)
        for label in ("Textures", "Edits", "Surface")
    )
    base_color = _add_texture(tree, maps.base_color, BASE_COLOR, (-900, 400), textures)
    if group is None:
        group = add_node(
            tree, "Group", (0, 0), name=DICHROMATIC, width=240, node_tree=dichromatic_group()
        )
    group.location, group.parent = (-500, 420), edits
    bsdf = add_node(tree, "BsdfPrincipled", (50, 420), name=SURFACE, parent=surface)
    bsdf.inputs["Specular IOR Level"].default_value = OWN_LEVEL
    output = add_node(tree, "OutputMaterial", (400, 420), parent=surface)
    connect(
        tree,
        (base_color.outputs["Color"], group.inputs["Base Color"]),
        (base_color.outputs["Color"], bsdf.inputs["Base Color"]),
        (bsdf.outputs["BSDF"], output.inputs["Surface"]),
    )
    if with_variation and maps.variation is not None:
        variation = _add_texture(tree, maps.variation, "Specular", (-900, 80), textures)
        factor = add_node(
            tree,
            "Math",
            (-200, 80),
            name=LEVEL_FACTOR,
            label="Specular Level",
            operation="MULTIPLY",
            parent=surface,
        )
        factor.inputs[1].default_value = OWN_LEVEL
        connect(
            tree,
            (variation.outputs["Color"], factor.inputs[0]),
            (factor.outputs["Value"], bsdf.inputs["Specular IOR Level"]),
        )
    if maps.normal is not None:
        normal = _add_texture(tree, maps.normal, "Normal", (-900, -240), textures)
        normal_map = add_node(tree, "NormalMap", (-200, -240), uv_map=UV, parent=surface)
        connect(
            tree,
            (normal.outputs["Color"], normal_map.inputs["Color"]),
            (normal_map.outputs["Normal"], bsdf.inputs["Normal"]),
        )
    if maps.alpha is not None:
        alpha = _add_texture(tree, maps.alpha, "Alpha", (-900, -560), textures)
        connect(tree, (alpha.outputs["Color"], bsdf.inputs["Alpha"]))
    return group


def _add_texture(
    tree: bpy.types.NodeTree,
    image: bpy.types.Image,
    name: str,
    location: tuple[float, float],
    frame: bpy.types.Node,
) -> bpy.types.Node:
    return add_node(
        tree,
        "TexImage",
        location,
        name=name,
        label=name,
        image=image,
        extension="EXTEND",
        parent=frame,
    )
