"""Building a mesh of the visible side of the object, or a solid, from the maps of a result.

Problem: convert a height map over a mask, with normals and reflectance, to an object that looks
like the photo in any viewer under the recovered light.

Geometry: vertices at pixel centres, one cell of two triangles where all pixels of the cell lie
inside the mask. If that exceeds the requested number of triangles, large triangles replace small
ones where the surface is smooth (see `triangulation`); the silhouette keeps its pixels. Where the
silhouette alone has too many, the grid takes every second pixel, every fourth and so on; an outline
between the pixels and a closed mesh keep all of theirs, and have more triangles then. World axes
are those of glTF: +X right, +Y up, +Z toward the viewer, metres; the origin is the centre of the
bounding box. With a perspective camera, vertices are on the rays of their pixels (see
`shading.perspective`), and the size of a pixel is that at their mean distance.

Normals: vertices have the recovered normals, or in a mesh of fewer triangles their mean over the
triangles of a vertex, weighted by its barycentric coordinate. The tangent-space normal map (green
up) stores the recovered normal of each pixel relative to the interpolated one. It is flat for a
mesh with a vertex at each pixel. The tangent is the direction of increasing texture columns.

Back: an open mesh is a single sheet with steps of one cell along the silhouette; `solids` closes
it, with a smooth outline. Where the coverage of pixels is known, the outlines of all meshes follow
it, and where the rim is soft, the material has an opacity (see `object_cover`).

Limits: programs that compute their own tangents interpolate them over triangles; their normals
differ by an error quadratic in the change of the normal within a triangle.
"""

from dataclasses import dataclass

import numpy as np

from ...errors import InputError
from ...imaging.bounding_box import FramePart, mask_slices
from ...photo.camera import Camera
from ...shading.lights import VIEW
from ...shading.perspective import lifted_points, object_axis, view_directions
from ..solids.back import Back
from ..solids.rim import Rim
from ..solids.surface import make_solid, vertex_positions, view_heights
from ..triangulation.adaptive_triangles import Triangulation, adaptive_triangles
from ..triangulation.renumbering import renumbered
from ..triangulation.vertex_normals import (
    detail_normals,
    directions_at,
    facing,
    flat_normals,
    mean_normals,
    view_cosine,
)
from .base_color import base_color
from .glb import TexturedMesh
from .object_cover import ObjectCover
from .options import MeshOptions
from .result import MeshResult
from .rim_heights import limit_rim


def build_mesh(
    height: np.ndarray,
    normal: np.ndarray,
    mask: np.ndarray,
    reflectance: np.ndarray,
    options: MeshOptions | None = None,
    camera: Camera | None = None,
    cover: ObjectCover | None = None,
    part: FramePart | None = None,
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
    camera : Camera, optional
        Of the maps; orthographic by default.
    cover : ObjectCover, optional
        The mesh follows its outline; by default it ends in the steps of the mask's pixels, or, with
        a back, halfway between them.
    part : FramePart, optional
        The part of the frame of `cover` that the maps are of; by default all of it.

    Returns
    -------
    MeshResult

    Raises
    ------
    InputError
        If the mask has no block of 2 x 2 pixels, or a size in the options is not positive.
    """
    options = options or MeshOptions()
    _check_inputs(height, normal, mask, reflectance, options)
    limited = limit_rim(height, mask, options.rim)
    if options.back is Back.OPEN and cover is None:
        shape = _open_sheet(limited, normal, mask, options, camera)
    else:
        place = part or FramePart.whole((mask.shape[0], mask.shape[1]))
        rim = Rim(mask) if cover is None else cover.rim(place)
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
        camera=camera,
        eye=None if camera is None else -middle * size,
        cover=cover,
        part=part,
    )


@dataclass(frozen=True, eq=False)
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
    """The mesh without tangents, whose sign would change where the texture is folded (see
    `solids`).
    """
    view = VIEW if camera is None else view_directions(camera, (mask.shape[0], mask.shape[1]))
    seen, budget = view_heights(height, mask, camera), options.triangles
    if budget and options.back is not Back.OPEN:
        budget = max(1, budget // 2)
    solid = make_solid(seen, normal, mask, rim, view, options.back, budget)
    places = vertex_positions(solid.mesh, camera)
    mesh, normals = solid.mesh, solid.normals(places)
    return _Shape(places, normals, mesh.faces, solid.uv(), None, mesh.pixels, solid.detail)


def _seen_origin(middle: np.ndarray, camera: Camera) -> tuple[float, float, float]:
    """Column and row of the projection of a point, and its height above the mean depth; pixels."""
    (x, y), focal = camera.principal_point, camera.focal_length
    right, up = middle[:2] * (focal / -middle[2])
    return float(x - 0.5 + right), float(y - 0.5 - up), float(focal + middle[2])


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
    """The stride of the grid, its triangles, and whether there are fewer than two per cell.

    There are at most `budget` (0: unlimited), unless the object is too thin for cells of a larger
    stride.
    """
    cells = _all_of_four(mask, 1)
    if not cells.any():
        raise InputError(
            "the mask has no block of 2 x 2 pixels to build a mesh from: mark a larger region or "
            "use a larger photo"
        )
    if not budget or 2 * np.count_nonzero(cells) <= budget:
        return 1, _full_grid(cells), False
    cosine, stride = view_cosine(normal, view), 1
    while True:
        thin = height if stride == 1 else height[::stride, ::stride] / stride
        thinned = thin, cells, cosine[::stride, ::stride]
        if (found := adaptive_triangles(*thinned, budget)) is not None:
            return stride, found, True
        coarser = _all_of_four(cells, 2)
        if not coarser.any():
            found = adaptive_triangles(*thinned, 0)
            assert found is not None
            return stride, found, True
        stride, cells = 2 * stride, coarser


def _all_of_four(flags: np.ndarray, step: int) -> np.ndarray:
    """Which 2 x 2 blocks of `flags`, `step` apart, are set."""
    rows = flags[:-1:step] & flags[1::step]
    return rows[:, :-1:step] & rows[:, 1::step]


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
