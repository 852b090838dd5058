"""Write the edits on the node "ISC Dichromatic" into the Principled BSDF and its textures.

Problem: exporters read images and numbers on the BSDF, and no node groups. An edited colour seen
through a group would be exported unedited, or black.

At rest the BSDF has an image and numbers. Numbers follow the sliders at once. While a colour slider
moves, the group's output is linked to the BSDF, so that the graphics processor shows each step;
then `bake_edits` writes the edited colours into a texture and links that. An unedited base colour
is the recovered texture itself.

Equation: see `color_bake`. The recovered texture is one of two: with highlights, of what is under
the fitted specular layer, see `isc_core.lobe_fitting.specular_layer`; without, or while the photo's
are shown, the plain one. Edits of the gloss change the base colour, too, which only the bake
computes: while such a slider moves, the last colour is shown.

Limits: keyframed edits, and a base colour that comes from the user's own nodes, stay live:
exporters then see the unedited image, or none.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from ..datablocks.images import (
    ImageFile,
    ImageRole,
    content_mark,
    image_name,
    keep_painted,
    new_image,
    unmodified_file,
)
from ..datablocks.nodes import add_node
from ..datablocks.provenance import KEY, ROLE, all_tagged, tag
from .color_bake import (
    UNCHANGED,
    ColorEdit,
    ColorSource,
    GlossEdit,
    color_source,
    edited_file,
    recolour_reflectance,
)
from .dichromatic import HIGHLIGHTS
from .edit_nodes import BASE_COLOR, EDITED, dichromatic_node, refraction, surface_node
from .gloss_edits import (
    choose_base_color,
    current_gloss,
    edited_gloss,
    gloss_edit,
    plain_base_color,
)

_NUMBERS, _COLOR = "isc_written_numbers", "isc_written_color"
_FORMER_FACTOR = "Specular Share"
_GLOSS_MARK = "\n"  # before the gloss in the text of a state
_STATE = "isc_edits"  # of an image: the edits it shows


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
    _sync_highlight_gain(group)
    choose_base_color(material, group)
    state, shown = _color_state(material, group), material.get(_COLOR)
    if state == shown:
        return False
    if not _is_isc_color(surface.inputs["Base Color"], group):
        return False
    can_bake = _can_bake(material, group)
    image = _find_edited(material, state) if can_bake else None
    if image is not None:
        _show_edited(material, surface, group, image)
        return False
    if not can_bake or shown is None or _without_gloss(shown) != _without_gloss(state):
        _show_group(surface, group)
    return can_bake


@dataclass(frozen=True)
class PendingBake:
    """Edited colours that have to be computed, see `color_bake`.

    Attributes
    ----------
    state : str
        What the colours depend on, as text.
    source : ColorSource
        The recovered colours.
    edit : ColorEdit
        Their edit.
    gloss : GlossEdit or None
        The edit of the gloss above them.
    """

    state: str
    source: ColorSource
    edit: ColorEdit
    gloss: GlossEdit | None = None

    def file(self, stopped: Callable[[], bool] = lambda: False) -> ImageFile | None:
        """Compute the colours, in any thread.

        Parameters
        ----------
        stopped : callable, optional
            Whether they are no longer needed.

        Returns
        -------
        ImageFile or None
            PNG in sRGB; None if stopped.
        """
        return edited_file(self.source, self.edit, stopped, self.gloss)


def bake_edits(material: bpy.types.Material) -> None:
    """Write all edits into the BSDF and its textures.

    Parameters
    ----------
    material : bpy.types.Material
        A local material of ISC; nothing changes where there is nothing to write.
    """
    pending = begin_bake(material)
    if pending is not None and (file := pending.file()) is not None:
        finish_bake(material, pending.state, file)


def begin_bake(material: bpy.types.Material) -> PendingBake | None:
    """Write all edits into the BSDF for which no colours have to be computed.

    Parameters
    ----------
    material : bpy.types.Material
        As of `bake_edits`.

    Returns
    -------
    PendingBake or None
        The colours to compute, in any thread, for `finish_bake`; None if there are none.
    """
    if not apply_edits(material):
        return None
    surface, group = surface_node(material), dichromatic_node(material)
    if surface is None or group is None:
        return None
    tree, edit, target = material.node_tree, _color_edit(group.inputs), surface.inputs["Base Color"]
    source, state = group.inputs["Base Color"], _color_state(material, group)
    gloss = gloss_edit(material, group)
    if not source.is_linked:
        color = recolour_reflectance(np.array(source.default_value[:3]), *edit.values)
        tree.links.remove(target.links[0])
        target.default_value = (*np.clip(color, 0, 1), 1.0)
    elif gloss is not None:
        return PendingBake(state, color_source(plain_base_color(material)), edit, gloss)
    elif not edit.changes_nothing:
        return PendingBake(state, color_source(source.links[0].from_node.image), edit)
    else:
        tree.links.new(source.links[0].from_socket, target)
        if (node := tree.nodes.get(EDITED)) is not None:
            _replace_image(node, None)
            tree.nodes.remove(node)
    material[_COLOR] = state
    return None


def finish_bake(material: bpy.types.Material, state: str, file: ImageFile) -> None:
    """Show edited colours in a material; does nothing if it has been edited since.

    Parameters
    ----------
    material : bpy.types.Material
        A local material of ISC.
    state : str
        As of `PendingBake`.
    file : ImageFile
        The colours.
    """
    if color_state(material) != state or not apply_edits(material):
        return
    surface, group = surface_node(material), dichromatic_node(material)
    if surface is None or group is None:
        return
    key = _key(material)
    image = tag(new_image(file), key, ImageRole.EDITED_BASE_COLOR)
    image.name, image[_STATE] = image_name(key, ImageRole.EDITED_BASE_COLOR), state
    _show_edited(material, surface, group, image)


def release_edited(material: bpy.types.Material) -> None:
    """Show the edited colours through the group; `apply_edits` finds their image again.

    Blender's undo keeps a material that two of its steps have in common as it is, and frees images
    that have been made since the later step: before an undo, materials may not use such images.

    Parameters
    ----------
    material : bpy.types.Material
        A local material of ISC; nothing changes where no texture has edited colours.
    """
    surface, group = surface_node(material), dichromatic_node(material)
    if surface is None or group is None:
        return
    node = material.node_tree.nodes.get(EDITED)
    if node is None or node.type != "TEX_IMAGE":
        return
    if any(link.to_socket != surface.inputs["Base Color"] for link in node.outputs["Color"].links):
        return  # the user's own nodes: the step that linked them has the image
    _show_group(surface, group)
    node.image = None
    material.pop(_COLOR, None)


def color_state(material: bpy.types.Material) -> str:
    """Return what the edited colours of a material depend on.

    Parameters
    ----------
    material : bpy.types.Material
        A local material of ISC.

    Returns
    -------
    str
        Equal texts mean equal colours; "" without the node of the edits.
    """
    group = dichromatic_node(material)
    return "" if group is None else _color_state(material, group)


def discard_edits(material: bpy.types.Material) -> None:
    """Remove the edited texture and the record of written values, before the nodes are rebuilt.

    Parameters
    ----------
    material : bpy.types.Material
        A local material of ISC.
    """
    for name in (_NUMBERS, _COLOR):
        if name in material:
            del material[name]
    for image in _edited_images(material):  # of a base colour that is replaced
        image.pop(_STATE, None)
    node = material.node_tree.nodes.get(EDITED) if material.node_tree else None
    if node is not None and node.type == "TEX_IMAGE":
        _replace_image(node, None)


def _color_edit(inputs: Any) -> ColorEdit:
    hue, saturation, value, gain, shown = (
        float(inputs[name].default_value)
        for name in ("Hue", "Saturation", "Value", "Diffuse Gain", "Photo Highlights")
    )
    # Until version 3 of the group, the photo's highlights used the base colour under the layer.
    share = inputs[_FORMER_FACTOR].default_value if _FORMER_FACTOR in inputs else 0.0
    return ColorEdit(hue, saturation, value * gain * (1 - shown * share))


def _color_state(material: bpy.types.Material, group: bpy.types.Node) -> str:
    """What the edited colour depends on."""
    source = group.inputs["Base Color"]
    if not source.is_linked:
        base = " ".join(f"{value:.6f}" for value in source.default_value)
    else:
        image = getattr(source.links[0].from_node, "image", None)
        base = content_mark(image) if image is not None else "nodes"
    gloss = edited_gloss(material, group)
    parts = (_color_edit(group.inputs).values, () if gloss is None else gloss)
    colors, above = (" ".join(f"{value:.6f}" for value in part) for part in parts)
    return f"{colors} {base}" + (_GLOSS_MARK + above if above else "")


def _without_gloss(state: str) -> str:
    return state.partition(_GLOSS_MARK)[0]


def _write_numbers(material: bpy.types.Material, surface: Any, inputs: Any) -> None:
    """Write what has changed since the last time: the BSDF's own fields can be edited, too."""
    level, roughness = current_gloss(inputs)
    wanted = [refraction(level), roughness]
    written = material.get(_NUMBERS)
    if written is None or abs(written[0] - wanted[0]) > UNCHANGED:
        surface.inputs["IOR"].default_value = wanted[0]
    if written is None or abs(written[1] - wanted[1]) > UNCHANGED:
        surface.inputs["Roughness"].default_value = wanted[1]
    if written is None or np.abs(np.subtract(list(written), wanted)).max() > 0:
        material[_NUMBERS] = wanted


