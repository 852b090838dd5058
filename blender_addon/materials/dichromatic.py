"""The node group "ISC Dichromatic": the edits of an object's diffuse and specular light, before its
Principled BSDF.

Equation: base colour = g_d v rotated(rho; hue, saturation), g_d the diffuse gain, v the value and
rho the texture (`specular_layer`). For a specular level L (1 is plastic) and its gain g_s, the
reflectance along the normal is f0 = min(.04 (1 - p) g_s L, .96), p 1 while the photo's own
highlights are shown, and the index of refraction is (1 + sqrt f0) / (1 - sqrt f0): unlike Blender's
own level, USD has it, too. Roughness = min(1, r / g) for the gain g of the gloss.

The group holds the values; its outputs are linked only while a slider moves. Otherwise the BSDF has
images and numbers, which every exporter reads: see `material_edits`.

"ISC Photo Highlights" shows the photo's own specular image to the camera instead: exact from the
photo's viewpoint, and without emitting light.

A group stores its version. A file from another version keeps its group, and this one is added
beside it; materials share it. Until version 2 the group was the whole surface, a Diffuse BSDF plus
a specular lobe: such an object keeps its look until it is built again.

Citation: S. A. Shafer, "Using color to separate reflection components", Color Research and
Application 10 (1985), doi:10.1002/col.5080100409.
"""

from dataclasses import dataclass
from typing import Any

import bpy

from isc_core.lobe_fitting.specular_layer import MOST
from isc_core.shading.brdf.ggx import F0

from ..datablocks.nodes import add_node, connect

VERSION = 4
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


_SPECULAR_GAIN = GroupInput(
    "Specular Gain",
    "Float",
    1.0,
    0,
    10,
    "Factor of the highlights; 0 is diffuse, 1 is as in the photo",
)
DICHROMATIC_INPUTS = (
    GroupInput(
        "Base Color",
        "Color",
        (0.8, 0.8, 0.8, 1.0),
        0,
        1,
        "Color of the surface without light and highlights",
    ),
    GroupInput(
        "Diffuse Gain",
        "Float",
        1.0,
        0,
        10,
        "Factor of the diffuse reflection; 0 is black, 1 is as in the photo",
    ),
    GroupInput(
        "Hue",
        "Float",
        0.5,
        0,
        1,
        "Rotation of the hue; 0.5 is as in the photo, 0 and 1 the opposite hue",
        factor=True,
    ),
    GroupInput(
        "Saturation",
        "Float",
        1.0,
        0,
        2,
        "Factor of the saturation; 0 is gray, 1 is as in the photo",
    ),
    GroupInput("Value", "Float", 1.0, 0, 2, "Factor of the brightness; 1 is as in the photo"),
    GroupInput(
        "Specular Level",
        "Float",
        0.0,
        0,
        24,
        "Strength of the highlights; 0 is diffuse, 1 is plastic (4 % along the normal)",
    ),
    _SPECULAR_GAIN,
    GroupInput("Roughness", "Float", 0.5, 0, 1, "Width of the highlights; 0 is a mirror", True),
    GroupInput(
        "Gloss Gain",
        "Float",
        1.0,
        0.1,
        10,
        "Divisor of the roughness; above 1, highlights are sharper than in the photo",
    ),
    GroupInput(
        "Photo Highlights",
        "Float",
        0.0,
        0,
        1,
        "1 while the photo's highlights replace those of the material",
        factor=True,
    ),
)
HIGHLIGHTS_INPUTS = (
    GroupInput(
        "Specular Image",
        "Color",
        (0.0, 0.0, 0.0, 1.0),
        0,
        1,
        "Linear highlights of the photo, visible to the camera and without emitting light",
    ),
    _SPECULAR_GAIN,
)

_DICHROMATIC_OUTPUTS = (
    ("Base Color", "Color", "Edited color of the surface"),
    ("IOR", "Float", "Index of refraction of the edited specular level"),
    ("Roughness", "Float", "Edited roughness"),
)
_HIGHLIGHTS_OUTPUTS = (("Surface", "Shader", "The photo's highlights"),)


def dichromatic_group() -> bpy.types.NodeTree:
    """Find or create the group "ISC Dichromatic" of this version.

    Returns
    -------
    bpy.types.NodeTree
        The group; one that the user has edited is kept while its inputs exist.
    """
    return _find_group(DICHROMATIC, DICHROMATIC_INPUTS, _DICHROMATIC_OUTPUTS) or _wire_dichromatic(
        _create_group(DICHROMATIC, DICHROMATIC_INPUTS, _DICHROMATIC_OUTPUTS)
    )


