"""What the user chooses for a scene, and what the window shows of a run.

The choices (`scene.isc`) are saved with the file and undone with it. The state of a run
(`window_manager.isc`) is neither: undoing a brush stroke while the work goes on must not turn the
progress back.
"""
# mypy: allow-subclassing-any, disable-error-code="valid-type"

from typing import Any

import bpy
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    IntVectorProperty,
    PointerProperty,
    StringProperty,
)

from .presets import CUSTOM, PRESETS, preset_of

MODELS = (
    (
        "joint",
        "Joint",
        "Highlights go by colour and form; shape, light and paint are recovered, and the paint beneath continued",
    ),
    (
        "mdr",
        "MDR",
        "Highlights are removed by colour, then shape, light and paint are recovered from the diffuse image",
    ),
    (
        "mbp",
        "MBP",
        "Shape, light and paint are recovered from the photo, then highlights are removed from the paint",
    ),
    ("sirfs", "SIRFS", "The photo is taken as free of highlights"),
    ("naive", "Naive", "Baseline: a flat shape under even light"),
    ("retinex", "Retinex", "Baseline: smooth changes are shading, sharp ones are paint"),
    ("sfs-tsai-shah", "Tsai-Shah", "Baseline: linear shape from shading"),
    ("sfs-ikeuchi-horn", "Ikeuchi-Horn", "Baseline: smoothed shape from shading"),
)
SEPARATORS = (
    ("isc", "ISC", "This project's own: the best on most photos"),
    (
        "network",
        "Network",
        "Learned from rendered glossy objects: also tells highlights from white paint, where colours alone cannot",
    ),
    (
        "sparse_coding",
        "Sparse Coding",
        "Highlights as what a dictionary of diffuse patches cannot say",
    ),
    (
        "chaotic_segmentation",
        "Chaotic Segmentation",
        "Highlights by thresholds that chaotic search finds, filled in from around",
    ),
    ("shen_2013", "Shen 2013", "Real-time: chromaticity ranges by pixel clustering"),
    ("shen_2009", "Shen 2009", "Simple: a modified specular-free image"),
    ("akashi_2016", "Akashi 2016", "Sparse non-negative matrix factors"),
    ("kim_2013", "Kim 2013", "Dark channel prior and optimisation"),
    ("yang_2010", "Yang 2010", "Bilateral filter of the largest chromaticity"),
    ("tan_2005", "Tan 2005", "Iterated comparison of neighbours' chromaticity"),
    (
        "mallick_2006",
        "Mallick 2006",
        "A differential equation in a colour space turned to the light",
    ),
    ("yoon_2006", "Yoon 2006", "Ratios of neighbours in specular-free images"),
    ("none", "None", "Nothing is removed"),
)
ILLUMINATIONS = (
    ("natural", "Natural", "Light from all around: outdoors, a room, a light tent"),
    ("laboratory", "Laboratory", "One strong lamp in a dark room"),
)
MASK_SOURCES = (
    (
        "ALPHA",
        "Alpha or Black",
        "The photo's transparency; without it, what is not black behind the object",
    ),
    (
        "IMAGE",
        "Image",
        "Another image, the object white on black (or opaque on transparent); also one painted in Blender",
    ),
)
SPECULAR_SOURCES = (
    (
        "lobe",
        "Fitted Gloss",
        "Highlights come from the material's fitted roughness and level: they move with light and view",
    ),
    ("image", "Image", "The separated highlights, fixed to the surface as in the photo"),
    ("none", "None", "A matte object"),
)
SHADOWS = (
    (
        "usual",
        "Usual",
        "On in a scene with others, off in a scene of its own; an object that is updated keeps what it has",
    ),
    (
        "on",
        "On",
        "The object casts shadows, on itself too, and its parts light each other; the recovered light holds the photo's already",
    ),
    ("off", "Off", "The object casts no shadows, and looks as photographed"),
)
_PRESET_NAMES = (*PRESETS, CUSTOM)


def _preset_items() -> list[tuple[str, str, str, int]]:
    known = [
        (name, preset.label, preset.text, index)
        for index, (name, preset) in enumerate(PRESETS.items())
    ]
    return [*known, (CUSTOM, "Custom", "What is set below", len(known))]


def _get_preset(settings: Any) -> int:
    return _PRESET_NAMES.index(preset_of(settings.max_size, settings.model, settings.samples))


def _set_preset(settings: Any, value: int) -> None:
    preset = PRESETS.get(_PRESET_NAMES[value])
    if preset is not None:
        settings.max_size, settings.model, settings.samples = (
            preset.max_size,
            preset.model,
            preset.samples,
        )


def _is_picture(_settings: Any, image: Any) -> bool:
    return image.source in {"FILE", "GENERATED"} or image.type == "COMPOSITING"


