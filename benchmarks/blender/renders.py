"""Renders of an imported result as linear arrays, through the scene's own camera.

Cycles on the CPU, no denoising, a fixed seed, a float OpenEXR read back; pixels are divided by
their coverage. The scene is the users' scene; what a measurement changes (`RenderVariant`) is set
on it afterwards.

Limits: a render has the size of the maps.
"""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import bpy
import numpy as np

from blender_addon.datablocks.images import COLOR, ImageRole, map_file, new_image, replace_image
from blender_addon.files.result_arrays import ResultArrays
from blender_addon.scene import BuildOptions, BuiltObject, build_object
from blender_addon.scene.sun import ensure_sun
from isc_core.io.exr import read_channels

from .closed_loop_cases import RelitTruth

Gloss = Literal["none", "lobe", "image"]
# Roles of images that hold light.
LIT = ("photo", "image", "diffuse", "specular", "residual", "lobe")


@dataclass(frozen=True)
class RenderVariant:
    """What a render shows.

    Attributes
    ----------
    gloss : {"none", "lobe", "image"}
        As `BuildOptions.specular_from`.
    white : bool
        A white Lambertian surface instead of the material.
    own_shadows : bool or None
        As in `BuildOptions`.
    filter_width : float or None
        Pixel filter, in pixels; None: that of the scene.
    relit : RelitTruth or None
        Another light, direct only.
    """

    gloss: Gloss = "none"
    white: bool = False
    own_shadows: bool | None = None
    filter_width: float | None = None
    relit: RelitTruth | None = None


def render(
    result: ResultArrays, variant: RenderVariant, samples: int
) -> tuple[np.ndarray, np.ndarray]:
    """Render a result. Blender's file is emptied first.

    Parameters
    ----------
    result : ResultArrays
        The result.
    variant : RenderVariant
        What to show.
    samples : int
        Samples per pixel.

    Returns
    -------
    image : (H, W, 3) ndarray
        Linear, 0 outside the object.
    coverage : (H, W) ndarray
        In [0, 1].

    Raises
    ------
    RuntimeError
        If the material emits light or shows the photo's specular layer although it should not.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    built = build_object(
        result, BuildOptions(specular_from=variant.gloss, own_shadows=variant.own_shadows)
    )
    if variant.gloss != "image" and (emitting := emitting_nodes(built.material)):
        raise RuntimeError(f"the material emits light: {', '.join(emitting)}")
    if variant.white:
        built.scene.view_layers[0].material_override = _white()
    if variant.relit is not None:
        _relight(built, variant.relit)
    return render_scene(built.scene, samples, variant.filter_width)


def emitting_nodes(material: bpy.types.Material) -> list[str]:
    """List the nodes by which a material, with its groups, emits light.

    Parameters
    ----------
    material : bpy.types.Material
        The material.

    Returns
    -------
    list of str
        Names of emission nodes and of images that hold the photo's light.
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
    diffuse, output = (
        tree.nodes.new("ShaderNodeBsdfDiffuse"),
        tree.nodes.new("ShaderNodeOutputMaterial"),
    )
    diffuse.inputs["Color"].default_value = (1, 1, 1, 1)
    tree.links.new(diffuse.outputs["BSDF"], output.inputs["Surface"])
    return material


def _relight(built: BuiltObject, new: RelitTruth) -> None:
    """Set another environment map and a sun; direct light only, as in the ground truth."""
    key = built.object["isc_key"]
    replace_image(new_image(map_file(new.sky, COLOR)), key, ImageRole.ENVIRONMENT_MAP)
    if new.sun_irradiance.any():
        sun = ensure_sun(key, built.collection, new.sun_direction, new.sun_irradiance)
        sun.data.angle = 0.0
    built.scene.cycles.max_bounces = 0


def render_scene(
    scene: bpy.types.Scene, samples: int, filter_width: float | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Render a scene as it is.

    Parameters
    ----------
    scene : bpy.types.Scene
        The scene.
    samples : int
        Samples per pixel.
    filter_width : float, optional
        Pixel filter, in pixels; that of the scene if None.

    Returns
    -------
    image : (H, W, 3) ndarray
        Linear, 0 outside the objects.
    coverage : (H, W) ndarray
        In [0, 1].
    """
    scene.render.engine, scene.render.film_transparent = "CYCLES", True
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
