"""The node group "ISC Dichromatic": a surface that is the sum of a diffuse and a specular lobe, as
the photo was decomposed.

Equation: radiance = g_d * rho' / pi * E + g_s * (specular reflection). rho' is the reflectance with
edited hue, saturation and value; E the irradiance. The specular lobe is GGX with the given
roughness and Fresnel's equations at the facets. Its level scales the whole lobe, as in its fit and
in glTF's KHR_materials_specular: the reflectance along the normal is f0 = 0.04 * level, toward
grazing angles f90 = min(level, 1). Blender's own level scales f0 alone, so the lobe of plastic is
mixed with black by min(level, 1), and only the excess above 1 goes to Blender's level. A coloured
specular image is split into its luminance, a factor of the level, and its tint, a factor of f0.

The two lobes are ADDED: a Diffuse BSDF and a Principled BSDF with a black base. Principled alone
attenuates the diffuse lobe by what the specular lobe reflects, and the recovered diffuse image
would become darker than in the photo.

"ISC Photo Highlights" shows the photo's own specular image to the camera instead: exact from the
photo's viewpoint, and without emitting light.

A group stores its version. A file from another version keeps its group, and this one is added
beside it; materials share it. Version 1 scaled f0 alone: such an object keeps its look until it is
built again.

Citation: S. A. Shafer, "Using color to separate reflection components", Color Research and
Application 10 (1985), doi:10.1002/col.5080100409. B. Walter et al., EGSR 2007,
doi:10.2312/EGWR/EGSR07/195-206. KHR_materials_specular, Khronos Group 2021 (no DOI).

Limits: f0 cannot exceed 0.99: level * gain above 24 changes nothing. f90 cannot exceed 1: above a
level of 1 the lobe grows less toward grazing angles than along the normal.
"""

from dataclasses import dataclass
from typing import Any

import bpy

from .nodes import add_node, connect

VERSION = 2
DICHROMATIC, HIGHLIGHTS = "ISC Dichromatic", "ISC Photo Highlights"


@dataclass(frozen=True)
class GroupInput:
    """An input of a node group.

    Attributes
    ----------
    name : str
        Name of the socket.
    kind : str
        "Color", "Float" or "Vector".
    default : Any
        Default value.
    low, high : float
        Range of a float.
    description : str
        Tooltip.
    factor : bool
        Whether a float is shown as a factor.
    """

    name: str
    kind: str
    default: Any
    low: float
    high: float
    description: str
    factor: bool = False


WHITE, BLACK = (1.0, 1.0, 1.0, 1.0), (0.0, 0.0, 0.0, 1.0)
_SPECULAR_GAIN = GroupInput(
    "Specular Gain",
    "Float",
    1.0,
    0,
    10,
    "Factor of the highlights, 0 is diffuse, 1 as in the photo",
)
DICHROMATIC_INPUTS = (
    GroupInput(
        "Reflectance",
        "Color",
        (0.8, 0.8, 0.8, 1.0),
        0,
        1,
        "Linear color of the surface without light and highlights",
    ),
    GroupInput(
        "Diffuse Gain",
        "Float",
        1.0,
        0,
        10,
        "Factor of the diffuse light, 0 is black, 1 as in the photo",
    ),
    GroupInput(
        "Hue",
        "Float",
        0.5,
        0,
        1,
        "Rotation of the hue, 0.5 as in the photo, 0 and 1 the opposite",
        factor=True,
    ),
    GroupInput(
        "Saturation",
        "Float",
        1.0,
        0,
        2,
        "Factor of the saturation, 0 is gray, 1 as in the photo",
    ),
    GroupInput("Value", "Float", 1.0, 0, 2, "Factor of the brightness, 1 as in the photo"),
    GroupInput(
        "Specular Image",
        "Color",
        WHITE,
        0,
        1,
        "Spatial factor of the specular level, and its tint",
    ),
    GroupInput(
        "Specular Level",
        "Float",
        0.0,
        0,
        24,
        "Strength of the specular lobe, 0 is diffuse, 1 is plastic (4 % along the normal)",
    ),
    GroupInput("Roughness", "Float", 0.5, 0, 1, "Width of the highlights, 0 is a mirror", True),
    _SPECULAR_GAIN,
    GroupInput(
        "Normal",
        "Vector",
        (0.0, 0.0, 0.0),
        -1,
        1,
        "Normal of a normal map, the mesh's normal if not connected",
    ),
)
HIGHLIGHTS_INPUTS = (
    GroupInput(
        "Specular Image",
        "Color",
        BLACK,
        0,
        1,
        "Linear highlights of the photo, visible to the camera and without emitting light",
    ),
    _SPECULAR_GAIN,
)


