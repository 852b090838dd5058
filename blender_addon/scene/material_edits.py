"""Write the edits on the node "ISC Dichromatic" into the Principled BSDF and its textures.

Problem: exporters read images and numbers on the BSDF, and no node groups. An edited colour seen
through a group would be exported unedited, or black.

At rest the BSDF has an image and numbers. Numbers follow the sliders at once. While a colour slider
moves, the group's output is linked to the BSDF, so that the graphics processor shows each step;
then `bake_edits` writes the edited colours into a texture and links that. An unedited base colour
is the recovered texture itself.

Equation: base colour = g v (1 - p s) rotated(rho; hue, saturation), as the group computes it,
clipped at 1 and coded in 8 bits; see `dichromatic`.

Citation: A. R. Smith, "Color gamut transform pairs", SIGGRAPH 1978, doi:10.1145/965139.807361 (hue,
saturation and value).

Limits: a base colour brighter than white is clipped. Keyframed edits, and a base colour that comes
from the user's own nodes, stay live: exporters then see the unedited image, or none.
"""

from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from isc_core.imaging.srgb import srgb_to_linear
from isc_core.shading.brdf.ggx import F0

from ..datablocks.images import SRGB, new_png_texture, new_texture, scaled_png
from ..datablocks.nodes import add_node
from ..datablocks.provenance import KEY, ROLE, tag
from .dichromatic import DICHROMATIC, MOST

SURFACE, BASE_COLOR, EDITED, LEVEL_FACTOR = (
    "Principled BSDF",
    "Base Color",
    "Edited Base Color",
    "Specular Level",
)
# Blender's own level of the BSDF: .5 is plastic. With exactly .5, its glTF exporter leaves out the
# index of refraction.
OWN_LEVEL = 0.499
_NUMBERS, _COLOR = "isc_written_numbers", "isc_written_color"
_UNCHANGED = 1e-6  # as in the group


@dataclass(frozen=True)
class ColorEdit:
    """An edit of the base colour.

    Attributes
    ----------
    hue : float
        Rotation of the hue; 0.5 changes nothing.
    saturation : float
        Factor of the saturation; 1 changes nothing.
    gain : float
        Factor of all channels; 1 changes nothing.
    """

    hue: float = 0.5
    saturation: float = 1.0
    gain: float = 1.0

    @property
    def values(self) -> tuple[float, float, float]:
        """The three numbers."""
        return self.hue, self.saturation, self.gain

    @property
    def only_scales(self) -> bool:
        """Whether hue and saturation stay."""
        return bool(np.abs(np.subtract(self.values[:2], (0.5, 1.0))).max() <= _UNCHANGED)

    @property
    def changes_nothing(self) -> bool:
        """Whether the edited colour is the recovered one."""
        return bool(np.abs(np.subtract(self.values, (0.5, 1.0, 1.0))).max() <= _UNCHANGED)