def _sync_highlight_gain(group: bpy.types.Node) -> None:
    """Give the layer of the photo's highlights, if it is shown, the same gain."""
    layer, gain = group.id_data.nodes.get(HIGHLIGHTS), group.inputs["Specular Gain"].default_value
    socket = None if layer is None else layer.inputs.get("Specular Gain")
    if socket is not None and socket.default_value != gain:
        socket.default_value = gain


def _is_isc_color(target: Any, group: bpy.types.Node) -> bool:
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
    if node.type != "TEX_IMAGE" or node.image is None:
        return False
    # Asking for the size of an image whose pixels Blender has not read yet would read them.
    return node.image.packed_file is not None or bool(node.image.size[0])


def _edited_images(material: bpy.types.Material) -> Iterator[bpy.types.Image]:
    return all_tagged(bpy.data.images, _key(material), ImageRole.EDITED_BASE_COLOR)


def _key(material: bpy.types.Material) -> str:
    return str(material.get(KEY, material.name))


def _find_edited(material: bpy.types.Material, state: str) -> bpy.types.Image | None:
    """An existing image of these edits, for example after an undo."""
    found = (image for image in _edited_images(material) if image.get(_STATE) == state)
    return next(found, None)


def _show_group(surface: bpy.types.Node, group: bpy.types.Node) -> None:
    target = surface.inputs["Base Color"]
    if not target.is_linked or target.links[0].from_node != group:
        group.id_data.links.new(group.outputs["Base Color"], target)


def _show_edited(
    material: bpy.types.Material,
    surface: bpy.types.Node,
    group: bpy.types.Node,
    image: bpy.types.Image,
) -> None:
    node = _edited_texture(material, group.inputs["Base Color"].links[0].from_node)
    _replace_image(node, image)
    material.node_tree.links.new(node.outputs["Color"], surface.inputs["Base Color"])
    material[_COLOR] = image[_STATE]


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


def _replace_image(node: Any, image: bpy.types.Image | None) -> None:
    """A new datablock each time: undo restores the pixels of one only with its datablock.

    An image that the user has painted on stays in the file.
    """
    old, node.image = node.image, image
    if old is None or old == image or old.get(ROLE) != ImageRole.EDITED_BASE_COLOR or old.users:
        return
    if unmodified_file(old):
        bpy.data.images.remove(old)
        return
    old.pop(_STATE, None)
    keep_painted(old)
