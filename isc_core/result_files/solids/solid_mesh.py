"""A solid mesh from the height map of its visible side: a smooth outline, a rounded rim, a back.

Problem: a photo shows one side. The height map of that side ends in the steps of its pixels, and
half of the shape is missing.

Model: u is a membrane over the inside of the outline, lap u = -4 and u = 0 around, so that sqrt(u)
is the height of a sphere over a disc; near the outline, u follows it between the pixels (see
`cross_section`). At the rim, where the surface turns away from the viewer, the last visible height
z and the outline differ by sqrt(u) in depth:

    rim = z - ROUND sqrt(u),   continued inward by a membrane m without load.

Heights of the last two pixels before the outline are at most rim + ROUND sqrt(u): seen from the
side, the steps of the outermost pixels would be teeth.

The height of the back at a pixel is

    flat       the furthest rim less a share of the size, with a wall
    rounded    m - FULLNESS sqrt(u)
    mirrored   m - (z - m)

and at least `_LEAST` sqrt(u) behind the front, so that the two meet only at the outline. Both are
graphs over the same triangles and do not intersect, also with a pinhole camera, along whose rays
the back lies. The texture of a rounded back is folded at the outline (see `texture_places`), that
of the others is the texture of the pixel in front. Where the rim is soft, the closed part ends at
its core, beyond which there is only the sheet (see `rim`). There the back has vertices of its own,
at the places of the front's, because it needs other normals.

Citation: the membrane as inflation: P. Joshi and N. A. Carr, "Repousse: automatic inflation of 2D
artwork", SBIM 2008, doi:10.2312/SBM/SBM08/049-055; outlines as the boundary of a smooth body: T.
Igarashi, S. Matsuoka and H. Tanaka, "Teddy", SIGGRAPH 1999, doi:10.1145/311535.311602.

Limits: the back is a guess. Parts that occlude others are connected to them: a depth discontinuity
inside the outline becomes a slope. Cuts along it were tried, see the research log ("Depth edges").
"""

from dataclasses import dataclass

import numpy as np

from ...filters.morphology import dilated, eroded
from ..triangulation.adaptive_triangles import Triangulation
from ..triangulation.renumbering import renumbered
from .back import Back
from .cross_section import cross_section, outline_weights, with_subpixel_outline
from .membrane import membrane
from .outline import Outlined, outlined, smooth_cover
from .rim import Rim
from .smoothing import smoothed_within
from .texture_places import folded_positions

ROUND, FULLNESS = 1.0, 1.0
_LEAST = 0.2
_SMOOTH = 6  # passes over the depth of the rim
_BEHIND = 0.02  # of the longer side
_SIDES = (-1, 0, 1)
_STEP = 1e3  # pixels of height between core and sheet, for small triangles there


@dataclass(frozen=True, eq=False)
class SolidMesh:
    """Front, rim and back of an object, as a mesh over the pixels.

    Attributes
    ----------
    places : (V, 2) float64 ndarray
        Row and column of each vertex.
    heights : (V,) float64 ndarray
        Pixels toward the viewer.
    pixels : (V, 2) int64 ndarray
        Row and column of the nearest pixel inside.
    faces : (F, 3) int64 ndarray
        Counter-clockwise from outside.
    front : (V,) bool ndarray
        Vertices at visible pixels; not those of the outline.
    visible : Triangulation
        The triangles between these vertices, which come first.
    texture : (V, 2) float64 ndarray
        Row and column of the texture at each vertex.
    """

    places: np.ndarray
    heights: np.ndarray
    pixels: np.ndarray
    faces: np.ndarray
    front: np.ndarray
    visible: Triangulation
    texture: np.ndarray


