"""A mesh with its material, and its files.

Gloss: roughness and specular level come from `lobe_fitting.specular_upper_bound`, with the level
times the scale k of the base colour. A level up to 1, with its variation over the object in a
texture's alpha, is the factor of KHR_materials_specular; the excess above 1 is its colour. Where
the level is unknown the factor is 0, because without the extension the mesh would look as glossy as
plastic. The base colour in files is that under the gloss of the same file, see
`lobe_fitting.specular_layer`; `MeshResult.base_color` is that without gloss.

Reference: Khronos Group (2021), glTF 2.0 specification,
https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html, section 3.9.
"""

from dataclasses import dataclass, field, replace
from math import log, pi, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from ...imaging.bounding_box import FramePart
from ...lobe_fitting.specular_level import SpecularFit, SpecularSource
from ...photo.camera import Camera
from ..solids.back import Back
from .glb import ExtraPrimitive, TexturedMesh, encode_glb
from .object_cover import ObjectCover
from .options import MeshOptions
from .texture_codes import alpha_codes, color_codes, encoded_png, vector_codes

if TYPE_CHECKING:
    from ...lobe_fitting.specular_layer import CoatedSurface

_SPECULAR = "KHR_materials_specular"


@dataclass(frozen=True, eq=False)
class MeshResult:
    """A mesh with its material and its relation to the maps.

    Attributes
    ----------
    mesh : TexturedMesh
        In metres, +Y up, facing +Z.
    reflectance_scale : float
        k: base colour = k * reflectance.
    metres_per_pixel : float
        Of the maps.
    origin : tuple of float
        (column, row, height), in pixels, of the world's origin; with a perspective camera the
        height is relative to the mean distance.
    stride : int
        Smallest distance of vertices in pixels.
    vertex_pixel : (V, 2) ndarray
        Row and column of each vertex.
    base_color : (H, W, 3) ndarray
        Linear, k * reflectance, extended beyond the mask; for a surface without gloss.
    detail : (H, W, 3) ndarray
        Unit vectors of the normal map in tangent space.
    options : MeshOptions
    gloss : SpecularFit
    camera : Camera or None
        Of the maps; None for an orthographic view.
    eye : (3,) ndarray or None
        The camera's position in metres.
    texture : (h, w, 3) uint8 ndarray or None
        Base colour of higher resolution in sRGB codes, see `with_texture`.
    texture_part : FramePart or None
        The part of the texture's frame that it covers; None without a texture.
    cover : ObjectCover or None
        Coverage that the outline follows, of the frame; None for the steps of the pixels.
    coated : CoatedSurface or None
        Determines the base colour under the gloss; None keeps the base colour unchanged.
    part : FramePart or None
        The part of the result's frame that all pixels, textures and the camera refer to; None for
        the whole.
    """

    mesh: TexturedMesh
    reflectance_scale: float
    metres_per_pixel: float
    origin: tuple[float, float, float]
    stride: int
    vertex_pixel: np.ndarray
    base_color: np.ndarray
    detail: np.ndarray
    options: MeshOptions = field(default_factory=MeshOptions)
    gloss: SpecularFit = field(default_factory=SpecularFit)
    camera: Camera | None = None
    eye: np.ndarray | None = None
    texture: np.ndarray | None = None
    texture_part: FramePart | None = None
    cover: ObjectCover | None = None
    coated: "CoatedSurface | None" = None
    part: FramePart | None = None

    @property
    def place(self) -> FramePart:
        """The part of the result's frame that its maps and textures cover."""
        rows, columns = self.detail.shape[:2]
        return FramePart.whole((rows, columns)) if self.part is None else self.part

    def with_texture(self, texture: np.ndarray) -> "MeshResult":
        """Return the mesh with a base colour of higher resolution.

        Parameters
        ----------
        texture : (h, w, 3) uint8 ndarray
            sRGB codes of the result's frame, of `exports.full_texture`.

        Returns
        -------
        MeshResult
            Its texture is a view.
        """
        part = self.place.scaled(texture.shape[1] / self.place.shape[1], texture.shape)
        return replace(self, texture=part.cut(texture), texture_part=part)

    @property
    def needs_normal_map(self) -> bool:
        """Whether the normal map adds detail to the normals of the vertices."""
        smooth = self.options.back is not Back.OPEN or self.cover is not None
        return smooth or self.mesh.tangents is not None

    @property
    def alpha(self) -> np.ndarray | None:
        """The opacity at the size of the base colour, (h, w) uint8; None for an opaque object."""
        return None if self.cover is None else self.cover.alpha(self.texture_part or self.place)

    @property
    def soft_faces(self) -> np.ndarray | None:
        """The triangles (F,) whose opacity is not 1; None where all or none are."""
        if self.cover is None or self.cover.soft is None:
            return None
        row, column = self.vertex_pixel.T
        thin = self.cover.rim(self.place).sheet[row, column]
        faces = thin[self.mesh.faces].any(1)
        return faces if faces.any() and not faces.all() else None

    @property
    def base_color_size(self) -> tuple[int, int]:
        """Width and height of the base colour, of higher resolution if available."""
        height, width = (self.base_color if self.texture is None else self.texture).shape[:2]
        return width, height

    @property
    def base_color_codes(self) -> np.ndarray:
        """The base colour under the gloss in sRGB codes, (h, w, 3) uint8, of higher resolution if
        available.
        """
        layer = None
        if self.coated is not None and self.has_layer:
            layer = self.coated.layer(self.specular * self._largest_variation, self.roughness)
        if self.texture is not None:
            return self.texture if layer is None else layer.codes_under(self.texture)
        color = self.base_color if layer is None else layer.color_under(self.base_color)
        return color_codes(color)

    @property
    def has_layer(self) -> bool:
        """Whether the base colour is that under the gloss."""
        return self.coated is not None and self.specular > 0

    @property
    def _largest_variation(self) -> float:
        variation = self.gloss.variation
        return 1.0 if variation is None else float(variation.max())

    @property
    def specular(self) -> float:
        """The specular level for the base colour, not negative; 0 where unknown."""
        return 0.0 if self.gloss.specular is None else self.reflectance_scale * self.gloss.specular

    @property
    def roughness(self) -> float:
        """The fitted roughness, or that of the options."""
        return self.options.roughness if self.gloss.roughness is None else self.gloss.roughness

    def illumination(self, recovered: np.ndarray) -> np.ndarray:
        """Return the light under which the mesh's texture gives the diffuse image.

        It is `recovered` / k, k the reflectance scale.

        Parameters
        ----------
        recovered : (9, 3) ndarray
            SH coefficients of log shading.

        Returns
        -------
        (9, 3) ndarray
            SH coefficients of log shading.
        """
        light = np.array(recovered, np.float64)
        light[0] -= log(self.reflectance_scale) * sqrt(4 * pi)
        return light

    def glb(self) -> bytes:
        """Return the content of a `.glb` file; equal meshes give equal bytes."""
        extension, pictures = self._specular_extension(first_texture=2)
        material = {
            "name": "recovered",
            "pbrMetallicRoughness": {
                "baseColorTexture": {"index": 0},
                "metallicFactor": self.options.metallic,
                "roughnessFactor": self.roughness,
            },
            "normalTexture": {"index": 1},
            # An open mesh must be visible from behind.
            "doubleSided": self.options.back is Back.OPEN,
            "extensions": {_SPECULAR: extension},
        }
        textures, soft = [self.base_color_png(), self.normal_png()], self.soft_faces
        extra = None
        if soft is not None:
            # Viewers do not sort transparent triangles: all others stay opaque.
            fading = {"name": "soft rim", "doubleSided": True, "alphaMode": "BLEND"}
            extra = ExtraPrimitive(soft, material | fading)
        return encode_glb(self.mesh, material, textures + pictures, extra)

    def base_color_png(self) -> bytes:
        """Return the base colour as the bytes of a PNG, 8-bit sRGB, with the opacity if any."""
        codes, alpha = self.base_color_codes, self.alpha
        return encoded_png(codes if alpha is None else np.dstack([codes, alpha]))

    def normal_png(self) -> bytes:
        """Return the tangent-space normal map as the bytes of a PNG, green upward."""
        return encoded_png(vector_codes(self.detail))

    def _specular_extension(self, first_texture: int) -> tuple[dict[str, Any], list[bytes]]:
        """KHR_materials_specular of the material, and the texture that it refers to, if any."""
        variation, largest = self.gloss.variation, self._largest_variation
        level = self.specular * largest
        extension: dict[str, Any] = {"specularFactor": min(level, 1.0)}
        if level > 1:
            extension["specularColorFactor"] = [level] * 3
        if variation is None:
            return extension, []
        extension["specularTexture"] = {"index": first_texture}
        return extension, [encoded_png(alpha_codes(variation / largest))]

    def describe(self) -> dict[str, Any]:
        """Return the metadata of the mesh, ready for JSON; its origin is in pixels of the frame."""
        left, top = self.place.corner
        return {
            "reflectance_scale": self.reflectance_scale,
            "metres_per_pixel": self.metres_per_pixel,
            "origin": {
                "column": self.origin[0] + left,
                "row": self.origin[1] + top,
                "height": self.origin[2],
            },
            "stride": self.stride,
            "base_color": "k * reflectance" + (" under the gloss" if self.has_layer else ""),
            "vertices": len(self.mesh.vertices),
            "faces": len(self.mesh.faces),
            "roughness": {
                "value": self.roughness,
                "source": self.gloss.roughness_source,
            },
            "specular": {
                "value": self.specular,
                "source": self.gloss.specular_source,
                "texture": self.gloss.variation is not None,
                "convention": "factor of the reflectance along the normal, 1 is .04; "
                "KHR_materials_specular",
            },
            "metallic": {"value": self.options.metallic, "source": SpecularSource.NOT_FITTED},
        }