def dichromatic_group() -> bpy.types.NodeTree:
    """Find or create the group "ISC Dichromatic" of this version.

    Returns
    -------
    bpy.types.NodeTree
        The group; one that the user has edited is kept while its inputs exist.
    """
    return _find_group(DICHROMATIC, DICHROMATIC_INPUTS) or _wire_dichromatic(
        _create_group(DICHROMATIC, DICHROMATIC_INPUTS)
    )


def highlights_group() -> bpy.types.NodeTree:
    """Find or create the group "ISC Photo Highlights" of this version.

    Returns
    -------
    bpy.types.NodeTree
        The group; one that the user has edited is kept while its inputs exist.
    """
    return _find_group(HIGHLIGHTS, HIGHLIGHTS_INPUTS) or _wire_highlights(
        _create_group(HIGHLIGHTS, HIGHLIGHTS_INPUTS)
    )


def _find_group(name: str, inputs: tuple[GroupInput, ...]) -> bpy.types.NodeTree | None:
    for group in bpy.data.node_groups:
        if (
            group.library is None
            and group.get("isc_group") == name
            and group.get("isc_group_version") == VERSION
        ):
            held = {
                item.name
                for item in group.interface.items_tree
                if item.item_type == "SOCKET" and item.in_out == "INPUT"
            }
            if held >= {socket.name for socket in inputs}:
                return group
    return None


def _create_group(name: str, inputs: tuple[GroupInput, ...]) -> bpy.types.NodeTree:
    group = bpy.data.node_groups.new(name, "ShaderNodeTree")
    group["isc_group"], group["isc_group_version"] = name, VERSION
    for socket in inputs:
        item = group.interface.new_socket(
            socket.name,
            description=socket.description,
            in_out="INPUT",
            socket_type=f"NodeSocket{socket.kind}",
        )
        item.default_value = socket.default
        if socket.kind == "Float":
            item.subtype, item.min_value, item.max_value = (
                "FACTOR" if socket.factor else "NONE",
                socket.low,
                socket.high,
            )
        # Unconnected, a vector input uses the mesh's normal.
        item.hide_value = socket.kind == "Vector"
    group.interface.new_socket(
        "Surface",
        description="Sum of the diffuse and the specular lobe",
        in_out="OUTPUT",
        socket_type="NodeSocketShader",
    )
    return group


def _wire_dichromatic(group: bpy.types.NodeTree) -> bpy.types.NodeTree:
    inputs = add_node(group, "NodeGroupInput", (-900, 0)).outputs
    diffuse = add_node(group, "BsdfDiffuse", (50, 200), label="Diffuse")
    total = add_node(group, "AddShader", (600, 100))
    output = add_node(group, "NodeGroupOutput", (800, 100))
    connect(
        group,
        (_edited_reflectance(group, inputs), diffuse.inputs["Color"]),
        (inputs["Normal"], diffuse.inputs["Normal"]),
        (diffuse.outputs["BSDF"], total.inputs[0]),
        (_scaled_lobe(group, inputs), total.inputs[1]),
        (total.outputs["Shader"], output.inputs["Surface"]),
    )
    return group


