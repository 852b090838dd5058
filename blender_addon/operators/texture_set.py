"""The textures of an object as files, under the names and in the packings of other programs.

Everything is taken from the scene, edits included: base colour, roughness, specular level and
normal map from the Principled BSDF, height and occlusion from the recovered height map.

    basecolor   coded as sRGB (EXR: linear); alpha is the object, or fades with its soft rim
    normal      (n + 1) / 2 on the mesh; green upward (OpenGL) or downward (DirectX)
    specular    .5 is plastic, f0 = .08 * specular = .04
    height      0 the lowest point of the object, 1 the highest

All have the size of the base colour. Smaller ones are upsampled cubically, from values that
continue beyond the object; normals are normalised again.

Packings: `isc_core.result_files.exports.targets`. Limits: as of `texture_set` there.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from isc_core.errors import InputError
from isc_core.imaging.srgb import linear_to_srgb
from isc_core.imaging.upsampling import enlarged_cubically
from isc_core.io.png import encode_png
from isc_core.result_files.exports.targets import PACKED, TARGETS
from isc_core.result_files.solids.solid_mesh import continued
from isc_core.shading.ambient_occlusion import ambient_occlusion

from ..datablocks.images import ImageRole
from ..materials.color_bake import linear_colors
from ..materials.edit_nodes import LEVEL_FACTOR, PLASTIC, specular_level, surface_node
from ..scene.built_object import BuiltObject

_FLAT = (0.5, 0.5, 1.0)
_REACH = 2  # pixels of the maps beyond the object that the cubic kernel reads


def write_texture_set(
    built: BuiltObject, folder: Path, name: str, target: str, file_format: str, green_down: bool
) -> list[str]:
    """Write the textures of an object.

    Parameters
    ----------
    built : BuiltObject
        The object; its edits are baked.
    folder : Path
        An existing folder.
    name : str
        Begins the files' names.
    target : str
        One of `TARGETS`.
    file_format : str
        "PNG8", "PNG16" or "EXR".
    green_down : bool
        Whether normal maps are DirectX's.

    Returns
    -------
    list of str
        Names of the files.

    Raises
    ------
    InputError
        If the base colour is not an image, or the object is of an earlier version.
    OSError
        If a file cannot be written.
    """
    planes = _Planes(built, green_down)
    wanted = (one for one in TARGETS[target].textures if one != "mesh_normal")
    names = []
    for texture in wanted:
        values = planes.texture(texture)
        coded = texture != "basecolor" or file_format == "EXR"
        suffix = "exr" if file_format == "EXR" else "png"
        names.append(f"{name}_{texture}.{suffix}")
        if not coded:
            values = np.dstack([linear_to_srgb(values[..., :3]), values[..., 3:]])
        data = _exr(values) if suffix == "exr" else _png(values, file_format == "PNG16")
        (folder / names[-1]).write_bytes(data)
    return names


@dataclass(frozen=True)
class _Planes:
    """Quantities in [0, 1], row 0 at the top; colours are linear."""

    built: BuiltObject
    green_down: bool

    def texture(self, name: str) -> np.ndarray:
        """A texture, packed where the target packs."""
        if name not in PACKED:
            return np.asarray(getattr(self, name))
        return np.dstack([getattr(self, one) for one in PACKED[name]])

    @cached_property
    def surface(self) -> Any:
        surface = surface_node(self.built.material)
        if surface is None:
            raise InputError(
                f"{self.built.material.name} is of an earlier version: create the object again"
            )
        return surface

    @cached_property
    def basecolor(self) -> np.ndarray:
        image = linked_image(self.surface.inputs["Base Color"])
        if image is None:
            raise InputError(
                f"the base color of {self.built.material.name} is not an image: connect an image "
                "texture, or bake it"
            )
        colors = linear_colors(image)[::-1]
        mask = self._map(ImageRole.MASK)
        rows, columns = (
            (np.arange(size) + 0.5) * of / size
            for size, of in zip(colors.shape, mask.shape, strict=False)
        )
        cover = mask[np.ix_(rows.astype(int), columns.astype(int))]
        if (soft := linked_image(self.surface.inputs["Alpha"])) is not None:
            alpha = enlarged_cubically(linear_colors(soft)[::-1, :, 0], cover.shape).clip(0, 1)
            cover = np.where(alpha < 1, alpha, cover)
        return np.dstack([np.clip(colors, 0, 1), cover])

    @property
    def normal(self) -> np.ndarray:
        node = _source(self.surface.inputs["Normal"])
        image = linked_image(node.inputs["Color"]) if node is not None else None
        if image is None:
            return np.broadcast_to(np.array(_FLAT), (*self.size, 3)).copy()
        values = linear_colors(image)[::-1].copy()
        if values.shape[:2] != self.size:
            vectors = self._fine(2 * values - 1)
            length = np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)
            values = (vectors / length + 1) / 2
        if self.green_down:
            values[..., 1] = 1 - values[..., 1]
        return values

    @property
    def roughness(self) -> np.ndarray:
        socket = self.surface.inputs["Roughness"]
        if (image := linked_image(socket)) is not None:  # the user's
            return np.clip(self._fine(linear_colors(image)[::-1].mean(-1)), 0, 1)
        return np.full(self.size, socket.default_value)

    @property
    def smoothness(self) -> np.ndarray:
        return np.asarray(1 - self.roughness)

    @property
    def metallic(self) -> np.ndarray:
        return np.zeros(self.size)

    detail = metallic

    @property
    def specular(self) -> np.ndarray:
        level = self.surface.inputs["Specular IOR Level"]
        factor = _source(level)
        image = linked_image(factor.inputs[0]) if factor is not None else None
        if factor is None or factor.name != LEVEL_FACTOR or image is None:
            return np.full(self.size, min(1.0, PLASTIC * specular_level(self.surface)))
        share = self._fine(linear_colors(image)[::-1, :, 0]) * PLASTIC
        return np.asarray(np.clip(share * specular_level(self.surface), 0, 1))

    @property
    def height(self) -> np.ndarray:
        height, mask = self._map(ImageRole.HEIGHT), self._map(ImageRole.MASK) > 0.5
        low, high = height[mask].min(), height[mask].max()
        share = np.clip((height - low) / max(high - low, 1e-12), 0, 1)
        return np.clip(self._fine(np.where(mask, share, 0)), 0, 1)

    @cached_property
    def ao(self) -> np.ndarray:
        share = ambient_occlusion(self._map(ImageRole.HEIGHT), self._map(ImageRole.MASK) > 0.5)
        return np.clip(self._fine(share.astype(float)), 0, 1)

    @property
    def size(self) -> tuple[int, int]:
        return self.basecolor.shape[0], self.basecolor.shape[1]

    def _fine(self, values: np.ndarray) -> np.ndarray:
        """Values of the maps at the size of the textures."""
        mask = self._map(ImageRole.MASK) > 0.5
        if values.shape[:2] == mask.shape != self.size:
            near = mask
            for _ in range(_REACH):
                padded = np.pad(near, 1)
                near = np.logical_or.reduce(
                    [padded[r : r + len(mask), c : c + mask.shape[1]] for r, c in np.ndindex(3, 3)]
                )
            beside = (near & ~mask).reshape(*mask.shape, *(1,) * (values.ndim - 2))
            values = np.where(beside, continued(values, mask, near), values)
        return enlarged_cubically(values.astype(np.float32), self.size)

    def _map(self, role: ImageRole) -> np.ndarray:
        image = self.built.object.get(f"isc_map_{role}")
        if image is None:
            raise InputError(f"{self.built.object.name} lacks its {role} map: create it again")
        return linear_colors(image)[::-1, :, 0]


def linked_image(socket: Any) -> bpy.types.Image | None:
    """Return the image whose texture is linked to a socket directly.

    Parameters
    ----------
    socket : bpy.types.NodeSocket
        An input.

    Returns
    -------
    bpy.types.Image or None
        None for other nodes.
    """
    node = _source(socket)
    return node.image if node is not None and node.type == "TEX_IMAGE" else None


def _source(socket: Any) -> Any:
    return socket.links[0].from_node if socket.is_linked else None


def _png(values: np.ndarray, deep: bool) -> bytes:
    highest, kind = (65535, np.uint16) if deep else (255, np.uint8)
    return encode_png(np.rint(highest * np.clip(values, 0, 1)).astype(kind))


def _exr(values: np.ndarray) -> bytes:
    """Blender packs float images as OpenEXR."""
    rows, columns = values.shape[:2]
    image = bpy.data.images.new("texture", columns, rows, alpha=True, float_buffer=True)
    try:
        image.colorspace_settings.name = "Non-Color"
        image.alpha_mode = "CHANNEL_PACKED"
        pixels = np.ones((rows, columns, 4), np.float32)
        channels = values if values.ndim == 3 else values[..., None]
        pixels[..., : max(3, channels.shape[2])] = channels
        image.pixels.foreach_set(pixels[::-1].ravel())
        image.pack()
        return bytes(image.packed_file.data)
    finally:
        bpy.data.images.remove(image)
