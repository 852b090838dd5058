"""Sound meshes: a closed tetrahedron and a cube with colours, in the formats that meshes come in."""

import functools
import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from isc_core.result_files.mesh import build_mesh
from synth.shapes.mesh_file import read_mesh_file

from .case import Case, Target
from .pictures import ball, saved

_GLTF_WORDS = (
    b'"accessors"',
    b'"bufferViews"',
    b'"byteLength"',
    b'"componentType": 5126',
    b'"count"',
    b'"type": "MAT4"',
    b'"uri": "../x"',
    b'"uri": "data:;base64,AAAA"',
    b'"sparse"',
    b'"children": [0]',
    b'"nodes"',
    b'"matrix"',
    b'"indices"',
    b'"POSITION"',
    b"1e999",
    b"null",
    b"-1",
    b'"mode": 4',
    b"[]",
    b"{}",
    b'"extensions"',
    b'"KHR_draco_mesh_compression"',
)
_OBJ_WORDS = (
    b"v 0 0 0\n",
    b"f 1 2 3\n",
    b"f -1 -2 -3\n",
    b"vt 0 0\n",
    b"mtllib ../x.mtl\n",
    b"usemtl a\n",
    b"g a\n",
    b"o b\n",
    b"f 1//1 2//2",
    b"nan",
    b"inf",
    b"\\\n",
    b"map_Kd x.png\n",
    b"newmtl a\n",
    b"Kd 1 2\n",
    b"f 99999999999 1 2\n",
)
_PLY_WORDS = (
    b"ply\n",
    b"format ascii 1.0\n",
    b"format binary_little_endian 1.0\n",
    b"format binary_big_endian 1.0\n",
    b"element vertex 999999999\n",
    b"element face -1\n",
    b"property list uchar int vertex_indices\n",
    b"property float x\n",
    b"property list int float x\n",
    b"end_header\n",
    b"comment TextureFile x.png\n",
    b"property double nx\n",
    b"property uchar red\n",
)
_STL_WORDS = (
    b"solid a\n",
    b"facet normal 0 0 1\n",
    b"outer loop\n",
    b"vertex 1 2 3\n",
    b"endloop\n",
    b"endfacet\n",
    b"endsolid\n",
    b"vertex nan",
)


def _read(path: Path) -> object:
    return read_mesh_file(path, texture_size=32)  # the usual texture takes most of the time


def _solid(colours: bool = False) -> trimesh.Trimesh:
    box = trimesh.creation.box()
    if colours:
        box.visual.vertex_colors = np.tile([[200, 100, 50, 255]], (8, 1))
    return box


def _textured() -> trimesh.Trimesh:
    """A cube with a picture on it."""
    from PIL import Image

    box = _solid()
    uv = np.random.default_rng(0).random((len(box.vertices), 2))
    box.visual = trimesh.visual.TextureVisuals(uv, image=Image.open(io.BytesIO(saved("png"))))
    return box


def _exported(mesh: trimesh.Trimesh, kind: str, **options: Any) -> bytes:
    data = mesh.export(file_type=kind, **options)
    return data.encode() if isinstance(data, str) else bytes(data)


def glb(tree: bytes, content: bytes) -> bytes:
    """The binary glTF file of a JSON text and its buffer: lengths as they have to be."""
    tree, content = (
        part + fill * (-len(part) % 4) for part, fill in ((tree, b" "), (content, b"\0"))
    )
    chunks = (
        struct.pack("<II", len(tree), 0x4E4F534A)
        + tree
        + struct.pack("<II", len(content), 0x004E4942)
        + content
    )
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


def _glb_parts(data: bytes) -> tuple[bytes, bytes]:
    (length,) = struct.unpack_from("<I", data, 12)
    return data[20 : 20 + length], data[28 + length :]


def _with_buffer(content: bytes, tree: bytes) -> bytes:
    return glb(tree, content)


def _glb() -> tuple[Case, ...]:
    ours = build_mesh(
        12 * ball()[..., 0],
        np.tile([0.0, 0, 1], (24, 20, 1)),
        ball().max(2) > 0,
        ball().astype(np.float32),
    ).glb()
    cases = []
    for data in (
        _exported(_solid(), "glb"),
        _exported(_textured(), "glb"),
        _exported(_solid(colours=True), "glb"),
        ours,
    ):
        tree, content = _glb_parts(data)
        cases += [
            Case("a.glb", data, _read),
            *[Case("a.glb", tree, _read, functools.partial(_with_buffer, content))] * 2,
        ]
        cases += [Case("a.glb", content, _read, functools.partial(glb, tree))]
    tree, content = _glb_parts(_exported(_textured(), "glb"))
    described = json.loads(tree)
    described["buffers"][0]["uri"] = "a.bin"
    return (
        *cases,
        Case("a.gltf", json.dumps(described).encode(), _read, beside={"a.bin": content}),
    )


def _obj() -> tuple[Case, ...]:
    plain, material = _exported(_solid(), "obj"), b"newmtl a\nKd 0.5 0.4 0.3\nmap_Kd a.png\n"
    wavy = b"mtllib a.mtl\nusemtl a\n" + plain.replace(b"f ", b"vt 0.1 0.2\nf ", 1)
    beside = {"a.mtl": material, "a.png": saved("png")}
    return (
        Case("a.obj", plain, _read),
        Case("a.obj", _exported(_solid(colours=True), "obj"), _read),
        Case("a.obj", wavy, _read, beside=beside),
        Case(
            "a.mtl",
            material,
            lambda path: _read(path.with_name("a.obj")),
            beside={"a.obj": wavy, "a.png": beside["a.png"]},
        ),
        Case(
            "a.png",
            beside["a.png"],
            lambda path: _read(path.with_name("a.obj")),
            beside={"a.obj": wavy, "a.mtl": material},
        ),
    )


def _ply() -> tuple[Case, ...]:
    kinds = [
        (_solid(colours), encoding) for colours in (False, True) for encoding in ("ascii", "binary")
    ]
    return tuple(
        Case("a.ply", _exported(mesh, "ply", encoding=encoding), _read) for mesh, encoding in kinds
    )


def _stl() -> tuple[Case, ...]:
    return tuple(Case("a.stl", _exported(_solid(), kind), _read) for kind in ("stl", "stl_ascii"))


def _off() -> tuple[Case, ...]:
    return (Case("a.off", _exported(_solid(), "off"), _read),)


MESHES = (
    Target("glb", _glb, _GLTF_WORDS),
    Target("obj", _obj, _OBJ_WORDS),
    Target("ply", _ply, _PLY_WORDS),
    Target("stl", _stl, _STL_WORDS),
    Target(
        "off", _off, (b"OFF\n", b"8 12 0\n", b"3 0 1 2\n", b"COFF", b"nan", b"-1", b"99999999999 ")
    ),
)
