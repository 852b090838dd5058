"""The nodes that hold and show the edits of a material, and its specular level.

Equation: a specular level L (1 is plastic) has the reflectance f0 = min(.04 L, .96) along the
normal, and the index of refraction (1 + sqrt f0) / (1 - sqrt f0).
"""

from typing import Any

import bpy

from isc_core.lobe_fitting.specular_layer import MOST
from isc_core.shading.brdf.ggx import F0

from .dichromatic import DICHROMATIC

SURFACE, BASE_COLOR, EDITED, LEVEL_FACTOR = (
    "Principled BSDF",
    "Base Color",
    "Edited Base Color",
    "Specular Level",
)
PLASTIC = 0.5  # Blender's own level of the BSDF for plastic
# With exactly .5, its glTF exporter leaves out the index of refraction.
OWN_LEVEL = 0.499


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
    return float(((index - 1) / (index + 1)) ** 2 / F0 * factor / PLASTIC)
