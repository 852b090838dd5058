"""The base colour under an edited gloss: what a material stores for it, and what is computed.

Problem: the photo shows the base colour through the specular layer. If the gloss is edited, the
same photo corresponds to another base colour (`isc_core.lobe_fitting.specular_layer`). A material
with a fitted layer therefore stores two base colours, the one under that layer and the one without
a layer, and what others are computed from: normals, light, and the variation of the level.
"""

from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from ..datablocks.images import unmodified_file
from .color_bake import UNCHANGED, GlossEdit
from .edit_nodes import BASE_COLOR

_UNDER_LAYER, _WITHOUT_LAYER = "isc_base_color", "isc_plain_base_color"
_NORMALS, _LIGHT, _VARIATION = "isc_normals", "isc_light", "isc_variation"
FITTED_GLOSS = "isc_fitted_gloss"  # of a material: level and roughness that `_UNDER_LAYER` is for


@dataclass(frozen=True)
class GlossBasis:
    """What the base colour under edited gloss is computed from.

    Attributes
    ----------
    plain : bpy.types.Image
        Base colour without a specular layer above.
    normals : bpy.types.Image
        Coded normals, see `coated_surface`.
    light : list of float
        Numbers of the `RecoveredLight`.
    variation : bpy.types.Image or None
        Spatial factor of the specular level.
    """

    plain: bpy.types.Image
    normals: bpy.types.Image
    light: list[float]
    variation: bpy.types.Image | None = None


def store_base_colors(
    material: bpy.types.Material, under_layer: bpy.types.Image, basis: GlossBasis | None
) -> None:
    """Store the two base colours of a material, and what others are computed from; `apply_edits`
    shows the right one.

    Parameters
    ----------
    material : bpy.types.Material
        A local material of ISC.
    under_layer : bpy.types.Image
        Under its fitted specular layer.
    basis : GlossBasis or None
        None if it has no such layer.
    """
    for name in (_UNDER_LAYER, _WITHOUT_LAYER, _NORMALS, _LIGHT, _VARIATION):
        material.pop(name, None)
    if basis is not None:
        material[_UNDER_LAYER], material[_WITHOUT_LAYER] = under_layer, basis.plain
        material[_NORMALS], material[_LIGHT] = basis.normals, basis.light
        if basis.variation is not None:
            material[_VARIATION] = basis.variation


def plain_base_color(material: bpy.types.Material) -> bpy.types.Image:
    """Return the base colour without a specular layer above.

    Parameters
    ----------
    material : bpy.types.Material
        A material with a `GlossBasis`.

    Returns
    -------
    bpy.types.Image
        The image.
    """
    return material[_WITHOUT_LAYER]


def choose_base_color(material: bpy.types.Material, group: bpy.types.Node) -> None:
    """Show the base colour that belongs to the gloss: without highlights, the one without a layer.

    Parameters
    ----------
    material : bpy.types.Material
        A local material of ISC; images that the user has put in its place stay.
    group : bpy.types.Node
        Its node "ISC Dichromatic".
    """
    under, plain = material.get(_UNDER_LAYER), material.get(_WITHOUT_LAYER)
    node = group.id_data.nodes.get(BASE_COLOR)
    if under is None or plain is None or node is None or node.type != "TEX_IMAGE":
        return
    wanted = under if current_gloss(group.inputs)[0] > 0 else plain
    if node.image in (under, plain) and node.image != wanted:
        node.image = wanted


def edited_gloss(material: bpy.types.Material, group: bpy.types.Node) -> tuple[float, float] | None:
    """Return the edited gloss, where the base colour has to follow the edit.

    Parameters
    ----------
    material : bpy.types.Material
        A local material of ISC.
    group : bpy.types.Node
        Its node "ISC Dichromatic".

    Returns
    -------
    tuple of float or None
        Level and roughness; None if the gloss is the fitted one, or the base colour the user's.
    """
    source, fitted = group.inputs["Base Color"], material.get(FITTED_GLOSS)
    images = [material.get(name) for name in (_UNDER_LAYER, _WITHOUT_LAYER, _NORMALS)]
    if not source.is_linked or fitted is None or None in images:
        return None
    if getattr(source.links[0].from_node, "image", None) != images[0]:
        return None
    edited = current_gloss(group.inputs)
    is_as_fitted = np.abs(np.subtract(list(fitted), edited)).max() <= UNCHANGED
    return None if is_as_fitted else edited


def gloss_edit(material: bpy.types.Material, group: bpy.types.Node) -> GlossEdit | None:
    """Return the edit of the gloss, for another thread.

    Parameters
    ----------
    material : bpy.types.Material
        A local material of ISC.
    group : bpy.types.Node
        Its node "ISC Dichromatic".

    Returns
    -------
    GlossEdit or None
        None as of `edited_gloss`, and where the user has painted on the base colour.
    """
    gloss = edited_gloss(material, group)
    if gloss is None or not unmodified_file(material[_UNDER_LAYER]):
        return None
    normals, variation = unmodified_file(material[_NORMALS]), material.get(_VARIATION)
    varies = b"" if variation is None else unmodified_file(variation)
    return GlossEdit(*gloss, normals, tuple(material[_LIGHT]), varies) if normals else None


def current_gloss(inputs: Any) -> tuple[float, float]:
    """Return the gloss with all edits.

    Parameters
    ----------
    inputs : bpy.types.NodeInputs
        Of the node "ISC Dichromatic".

    Returns
    -------
    tuple of float
        Level, 0 while the photo's highlights are shown, and roughness.
    """
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
    return level * gain * (1 - shown), min(1.0, roughness / max(gloss, 1e-3))
