"""Export of a result as textures with the names and packing that other programs expect.

Problem: programs expect the same quantities in different files: green of normal maps upward or
downward, roughness or smoothness, several values packed into the channels of one file.

The textures describe the surface over the plane of the photo, or over the object's part of it if
that is less than half: height, normal and occlusion are for a flat plane with the aspect ratio of
the textures. Base colour, roughness, specular and occlusion are also for the mesh, which has the
same texture coordinates, with `mesh_normal` instead of `normal`, which is written if the mesh needs
one.

    basecolor             sRGB, 8 bits: k * reflectance under the gloss that the program shows;
                          alpha is the object's cover
    normal, mesh_normal   (n + 1) / 2, 8 bits; green upward (OpenGL) or downward (DirectX)
    roughness             8 bits, linear as all that follow
    specular              8 bits; .5 is plastic, f0 = .08 * specular = .04
    ao                    8 bits, see `shading.ambient_occlusion`
    height                16 bits: 0 the lowest point of the object, 65535 the highest; float32 EXR:
                          metres above the lowest
    orm                   red occlusion, green roughness, blue metallic
    metallic_smoothness   red metallic, alpha 1 - roughness
    mask_map              red metallic, green occlusion, blue detail mask, alpha 1 - roughness

All have the size of the base colour. Maps that are smaller are upsampled cubically, from unrounded
values that continue beyond the object; normals are normalised again. A JSON file records the
scales, the conventions and the sources of roughness and specular.

Sources of the conventions: B. Burley, "Physically based shading at Disney", SIGGRAPH 2012 courses
(the specular scale, which Unreal and Blender share). Epic Games, Unreal Engine documentation,
"Physically Based Materials" and "Normal Map Creation" (green downward). The packing orm is glTF's,
Khronos Group (2021), section 3.9.2. Unity manual, "Standard Shader: Metallic mode" (smoothness in
alpha) and "Normal map" (green upward); Unity HDRP manual, "Mask and detail maps". Blender manual,
"Normal Map Node" (green upward) and "Node Wrangler" (recognises the names above).

Limits: 8 bits clip base colours above 1 (.5 % of the pixels) and specular levels above that of f0 =
.08. Unity's metallic materials have no specular level: they show that of plastic. Metallic is 0.
Farther than 16 pixels from the object, textures have the mean colour or a flat surface. Upsampling
adds no detail.
"""

import json
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from ...errors import InputError
from ...imaging.row_blocks import row_blocks
from ...imaging.srgb import share_codes
from ...imaging.upsampling import enlarged, enlarged_cubically
from ...io.atomic import new_folder
from ...io.exr import write_channels
from ...lobe_fitting.specular_level import SpecularSource
from ...progress import Monitor
from ...scene.decomposition import Decomposition
from ...shading.ambient_occlusion import ambient_occlusion
from ..mesh.base_color import nearest_inside
from ..mesh.result import MeshResult
from ..mesh.texture_codes import vector_codes
from .targets import TARGETS
from .textures import PLASTIC

_COMPRESSION = 2  # of 9: a third of the time of the default 6


def texture_files(name: str) -> tuple[str, ...]:
    """Return the possible files of texture sets of a name, the description first.

    Parameters
    ----------
    name : str

    Returns
    -------
    tuple of str
    """
    textures = sorted({texture for target in TARGETS.values() for texture in target.textures})
    pictures = (f"{name}_{texture}.png" for texture in textures)
    return (f"{name}_textures.json", *pictures, f"{name}_height.exr")