def make_solid_mesh(
    height: np.ndarray,
    cosine: np.ndarray,
    mask: np.ndarray,
    rim: Rim,
    back: Back,
    triangles: int,
) -> SolidMesh:
    """Build the mesh of an object from its height map.

    Parameters
    ----------
    height : (H, W) ndarray
        Pixels toward the viewer, inside the mask.
    cosine : (H, W) ndarray
        Of the angle between normal and view.
    mask : (H, W) bool ndarray
        Where heights are known.
    rim : Rim
    back : Back
    triangles : int
        Largest number on the visible side, if its outline allows, and half of the largest number of
        a closed mesh; 0 for two at each pixel.

    Returns
    -------
    SolidMesh
        Closed except for `Back.OPEN` and the sheets of a soft rim.

    Raises
    ------
    InputError
        If no block of 2 x 2 pixels lies inside.
    """
    smooth, thin = smooth_cover(rim.outline), rim.sheet
    inside = smooth > 0.5
    core = inside & ~thin
    known = continued(np.where(mask, height, 0.0).astype(np.float64), mask, inside)
    wall = back is Back.FLAT  # two triangles at each edge, half of them from the visible side's
    sheet = outlined(smooth, known + _STEP * thin, cosine, triangles, with_wall=wall)
    # Of a pixel's neighbours around: zero half a pixel beyond the outline on average.
    around = dilated(core, square=True) & ~core
    u = np.maximum(membrane(core, around, np.zeros_like(known), 4.0), 0)
    section = cross_section(u)
    u = with_subpixel_outline(u, smooth, section)
    round_height = np.sqrt(u)
    known, last = _rolled_off(
        known, round_height, inside, np.where(core, outline_weights(smooth), 0)
    )
    rows, columns = sheet.pixels.T
    heights = known[rows, columns]
    heights[sheet.inner :] = last[rows, columns][sheet.inner :]
    front = np.arange(len(heights)) < sheet.inner
    if back is Back.OPEN:
        visible = sheet.pixel_triangles
        return SolidMesh(
            sheet.places, heights, sheet.pixels, sheet.faces, front, visible, sheet.places
        )
    closed = _core_faces(sheet, thin)
    if back is Back.FLAT:
        return _used(_walled(sheet, closed, heights, front, mask))
    edge = dilated(around, square=True) & core
    middle = membrane(core & ~edge, edge, last, 0.0)
    middle = np.where(edge, last, middle)
    depth = FULLNESS * round_height if back is Back.ROUNDED else known - middle
    seam = _seam(sheet, closed, core.shape)
    behind = np.where(seam, known, np.minimum(middle - depth, known - _LEAST * round_height))
    mesh = _used(_joined(sheet, closed, heights, behind, front))
    if back is Back.MIRRORED:
        return mesh
    rows, columns = mesh.pixels.T
    hidden = ~mesh.front & core[rows, columns]
    outline = ((np.arange(len(hidden)) < len(front)) | seam[rows, columns])[hidden]
    mesh.texture[hidden] = folded_positions(
        u, section, mesh.places[hidden], mesh.pixels[hidden], outline
    )
    return mesh


