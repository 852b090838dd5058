"""The properties of a scene, and the state of the current run that the panels show.

The settings (`scene.isc`) are saved with the file and take part in undo. The state of a run
(`window_manager.isc`) does neither: undoing a brush stroke during a run must not reset its
progress.

Blender saves the choice of an enumeration as a number. Every item therefore has an explicit number,
which must not change: files of earlier versions keep their choices when identifiers are renamed.
"""
# mypy: allow-subclassing-any, disable-error-code="valid-type"

from typing import Any

import bpy
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    IntVectorProperty,
    PointerProperty,
    StringProperty,
)

from ..worker.commands import CERTAIN
from .presets import CUSTOM, PRESETS, matching_preset

EnumItem = tuple[str, str, str, int]


def _numbered(*items: tuple[str, str, str]) -> tuple[EnumItem, ...]:
    """Items of (identifier, label, tooltip) with the numbers that files store."""
    return tuple((*item, number) for number, item in enumerate(items))


MODELS = _numbered(
    (
        "joint",
        "Joint",
        "Separate highlights by color and shape, recover shape, light and reflectance, "
        "and continue the reflectance under the highlights",
    ),
    (
        "mdr",
        "MDR",
        "Remove highlights by color, then recover shape, light and reflectance from the "
        "diffuse image",
    ),
    (
        "mbp",
        "MBP",
        "Recover shape, light and reflectance from the photo, then remove highlights from the "
        "reflectance",
    ),
    ("sirfs", "SIRFS", "Recover shape, light and reflectance of a photo without highlights"),
    ("naive", "Naive", "Baseline: flat shape under uniform light"),
    ("retinex", "Retinex", "Baseline: smooth changes are shading, sharp changes are reflectance"),
    ("sfs-tsai-shah", "Tsai-Shah", "Baseline: linear shape from shading"),
    ("sfs-ikeuchi-horn", "Ikeuchi-Horn", "Baseline: regularized shape from shading"),
)
HIGHLIGHT_ODDS = _numbered(
    (
        CERTAIN,
        "Certain",
        "Remove certain highlights only; print stays, and some highlights with it",
    ),
    ("1", "Likely", "Remove what is more likely a highlight than print, including some print"),
    ("0", "All", "Remove everything that looks like a highlight, including print"),
)
SEPARATORS = _numbered(
    ("isc", "ISC", "Remove only what color proves to be a highlight"),
    (
        "network",
        "Network",
        "Network trained on rendered glossy objects; also separates highlights from white "
        "reflectance, where color alone cannot",
    ),
    (
        "sparse_coding",
        "Sparse Coding",
        "Remove the part of the photo that a dictionary of diffuse patches cannot represent",
    ),
    (
        "chaotic_segmentation",
        "Chaotic Segmentation",
        "Remove what exceeds thresholds found by chaotic search, and inpaint it",
    ),
    ("shen_2013", "Shen 2013", "Real-time: chromaticity ranges by pixel clustering"),
    ("shen_2009", "Shen 2009", "Modified specular-free image"),
    ("akashi_2016", "Akashi 2016", "Sparse non-negative matrix factorization"),
    ("kim_2013", "Kim 2013", "Dark channel prior and optimization"),
    ("yang_2010", "Yang 2010", "Bilateral filter of the maximum chromaticity"),
    ("tan_2005", "Tan 2005", "Iterative comparison of neighboring chromaticities"),
    (
        "mallick_2006",
        "Mallick 2006",
        "Partial differential equation in a color space aligned with the light",
    ),
    ("yoon_2006", "Yoon 2006", "Ratios of neighboring pixels in specular-free images"),
    ("none", "None", "Keep the highlights"),
)
ILLUMINATIONS = _numbered(
    ("photo", "Photo", "Any light, in a photo with balanced colors"),
    ("natural", "Natural", "Smooth light of any color from all directions"),
    ("laboratory", "Laboratory", "One strong light source in a dark room"),
)
LIGHT_COLORS = _numbered(
    ("balanced", "Balanced", "Nearly white, as the camera's white balance leaves it"),
    (
        "estimate",
        "Estimate",
        "Estimate the color from the highlights, for warm or cold light; nearly white where they "
        "do not determine it",
    ),
    ("free", "Any", "Highlights are white, but diffuse light may have any color"),
    (
        "toned",
        "Toned",
        "A gray photo with a tone, such as sepia, which becomes part of the base color",
    ),
    ("custom", "Custom", "Use the given color"),
)
CAMERAS = _numbered(
    (
        "auto",
        "Automatic",
        "Use the focal length in the photo's metadata, or an orthographic camera without one",
    ),
    ("orthographic", "Orthographic", "Assume parallel rays"),
    ("focal_length", "Perspective", "Use the given focal length"),
)
MASK_SOURCES = _numbered(
    (
        "ALPHA",
        "Automatic",
        "Use the photo's transparency or black background; without either, find the object",
    ),
    (
        "IMAGE",
        "Image",
        "Use another image, in which the object is white on black or opaque on transparent",
    ),
)
SPECULAR_SOURCES = _numbered(
    (
        "lobe",
        "Material",
        "Use the recovered roughness and specular level; highlights move with light and view",
    ),
    ("image", "Photo", "Use the photo's highlights, fixed to the surface"),
    ("none", "None", "Create an object without highlights"),
)
BACKS = _numbered(
    ("open", "Open", "Build no back"),
    ("flat", "Flat", "Build a plane, and a wall along the outline, for reliefs"),
    ("rounded", "Rounded", "Build a back that is as round as the outline"),
    ("mirrored", "Mirrored", "Mirror the visible side"),
)
OWN_SHADOWS_ITEMS = _numbered(
    (
        "auto",
        "Auto",
        "On in a scene with other objects, off in a new scene; an updated object keeps its setting",
    ),
    (
        "on",
        "On",
        "Cast shadows, also on the object itself, in addition to those in the recovered light",
    ),
    ("off", "Off", "Cast no shadows; the object looks as in the photo"),
)
TEXTURE_SIZES = _numbered(
    ("photo", "Photo", "Use the resolution of the photo"),
    ("4096", "4K", "At most 4096 pixels"),
    ("2048", "2K", "At most 2048 pixels"),
    ("1024", "1K", "At most 1024 pixels"),
    ("maps", "Maps", "Use the resolution of the maps, which Size sets"),
)
_PRESET_NAMES = (*PRESETS, CUSTOM)
_PRESET_ITEMS = _numbered(
    *((name, preset.label, preset.description) for name, preset in PRESETS.items()),
    (CUSTOM, "Custom", "Use the values in the Method panel"),
)