def write_texture_set(
    d: Decomposition,
    built: MeshResult,
    cover: np.ndarray,
    target: str,
    folder: Path,
    *,
    name: str,
    monitor: Monitor | None = None,
) -> None:
    """Write a texture set, completely or not at all; an earlier one of that name is replaced.

    Parameters
    ----------
    d : Decomposition
        The part of the result that the mesh covers.
    built : MeshResult
        Its mesh.
    cover : (H, W) ndarray
        Alpha of the base colour.
    target : str
        One of `TARGETS`.
    folder : Path
    name : str
        Prefix of the file names.
    monitor : Monitor, optional

    Raises
    ------
    InputError
        If the target is unknown, no roughness is known, or the folder cannot be written.
    """
    if target not in TARGETS:
        raise InputError(f'unknown target "{target}": choose {", ".join(TARGETS)}')
    monitor, wanted = monitor or Monitor(), TARGETS[target]
    shown = _shown(built, "specular" in wanted.textures)
    layers = _Layers(d, shown, cover, *known_roughness(built), wanted.green_down)
    textures = [one for one in wanted.textures if one != "mesh_normal" or built.needs_normal_map]
    with new_folder(folder, texture_files(name)) as partial:
        for number, texture in enumerate(textures):
            monitor.report(f"writing {texture}", number / len(textures))
            picture = Image.fromarray(getattr(layers, texture))
            picture.save(partial / f"{name}_{texture}.png", compress_level=_COMPRESSION)
        write_channels(partial / f"{name}_height.exr", {"Y": layers.fine(layers.metres)})
        text = json.dumps(_description(d, built, layers, target, textures, name), indent=2)
        (partial / f"{name}_textures.json").write_text(text + "\n", encoding="utf-8")
        monitor.report("writing textures", 1.0)


def _shown(built: MeshResult, has_texture: bool) -> MeshResult:
    """The mesh with the specular level that a program shows: at most that of f0 = .08, or that of
    plastic where it reads no texture.
    """
    gloss, coated = built.gloss, built.coated
    if coated is None or not gloss.specular:
        return built
    plastic = 1 / built.reflectance_scale
    if not has_texture:
        return replace(
            built,
            gloss=replace(gloss, specular=plastic, variation=None),
            coated=replace(coated, variation=None),
        )
    most = plastic / PLASTIC
    if gloss.variation is None:
        return replace(built, gloss=replace(gloss, specular=min(gloss.specular, most)))
    variation = np.minimum(gloss.variation, most / gloss.specular)
    return replace(
        built,
        gloss=replace(gloss, variation=variation),
        coated=replace(coated, variation=variation / variation.max()),
    )


def known_roughness(built: MeshResult) -> tuple[float, str]:
    """Return the roughness of the textures, and its source.

    Parameters
    ----------
    built : MeshResult

    Returns
    -------
    roughness : float
        In [0, 1]; 1 for an object without highlights.
    source : str

    Raises
    ------
    InputError
        If it is unknown.
    """
    gloss = built.gloss
    if gloss.roughness is not None:
        return gloss.roughness, str(gloss.roughness_source)
    if gloss.specular_source == SpecularSource.NO_HIGHLIGHTS:
        return 1.0, str(gloss.specular_source)
    raise InputError(
        "the result has no fitted roughness: give one, such as --roughness 0.5, or decompose the "
        "photo with --model joint"
    )


