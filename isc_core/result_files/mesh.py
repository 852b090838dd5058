"""A textured mesh of the visible side of the object, as glTF 2.0 binary.

Problem: a height map over a mask, with its normals and reflectance, is to become an object in any
viewer, under the recovered light, that looks like the photo.

Geometry: vertices at pixel centres, one cell of two triangles where all pixels of the cell lie
inside the mask. If that exceeds the number of triangles asked for, large triangles replace small
ones where the surface is smooth (see `triangulation`); the silhouette keeps its pixels. Where the
silhouette alone has too many, the grid takes every second pixel, every fourth and so on. World axes
are those of glTF: +X right, +Y up, +Z toward the viewer, metres; the origin is the middle of the
bounding box. Before a camera, vertices are on the rays of their pixels (see
`shading.perspective`), and a pixel has its size at their mean distance.

Normals: those of vertices are the recovered ones; in a mesh of fewer triangles, their mean over the
triangles of a vertex, weighted by its barycentric coordinate. The tangent-space normal map (green
up) holds the recovered normal of each pixel relative to the interpolated one. It is flat for a mesh
with a vertex at each pixel. The tangent is the direction in which the texture's column grows.

Rim: the true slope of a smooth object is infinite at its silhouette, so the outermost heights of a
reconstruction are the least certain and may spike. From the inside out, a height in the last `rim`
rings of pixels may differ from its neighbours further inside by no more than 1.5 times what these
differ from theirs, plus half a pixel; a sphere keeps its shape under this rule. Then the outermost
ring is averaged along itself over 5 x 5 pixels: the silhouette follows the steps of the pixel grid,
and on a steep rim each step of one pixel sideways would be a tooth of many pixels in depth.

Base colour: k * reflectance, with k such that the 99.5th percentile of the reflectance's largest
channel becomes 0.9; the matching light is the recovered one divided by k, that is log shading - log
k. Beyond the mask the texture repeats the nearest colour inside, so that filtering draws no dark
fringe. Textures of files have the base colour under the gloss of the same file, see
`lobe_fitting.specular_layer`; `MeshResult.base_color` is that without gloss.

Gloss: roughness and specular level are given (see `lobe_fitting.specular_upper_bound`), the level
times k, as the base colour is. A level up to 1, and its variation over the object in a texture's
alpha, are KHR_materials_specular's factor; the excess above 1 is its colour. Where no level is
known the factor is 0: without the extension the file would look as glossy as plastic.

Reference: Khronos Group (2021), glTF 2.0 specification,
https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html, section 3.9.

Back: an open mesh is one sheet with steps of one cell along the silhouette; `solids` closes it,
with a smooth outline. Where the object's cover of the pixels is known, the outline of all meshes
follows that, and where the rim is soft, the material has an opacity (see `object_cover`).

Limits: reflectances above 1/k are
clipped (at most 0.5 % of the pixels). Programs that compute tangents by themselves interpolate them
along the triangles: their normals differ by the square of what the surface turns within one.
"""

from dataclasses import dataclass, field
from math import log, pi, sqrt
from typing import Any

import numpy as np
from scipy import ndimage

from ..errors import InputError
from ..imaging.bounding_box import mask_slices
from ..imaging.row_blocks import row_blocks
from ..imaging.srgb import srgb_codes
from ..io.png import encode_png
from ..lobe_fitting.specular_layer import CoatedSurface
from ..lobe_fitting.specular_level import SpecularFit, SpecularSource
from ..photo.camera import Camera
from ..shading.lights import VIEW
from ..shading.perspective import lifted_points, object_axis, view_directions
from .glb import TexturedMesh, Veil, encode_glb
from .mesh_options import MeshOptions
from .object_cover import ObjectCover
from .solids.back import Back
from .solids.rim import Rim
from .solids.surface import heights_seen, make_solid, placed
from .triangulation.adaptive_triangles import Triangulation, adaptive_triangles
from .triangulation.renumbering import renumbered
from .triangulation.vertex_normals import (
    detail_normals,
    directions_at,
    facing,
    flat_normals,
    mean_normals,
)