def dichromatic_node(material: bpy.types.Material) -> bpy.types.Node | None:
    """Find the node of the group "ISC Dichromatic", of any version, in a material.

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


def surface_node(material: bpy.types.Material) -> bpy.types.Node | None:
    """Find the Principled BSDF that the edits of a material are written to.

    Parameters
    ----------
    material : bpy.types.Material
        The material.

    Returns
    -------
    bpy.types.Node or None
        None for materials of earlier versions, whose group is the whole surface.
    """
    group = dichromatic_node(material)
    if group is None or "Gloss Gain" not in group.inputs:
        return None
    node = material.node_tree.nodes.get(SURFACE)
    return node if node is not None and node.type == "BSDF_PRINCIPLED" else None


def apply_edits(material: bpy.types.Material) -> bool:
    """Write the numbers into the BSDF, and show the edited colour.

    Parameters
    ----------
    material : bpy.types.Material
        A local material of ISC.

    Returns
    -------
    bool
        Whether the colour is shown through the group and can be baked.
    """
    surface, group = surface_node(material), dichromatic_node(material)
    if surface is None or group is None:
        return False
    _write_numbers(material, surface, group.inputs)
    if _color_state(group) == material.get(_COLOR):
        return False
    target = surface.inputs["Base Color"]
    if not _is_ours(target, group):
        return False
    if not target.is_linked or target.links[0].from_node != group:
        material.node_tree.links.new(group.outputs["Base Color"], target)
    return _can_bake(material, group)


def bake_edits(material: bpy.types.Material, plain: bytes | None = None) -> None:
    """Write all edits into the BSDF and its textures.

    Parameters
    ----------
    material : bpy.types.Material
        A local material of ISC; nothing changes where there is nothing to write.
    plain : bytes, optional
        PNG file of the base colour without its compensation for the specular share.
    """
    if not apply_edits(material):
        return
    surface, group = surface_node(material), dichromatic_node(material)
    if surface is None or group is None:
        return
    tree, edit, target = material.node_tree, _color_edit(group.inputs), surface.inputs["Base Color"]
    source = group.inputs["Base Color"]
    if not source.is_linked:
        color = recolour_reflectance(np.array(source.default_value[:3]), *edit.values)
        tree.links.remove(target.links[0])
        target.default_value = (*np.clip(color, 0, 1), 1.0)
    elif not edit.changes_nothing:
        node = _edited_texture(material, source.links[0].from_node)
        share = group.inputs["Specular Share"].default_value
        if not (edit.only_scales and abs(edit.gain + share - 1) <= _UNCHANGED):
            plain = None
        _replace_image(node, _bake(material, source.links[0].from_node.image, edit, plain))
        tree.links.new(node.outputs["Color"], target)
    else:
        tree.links.new(source.links[0].from_socket, target)
        if (node := tree.nodes.get(EDITED)) is not None:
            _replace_image(node, None)
            tree.nodes.remove(node)
    material[_COLOR] = _color_state(group)


def forget_edits(material: bpy.types.Material) -> None:
    """Remove the edited texture, and what is known of written values: the nodes are made anew.

    Parameters
    ----------
    material : bpy.types.Material
        A local material of ISC.
    """
    for name in (_NUMBERS, _COLOR):
        if name in material:
            del material[name]
    node = material.node_tree.nodes.get(EDITED) if material.node_tree else None
    if node is not None and node.type == "TEX_IMAGE":
        _replace_image(node, None)


def recolour_reflectance(
    reflectance: np.ndarray, hue: float, saturation: float, gain: float
) -> np.ndarray:
    """Apply the group's colour edits.

    Parameters
    ----------
    reflectance : (..., 3) ndarray
        Linear Rec.709, 0 or more.
    hue : float
        Rotation of the hue; 0.5 changes nothing.
    saturation : float
        Factor of the saturation; 1 changes nothing.
    gain : float
        Factor of all channels.

    Returns
    -------
    (..., 3) ndarray
        Linear Rec.709, not clipped at 1.
    """
    if abs(hue - 0.5) <= _UNCHANGED and abs(saturation - 1) <= _UNCHANGED:
        return gain * reflectance
    value, low = reflectance.max(-1), reflectance.min(-1)
    spread = np.where(value > low, value - low, 1.0)
    red, green, blue = np.moveaxis(reflectance, -1, 0)
    sector = np.where(green == value, 2 + (blue - red) / spread, 4 + (red - green) / spread)
    sector = np.where(red == value, (green - blue) / spread, sector) + 6 * (hue + 0.5)
    share = np.clip(saturation * (value - low) / np.where(value > 0, value, 1.0), 0, 1)
    place = (np.array([5.0, 3.0, 1.0]) + sector[..., None]) % 6
    removed = (value * share)[..., None] * np.clip(np.minimum(place, 4 - place), 0, 1)
    return np.asarray(gain * (value[..., None] - removed))


def refraction(level: float) -> float:
    """Return the index of refraction of a specular level.

    Parameters
    ----------
    level : float
        0 or more; 1 is plastic.

    Returns
    -------
    float
        1 or more.
    """
    amplitude = min(F0 * level, MOST) ** 0.5
    return float((1 + amplitude) / (1 - amplitude))


def specular_level(surface: Any) -> float:
    """Return the specular level of a Principled BSDF, from its index of refraction.

    Parameters
    ----------
    surface : bpy.types.ShaderNodeBsdfPrincipled
        The BSDF; its own level, or its factor, is 0.5 for plastic.

    Returns
    -------
    float
        1 is plastic; without the spatial variation.
    """
    index = surface.inputs["IOR"].default_value
    level = surface.inputs["Specular IOR Level"]
    factor = OWN_LEVEL if level.is_linked else level.default_value
    return float(((index - 1) / (index + 1)) ** 2 / F0 * factor / 0.5)


def linear_colors(image: bpy.types.Image) -> np.ndarray:
    """Return the colours of an image.

    Parameters
    ----------
    image : bpy.types.Image
        The image.

    Returns
    -------
    (H, W, 3) ndarray
        Linear Rec.709, row 0 at the bottom.
    """
    width, height = image.size
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    colors = pixels.reshape(height, width, 4)[..., :3].astype(float)
    # Blender returns the codes of such an image, and linear values of others.
    if not image.is_float and image.colorspace_settings.name == SRGB:
        return np.asarray(srgb_to_linear(colors))
    return colors


def _codes(image: bpy.types.Image) -> np.ndarray:
    """(H, W, 3) uint8, row 0 at the top, of an image of 8 bits."""
    width, height = image.size
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    colors = pixels.reshape(height, width, 4)[::-1, :, :3]
    return (255 * colors + 0.5).astype(np.uint8)


def _color_edit(inputs: Any) -> ColorEdit:
    hue, saturation, value, gain, shown, share = (
        float(inputs[name].default_value)
        for name in (
            "Hue",
            "Saturation",
            "Value",
            "Diffuse Gain",
            "Photo Highlights",
            "Specular Share",
        )
    )
    return ColorEdit(hue, saturation, value * gain * (1 - shown * share))


def _color_state(group: bpy.types.Node) -> str:
    """What the edited colour depends on."""
    source = group.inputs["Base Color"]
    if not source.is_linked:
        base = " ".join(f"{value:.6f}" for value in source.default_value)
    else:
        image = getattr(source.links[0].from_node, "image", None)
        base = image.name if image is not None else "nodes"
    return " ".join(f"{value:.6f}" for value in _color_edit(group.inputs).values) + f" {base}"


def _write_numbers(material: bpy.types.Material, surface: Any, inputs: Any) -> None:
    """Write what has changed since the last time: the BSDF's own fields can be edited, too."""
    level, gain, roughness, gloss, shown = (
        float(inputs[name].default_value)
        for name in (
            "Specular Level",
            "Specular Gain",
            "Roughness",
            "Gloss Gain",
            "Photo Highlights",
        )
    )
    wanted = [refraction(level * gain * (1 - shown)), min(1.0, roughness / max(gloss, 1e-3))]
    written = material.get(_NUMBERS)
    if written is None or abs(written[0] - wanted[0]) > _UNCHANGED:
        surface.inputs["IOR"].default_value = wanted[0]
    if written is None or abs(written[1] - wanted[1]) > _UNCHANGED:
        surface.inputs["Roughness"].default_value = wanted[1]
    if written is None or np.abs(np.subtract(list(written), wanted)).max() > 0:
        material[_NUMBERS] = wanted