@dataclass(frozen=True, eq=False)
class _Layers:
    """The textures as codes, computed on demand."""

    d: Decomposition
    built: MeshResult
    cover: np.ndarray
    roughness_value: float
    roughness_source: str
    green_down: bool

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns of all textures."""
        width, height = self.built.base_color_size
        return height, width

    def fine(self, values: np.ndarray) -> np.ndarray:
        """Values (H, W) of the maps at the size of the textures."""
        return enlarged_cubically(values, self.size)

    @property
    def basecolor(self) -> np.ndarray:
        codes = self.built.base_color_codes
        cover = enlarged(self.cover, codes.shape[:2], codes.shape[1] / self.cover.shape[1])
        return np.dstack([codes, share_codes(cover)])

    @property
    def normal(self) -> np.ndarray:
        return self._vectors(self._continued(self.d.normal, (0.0, 0.0, 1.0)))

    @property
    def mesh_normal(self) -> np.ndarray:
        return self._vectors(self.built.detail)

    @property
    def roughness(self) -> np.ndarray:
        return np.full(self.size, _code(self.roughness_value), np.uint8)

    @property
    def specular(self) -> np.ndarray:
        level = np.float32(PLASTIC * self.built.specular)
        if self.built.gloss.variation is None:
            return share_codes(np.full(self.size, level))
        return share_codes(level * self.fine(self._continued(self.built.gloss.variation, 1.0)))

    @property
    def height(self) -> np.ndarray:
        share = self.fine(self.metres) / max(self.highest, 1e-12)
        return np.rint(65535 * np.clip(share, 0, 1)).astype(np.uint16)

    @cached_property
    def ao(self) -> np.ndarray:
        share = ambient_occlusion(self.d.height, self.d.mask)
        return share_codes(self.fine(self._continued(share, 1.0)))

    @property
    def orm(self) -> np.ndarray:
        return np.dstack([self.ao, self.roughness, np.zeros_like(self.ao)])

    @property
    def metallic_smoothness(self) -> np.ndarray:
        empty = np.zeros_like(self.roughness)
        return np.dstack([empty, empty, empty, 255 - self.roughness])

    @property
    def mask_map(self) -> np.ndarray:
        empty = np.zeros_like(self.ao)
        return np.dstack([empty, self.ao, empty, 255 - self.roughness])

    @cached_property
    def metres(self) -> np.ndarray:
        """Heights (H, W) float32 above the lowest point of the object."""
        level = (self.d.height - self.d.height[self.d.mask].min()) * self.built.metres_per_pixel
        return self._continued(level.astype(np.float32), 0.0)

    @property
    def highest(self) -> float:
        return float(self.metres.max())

    @cached_property
    def _nearest(self) -> tuple[np.ndarray, np.ndarray]:
        """Flat indices of the pixels near the object, and of its nearest pixel to each."""
        return nearest_inside(self.d.mask, self.built.options.bleed)

    def _continued(self, values: np.ndarray, beyond: Any) -> np.ndarray:
        """The values inside the mask, extended around it; `beyond` farther out."""
        mask = self.d.mask if values.ndim == 2 else self.d.mask[..., None]
        result = np.where(mask, values, np.asarray(beyond, values.dtype))
        near, source = self._nearest
        flat = result.reshape(mask.size, -1)
        flat[near] = values.reshape(flat.shape)[source]
        return result

    def _vectors(self, vectors: np.ndarray) -> np.ndarray:
        codes = np.empty((*self.size, 3), np.uint8)
        for block in row_blocks(self.size):
            fine = enlarged_cubically(vectors, self.size, block.rows)
            if vectors.shape[:2] != self.size:
                fine = fine / np.maximum(np.linalg.norm(fine, axis=-1, keepdims=True), 1e-9)
            codes[block.rows] = vector_codes(fine)
        if self.green_down:
            codes[..., 1] = 255 - codes[..., 1]
        return codes


def _code(value: float) -> int:
    return round(255 * value)


def _description(
    d: Decomposition,
    built: MeshResult,
    layers: _Layers,
    target: str,
    textures: list[str],
    name: str,
) -> dict[str, Any]:
    described = built.describe()
    return {
        "target": target,
        "photo": d.provenance.input.get("name", ""),
        "size": list(built.base_color_size),
        "frame": [*built.place.corner, *built.place.shape[::-1]],
        "files": {texture: f"{name}_{texture}.png" for texture in textures}
        | {"height_float": f"{name}_height.exr"},
        "colour_space": {"basecolor": "sRGB", "others": "linear"},
        "normal": "DirectX, green downward" if layers.green_down else "OpenGL, green upward",
        "metres_per_pixel": built.metres_per_pixel * d.mask.shape[1] / built.base_color_size[0],
        "height": {"metres_at_0": 0.0, "metres_at_65535": layers.highest},
        "reflectance_scale": built.reflectance_scale,
        "basecolor": described["base_color"],
        "roughness": {"value": layers.roughness_value, "source": layers.roughness_source},
        "specular": {
            "value": PLASTIC * built.specular,
            "source": described["specular"]["source"],
            "convention": "f0 = .08 * specular",
        },
        "metallic": 0.0,
    }