def _rolled_off(
    known: np.ndarray, round_height: np.ndarray, inside: np.ndarray, near: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The heights (H, W), limited toward the outline, and the depth of the rim.

    Without the limit, the outermost pixels would be teeth, because their distances to the outline
    vary from pixel to pixel.
    """
    last = np.where(inside, known - ROUND * round_height, 0.0)
    (last,) = smoothed_within((last,), eroded(inside), _SMOOTH)
    last[~inside] = 0.0
    return known + near * np.minimum(last + ROUND * round_height - known, 0), last


def continued(height: np.ndarray, mask: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Extend heights from the mask to the pixels inside, ring by ring.

    Each pixel of a ring is the mean of its known neighbours.

    Parameters
    ----------
    height : (H, W) or (H, W, C) ndarray
    mask, inside : (H, W) bool ndarray

    Returns
    -------
    ndarray
        Of the shape and type of `height`.
    """
    padded, more = (mask.shape[0] + 2, mask.shape[1] + 2), height.shape[2:]
    found, known = np.zeros((*padded, *more), height.dtype), np.pad(mask, 1)
    found[1:-1, 1:-1] = height
    frame, missing = np.pad(np.ones_like(mask), 1), np.pad(inside & ~mask, 1)
    ring, left = (
        np.flatnonzero(np.pad(dilated(mask, square=True) & ~mask, 1)),
        np.count_nonzero(missing),
    )
    values = found.reshape(-1, *more)
    known, frame, missing = known.ravel(), frame.ravel(), missing.ravel()
    around = np.add.outer(_SIDES, np.multiply(_SIDES, padded[1])).ravel()
    while left and ring.size:
        beside = ring[:, None] + around
        weight = known[beside].reshape(-1, 9, *(1,) * len(more))
        parts = (values[beside] * weight).reshape(-1, 3, 3, *more)
        values[ring] = parts.sum(2).sum(1) / weight.sum(1)
        known[ring] = True
        left -= np.count_nonzero(missing[ring])
        near = np.unique(beside)
        ring = near[frame[near] & ~known[near]]
    return found[1:-1, 1:-1]


def _core_faces(sheet: Outlined, thin: np.ndarray) -> np.ndarray:
    """Which triangles (F,) of the sheet have a back: those between pixels of the core.

    A triangle whose corners all belong to the single sheet, too, has none, because its back would
    be the same triangle.
    """
    alone = thin[sheet.pixels[:, 0], sheet.pixels[:, 1]][sheet.faces].any(1)
    if not alone.any():
        return ~alone
    common = np.arange(len(sheet.pixels)) >= sheet.inner
    common[sheet.faces[alone]] = True
    return ~alone & ~common[sheet.faces].all(1)


def _seam(sheet: Outlined, closed: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Pixels (H, W) with a vertex where the back meets the single sheet."""
    found = np.zeros(shape, bool)
    around = sheet.faces[~closed].ravel()
    rows, columns = sheet.pixels[around[around < sheet.inner]].T
    found[rows, columns] = True
    return found


def _joined(
    sheet: Outlined, closed: np.ndarray, heights: np.ndarray, behind: np.ndarray, front: np.ndarray
) -> SolidMesh:
    """The sheet and the back, which share the points of a hard outline."""
    n, inner = len(heights), sheet.inner
    rows, columns = sheet.pixels[:inner].T
    other = np.where(sheet.faces < inner, sheet.faces + n, sheet.faces)[closed, ::-1]
    return SolidMesh(
        np.concatenate([sheet.places, sheet.places[:inner]]),
        np.concatenate([heights, behind[rows, columns]]),
        np.concatenate([sheet.pixels, sheet.pixels[:inner]]),
        np.concatenate([sheet.faces, other]),
        np.concatenate([front, np.zeros(inner, bool)]),
        sheet.pixel_triangles,
        np.concatenate([sheet.places, sheet.places[:inner]]),
    )


def _used(mesh: SolidMesh) -> SolidMesh:
    """The mesh without unused vertices."""
    kept, faces = renumbered(mesh.faces)
    if len(kept) == len(mesh.places):
        return mesh
    vertices = (mesh.places, mesh.heights, mesh.pixels, mesh.front, mesh.texture)
    places, heights, pixels, front, texture = (values[kept] for values in vertices)
    return SolidMesh(places, heights, pixels, faces, front, mesh.visible, texture)


def _walled(
    sheet: Outlined, closed: np.ndarray, heights: np.ndarray, front: np.ndarray, mask: np.ndarray
) -> SolidMesh:
    """The sheet, a plane behind it, and a wall of two triangles at each edge of the outline."""
    n = len(heights)
    size = (np.ptp(np.argwhere(mask), axis=0) + 1).max()
    shut = sheet.faces[closed]
    edges = shut[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    rim = edges[~np.isin(edges @ (n, 1), edges[:, ::-1] @ (n, 1))]
    wall = np.concatenate(
        [
            np.stack([rim[:, 1], rim[:, 0], rim[:, 0] + n], -1),
            np.stack([rim[:, 1], rim[:, 0] + n, rim[:, 1] + n], -1),
        ]
    )
    return SolidMesh(
        np.concatenate([sheet.places, sheet.places]),
        np.concatenate([heights, np.full(n, heights.min() - _BEHIND * size)]),
        np.concatenate([sheet.pixels, sheet.pixels]),
        np.concatenate([sheet.faces, shut[:, ::-1] + n, wall]),
        np.concatenate([front, np.zeros(n, bool)]),
        sheet.pixel_triangles,
        np.concatenate([sheet.places, sheet.places]),
    )