def highlights_group() -> bpy.types.NodeTree:
    """Find or create the group "ISC Photo Highlights" of this version.

    Returns
    -------
    bpy.types.NodeTree
        The group; one that the user has edited is kept while its inputs exist.
    """
    return _find_group(HIGHLIGHTS, HIGHLIGHTS_INPUTS, _HIGHLIGHTS_OUTPUTS) or _wire_highlights(
        _create_group(HIGHLIGHTS, HIGHLIGHTS_INPUTS, _HIGHLIGHTS_OUTPUTS)
    )


def _find_group(
    name: str, inputs: tuple[GroupInput, ...], outputs: tuple[tuple[str, str, str], ...]
) -> bpy.types.NodeTree | None:
    for group in bpy.data.node_groups:
        if (
            group.library is None
            and group.get("isc_group") == name
            and group.get("isc_group_version") == VERSION
        ):
            held = {
                (item.in_out, item.name)
                for item in group.interface.items_tree
                if item.item_type == "SOCKET"
            }
            needed = {("INPUT", socket.name) for socket in inputs}
            if held >= needed | {("OUTPUT", output) for output, *_ in outputs}:
                return group
    return None


def _create_group(
    name: str, inputs: tuple[GroupInput, ...], outputs: tuple[tuple[str, str, str], ...]
) -> bpy.types.NodeTree:
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
    for output, kind, description in outputs:
        group.interface.new_socket(
            output, description=description, in_out="OUTPUT", socket_type=f"NodeSocket{kind}"
        )
    return group


def _wire_dichromatic(group: bpy.types.NodeTree) -> bpy.types.NodeTree:
    inputs = add_node(group, "NodeGroupInput", (-1100, 0)).outputs
    output = add_node(group, "NodeGroupOutput", (380, 100))
    shown = add_node(group, "Math", (-800, -350), operation="SUBTRACT", label="Own Highlights")
    shown.inputs[0].default_value = 1.0
    level = _product(group, inputs["Specular Level"], inputs["Specular Gain"], (-800, -150))
    level = _product(group, level, shown.outputs["Value"], (-600, -150))
    f0 = _math(group, "MINIMUM", _product(group, level, F0, (-400, -150)), MOST, (-250, -150))
    amplitude = _math(group, "SQRT", f0, 0.0, (-100, -150))
    above = _math(group, "ADD", amplitude, 1.0, (50, -100))
    below = add_node(group, "Math", (50, -250), operation="SUBTRACT")
    below.inputs[0].default_value = 1.0
    index = add_node(group, "Math", (180, -150), operation="DIVIDE", label="Index of Refraction")
    rougher = add_node(group, "Math", (-600, -350), operation="DIVIDE", label="Gloss Gain")
    roughness = add_node(group, "Math", (-400, -350), operation="MINIMUM", label="At Most 1")
    roughness.inputs[1].default_value = 1.0
    connect(
        group,
        (inputs["Photo Highlights"], shown.inputs[1]),
        (amplitude, below.inputs[1]),
        (above, index.inputs[0]),
        (below.outputs["Value"], index.inputs[1]),
        (index.outputs["Value"], output.inputs["IOR"]),
        (inputs["Roughness"], rougher.inputs[0]),
        (inputs["Gloss Gain"], rougher.inputs[1]),
        (rougher.outputs["Value"], roughness.inputs[0]),
        (roughness.outputs["Value"], output.inputs["Roughness"]),
        (_edited_color(group, inputs), output.inputs["Base Color"]),
    )
    return group


def _edited_color(group: bpy.types.NodeTree, inputs: Any) -> bpy.types.NodeSocket:
    """The edited base colour times its gain.

    The conversion to hue and back loses some bits, so an unedited colour bypasses that node.
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
        (inputs["Base Color"], recolour.inputs["Color"]),
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
    return _math(group, "MULTIPLY", first, second, location)


def _math(
    group: bpy.types.NodeTree,
    operation: str,
    first: bpy.types.NodeSocket,
    second: bpy.types.NodeSocket | float,
    location: tuple[float, float],
) -> bpy.types.NodeSocket:
    node = add_node(group, "Math", location, operation=operation)
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
