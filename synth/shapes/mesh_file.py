"""A user's mesh and its colours, from a file that trimesh reads.

Equation: vertices at the same position are merged; face corners around it are smooth together where
adjacent faces meet at less than `CREASE`; the normal is the sum over such a group of the face
normals, each weighted by the face's angle there. Colours that are not a single texture within
[0, 1] are projected onto one, as seen from the front.

Citation: M. Dawson-Haggerty et al., trimesh (2019), https://trimesh.org; glTF 2.0 (ISO/IEC
12113:2022) for the meaning of its colours.

Limits: the file's own normals, transparency and other maps are ignored. The frame is kept: y must
be up, +z toward the viewer, as in glTF. Only files in the mesh's own folder, or below it, are
opened.
"""

import io
import json
import math
import os
import struct
import zlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from scipy.ndimage import distance_transform_edt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from isc_core.errors import InputError
from isc_core.imaging.srgb import srgb_to_linear
from isc_core.io.decoders.jpeg import check_scans
from isc_core.io.limits import DEFAULT_LIMITS
from isc_core.io.memory import is_exhausted, memory_error
from isc_core.io.native_io import suppress_native_output
from isc_core.io.regular_files import read_regular

from ..scene.materials import texture_at
from ..scene.meshes import Mesh
from .texture_coordinates import from_the_front

KINDS = ("glb", "gltf", "obj", "off", "ply", "stl")
CREASE = 40.0  # degrees between the normals of neighbouring faces; above it their edge is sharp
MOST_FACES = 3_000_000
_MOST_BYTES = 1 << 29
_MOST_NUMBERS = 4 * MOST_FACES  # entries of all tables of a glTF file
_LOADING = 20  # bytes of memory a byte of a file, at most
_PICTURES = ("PNG", "JPEG", "BMP", "TIFF", "WEBP", "TGA")  # of textures; others may run programs
_DEEPEST, _FARTHEST = 10_000, 1e6  # relative to the width; of texture coordinates
_UNREADABLE = "model.gltf"  # what trimesh requests where a glTF file is not JSON
_NO_COLOUR = (102, 102, 102)  # trimesh's default for a material without colour
TEXTURE_SIZE = 768  # side of a projected texture, texels
# A damaged file can make a loader fail in any of these ways.
_ERRORS = (
    OSError,
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    NameError,
    ArithmeticError,
    NotImplementedError,
    EOFError,
    AssertionError,
    SyntaxError,
    ImportError,
    RecursionError,
    MemoryError,
    struct.error,
    zlib.error,
    Image.DecompressionBombError,
)


@dataclass(frozen=True, eq=False)
class MeshFile:
    """A mesh with its texture.

    Attributes
    ----------
    mesh : Mesh
        Centred, its larger x or y extent 2.
    albedo : (h, w, 3) ndarray or None
        Texture for its `uv`, linear Rec.709 in [0, 1]; None if the file has no colours.
    """

    mesh: Mesh
    albedo: np.ndarray | None


@dataclass(frozen=True, eq=False)
class _Part:
    """One part of a file: `vertices` (N, 3), `faces` (M, 3), `uv` (N, 2) as in `Mesh` or None,
    `texture` (h, w, 3) or None, `colours` (N, 3) or None; linear.
    """

    vertices: np.ndarray
    faces: np.ndarray
    uv: np.ndarray | None
    texture: np.ndarray | None
    colours: np.ndarray | None


class _Beside:
    """Access to the files referenced by a mesh file: only those in its own folder and below.

    Records the references that could not be resolved.
    """

    def __init__(self, path: Path) -> None:
        self.folder = path.resolve().parent
        self.missing: list[str] = []
        self.outside: list[str] = []
        self.given: list[str] = []

    def get(self, name: str) -> bytes:
        """Return the bytes of a file; `FileNotFoundError` if it is missing or elsewhere."""
        name = str(name).strip().replace("\\", "/")
        place = Path(os.path.realpath(self.folder / name))  # raises for no loop of links
        if name == _UNREADABLE:
            raise FileNotFoundError(name)
        if not place.is_relative_to(self.folder):
            self.outside.append(name)
        elif not place.is_file():
            self.missing.append(name)
        else:
            self.given.append(name)
            return place.read_bytes()
        raise FileNotFoundError(name)

    __getitem__ = get


