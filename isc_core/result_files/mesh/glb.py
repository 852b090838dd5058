"""Binary glTF 2.0: one textured triangle mesh and its material as the bytes of a `.glb` file.

Layout: a header of 12 bytes; the JSON tree; one buffer with the arrays and pictures in sequence. An
accessor gives an array's type, a buffer view its offset. Both chunks and the buffer's parts begin
at multiples of 4 bytes.

No mesh library is used, because its import takes longer than writing a result.

Reference: Khronos Group (2021), glTF 2.0 specification,
https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html, sections 3.6 and 4.4.

Limits: one mesh of triangles with normals and texture coordinates; no animation, no cameras.
"""

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

_VERSION = 2
_TRIANGLES = 4
_FLOAT, _UNSIGNED = 5126, 5125  # componentType
_VERTICES, _INDICES = 34962, 34963  # target of a buffer view
_ALIGNMENT = 4


@dataclass(frozen=True, eq=False)
class TexturedMesh:
    """A triangle mesh with texture coordinates.

    Attributes
    ----------
    vertices : (V, 3) float64 ndarray
        Metres, +Y up.
    faces : (F, 3) int64 ndarray
        Vertices of each triangle, counter-clockwise seen from its front.
    vertex_normals : (V, 3) float64 ndarray
        Unit vectors.
    uv : (V, 2) float64 ndarray
        Texture coordinates in [0, 1]; v starts at the bottom of the texture.
    tangents : (V, 3) float64 ndarray or None
        Unit vectors along the normal map's first axis; its second one is normal x tangent. None if
        the map is flat.
    """

    vertices: np.ndarray
    faces: np.ndarray
    vertex_normals: np.ndarray
    uv: np.ndarray
    tangents: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class ExtraPrimitive:
    """A second primitive: a part of a mesh with another material.

    Attributes
    ----------
    faces : (F,) bool ndarray
        Its triangles; neither none nor all.
    material : mapping
        A glTF material.
    """

    faces: np.ndarray
    material: Mapping[str, Any]


def encode_glb(
    mesh: TexturedMesh,
    material: Mapping[str, Any],
    pictures: Sequence[bytes],
    extra: ExtraPrimitive | None = None,
) -> bytes:
    """Encode a mesh; equal arguments give equal bytes.

    Parameters
    ----------
    mesh : TexturedMesh
    material : mapping
        A glTF material. Texture n is picture n.
    pictures : sequence of bytes
        PNG files, at least one.
    extra : ExtraPrimitive, optional
        A second primitive over the same vertices.

    Returns
    -------
    bytes
        The content of a `.glb` file.
    """
    arrays = {
        # In glTF v starts at the top.
        "TEXCOORD_0": np.stack([mesh.uv[:, 0], 1 - mesh.uv[:, 1]], -1).astype("<f4"),
        "POSITION": mesh.vertices.astype("<f4"),
        "NORMAL": mesh.vertex_normals.astype("<f4"),
    }
    if mesh.tangents is not None:  # the fourth number is the sign of the bitangent
        arrays["TANGENT"] = np.pad(mesh.tangents, [(0, 0), (0, 1)], constant_values=1).astype("<f4")
    parts = [mesh.faces] if extra is None else [mesh.faces[~extra.faces], mesh.faces[extra.faces]]
    indices = [part.astype("<u4").reshape(-1) for part in parts]
    stored = [*indices, *arrays.values()]
    blocks = [*(values.tobytes() for values in stored), *pictures]
    targets = [*[_INDICES] * len(parts), *[_VERTICES] * len(arrays), *[None] * len(pictures)]
    views, buffer = _joined(blocks, targets)
    first_array, first_picture = len(parts), len(stored)
    tree: dict[str, Any] = {
        "asset": {"version": f"{_VERSION}.0", "generator": "ISC"},
        "extensionsUsed": list(material.get("extensions", {})),
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "object", "mesh": 0}],
        "meshes": [
            {
                "name": "object",
                "primitives": [
                    {
                        "attributes": {name: first_array + n for n, name in enumerate(arrays)},
                        "indices": part,
                        "material": part,
                        "mode": _TRIANGLES,
                    }
                    for part in range(len(parts))
                ],
            }
        ],
        "materials": [material] if extra is None else [material, extra.material],
        "textures": [{"source": n} for n in range(len(pictures))],
        "images": [
            {"bufferView": first_picture + n, "mimeType": "image/png"} for n in range(len(pictures))
        ],
        "accessors": [_accessor(n, values) for n, values in enumerate(stored)],
        "bufferViews": views,
        "buffers": [{"byteLength": len(buffer)}],
    }
    if not tree["extensionsUsed"]:
        del tree["extensionsUsed"]  # glTF does not allow empty lists
    return _container(tree, buffer)


def _accessor(view: int, values: np.ndarray) -> dict[str, Any]:
    columns = values.reshape(len(values), -1)
    return {
        "bufferView": view,
        "componentType": _FLOAT if values.dtype.kind == "f" else _UNSIGNED,
        "type": "SCALAR" if values.ndim == 1 else f"VEC{values.shape[1]}",
        "count": len(values),
        "min": columns.min(axis=0).tolist(),
        "max": columns.max(axis=0).tolist(),
    }


def _joined(
    blocks: Sequence[bytes], targets: Sequence[int | None]
) -> tuple[list[dict[str, Any]], bytes]:
    """The buffer views of consecutive blocks, and the buffer."""
    views, buffer = [], bytearray()
    for block, target in zip(blocks, targets, strict=True):
        buffer += _padding(len(buffer), b"\0")
        view = {"buffer": 0, "byteOffset": len(buffer), "byteLength": len(block)}
        views.append(view if target is None else view | {"target": target})
        buffer += block
    return views, bytes(buffer)


def _container(tree: Mapping[str, Any], buffer: bytes) -> bytes:
    text = json.dumps(tree, separators=(",", ":"), allow_nan=False).encode()
    chunks = b"".join(
        [*_chunk(b"JSON", text, filling=b" "), *_chunk(b"BIN\0", buffer, filling=b"\0")]
    )
    return struct.pack("<4sII", b"glTF", _VERSION, 12 + len(chunks)) + chunks


def _chunk(kind: bytes, content: bytes, filling: bytes) -> tuple[bytes, bytes, bytes]:
    padding = _padding(len(content), filling)
    return struct.pack("<I4s", len(content) + len(padding), kind), content, padding


def _padding(length: int, filling: bytes) -> bytes:
    return filling * (-length % _ALIGNMENT)
