"""The properties of a scene, and the state of the current run that the panels show.

The settings (`scene.isc`) are saved with the file and take part in undo. The state of a run
(`window_manager.isc`) does neither: undoing a brush stroke during a run must not reset its
progress.
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

from ..datablocks.provenance import MASK_OF
from ..worker.commands import CERTAIN
from .choices import (
    BACKS,
    CAMERAS,
    HIGHLIGHT_ODDS,
    ILLUMINATIONS,
    LIGHT_COLORS,
    MASK_SOURCES,
    MODELS,
    OWN_SHADOWS_ITEMS,
    SEPARATORS,
    SPECULAR_SOURCES,
    TEXTURE_SIZES,
    numbered,
)
from .presets import CUSTOM, PRESETS, matching_preset

_PRESET_NAMES = (*PRESETS, CUSTOM)
_PRESET_ITEMS = numbered(
    *((name, preset.label, preset.description) for name, preset in PRESETS.items()),
    (CUSTOM, "Custom", "Use the values in the Method panel"),
)


def _get_preset(settings: Any) -> int:
    if settings.is_custom:
        return _PRESET_NAMES.index(CUSTOM)
    return _PRESET_NAMES.index(matching_preset(settings.max_size, settings.model, settings.samples))


def _set_preset(settings: Any, value: int) -> None:
    preset = PRESETS.get(_PRESET_NAMES[value])
    settings.is_custom = preset is None
    if preset is not None:
        settings.max_size, settings.model = preset.max_size, preset.model
        settings.samples = preset.samples


def _is_still_image(_settings: Any, image: Any) -> bool:
    return image.source in {"FILE", "GENERATED"} or image.type == "COMPOSITING"


def _forget_other_photo(settings: Any, context: Any) -> None:
    """Points belong to one photo, and so does a mask that ISC has found."""
    del context
    image, mask = settings.image, settings.mask
    is_of_isc = image is not None and mask is not None and MASK_OF in mask
    if is_of_isc and mask[MASK_OF] not in (image, f"{image.name} mask"):
        settings.mask, settings.mask_source = None, "ALPHA"
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
        update=_forget_other_photo,
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
    is_custom: BoolProperty(
        name="Custom",
        description="Whether the preset Custom was chosen, with whatever values",
        default=False,
        options={"HIDDEN"},
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
        name="World",
        description=(
            "Replace the scene's world with the recovered light; the world stays in the file"
        ),
        default=False,
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
            "Add a sun along the main direction of the light, and replace the recovered light with "
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
