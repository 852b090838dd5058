"""The node group "ISC Dichromatic": a surface that is the sum of paint and gloss, as the photo was
taken apart.

Equation: radiance = g_d * rho' / pi * E + g_s * (what the gloss mirrors); rho' is the reflectance,
recoloured in hue, saturation and value; E the irradiance. The gloss is a GGX lobe of the given
roughness, with Fresnel's equations at the facets. Its level scales all of it, as the fit and glTF's
KHR_materials_specular mean it: what is mirrored along the normal is f0 = 0.04 * level, toward
grazing light it is f90 = min(level, 1). Blender's own level moves f0 alone, so that the lobe of
plastic is mixed with black by min(level, 1), and only what exceeds 1 goes to Blender's level. A
coloured specular image is split into its luminance, a factor of the level, and its tint, of f0.

Paint and gloss are ADDED: a Diffuse BSDF beside a Principled one that has a black base, since
Principled alone takes from the paint what its gloss mirrors, and the recovered diffuse image would
come out darker than it is in the photo.

"ISC Photo Highlights" shows the photo's own specular image to the camera instead: exact from where
the photo was taken, and no light.

A group carries its version. A file made by another version keeps its own group, this one is added
beside it; materials share it. Version 1 scaled f0 alone: such an object keeps its look until it is
built again.

Citation: S. A. Shafer, "Using color to separate reflection components", Color Research and
Application 10 (1985), doi:10.1002/col.5080100409. B. Walter et al., EGSR 2007,
doi:10.2312/EGWR/EGSR07/195-206. KHR_materials_specular, Khronos Group 2021 (no DOI).

Limits: f0 cannot exceed 0.99: level * gain above 24 changes nothing. f90 cannot exceed 1: above a
level of 1 the gloss grows less toward grazing light than along the normal.
"""

from dataclasses import dataclass
from typing import Any

import bpy

from .nodes import add_node, connect

VERSION = 2
DICHROMATIC, HIGHLIGHTS = "ISC Dichromatic", "ISC Photo Highlights"


@dataclass(frozen=True)
class Socket:
    """An input of a group: its name, kind ("Color", "Float" or "Vector"), usual value, range and
    tooltip.
    """

    name: str
    kind: str
    default: Any
    low: float
    high: float
    about: str
    factor: bool = False


WHITE, BLACK = (1.0, 1.0, 1.0, 1.0), (0.0, 0.0, 0.0, 1.0)
_SPECULAR_GAIN = Socket(
    "Specular Gain", "Float", 1.0, 0, 10, "Factor of the gloss: 0 is matt, 1 as in the photo"
)
DICHROMATIC_SOCKETS = (
    Socket(
        "Reflectance",
        "Color",
        (0.8, 0.8, 0.8, 1.0),
        0,
        1,
        "Colour of the paint without light or gloss (linear)",
    ),
    Socket(
        "Diffuse Gain",
        "Float",
        1.0,
        0,
        10,
        "Factor of the light that the paint scatters: 0 is black, 1 as in the photo",
    ),
    Socket(
        "Hue",
        "Float",
        0.5,
        0,
        1,
        "Turns the paint's hue: 0.5 as in the photo, 0 and 1 the opposite",
        True,
    ),
    Socket(
        "Saturation",
        "Float",
        1.0,
        0,
        2,
        "Factor of the paint's saturation: 0 is grey, 1 as in the photo",
    ),
    Socket("Value", "Float", 1.0, 0, 2, "Factor of the paint's brightness: 1 as in the photo"),
    Socket(
        "Specular Image",
        "Color",
        WHITE,
        0,
        1,
        "Where the gloss is stronger or weaker, and its colour: a factor of the level",
    ),
    Socket(
        "Specular Level",
        "Float",
        0.0,
        0,
        24,
        "Strength of the gloss: 0 is matt, 1 is plastic (4 % along the normal)",
    ),
    Socket("Roughness", "Float", 0.5, 0, 1, "Width of the highlights: 0 is a mirror", True),
    _SPECULAR_GAIN,
    Socket(
        "Normal",
        "Vector",
        (0.0, 0.0, 0.0),
        -1,
        1,
        "A normal map's normal; the mesh's own where nothing is connected",
    ),
)
HIGHLIGHTS_SOCKETS = (
    Socket(
        "Specular Image",
        "Color",
        BLACK,
        0,
        1,
        "The photo's highlights, linear; seen by the camera, they light nothing",
    ),
    _SPECULAR_GAIN,
)


def dichromatic_group() -> bpy.types.NodeTree:
    """The group of this version, made where the file has none; one that people edited stays as it
    is while its inputs are there.
    """
    return _found(DICHROMATIC, DICHROMATIC_SOCKETS) or _wire_dichromatic(
        _new(DICHROMATIC, DICHROMATIC_SOCKETS)
    )


def highlights_group() -> bpy.types.NodeTree:
    """The group that shows a specular image, as `dichromatic_group` does the other one."""
    return _found(HIGHLIGHTS, HIGHLIGHTS_SOCKETS) or _wire_highlights(
        _new(HIGHLIGHTS, HIGHLIGHTS_SOCKETS)
    )


def _found(name: str, sockets: tuple[Socket, ...]) -> bpy.types.NodeTree | None:
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
            if held >= {socket.name for socket in sockets}:
                return group
    return None


