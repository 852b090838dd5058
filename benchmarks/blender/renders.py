"""Pictures that Blender makes of an imported result, as linear arrays, through the scene's own
camera.

Cycles on the processor, no denoising, a fixed seed, a float OpenEXR read back; pixels are divided
by their coverage. The scene is the one that people get; what a measurement needs to be otherwise
(`Look`) is set on it afterwards.

Limits: the render has the size of the maps.
"""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import bpy
import numpy as np

from blender_addon.files.result_arrays import Result
from blender_addon.scene import BuildOptions, Built, build
from blender_addon.scene.images import COLOR, ensure_image
from blender_addon.scene.sun import ensure_sun
from isc_core.io.exr import read_channels

from .closed_loop_cases import Relit

Gloss = Literal["none", "lobe", "image"]
LIT = (
    "photo",
    "image",
    "diffuse",
    "specular",
    "residual",
    "lobe",
)  # roles of images that are light already


@dataclass(frozen=True)
class Look:
    """What a picture shows. `gloss`: as `BuildOptions.specular_from`. `white`: a white matt surface
    instead of the material. `own_shadows`: as in `BuildOptions`. `filter_width`: Blender's, pixels;
    the scene's own if None. `relit`: another light, direct only.
    """

    gloss: Gloss = "none"
    white: bool = False
    own_shadows: bool | None = None
    filter_width: float | None = None
    relit: Relit | None = None


def picture(result: Result, look: Look, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """The picture (H, W, 3), linear, 0 where nothing is, and the coverage (H, W) in [0, 1].
    Blender's file is emptied first.

    Raises `RuntimeError` if a material that should do without shines by itself or shows the photo's
    specular image.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    built = build(result, BuildOptions(specular_from=look.gloss, own_shadows=look.own_shadows))
    if look.gloss != "image" and (cheats := shining(built.material)):
        raise RuntimeError(f"the material shines by {', '.join(cheats)}")
    if look.white:
        built.scene.view_layers[0].material_override = _white()
    if look.relit is not None:
        _relight(built, look.relit)
    return _rendered(built.scene, look.filter_width, samples)


def shining(material: bpy.types.Material) -> list[str]:
    """Names of the nodes that a material, with the groups in it, shines by: emission, and images
    that hold the photo's light.
    """
    found = []
    for node in _nodes(material.node_tree):
        emits = node.type == "EMISSION" or (node.type == "BSDF_PRINCIPLED" and _may_emit(node))
        shows = (
            node.type == "TEX_IMAGE"
            and node.image is not None
            and node.image.get("isc_role") in LIT
        )
        found += [node.name] if emits or shows else []
    return found


def _nodes(tree: bpy.types.NodeTree) -> Iterator[Any]:
    for node in tree.nodes:
        yield node
        if node.type == "GROUP" and node.node_tree is not None:
            yield from _nodes(node.node_tree)


def _may_emit(node: Any) -> bool:
    strength, color = node.inputs["Emission Strength"], node.inputs["Emission Color"]
    return bool(
        strength.is_linked
        or color.is_linked
        or (strength.default_value > 0 and any(tuple(color.default_value)[:3]))
    )


def _white() -> bpy.types.Material:
    material = bpy.data.materials.new("white")
    if material.node_tree is None:  # before Blender 5
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    matt, output = (
        tree.nodes.new("ShaderNodeBsdfDiffuse"),
        tree.nodes.new("ShaderNodeOutputMaterial"),
    )
    matt.inputs["Color"].default_value = (1, 1, 1, 1)
    tree.links.new(matt.outputs["BSDF"], output.inputs["Surface"])
    return material


def _relight(built: Built, new: Relit) -> None:
    """Another sky in the scene's world, and a sun lamp: direct light only, as in the truth."""
    key = built.object["isc_key"]
    ensure_image(key, "sky", np.asarray(new.sky, np.float32), COLOR)
    if new.sun_irradiance.any():
        sun = ensure_sun(key, built.collection, new.sun_direction, new.sun_irradiance)
        sun.data.angle = 0.0
    built.scene.cycles.max_bounces = 0


def _rendered(
    scene: bpy.types.Scene, filter_width: float | None, samples: int
) -> tuple[np.ndarray, np.ndarray]:
    scene.render.engine = "CYCLES"
    cycles, image = scene.cycles, scene.render.image_settings
    cycles.device, cycles.samples, cycles.seed = "CPU", samples, 0
    cycles.use_denoising, cycles.use_adaptive_sampling = False, False
    if filter_width is not None:
        cycles.filter_width = filter_width
    image.file_format, image.color_mode, image.color_depth = "OPEN_EXR", "RGBA", "32"
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(Path(folder) / "render.exr")
        bpy.ops.render.render(write_still=True, scene=scene.name)
        channels = read_channels(Path(folder) / "render.exr")
    color, alpha = np.stack([channels[name] for name in "RGB"], -1), channels["A"]
    return np.where(alpha[..., None] > 1e-3, color / np.maximum(alpha, 1e-3)[..., None], 0), alpha