def _is_ours(target: Any, group: bpy.types.Node) -> bool:
    """Whether the BSDF's colour comes from the group, its image or the edited one, or is a number:
    the user's own nodes are left alone.
    """
    if not target.is_linked:
        return True
    source, base = target.links[0].from_node, group.inputs["Base Color"]
    nodes = group.id_data.nodes
    return source in (group, nodes.get(EDITED), nodes.get(BASE_COLOR)) or (
        base.is_linked and source == base.links[0].from_node
    )


def _can_bake(material: bpy.types.Material, group: bpy.types.Node) -> bool:
    motion = material.node_tree.animation_data
    if motion is not None and (motion.action is not None or len(motion.drivers)):
        return False
    source = group.inputs["Base Color"]
    if not source.is_linked:
        return True
    node = source.links[0].from_node
    return node.type == "TEX_IMAGE" and node.image is not None and bool(node.image.size[0])


def _edited_texture(material: bpy.types.Material, base: bpy.types.Node) -> bpy.types.Node:
    tree = material.node_tree
    node = tree.nodes.get(EDITED)
    if node is None:
        node = add_node(
            tree, "TexImage", (0, 0), name=EDITED, label=EDITED, extension=base.extension
        )
        node.location = base.location[0], base.location[1] - 280
        node.parent = base.parent
    return node


def _bake(
    material: bpy.types.Material, image: bpy.types.Image, edit: ColorEdit, png: bytes | None
) -> bpy.types.Image:
    """The edited colours; `png` is their file where that is known."""
    key = str(material.get(KEY, material.name))
    is_coded = not image.is_float and image.colorspace_settings.name == SRGB
    if png is None and edit.only_scales and is_coded:
        png = scaled_png(_codes(image), edit.gain)
    if png is not None:
        return tag(new_png_texture(key, "edited_base_color", png), key, "edited_base_color")
    colors = recolour_reflectance(linear_colors(image), *edit.values)
    return tag(new_texture(key, "edited_base_color", colors, SRGB), key, "edited_base_color")


def _replace_image(node: Any, image: bpy.types.Image | None) -> None:
    """A new datablock each time: undo restores the pixels of one only with its datablock."""
    old, node.image = node.image, image
    if old is not None and old.users == 0 and old.get(ROLE) == "edited_base_color":
        bpy.data.images.remove(old)