def read_mesh(path: str | Path) -> Mesh:
    """Return only the mesh of `read_mesh_file`.

    Parameters
    ----------
    path : Path or str
        A file of one of `KINDS`.

    Returns
    -------
    Mesh
        The mesh.

    Raises
    ------
    InputError
        As `read_mesh_file`.
    """
    return read_mesh_file(path).mesh


def read_mesh_file(path: str | Path, texture_size: int = TEXTURE_SIZE) -> MeshFile:
    """Read a closed mesh and its base colour.

    Parameters
    ----------
    path : Path or str
        A file of one of `KINDS`.
    texture_size : int, optional
        Side of a texture that has to be made for the mesh, in texels.

    Returns
    -------
    MeshFile
        The mesh.

    Raises
    ------
    InputError
        If the file is missing, unreadable, empty, huge, or refers to a file that is missing or
        outside its folder; if the mesh is open, inconsistently oriented, without volume, or has
        vertices that are not finite.
    """
    path = Path(path)
    parts = _read_parts(path)
    vertices = np.concatenate([part.vertices for part in parts])
    starts = np.cumsum([0] + [len(part.vertices) for part in parts])
    faces = np.concatenate(
        [part.faces + start for part, start in zip(parts, starts[:-1], strict=True)]
    )
    vertices, faces, place = _sound(path, vertices, faces)
    corners, normals = _smooth_corners(vertices, faces, place)
    lone = parts[0] if len(parts) == 1 else None
    if lone is not None and lone.uv is not None and _within(lone.uv):
        uv, albedo = np.clip(lone.uv, 0, 1), lone.texture
    else:
        uv = from_the_front(vertices)
        albedo = _projected(parts, vertices, uv, texture_size)
        faces = np.unique(place, return_index=True)[1][
            place[faces]
        ]  # vertices at one position share their coordinates now
    # One vertex of the mesh per vertex of the file and smooth group around it.
    groups = len(normals)
    keys, number = np.unique(faces.ravel() * groups + corners, return_inverse=True)
    source, group = keys // groups, keys % groups
    mesh = Mesh(vertices[source], normals[group], uv[source], number.reshape(-1, 3))
    return MeshFile(mesh, albedo)


def _read_parts(path: Path) -> list[_Part]:
    import trimesh

    kind = path.suffix.lower().lstrip(".")
    if kind not in KINDS:
        raise InputError(f"{path}: meshes are read from {', '.join(KINDS)} files")
    if not path.exists():
        raise InputError(f"{path} does not exist")
    if path.stat().st_size > _MOST_BYTES:
        raise InputError(f"{path} is larger than {_MOST_BYTES >> 20} MiB: simplify the mesh")
    beside, data = _Beside(path), read_regular(path, None, "use a mesh")
    try:
        if kind in ("glb", "gltf"):
            _check_claims(path, data)
        with suppress_native_output():
            loaded = trimesh.load(
                io.BytesIO(data), file_type=kind, resolver=beside, force="scene", process=False
            )
            parts = [
                part
                for name in loaded.graph.nodes_geometry
                for part in [_part(loaded, name, kind)]
                if part is not None
            ]
    except InputError:
        raise
    except _ERRORS as error:
        if is_exhausted(error):
            needed = _LOADING * len(data)
            raise memory_error(f"{path}: its triangles", needed, "simplify the mesh") from error
        _check_references(path, beside)
        raise InputError(
            f"{path} is not a readable {kind.upper()} file: export the mesh again"
        ) from error
    _check_references(path, beside)
    if not parts:
        raise InputError(f"{path} has no triangles: export the object as a mesh")
    for name in tuple(beside.given):
        if Path(name).suffix.lower() not in (".mtl", ".bin") and not _is_image(beside.get(name)):
            raise InputError(
                f"{path}: its texture {name} is not a readable image: save it again as PNG"
            )
    if (
        kind == "obj" and not beside.given
    ):  # trimesh adds a grey material to an OBJ file without one
        return [replace(part, texture=None) for part in parts]
    return parts