_SPECULAR = "KHR_materials_specular"
_BRIGHT = 0.9  # linear base colour of the 99.5th percentile of the reflectance
_FADING = 0.01  # of the object's longer side: as wide a dark border may be a fading outline
_AS_BRIGHT = 0.8  # of what lies within
_ROWS = 256  # coded at once
_COMPRESSION = 4  # of 9: half of the time of 6 for a fiftieth more bytes


@dataclass(frozen=True)
class MeshResult:
    """A mesh with its material and how it relates to the maps.

    Attributes
    ----------
    mesh : TexturedMesh
        In metres, +Y up, facing +Z.
    reflectance_scale : float
        k: base colour = k * reflectance.
    metres_per_pixel : float
        Of the maps.
    origin : tuple of float
        (column, row, height), in pixels, of the world's origin; before a camera the height counts
        from the mean distance.
    stride : int
        Least number of pixels from vertex to vertex.
    vertex_pixel : (V, 2) ndarray
        Row and column of each vertex.
    base_color : (H, W, 3) ndarray
        Linear, k * reflectance, continued beyond the mask; without gloss above.
    detail : (H, W, 3) ndarray
        Unit vectors of the normal map in tangent space.
    options : MeshOptions
    gloss : SpecularFit
    camera : Camera or None
        Of the maps; None for an orthographic view.
    eye : (3,) ndarray or None
        The camera's place in metres.
    texture : (h, w, 3) uint8 ndarray or None
        Finer base colour in sRGB codes, over the same frame.
    cover : ObjectCover or None
        That the outline follows; None for the steps of the pixels.
    coated : CoatedSurface or None
        What the base colour under the gloss follows from; None leaves it as it is.
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
    cover: ObjectCover | None = None
    coated: CoatedSurface | None = None

    @property
    def bumpy(self) -> bool:
        """Whether the normal map holds more than the normals of the vertices."""
        smooth = self.options.back is not Back.OPEN or self.cover is not None
        return smooth or self.mesh.tangents is not None

    @property
    def alpha(self) -> np.ndarray | None:
        """The opacity at the size of the base colour, (h, w) uint8; None for an opaque object."""
        width, height = self.base_color_size
        return None if self.cover is None else self.cover.alpha((height, width))

    @property
    def soft_faces(self) -> np.ndarray | None:
        """The triangles (F,) whose opacity is not 1; None where all or none are."""
        if self.cover is None or self.cover.soft is None:
            return None
        row, column = self.vertex_pixel.T
        thin = Rim(self.cover.share, self.cover.soft).sheet[row, column]
        faces = thin[self.mesh.faces].any(1)
        return faces if faces.any() and not faces.all() else None

    @property
    def base_color_size(self) -> tuple[int, int]:
        """Width and height of the base colour: the finer one where there is one."""
        height, width = (self.base_color if self.texture is None else self.texture).shape[:2]
        return width, height

    @property
    def base_color_codes(self) -> np.ndarray:
        """The base colour under the gloss in sRGB codes, (h, w, 3) uint8: the finer one where there
        is one.
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
        """Whether the base colour is one under gloss."""
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
        """Return the light that gives the diffuse image with the mesh's texture.

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
            # An open mesh should stay visible from behind.
            "doubleSided": self.options.back is Back.OPEN,
            "extensions": {_SPECULAR: extension},
        }
        textures, soft = [self.base_color_png(), self.normal_png()], self.soft_faces
        veil = None
        if soft is not None:
            # Viewers draw transparent triangles in any order: the rest stays opaque.
            fading = {"name": "soft rim", "doubleSided": True, "alphaMode": "BLEND"}
            veil = Veil(soft, material | fading)
        return encode_glb(self.mesh, material, textures + pictures, veil)

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
        return extension, [encoded_png(_alpha_codes(variation / largest))]

    def describe(self) -> dict[str, Any]:
        """Return what a reader needs beside the file, ready for JSON."""
        return {
            "reflectance_scale": self.reflectance_scale,
            "metres_per_pixel": self.metres_per_pixel,
            "origin": {"column": self.origin[0], "row": self.origin[1], "height": self.origin[2]},
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


def build_mesh(
    height: np.ndarray,
    normal: np.ndarray,
    mask: np.ndarray,
    reflectance: np.ndarray,
    options: MeshOptions | None = None,
    gloss: SpecularFit | None = None,
    camera: Camera | None = None,
    cover: ObjectCover | None = None,
) -> MeshResult:
    """Build the mesh of the pixels inside the mask.

    Parameters
    ----------
    height : (H, W) ndarray
        Pixels, toward the viewer.
    normal : (H, W, 3) ndarray
        Unit vectors, camera frame.
    mask : (H, W) bool ndarray
    reflectance : (H, W, 3) ndarray
        Linear, not negative.
    options : MeshOptions, optional
    gloss : optional
        Gloss of the surface; where unknown, the default roughness and no gloss.
    camera : Camera, optional
        Of the maps; orthographic by default.
    cover : ObjectCover, optional
        An outline to follow; by default the mesh ends in the steps of the mask's pixels, or, with
        a back, halfway between them.

    Returns
    -------
    MeshResult

    Raises
    ------
    InputError
        If the mask holds no block of 2 x 2 pixels, or a size in the options is not positive.
    """
    options, gloss = options or MeshOptions(), gloss or SpecularFit()
    _check_inputs(height, normal, mask, reflectance, options)
    limited = limit_rim(height, mask, options.rim)
    if options.back is Back.OPEN and cover is None:
        shape = _open_sheet(limited, normal, mask, options, camera)
    else:
        rim = Rim(mask) if cover is None else Rim(cover.share, cover.soft)
        shape = _outlined(limited, normal, mask, rim, options, camera)
    pixels = shape.places
    middle = (pixels.min(0) + pixels.max(0)) / 2
    size = options.metres_per_pixel or options.longest_side / max(mask[mask_slices(mask)].shape)
    color, k = base_color(reflectance, mask, options.bleed)
    mesh = TexturedMesh(
        (pixels - middle) * size,
        shape.faces,
        shape.normals.astype(np.float64),
        shape.uv,
        shape.tangents,
    )
    origin = (float(middle[0]), float(-middle[1]), float(middle[2]))
    if camera is not None:
        origin = _seen_origin(middle, camera)
    return MeshResult(
        mesh,
        k,
        float(size),
        origin,
        shape.stride,
        shape.vertex_pixel,
        color,
        shape.detail,
        options,
        gloss,
        camera,
        None if camera is None else -middle * size,
        cover=cover,
    )


@dataclass(frozen=True)
class _Shape:
    """A mesh in pixels.

    `places` and `normals` (V, 3), camera frame, the pinhole at the origin, if any; `faces` (F, 3);
    `uv` (V, 2); `tangents` (V, 3) or None; `vertex_pixel` (V, 2); `detail` (H, W, 3).
    """

    places: np.ndarray
    normals: np.ndarray
    faces: np.ndarray
    uv: np.ndarray
    tangents: np.ndarray | None
    vertex_pixel: np.ndarray
    detail: np.ndarray
    stride: int = 1


def _open_sheet(
    height: np.ndarray,
    normal: np.ndarray,
    mask: np.ndarray,
    options: MeshOptions,
    camera: Camera | None,
) -> _Shape:
    view = VIEW if camera is None else view_directions(camera, (mask.shape[0], mask.shape[1]))
    stride, grid, fewer = _triangulated(height, normal, mask, view, options.triangles)
    vertex_pixel = grid.vertices * stride
    row, column = vertex_pixel.T
    if fewer:
        smooth = mean_normals(grid, stride, normal, view)
        detail, tangents = detail_normals(grid, stride, normal, smooth, view)
    else:
        smooth = facing(normal[row, column].astype(np.float32), directions_at(view, row, column))
        detail, tangents = flat_normals(mask.shape), None
    if camera is None:
        places = np.stack([column, -row, height[row, column]], -1).astype(np.float64)
    else:
        points = lifted_points(height, camera, object_axis(camera, mask))[row, column]
        places = points * (camera.focal_length / -points[:, 2].mean())
    uv = np.stack([(column + 0.5) / mask.shape[1], 1 - (row + 0.5) / mask.shape[0]], -1)
    return _Shape(places, smooth, grid.faces, uv, tangents, vertex_pixel, detail, stride)


def _outlined(
    height: np.ndarray,
    normal: np.ndarray,
    mask: np.ndarray,
    rim: Rim,
    options: MeshOptions,
    camera: Camera | None,
) -> _Shape:
    """Without tangents: they would change their sign where the texture folds (see `solids`)."""
    view = VIEW if camera is None else view_directions(camera, (mask.shape[0], mask.shape[1]))
    seen, sides = heights_seen(height, mask, camera), 1 if options.back is Back.OPEN else 2
    solid = make_solid(seen, normal, mask, rim, view, options.back, options.triangles // sides)
    places = placed(solid.mesh, camera)
    mesh, normals = solid.mesh, solid.normals(places)
    return _Shape(places, normals, mesh.faces, solid.uv(), None, mesh.pixels, solid.detail)


def _seen_origin(middle: np.ndarray, camera: Camera) -> tuple[float, float, float]:
    """Column and row at which a place before the camera is seen, and its height before the focal
    plane; in pixels.
    """
    (x, y), focal = camera.principal_point, camera.focal_length
    right, up = middle[:2] * (focal / -middle[2])
    return float(x - 0.5 + right), float(y - 0.5 - up), float(focal + middle[2])


def base_color(reflectance: np.ndarray, mask: np.ndarray, bleed: int) -> tuple[np.ndarray, float]:
    """Return the texture and its scale.

    Parameters
    ----------
    reflectance : (H, W, 3) ndarray
    mask : (H, W) bool ndarray
    bleed : int
        Pixels by which it continues beyond the mask; further out it is the mean colour, which the
        smallest mipmaps should fade to.

    Returns
    -------
    color : (H, W, 3) ndarray
        k * reflectance, linear.
    k : float
    """
    bright = float(np.percentile(reflectance[mask].max(-1).astype(np.float64), 99.5))
    k = _BRIGHT / bright if bright > 0 else 1.0
    mean = reflectance[mask].mean(0, dtype=np.float64)
    depth = _depth_near(mask, 2 * _widest_fading(mask) + 3)
    rings = dark_rings(reflectance, depth)
    inner = depth > rings
    near, source = nearest_inside(inner, bleed + rings)
    color = np.where(inner[..., None], reflectance, mean)
    color.reshape(-1, 3)[near] = reflectance.reshape(-1, 3)[source]
    color *= k
    return color, k


def _widest_fading(inside: np.ndarray) -> int:
    """Pixels of a border that may be the fading outline of an object."""
    return max(1, round(_FADING * max(inside[mask_slices(inside)].shape)))


def _depth_near(mask: np.ndarray, reach: int) -> np.ndarray:
    """The distance (H, W) of a mask's pixels from its outside, exact up to `reach`, larger from
    there on; 0 outside.
    """
    depth = np.full(mask.shape, np.inf, np.float32)
    for block in row_blocks(mask.shape, reach):
        near = mask[block.wide]
        if not near.all():
            depth[block.rows] = ndimage.distance_transform_edt(near)[block.own]
    return depth


def dark_rings(reflectance: np.ndarray, depth: np.ndarray) -> int:
    """Count the outermost rings of a mask that show a black background rather than the object.

    A soft outline before black fades over several pixels, which a mask may include; the sides of
    the mesh would stretch them to a black band. A darker border that is wider is paint.

    Parameters
    ----------
    reflectance : (H, W, 3) ndarray
    depth : (H, W) ndarray
        Distance of the mask's pixels from its outside; 0 outside.

    Returns
    -------
    int
        Pixels; 0 where the border is as bright as what lies within.
    """
    most = _widest_fading(depth > 0)

    def light(above: int, most: int) -> np.ndarray:
        between = (depth > above) & (depth <= most)
        return np.asarray(reflectance[between].mean(axis=-1, dtype=np.float64))

    within = light(most + 1, 2 * most + 2)
    if not within.size:
        return 0
    enough = _AS_BRIGHT * float(np.median(within))
    for rings in range(most + 1):
        if float(np.median(light(rings, rings + 1))) >= enough:
            return rings
    return 0


def nearest_inside(mask: np.ndarray, distance: int) -> tuple[np.ndarray, np.ndarray]:
    """Find the nearest pixels of a mask to those around it.

    Parameters
    ----------
    mask : (H, W) bool ndarray
    distance : int
        Largest distance in pixels.

    Returns
    -------
    near : (N,) ndarray
        Flat indices of the pixels outside the mask within that distance.
    source : (N,) ndarray
        Of the nearest pixel inside to each.
    """
    width, found = mask.shape[1], [np.zeros((2, 0), np.int64)]
    for block in row_blocks(mask.shape, distance):
        inside, first = mask[block.wide], block.wide.start
        if not inside.any():
            continue
        away, (rows, columns) = ndimage.distance_transform_edt(~inside, return_indices=True)
        near = ~inside & (away <= distance)
        near[: block.own.start] = near[block.own.stop :] = False
        row, column = np.nonzero(near)
        source = (rows[near].astype(np.int64) + first) * width + columns[near]
        found.append(np.stack([(row + first) * width + column, source]))
    near, source = np.concatenate(found, axis=1)
    return near, source


def limit_rim(height: np.ndarray, mask: np.ndarray, rings: int) -> np.ndarray:
    """Limit the heights of the outermost rings by extrapolation from the inside (see the module).

    Parameters
    ----------
    height : (H, W) ndarray
    mask : (H, W) bool ndarray
    rings : int

    Returns
    -------
    (H, W) float64 ndarray
    """
    depth = ndimage.distance_transform_cdt(np.pad(mask, 1), "chessboard")[1:-1, 1:-1]
    depth = np.minimum(depth, rings + 2).astype(np.int16)  # 1 in the outermost ring
    limited = np.where(mask, height, 0.0).astype(np.float64, copy=False)
    step = np.zeros(mask.shape, np.float64)
    for ring in range(rings + 1, 0, -1):
        at = np.nonzero(depth == ring)
        base, weight = _neighbour_mean(limited, depth > ring, at)
        at, base = tuple(part[weight > 0] for part in at), base[weight > 0]
        if ring <= rings:
            slack = 1.5 * _neighbour_mean(step, depth > ring, at)[0] + 0.5
            limited[at] = np.clip(limited[at], base - slack, base + slack)
        step[at] = np.abs(limited[at] - base)
    if rings > 0:
        outermost = depth == 1
        at = np.nonzero(outermost)
        limited[at] = _neighbour_mean(limited, outermost, at, 5)[0]
    return limited


def _neighbour_mean(
    values: np.ndarray, valid: np.ndarray, at: tuple[np.ndarray, ...], size: int = 3
) -> tuple[np.ndarray, np.ndarray]:
    """Mean of the valid pixels in the `size` x `size` neighbourhood of pixels `at`, and their
    number, each (n,).
    """
    total = np.where(valid, values, 0.0)
    ndimage.uniform_filter(total, size, output=total, mode="constant")
    weight = ndimage.uniform_filter(valid.astype(np.float32), size, mode="constant")
    count = np.rint(weight[at].astype(np.float64) * size**2)
    return total[at] * size**2 / np.maximum(count, 1), count


def _check_inputs(
    height: np.ndarray,
    normal: np.ndarray,
    mask: np.ndarray,
    reflectance: np.ndarray,
    options: MeshOptions,
) -> None:
    for name, values in (("height", height), ("normal", normal), ("reflectance", reflectance)):
        if values.shape[:2] != mask.shape:
            raise InputError(
                f"the {name} map is {values.shape[:2]}, the mask {mask.shape}: use maps of one size"
            )
        if not np.isfinite(values[mask]).all():
            raise InputError(
                f"the {name} map has NaN or infinite values inside the mask: repair it or "
                "exclude them from the mask"
            )
    if not (
        options.longest_side > 0
        and (options.metres_per_pixel is None or options.metres_per_pixel > 0)
    ):
        raise InputError("the mesh's longest side and metres per pixel must be positive")
    if options.triangles < 0:
        raise InputError("the mesh's number of triangles cannot be negative: 0 keeps every pixel")


def _triangulated(
    height: np.ndarray, normal: np.ndarray, mask: np.ndarray, view: np.ndarray, budget: int
) -> tuple[int, Triangulation, bool]:
    """The stride of the grid, its triangles, and whether they are fewer than two a cell.

    They are at most `budget` (0: as many as there are), unless the object is too thin for the cells
    of a larger stride.
    """
    cells = _cells_inside(mask, 1)
    if not cells.any():
        raise InputError(
            "the mask has no block of 2 x 2 pixels to build a mesh from: mark a larger region or "
            "use a larger photo"
        )
    if not budget or 2 * np.count_nonzero(cells) <= budget:
        return 1, _full_grid(cells), False
    cosine, stride = np.empty(mask.shape, np.float32), 1
    for block in row_blocks(mask.shape):
        toward = view if view.ndim == 1 else view[block.rows]
        cosine[block.rows] = (normal[block.rows] * toward).sum(axis=-1)
    while True:
        thin = height if stride == 1 else height[::stride, ::stride] / stride
        thinned = thin, cells, cosine[::stride, ::stride]
        if (found := adaptive_triangles(*thinned, budget)) is not None:
            return stride, found, True
        coarser = _cells_inside(mask, 2 * stride)
        if not coarser.any():
            found = adaptive_triangles(*thinned, 0)
            assert found is not None
            return stride, found, True
        stride, cells = 2 * stride, coarser


def _cells_inside(mask: np.ndarray, stride: int) -> np.ndarray:
    size = stride + 1
    inside = ndimage.minimum_filter(
        mask.astype(np.uint8), size, mode="constant", origin=-(size // 2)
    ).astype(bool)
    return inside[: mask.shape[0] - stride : stride, : mask.shape[1] - stride : stride]


def _full_grid(cells: np.ndarray) -> Triangulation:
    """Two triangles for each cell, split from its top left to its bottom right."""
    width = cells.shape[1] + 1
    row, column = np.nonzero(cells)
    top_left = row * width + column
    top_right, bottom_left, bottom_right = top_left + 1, top_left + width, top_left + width + 1
    lower = np.stack([top_left, bottom_left, bottom_right], -1)
    upper = np.stack([top_left, bottom_right, top_right], -1)
    used, faces = renumbered(np.stack([lower, upper], 1))
    return Triangulation(np.stack(np.divmod(used, width), -1), faces.reshape(-1, 3))


def color_codes(linear: np.ndarray) -> np.ndarray:
    """Return linear colours as 8-bit sRGB codes.

    Parameters
    ----------
    linear : (H, W, 3) ndarray

    Returns
    -------
    (H, W, 3) uint8 ndarray
    """
    codes = np.empty(linear.shape, np.uint8)
    for top in range(0, len(linear), _ROWS):  # so that no large array is made for a step
        part = linear[top : top + _ROWS]
        codes[top : top + _ROWS] = srgb_codes(part)
    return codes


def vector_codes(vectors: np.ndarray) -> np.ndarray:
    """Return unit vectors as 8-bit codes, (n + 1) / 2.

    Parameters
    ----------
    vectors : (H, W, 3) ndarray

    Returns
    -------
    (H, W, 3) uint8 ndarray
    """
    codes = np.empty(vectors.shape, np.uint8)
    for top in range(0, len(vectors), _ROWS):
        part = vectors[top : top + _ROWS]
        codes[top : top + _ROWS] = np.rint(np.clip(part * 127.5 + 127.5, 0, 255))
    return codes


def _alpha_codes(values: np.ndarray) -> np.ndarray:
    """(H, W) in [0, 1] as the alpha of white pixels, (H, W, 4)."""
    pixels = np.full((*values.shape, 4), 255, np.uint8)
    pixels[..., 3] = np.rint(255 * np.clip(values, 0, 1))
    return pixels


def encoded_png(pixels: np.ndarray) -> bytes:
    """Return pixels as the bytes of a PNG.

    Parameters
    ----------
    pixels : (H, W), (H, W, 3) or (H, W, 4) uint8 ndarray

    Returns
    -------
    bytes
    """
    return encode_png(pixels, _COMPRESSION)
