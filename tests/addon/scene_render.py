"""Renders a scene with Cycles to linear float arrays, layer by layer."""

from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

# Blender 5 spells the layers out.
_LAYERS = {
    "DiffCol": "Diffuse Color",
    "DiffDir": "Diffuse Direct",
    "GlossCol": "Glossy Color",
    "GlossDir": "Glossy Direct",
}


def render(scene: Any, folder: Path, samples: int = 1) -> dict[str, np.ndarray]:
    """Layers (H, W, C) by name, as Blender 5 calls them: "Combined" (RGBA), "Emission", "Diffuse
    Color", ... Rays pass pixel centres.
    """
    import bpy

    cycles, layer, picture = scene.cycles, scene.view_layers[0], scene.render.image_settings
    cycles.samples, cycles.seed, cycles.device = samples, 0, "CPU"
    cycles.use_adaptive_sampling, cycles.use_denoising = False, False
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 0.01
    layer.use_pass_diffuse_color = layer.use_pass_diffuse_direct = layer.use_pass_normal = (
        layer.use_pass_position
    ) = True
    layer.use_pass_glossy_color = layer.use_pass_glossy_direct = layer.use_pass_emit = True
    if hasattr(picture, "media_type"):
        picture.media_type = "MULTI_LAYER_IMAGE"
    picture.file_format, picture.color_depth = "OPEN_EXR_MULTILAYER", "32"
    scene.render.filepath = str(folder / "layers.exr")
    bpy.ops.render.render(write_still=True, scene=scene.name)
    planes: dict[str, dict[str, np.ndarray]] = {}
    for part in OpenEXR.File(scene.render.filepath, separate_channels=True).parts:
        for name, channel in part.channels.items():
            *_, kind, letter = name.split(".")
            planes.setdefault(_LAYERS.get(kind, kind), {})[letter] = channel.pixels
    letters = {"Combined": "RGBA", "Normal": "XYZ", "Position": "XYZ"}
    return {
        name: np.stack([held[letter] for letter in letters.get(name, "RGB")], -1)
        for name, held in planes.items()
        if len(held) > 2
    }


def pixels(image: Any) -> np.ndarray:
    """(H, W, 4) float32 of a Blender image, row 0 at the top."""
    width, height = image.size
    values = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(height, width, 4)[::-1]
