"""A plain material for export where the edits are not written into a Principled BSDF: in files from
earlier versions, whose group "ISC Dichromatic" was the whole surface, and where the user has
removed or renamed that node.

Equation: base colour = min(1, g v rotated(rho; hue, saturation)), as the group computes it:
`rotated` is Blender's Hue/Saturation, v the value, g the diffuse gain. It is baked into an 8-bit
sRGB image, as glTF and similar formats require. Roughness is the group's; the specular level is the
group's times its gain. Where the material shows the photo's highlights, the group's level is 0 and
the fitted level replaces it: without that image the exported object stays as glossy as the photo.

Citation: A. R. Smith, "Color gamut transform pairs", SIGGRAPH 1978, doi:10.1145/965139.807361 (hue,
saturation and value).

Limits: a base colour brighter than white is clipped at 1. The level is one number: its spatial
variation is not exported.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import bpy
import numpy as np

from isc_core.errors import InputError

from ..datablocks.images import SRGB, ImageRole, image_name, new_image, texture_file
from ..datablocks.nodes import node_tree
from ..datablocks.provenance import SPECULAR_LEVEL
from ..materials.color_bake import linear_colors, recolour_reflectance
from ..materials.edit_nodes import PLASTIC, dichromatic_node
from ..materials.material import shows_highlights


@contextmanager
def export_material(
    obj: bpy.types.Object, material: bpy.types.Material
) -> Iterator[bpy.types.Material]:
    """Assign a plain version of a material to an object while the context lasts.

    Parameters
    ----------
    obj : bpy.types.Object
        The object.
    material : bpy.types.Material
        Its material.

    Yields
    ------
    bpy.types.Material
        The plain material; deleted at the end with its images.

    Raises
    ------
    InputError
        If the reflectance comes from nodes other than an image.
    """
    plain = bpy.data.materials.new("plain")
    try:
        _fill(plain, obj, material)
        with temporarily_assigned(obj, material, plain):
            yield plain
    finally:
        images = [node.image for node in plain.node_tree.nodes if node.type == "TEX_IMAGE"]
        bpy.data.materials.remove(plain)
        for image in images:
            bpy.data.images.remove(image)


@contextmanager
def temporarily_assigned(
    obj: Any, material: bpy.types.Material, replacement: bpy.types.Material
) -> Iterator[None]:
    """Replace a material of an object while the context lasts.

    Parameters
    ----------
    obj : bpy.types.Object
        The object.
    material : bpy.types.Material
        The material to replace in all slots; the first slot's if it is in none. An object without
        slots has one for the duration.
    replacement : bpy.types.Material
        The other material.

    Yields
    ------
    None
    """
    slot_added = not obj.material_slots
    if slot_added:
        obj.data.materials.append(None)
    slots = list(obj.material_slots)
    replaced = [(slot, slot.material) for slot in slots if slot.material == material] or [
        (slots[0], slots[0].material)
    ]
    # A library override has slots that cannot be set, but need not be, either.
    replaced = [(slot, before) for slot, before in replaced if before != replacement]
    try:
        for slot, _ in replaced:
            slot.material = replacement
        yield
    finally:
        for slot, before in replaced:
            slot.material = before
        if slot_added:
            obj.data.materials.clear()


def _fill(plain: bpy.types.Material, obj: bpy.types.Object, material: bpy.types.Material) -> None:
    tree = node_tree(plain)
    surface = next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")
    group = dichromatic_node(material)
    if group is None:
        return
    given = group.inputs
    level = given["Specular Level"].default_value
    if level == 0 and shows_highlights(material):
        level = float(obj.get(SPECULAR_LEVEL, 0.0))
    gloss = given["Gloss Gain"].default_value if "Gloss Gain" in given else 1.0
    roughness = given["Roughness"].default_value / max(gloss, 1e-3)
    surface.inputs["Roughness"].default_value = min(1.0, roughness)
    surface.inputs["Specular IOR Level"].default_value = (
        PLASTIC * level * given["Specular Gain"].default_value
    )
    gain = given["Value"].default_value * given["Diffuse Gain"].default_value
    edits = (given["Hue"].default_value, given["Saturation"].default_value, gain)
    source = given["Reflectance" if "Reflectance" in given else "Base Color"]
    if not source.is_linked:
        color = recolour_reflectance(np.array(source.default_value[:3]), *edits)
        surface.inputs["Base Color"].default_value = (*np.clip(color, 0, 1), 1.0)
        return
    node = source.links[0].from_node
    if node.type != "TEX_IMAGE" or node.image is None or not node.image.size[0]:
        raise InputError(
            f"the base color of {obj.name} is not an image: connect an image texture to the "
            f"node's {source.name}, or bake it"
        )
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = _bake(node.image, *edits)
    tree.links.new(texture.outputs["Color"], surface.inputs["Base Color"])


def _bake(image: bpy.types.Image, hue: float, saturation: float, gain: float) -> bpy.types.Image:
    """The edited reflectance, 8 bits, sRGB."""
    edited = recolour_reflectance(linear_colors(image), hue, saturation, gain)
    baked = new_image(texture_file(edited[::-1], SRGB))
    baked.name = image_name("plain", ImageRole.BASE_COLOR)
    return baked