def _get_preset(settings: Any) -> int:
    return _PRESET_NAMES.index(matching_preset(settings.max_size, settings.model, settings.samples))


def _set_preset(settings: Any, value: int) -> None:
    preset = PRESETS.get(_PRESET_NAMES[value])
    if preset is not None:
        settings.max_size, settings.model = preset.max_size, preset.model
        settings.samples = preset.samples


def _is_still_image(_settings: Any, image: Any) -> bool:
    return image.source in {"FILE", "GENERATED"} or image.type == "COMPOSITING"


def _forget_points(settings: Any, context: Any) -> None:
    """Points belong to one photo."""
    del context
    for name in ("points", "other_points", "highlights", "not_highlights"):
        if getattr(settings, name):
            setattr(settings, name, "")


class ISC_PG_settings(bpy.types.PropertyGroup):
    """The settings of one scene."""

    image: PointerProperty(
        name="Photo",
        description="Photo of an object: an image file, or any image in this .blend file",
        type=bpy.types.Image,
        poll=_is_still_image,
        update=_forget_points,
    )
    mask_source: EnumProperty(
        name="Mask",
        description="How the object is separated from the background",
        items=MASK_SOURCES,
        default="ALPHA",
    )
    mask: PointerProperty(
        name="Mask Image",
        description="Image of the same size as the photo, with the object white on black",
        type=bpy.types.Image,
        poll=_is_still_image,
    )
    scale_mask: BoolProperty(
        name="Scale Mask",
        description="Scale the mask to the size of the photo if the sizes differ",
        default=False,
    )
    each: BoolProperty(
        name="Each Object",
        description="Create a Blender object for each separate object in the photo",
        default=False,
    )
    box: IntVectorProperty(
        name="Box",
        description=(
            "Left, top, width and height of a box around the object with some background, in "
            "pixels from the photo's upper left corner"
        ),
        size=4,
        min=0,
        default=(0, 0, 0, 0),
    )
    points: StringProperty(
        name="Points",
        description=(
            "Pixels of the object as column,row from the photo's upper left corner, separated by "
            "spaces"
        ),
    )
    other_points: StringProperty(
        name="Background",
        description="Pixels that do not belong to the object, in the same format as Points",
    )
    highlights: StringProperty(
        name="Highlights",
        description=(
            "Pixels of highlights to remove, as column,row from the photo's upper left corner, "
            "separated by spaces"
        ),
    )
    not_highlights: StringProperty(
        name="Print",
        description=(
            "Pixels of print or paint that look like highlights, in the same format as Highlights"
        ),
    )

    preset: EnumProperty(
        name="Preset",
        description=(
            "Detail of relief and highlights, and the time it takes; the overall shape is the same "
            "in all presets"
        ),
        items=_PRESET_ITEMS,
        get=_get_preset,
        set=_set_preset,
        options={"SKIP_SAVE"},
    )
    model: EnumProperty(
        name="Model",
        description="Method that recovers highlights, shape, light and reflectance",
        items=MODELS,
        default="joint",
    )
    separator: EnumProperty(
        name="Separator",
        description="Method that removes the highlights",
        items=SEPARATORS,
        default="isc",
    )
    highlight_odds: EnumProperty(
        name="Remove Highlights",
        description="Which highlights to remove from the base color if they could also be print",
        items=HIGHLIGHT_ODDS,
        default=CERTAIN,
    )
    refine: BoolProperty(
        name="Refine Gloss",
        description=(
            "Fit lamps, roughness and small changes of the relief to the removed highlights, so "
            "that the highlights appear where the photo shows them. The fit is kept only if it "
            "explains the photo better. Takes about 10 seconds more"
        ),
        default=False,
    )
    illumination: EnumProperty(
        name="Light",
        description="Kind of light in the photo",
        items=ILLUMINATIONS,
        default="photo",
    )
    light_color: EnumProperty(
        name="Light Color",
        description="Color of the light in the photo",
        items=LIGHT_COLORS,
        default="balanced",
    )
    custom_light_color: FloatVectorProperty(
        name="Color",
        description="Color of the light; pick it from something white in the photo",
        subtype="COLOR",
        size=3,
        min=0.01,
        max=1,
        default=(1, 1, 1),
    )
    camera: EnumProperty(
        name="Camera", description="Projection of the photo", items=CAMERAS, default="auto"
    )
    focal_length: FloatProperty(
        name="Focal Length",
        description="35 mm equivalent focal length in millimeters, based on the diagonal",
        subtype="DISTANCE_CAMERA",
        default=28.0,
        min=8.0,
        max=3000.0,
        soft_max=200.0,
    )
    max_size: IntProperty(
        name="Size",
        description=(
            "Longer side of the object in its maps, in pixels (0 keeps the photo's resolution); "
            "the time grows with the square of the size"
        ),
        default=512,
        min=0,
        max=8192,
        soft_min=64,
        soft_max=1024,
    )
    samples: IntProperty(
        name="Samples",
        description="Samples per pixel for Cycles renders in a new scene",
        default=64,
        min=1,
        soft_max=4096,
    )

    texture_size: EnumProperty(
        name="Texture Size",
        description="Longest side of the base color texture; it is never smaller than the maps",
        items=TEXTURE_SIZES,
        default="photo",
    )
    size_metres: FloatProperty(
        name="Object Size",
        description="Longer side of the object in the scene",
        subtype="DISTANCE",
        default=1.0,
        min=1e-4,
        soft_max=10.0,
    )
    own_scene: BoolProperty(
        name="New Scene",
        description=(
            "Create the object in a new scene, with the photo's light and camera, instead of at "
            "the 3D cursor of this scene"
        ),
        default=False,
    )
    light_and_camera: BoolProperty(
        name="Light and Camera",
        description=(
            "Add the photo's camera and an estimated sun in a collection that is excluded from "
            "the view layer until you check it in the Outliner"
        ),
        default=True,
    )
    set_world: BoolProperty(
        name="World", description="Replace the scene's world by the recovered light", default=False
    )
    set_camera: BoolProperty(
        name="Camera", description="Make the photo's camera the scene's camera", default=False
    )
    set_resolution: BoolProperty(
        name="Resolution", description="Set the render resolution to the photo's", default=False
    )
    set_view_transform: BoolProperty(
        name="View Transform",
        description=(
            "Set the scene's view transform to Standard; AgX and Filmic change the photo's colors"
        ),
        default=False,
    )
    sun: BoolProperty(
        name="Estimated Sun",
        description=(
            "Add a sun along the main direction of the light, and replace the recovered light by "
            "uniform light"
        ),
        default=False,
    )
    displacement: BoolProperty(
        name="Displacement",
        description="Create a flat grid with a Displace modifier instead of a mesh",
        default=False,
    )
    back: EnumProperty(
        name="Back",
        description="Shape of the side that the photo does not show",
        items=BACKS,
        default="rounded",
    )
    triangles: IntProperty(
        name="Triangles",
        description=(
            "Maximum number of triangles of the visible side (0 keeps two for each pixel); finer "
            "detail is in the normal map"
        ),
        default=50_000,
        min=0,
        soft_max=1_000_000,
    )
    all_maps: BoolProperty(
        name="All Maps",
        description=(
            "Also pack the layers and maps that the material does not use, such as normals, "
            "shading and diffuse light, for compositing"
        ),
        default=False,
    )
    shadows: EnumProperty(
        name="Self-Shadowing",
        description="Cast shadows and diffuse light, also on the object itself (Cycles)",
        items=OWN_SHADOWS_ITEMS,
        default="auto",
    )
    specular_from: EnumProperty(
        name="Highlights",
        description="Source of the material's highlights",
        items=SPECULAR_SOURCES,
        default="lobe",
    )