def _check_claims(path: Path, data: bytes) -> None:
    """Check the sizes that a glTF file declares before memory is allocated: accessors without a
    buffer count as zeros.
    """
    text = (
        data[20 : 20 + int.from_bytes(data[12:16], "little")] if data.startswith(b"glTF") else data
    )
    tree = json.loads(text.decode("utf-8", "replace"))
    counts = [accessor["count"] for accessor in tree.get("accessors", [])]
    if any(type(count) is not int or count < 0 for count in counts) or sum(counts) > _MOST_NUMBERS:
        raise InputError(
            f"{path} declares more than {_MOST_NUMBERS} entries or an invalid number: simplify the "
            "mesh or export it again"
        )


def _is_image(data: bytes) -> bool:
    try:
        with suppress_native_output(), Image.open(io.BytesIO(data), formats=_PICTURES) as image:
            DEFAULT_LIMITS.check_pixels("a texture", *image.size)
            if image.format == "JPEG":
                check_scans(data, "a texture")
            image.load()
    except _ERRORS:
        return False
    return True


def _check_references(path: Path, beside: _Beside) -> None:
    if beside.outside:
        raise InputError(
            f"{path} refers to {beside.outside[0]}, which is not in its folder: put a copy beside "
            "the mesh and refer to it"
        )
    if beside.missing:
        raise InputError(
            f"{path} refers to {beside.missing[0]}, which is missing: put it beside the mesh, or "
            "remove the reference"
        )


def _part(scene: Any, node: str, kind: str) -> _Part | None:
    """One part at its position in the scene; None without faces."""
    transform, name = scene.graph[node]
    piece = scene.geometry[name]
    faces = np.asarray(getattr(piece, "faces", np.empty((0, 3))), dtype=np.int64)
    if not len(faces):
        return None
    with np.errstate(
        invalid="ignore", over="ignore"
    ):  # non-finite vertices are rejected later, with a message
        vertices = np.asarray(piece.vertices, float) @ transform[:3, :3].T + transform[:3, 3]
    if np.linalg.det(transform[:3, :3]) < 0:
        faces = faces[:, ::-1]
    uv = getattr(piece.visual, "uv", None)
    # trimesh counts v from the lowest row of a texture, Mesh from the highest.
    uv = (
        None if uv is None or len(uv) != len(vertices) else np.asarray(uv, float) * (1, -1) + (0, 1)
    )
    texture = _texture(getattr(piece.visual, "material", None))
    if texture is not None and uv is None:
        texture = texture if texture.shape[:2] == (1, 1) else None
    return _Part(vertices, faces, uv, texture, _vertex_colours(piece.visual, kind, len(vertices)))


def _texture(material: Any) -> np.ndarray | None:
    """A material's base colour (h, w, 3), linear: its image times its factor, or the factor alone
    as one pixel; None without either.
    """
    image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    factor = getattr(material, "baseColorFactor", None)
    if image is None and factor is None:
        factor = getattr(material, "diffuse", None)
        if factor is None or (np.asarray(factor)[:3] == _NO_COLOUR).all():
            return None
    if image is not None:
        if image.format not in (None, *_PICTURES):  # images made by trimesh have no format
            raise ValueError("a texture of a kind that is not read")
        DEFAULT_LIMITS.check_pixels("a texture", *image.size)
    numbers = np.ones(3) if factor is None else np.asarray(factor)[:3]
    scale = numbers / (255 if numbers.dtype.kind in "iu" else 1)
    if image is None:
        return np.clip(scale, 0, 1).reshape(1, 1, 3)
    return np.clip(srgb_to_linear(np.asarray(image.convert("RGB"), float) / 255) * scale, 0, 1)


def _vertex_colours(visual: Any, kind: str, count: int) -> np.ndarray | None:
    """Colours of the vertices (N, 3), linear; glTF stores them linear, other formats as sRGB."""
    if getattr(visual, "kind", None) not in ("vertex", "face"):
        return None
    colours = np.asarray(visual.vertex_colors, float)[:, :3] / 255
    if len(colours) != count:
        return None
    return colours if kind in ("glb", "gltf") else srgb_to_linear(colours)


