"""The textures that other programs expect, and their channel packing.

Sources: those of `texture_set`; Godot manual, "Standard Material 3D and ORM Material 3D" (green
upward, the packing of glTF).
"""

from collections.abc import Mapping
from dataclasses import dataclass

_SEPARATE = ("basecolor", "normal", "mesh_normal", "roughness", "specular", "height", "ao")


@dataclass(frozen=True)
class TextureTarget:
    """The textures of a program.

    Attributes
    ----------
    textures : tuple of str
        Their names; `height` is written as PNG and as EXR.
    green_down : bool
        Whether normal maps follow the convention of DirectX.
    """

    textures: tuple[str, ...]
    green_down: bool = False


TARGETS: Mapping[str, TextureTarget] = {
    "generic": TextureTarget(_SEPARATE),
    "blender": TextureTarget(_SEPARATE),
    "unity": TextureTarget(
        (
            *("basecolor", "normal", "mesh_normal", "metallic_smoothness", "mask_map"),
            *("height", "ao"),
        )
    ),
    "unreal": TextureTarget(
        ("basecolor", "normal", "mesh_normal", "orm", "specular", "height"), green_down=True
    ),
    "godot": TextureTarget(("basecolor", "normal", "mesh_normal", "orm", "specular", "height")),
}
# Quantity of each channel of packed textures: red, green, blue and alpha.
PACKED: Mapping[str, tuple[str, ...]] = {
    "orm": ("ao", "roughness", "metallic"),
    "metallic_smoothness": ("metallic", "metallic", "metallic", "smoothness"),
    "mask_map": ("metallic", "ao", "detail", "smoothness"),
}