class ISC_PG_run(bpy.types.PropertyGroup):
    """What the panels show of the current run, or of the last one."""

    title: StringProperty(name="Run", description="Name of the run", options={"SKIP_SAVE"})
    state: StringProperty(
        name="State", description="State of the run; empty before the first", options={"SKIP_SAVE"}
    )
    stage: StringProperty(
        name="Stage", description="Current stage of the worker", options={"SKIP_SAVE"}
    )
    fraction: FloatProperty(
        name="Progress",
        description="Completed fraction of the work",
        min=0,
        max=1,
        options={"SKIP_SAVE"},
    )
    message: StringProperty(name="Message", description="Outcome of the run", options={"SKIP_SAVE"})
    notes: StringProperty(
        name="Details", description="Notes on the result, one per line", options={"SKIP_SAVE"}
    )
    longest_call_ms: FloatProperty(
        name="Longest Call",
        description="Longest time in milliseconds for which the run blocked the window",
        options={"SKIP_SAVE"},
    )
    import_ms: FloatProperty(
        name="Import",
        description="Time in milliseconds to build the result in the scene",
        options={"SKIP_SAVE"},
    )


CLASSES = (ISC_PG_settings, ISC_PG_run)


def add_properties() -> None:
    """Add `scene.isc` and `window_manager.isc`; the classes must be registered."""
    bpy.types.Scene.isc = PointerProperty(
        name="ISC", description="Settings of ISC", type=ISC_PG_settings
    )
    bpy.types.WindowManager.isc = PointerProperty(
        name="ISC", description="Current run of ISC", type=ISC_PG_run, options={"SKIP_SAVE"}
    )


def remove_properties() -> None:
    """Remove `scene.isc` and `window_manager.isc`."""
    del bpy.types.Scene.isc
    del bpy.types.WindowManager.isc