def _sound(
    path: Path, vertices: np.ndarray, faces: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices centred and scaled, faces without degenerate ones and oriented outward, and the
    index of each vertex's position.
    """
    if len(faces) > MOST_FACES:
        raise InputError(
            f"{path} has {len(faces)} faces, at most {MOST_FACES} are supported: simplify the mesh"
        )
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError(f"{path}: a face refers to a missing vertex: export the mesh again")
    used = vertices[faces.ravel()]
    if not np.isfinite(used).all():
        raise InputError(f"{path} has vertices that are not finite numbers: remove them")
    low, high = used.min(0), used.max(0)
    with np.errstate(over="ignore"):
        sized = (high - low)[:2].max() > 0 and np.isfinite((high - low) ** 2).all()
    if sized and (high - low)[2] > _DEEPEST * (high - low)[:2].max():
        raise InputError(
            f"{path}: the mesh is over {_DEEPEST} times deeper than wide: use the same scale for "
            "x, y and z"
        )
    if not sized:
        raise InputError(
            f"{path}: the mesh has no size: all vertices lie at one point or on one line toward "
            "the viewer"
        )
    # Vertices that no face uses may lie anywhere: they are clipped to the box of the others.
    vertices = (np.clip(np.nan_to_num(vertices), low, high) - (low + high) / 2) * (
        2 / (high - low)[:2].max()
    )
    place = _places(vertices)
    whole = place[faces]
    faces = faces[
        (whole[:, 0] != whole[:, 1]) & (whole[:, 1] != whole[:, 2]) & (whole[:, 2] != whole[:, 0])
    ]
    _check_closed(path, place[faces])
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    volume = float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6
    if abs(volume) < 1e-9:
        raise InputError(f"{path}: the mesh encloses no volume: add thickness")
    return vertices, faces if volume > 0 else faces[:, ::-1], place


def _places(vertices: np.ndarray) -> np.ndarray:
    """Indices (N,), equal for vertices at the same position, to 1e-7 units."""
    _, place = np.unique(np.rint(vertices * 1e7).astype(np.int64), axis=0, return_inverse=True)
    return place.reshape(-1)


def _check_closed(path: Path, faces: np.ndarray) -> None:
    """Check that every edge has as many faces on one side as on the other."""
    if not len(faces):
        raise InputError(f"{path}: all faces are degenerate: export the mesh again")
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    forward = edges[:, 0] < edges[:, 1]
    key = edges.min(1) * (edges.max() + 1) + edges.max(1)
    _, number, count = np.unique(key, return_inverse=True, return_counts=True)
    unpaired = int((count % 2).sum())
    if unpaired:
        raise InputError(
            f"{path}: the mesh is open, {unpaired} edges have a face on one side only: fill its "
            "holes, or add thickness"
        )
    if np.bincount(number.reshape(-1), np.where(forward, 1, -1)).any():
        raise InputError(
            f"{path}: neighbouring faces have opposite orientations: recalculate the normals so "
            "that all point outward"
        )


def _smooth_corners(
    vertices: np.ndarray, faces: np.ndarray, place: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The smooth group (3 M,) of each corner of the faces in order, and the groups' unit normals
    (G, 3).
    """
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    across = np.cross(b - a, c - a)
    length = np.linalg.norm(across, axis=1)
    facing = across / np.where(length > 0, length, 1)[:, None]
    whole, count = place[faces], len(faces)
    # Half edges: from corner i of a face to its next one; partners run in the opposite direction
    # between the same positions.
    start, end = whole.ravel(), np.roll(whole, -1, 1).ravel()
    corner, after = (
        np.arange(3 * count),
        (np.arange(3 * count) // 3) * 3 + (np.arange(3 * count) % 3 + 1) % 3,
    )
    size = int(whole.max()) + 1
    order = np.argsort(np.minimum(start, end) * size + np.maximum(start, end), kind="stable")
    first, second = order[0::2], order[1::2]
    smooth = (facing[first // 3] * facing[second // 3]).sum(1) > np.cos(np.radians(CREASE))
    # A degenerate face has no normal: it joins its neighbours.
    smooth |= (length[first // 3] == 0) | (length[second // 3] == 0)
    smooth &= start[first] == end[second]
    first, second = first[smooth], second[smooth]
    links = np.concatenate(
        [np.stack([corner[first], after[second]]), np.stack([after[first], corner[second]])], axis=1
    )
    graph = coo_matrix(
        (np.ones(links.shape[1], bool), (links[0], links[1])), shape=(3 * count, 3 * count)
    )
    groups, group = connected_components(graph, directed=False)
    angle = _angles(vertices[faces]).ravel()
    total = np.stack(
        [np.bincount(group, angle * np.repeat(facing[:, i], 3), groups) for i in range(3)], -1
    )
    norm = np.linalg.norm(total, axis=1, keepdims=True)
    return group, np.where(norm > 0, total / np.where(norm > 0, norm, 1), (0.0, 0.0, 1.0))


def _angles(corner: np.ndarray) -> np.ndarray:
    """The angles (M, 3) of triangles (M, 3, 3), radians; 0 where a side has no length."""
    ahead, behind = np.roll(corner, -1, 1) - corner, np.roll(corner, 1, 1) - corner
    return np.arctan2(np.linalg.norm(np.cross(ahead, behind), axis=-1), (ahead * behind).sum(-1))


def _within(uv: np.ndarray) -> bool:
    return bool(np.isfinite(uv).all() and (uv >= -1e-3).all() and (uv <= 1.001).all())


def _projected(
    parts: list[_Part], vertices: np.ndarray, front: np.ndarray, side: int
) -> np.ndarray | None:
    """The colours of all parts on one texture, at the coordinates `front` of the vertices; the
    frontmost part is visible.
    """
    if all(part.texture is None and part.colours is None for part in parts):
        return None
    if len(parts) == 1 and parts[0].texture is not None and parts[0].texture.shape[:2] == (1, 1):
        return parts[0].texture
    texture, depth = np.zeros((side**2, 3)), np.full(side**2, -np.inf)
    start = 0
    for part in parts:
        own = slice(start, start + len(part.vertices))
        _rasterise(part, vertices[own, 2], front[own], texture, depth)
        start += len(part.vertices)
    # Texels that no face covers take the colour of the nearest covered one.
    empty = np.isinf(depth).reshape(side, side)
    row, column = distance_transform_edt(empty, return_distances=False, return_indices=True)
    return texture.reshape(side, side, 3)[row, column]


def _rasterise(
    part: _Part, z: np.ndarray, front: np.ndarray, texture: np.ndarray, depth: np.ndarray
) -> None:
    """Rasterise one part's colours into a texture (h w, 3) where it is in front of the present
    ones, by points spread over its faces.
    """
    side = math.isqrt(len(depth))
    x, y = (part.vertices[part.faces, i] for i in range(2))
    toward = (x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) > (x[:, 2] - x[:, 0]) * (y[:, 1] - y[:, 0])
    shown = part.faces[toward]  # the other faces of a closed mesh are hidden
    place = front[shown] * side
    longest = np.linalg.norm(place - np.roll(place, 1, 1), axis=-1).max(1, initial=0)
    steps = np.ceil(1.25 ** np.ceil(np.log(np.maximum(1.2 * longest, 1)) / np.log(1.25))).astype(
        int
    )
    for step in np.unique(steps):
        i, j = np.nonzero(np.add.outer(np.arange(step + 1), np.arange(step + 1)) <= step)
        weights = np.stack([i, j, step - i - j], -1) / step
        for faces in np.array_split(
            shown[steps == step], max(1, (steps == step).sum() * len(weights) // 2_000_000)
        ):
            cell = np.clip(np.floor(weights @ front[faces] * side).astype(int), 0, side - 1)
            index, near = (
                (cell[..., 1] * side + cell[..., 0]).ravel(),
                (weights @ z[faces][..., None]).ravel(),
            )
            order = np.argsort(near)  # the nearest last: it overwrites the others
            order = order[near[order] >= depth[index[order]]]
            colours = _colours_of(part, faces, weights).reshape(-1, 3)
            depth[index[order]], texture[index[order]] = near[order], colours[order]


def _colours_of(part: _Part, faces: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """The colours (M, P, 3) at the points of faces (M, 3) with barycentric weights (P, 3); middle
    grey for a part without colours.
    """
    if part.colours is not None:
        return weights @ part.colours[faces]
    if part.texture is None:
        return np.full((len(faces), len(weights), 3), 0.5)
    if part.uv is None:
        return np.broadcast_to(part.texture[0, 0], (len(faces), len(weights), 3))
    near = np.where(np.abs(part.uv) < _FARTHEST, part.uv, 0)  # NaN becomes 0 too
    uv = (weights @ near[faces]).reshape(-1, 2)
    return texture_at(part.texture, np.stack([uv[:, 0], np.mod(uv[:, 1], 1)], -1)).reshape(
        len(faces), len(weights), 3
    )