class ISC_PG_settings(bpy.types.PropertyGroup):
    """The choices of one scene."""

    image: PointerProperty(
        name="Photo",
        description="The photo of one object: open a file, or choose an image that is in Blender already, also a painted one",
        type=bpy.types.Image,
        poll=_is_picture,
    )
    mask_source: EnumProperty(
        name="Mask",
        description="What says where the object is",
        items=MASK_SOURCES,
        default="ALPHA",
    )
    mask: PointerProperty(
        name="Mask Image",
        description="The object white on black, of the photo's size",
        type=bpy.types.Image,
        poll=_is_picture,
    )
    scale_mask: BoolProperty(
        name="Scale Mask",
        description="Bring a mask of another size to the photo's size; otherwise it is refused",
        default=False,
    )
    box: IntVectorProperty(
        name="Box",
        description="Left, top, width and height in pixels, from the photo's upper left corner; some background around the object included",
        size=4,
        min=0,
        default=(0, 0, 0, 0),
    )

    preset: EnumProperty(
        name="Preset",
        description="Usual choices of size, model and samples",
        items=_preset_items(),
        get=_get_preset,
        set=_set_preset,
        options={"SKIP_SAVE"},
    )
    model: EnumProperty(
        name="Model",
        description="How highlights, shape, light and paint are told apart",
        items=MODELS,
        default="joint",
    )
    separator: EnumProperty(
        name="Separator", description="What removes the highlights", items=SEPARATORS, default="isc"
    )
    illumination: EnumProperty(
        name="Light", description="Which lights to expect", items=ILLUMINATIONS, default="natural"
    )
    max_size: IntProperty(
        name="Size",
        description="The object's long side in pixels, in the maps and the mesh; 0 keeps the photo's; time grows with its square",
        default=256,
        min=0,
        max=8192,
        soft_min=64,
        soft_max=1024,
    )
    samples: IntProperty(
        name="Samples",
        description="Rays a pixel that Cycles spends in the object's own scene",
        default=64,
        min=1,
        soft_max=4096,
    )

    size_metres: FloatProperty(
        name="Object Size",
        description="The object's long side in the scene",
        subtype="DISTANCE",
        default=0.1,
        min=1e-4,
        soft_max=10.0,
    )
    own_scene: BoolProperty(
        name="Own Scene",
        description="Build in a scene of its own, and leave this one as it is; otherwise in this scene",
        default=True,
    )
    set_world: BoolProperty(
        name="World", description="Replace this scene's world by the recovered light", default=False
    )
    set_camera: BoolProperty(
        name="Camera", description="Make the photo's camera this scene's camera", default=False
    )
    set_resolution: BoolProperty(
        name="Resolution", description="Give this scene's renders the photo's size", default=False
    )
    set_view_transform: BoolProperty(
        name="View Transform",
        description="Show this scene as photos are (Standard): AgX and Filmic would change its colours",
        default=False,
    )
    sun: BoolProperty(
        name="Sun", description="Add a sun along the light's best single direction", default=False
    )
    displacement: BoolProperty(
        name="Displacement",
        description="A flat grid, raised by a Displace modifier from the height map, instead of a mesh",
        default=False,
    )
    closed_back: BoolProperty(
        name="Closed Back", description="Close the object with a flat back", default=False
    )
    shadows: EnumProperty(
        name="Own Shadows",
        description="Whether the object casts shadows and lights itself in Cycles",
        items=SHADOWS,
        default="usual",
    )
    specular_from: EnumProperty(
        name="Highlights",
        description="Where the material's highlights come from",
        items=SPECULAR_SOURCES,
        default="image",
    )


class ISC_PG_run(bpy.types.PropertyGroup):
    """What the window shows of the run that goes on, or of the last one."""

    title: StringProperty(name="Run", description="What is being done", options={"SKIP_SAVE"})
    state: StringProperty(
        name="State",
        description="running, done, failed, cancelled, or empty",
        options={"SKIP_SAVE"},
    )
    stage: StringProperty(name="Stage", description="What the worker is at", options={"SKIP_SAVE"})
    fraction: FloatProperty(
        name="Progress",
        description="How much of the work is done",
        min=0,
        max=1,
        options={"SKIP_SAVE"},
    )
    message: StringProperty(name="Message", description="How the run ended", options={"SKIP_SAVE"})
    longest_call_ms: FloatProperty(
        name="Longest Call",
        description="The longest time in milliseconds that the run has kept the window waiting",
        options={"SKIP_SAVE"},
    )
    import_ms: FloatProperty(
        name="Import",
        description="How long in milliseconds it took to build the result in the scene",
        options={"SKIP_SAVE"},
    )


CLASSES = (ISC_PG_settings, ISC_PG_run)


def attach() -> None:
    """Makes `scene.isc` and `window_manager.isc`; the classes must be registered."""
    bpy.types.Scene.isc = PointerProperty(
        name="ISC", description="Choices of ISC", type=ISC_PG_settings
    )
    bpy.types.WindowManager.isc = PointerProperty(
        name="ISC", description="The run of ISC", type=ISC_PG_run, options={"SKIP_SAVE"}
    )


def detach() -> None:
    """Takes them away."""
    del bpy.types.Scene.isc
    del bpy.types.WindowManager.isc