def _scaled_lobe(group: bpy.types.NodeTree, inputs: Any) -> bpy.types.NodeSocket:
    """The lobe of plastic, mixed with black for a level below 1, with a larger f0 above 1."""
    grey = add_node(group, "RGBToBW", (-650, -350))
    # A division by zero gives zero; the level is zero there, too.
    tint = add_node(group, "VectorMath", (-200, -450), operation="DIVIDE", label="Tint")
    excess = add_node(group, "Math", (-200, -250), operation="MAXIMUM", label="Excess above 1")
    lobe = add_node(group, "BsdfPrincipled", (50, 0), distribution="GGX", label="Specular")
    # The unconnected first input is black; the factor is clamped at 1.
    mixed = add_node(group, "MixShader", (400, 0), label="Level")
    lobe.inputs["Base Color"].default_value = BLACK
    excess.inputs[1].default_value = 0.5  # Blender's level of plastic
    level = _product(group, inputs["Specular Level"], inputs["Specular Gain"], (-650, -150))
    local = _product(group, level, grey.outputs["Val"], (-420, -150))
    connect(
        group,
        (inputs["Specular Image"], grey.inputs["Color"]),
        (inputs["Specular Image"], tint.inputs[0]),
        (grey.outputs["Val"], tint.inputs[1]),
        (_product(group, local, 0.5, (-420, -320)), excess.inputs[0]),
        (excess.outputs["Value"], lobe.inputs["Specular IOR Level"]),
        (tint.outputs["Vector"], lobe.inputs["Specular Tint"]),
        (inputs["Roughness"], lobe.inputs["Roughness"]),
        (inputs["Normal"], lobe.inputs["Normal"]),
        (local, mixed.inputs["Fac"]),
        (lobe.outputs["BSDF"], mixed.inputs[2]),
    )
    return mixed.outputs["Shader"]


def _edited_reflectance(group: bpy.types.NodeTree, inputs: Any) -> bpy.types.NodeSocket:
    """The edited reflectance times its gain.

    The conversion to hue and back loses some bits, so an unedited reflectance bypasses that node.
    """
    recolour = add_node(group, "HueSaturation", (-450, 450), label="Recolor")
    scaled = add_node(group, "VectorMath", (-150, 300), operation="SCALE", label="Diffuse Gain")
    unchanged = [
        add_node(group, "Math", (-850, 350 + 170 * k), operation="COMPARE", label="Unchanged?")
        for k in (0, 1)
    ]
    for node, default in zip(unchanged, (0.5, 1.0), strict=True):
        node.inputs[1].default_value, node.inputs[2].default_value = default, 1e-6
    changed = add_node(group, "Math", (-550, 650), operation="SUBTRACT", label="Changed?")
    changed.inputs[0].default_value = 1.0
    connect(
        group,
        (inputs["Hue"], unchanged[0].inputs[0]),
        (inputs["Saturation"], unchanged[1].inputs[0]),
        (
            _product(
                group, unchanged[0].outputs["Value"], unchanged[1].outputs["Value"], (-650, 500)
            ),
            changed.inputs[1],
        ),
        # The factor; its name differs between versions of Blender.
        (changed.outputs["Value"], recolour.inputs[3]),
        (inputs["Hue"], recolour.inputs["Hue"]),
        (inputs["Saturation"], recolour.inputs["Saturation"]),
        (inputs["Reflectance"], recolour.inputs["Color"]),
        (recolour.outputs["Color"], scaled.inputs[0]),
        (
            _product(group, inputs["Diffuse Gain"], inputs["Value"], (-450, 150)),
            scaled.inputs["Scale"],
        ),
    )
    return scaled.outputs["Vector"]


def _product(
    group: bpy.types.NodeTree,
    first: bpy.types.NodeSocket,
    second: bpy.types.NodeSocket | float,
    location: tuple[float, float],
) -> bpy.types.NodeSocket:
    node = add_node(group, "Math", location, operation="MULTIPLY")
    group.links.new(first, node.inputs[0])
    if isinstance(second, float):
        node.inputs[1].default_value = second
    else:
        group.links.new(second, node.inputs[1])
    return node.outputs["Value"]


def _wire_highlights(group: bpy.types.NodeTree) -> bpy.types.NodeTree:
    inputs = add_node(group, "NodeGroupInput", (-500, 0)).outputs
    to_camera = add_node(group, "LightPath", (-500, 350)).outputs["Is Camera Ray"]
    emission = add_node(group, "Emission", (0, 0), label="Visible to Camera Only")
    output = add_node(group, "NodeGroupOutput", (250, 0))
    connect(
        group,
        (
            _product(group, to_camera, inputs["Specular Gain"], (-250, 100)),
            emission.inputs["Strength"],
        ),
        (inputs["Specular Image"], emission.inputs["Color"]),
        (emission.outputs["Emission"], output.inputs["Surface"]),
    )
    return group