def _new(name: str, sockets: tuple[Socket, ...]) -> bpy.types.NodeTree:
    group = bpy.data.node_groups.new(name, "ShaderNodeTree")
    group["isc_group"], group["isc_group_version"] = name, VERSION
    for socket in sockets:
        item = group.interface.new_socket(
            socket.name,
            description=socket.about,
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
        item.hide_value = (
            socket.kind == "Vector"
        )  # unconnected, such an input leaves the mesh's normal alone
    group.interface.new_socket(
        "Surface",
        description="Paint and gloss, added",
        in_out="OUTPUT",
        socket_type="NodeSocketShader",
    )
    return group


def _wire_dichromatic(group: bpy.types.NodeTree) -> bpy.types.NodeTree:
    given = add_node(group, "NodeGroupInput", (-900, 0)).outputs
    matt = add_node(group, "BsdfDiffuse", (50, 200), label="Paint")
    both = add_node(group, "AddShader", (600, 100))
    out = add_node(group, "NodeGroupOutput", (800, 100))
    connect(
        group,
        (_bright(group, given), matt.inputs["Color"]),
        (given["Normal"], matt.inputs["Normal"]),
        (matt.outputs["BSDF"], both.inputs[0]),
        (_scaled_gloss(group, given), both.inputs[1]),
        (both.outputs["Shader"], out.inputs["Surface"]),
    )
    return group


def _scaled_gloss(group: bpy.types.NodeTree, given: Any) -> bpy.types.NodeSocket:
    """The lobe of plastic, mixed with black where the level is below 1, and with a larger f0 where
    it is above.
    """
    grey = add_node(group, "RGBToBW", (-650, -350))
    tint = add_node(
        group, "VectorMath", (-200, -450), operation="DIVIDE", label="Tint"
    )  # by zero it is zero, and so is the level
    excess = add_node(group, "Math", (-200, -250), operation="MAXIMUM", label="What exceeds 1")
    gloss = add_node(group, "BsdfPrincipled", (50, 0), distribution="GGX", label="Gloss alone")
    mixed = add_node(
        group, "MixShader", (400, 0), label="Level"
    )  # its first input stays empty: that is black; its factor ends at 1
    gloss.inputs["Base Color"].default_value = BLACK
    excess.inputs[1].default_value = 0.5  # Blender's level of plastic
    level = _product(group, given["Specular Level"], given["Specular Gain"], (-650, -150))
    here = _product(group, level, grey.outputs["Val"], (-420, -150))
    connect(
        group,
        (given["Specular Image"], grey.inputs["Color"]),
        (given["Specular Image"], tint.inputs[0]),
        (grey.outputs["Val"], tint.inputs[1]),
        (_product(group, here, 0.5, (-420, -320)), excess.inputs[0]),
        (excess.outputs["Value"], gloss.inputs["Specular IOR Level"]),
        (tint.outputs["Vector"], gloss.inputs["Specular Tint"]),
        (given["Roughness"], gloss.inputs["Roughness"]),
        (given["Normal"], gloss.inputs["Normal"]),
        (here, mixed.inputs["Fac"]),
        (gloss.outputs["BSDF"], mixed.inputs[2]),
    )
    return mixed.outputs["Shader"]


def _bright(group: bpy.types.NodeTree, given: Any) -> bpy.types.NodeSocket:
    """The recoloured paint times its gain.

    Turning hues and back costs some bits: a paint that nobody recolours goes around that node.
    """
    paint = add_node(group, "HueSaturation", (-450, 450), label="Recolour")
    bright = add_node(group, "VectorMath", (-150, 300), operation="SCALE", label="Diffuse Gain")
    untouched = [
        add_node(group, "Math", (-850, 350 + 170 * k), operation="COMPARE", label="Untouched?")
        for k in (0, 1)
    ]
    for node, usual in zip(untouched, (0.5, 1.0), strict=True):
        node.inputs[1].default_value, node.inputs[2].default_value = usual, 1e-6
    recoloured = add_node(group, "Math", (-550, 650), operation="SUBTRACT", label="Recoloured?")
    recoloured.inputs[0].default_value = 1.0
    connect(
        group,
        (given["Hue"], untouched[0].inputs[0]),
        (given["Saturation"], untouched[1].inputs[0]),
        (
            _product(
                group, untouched[0].outputs["Value"], untouched[1].outputs["Value"], (-650, 500)
            ),
            recoloured.inputs[1],
        ),
        (
            recoloured.outputs["Value"],
            paint.inputs[3],
        ),  # how much of it; its name changed between versions of Blender
        (given["Hue"], paint.inputs["Hue"]),
        (given["Saturation"], paint.inputs["Saturation"]),
        (given["Reflectance"], paint.inputs["Color"]),
        (paint.outputs["Color"], bright.inputs[0]),
        (
            _product(group, given["Diffuse Gain"], given["Value"], (-450, 150)),
            bright.inputs["Scale"],
        ),
    )
    return bright.outputs["Vector"]


def _product(
    group: bpy.types.NodeTree,
    first: bpy.types.NodeSocket,
    second: bpy.types.NodeSocket | float,
    place: tuple[float, float],
) -> bpy.types.NodeSocket:
    node = add_node(group, "Math", place, operation="MULTIPLY")
    group.links.new(first, node.inputs[0])
    if isinstance(second, float):
        node.inputs[1].default_value = second
    else:
        group.links.new(second, node.inputs[1])
    return node.outputs["Value"]


def _wire_highlights(group: bpy.types.NodeTree) -> bpy.types.NodeTree:
    given = add_node(group, "NodeGroupInput", (-500, 0)).outputs
    seen = add_node(group, "LightPath", (-500, 350)).outputs["Is Camera Ray"]
    shine = add_node(group, "Emission", (0, 0), label="Seen by the camera only")
    out = add_node(group, "NodeGroupOutput", (250, 0))
    connect(
        group,
        (_product(group, seen, given["Specular Gain"], (-250, 100)), shine.inputs["Strength"]),
        (given["Specular Image"], shine.inputs["Color"]),
        (shine.outputs["Emission"], out.inputs["Surface"]),
    )
    return group
