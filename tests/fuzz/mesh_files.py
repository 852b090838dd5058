"""Sound meshes: a cube, plain, coloured and textured, and one of ours, in every mesh format."""

import functools
import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from isc_core.result_files.mesh.build import build_mesh
from synth.shapes.mesh_file import read_mesh_file
from tests.fuzz.case import Case, Target, words
from tests.fuzz.pictures import ball, saved

_GLTF_WORDS = words(
    b'"accessors"~"bufferViews"~"byteLength"~"componentType": 5126~"count"~"type": "MAT4"~'
    b'"uri": "../x"~"uri": "data:;base64,AAAA"~"sparse"~"children": [0]~"nodes"~"matrix"~'
    b'"indices"~"POSITION"~1e999~null~-1~"mode": 4~[]~{}~"extensions"~'
    b'"KHR_draco_mesh_compression"'
)
_OBJ_WORDS = words(
    b"v 0 0 0\n~f 1 2 3\n~f -1 -2 -3\n~vt 0 0\n~mtllib ../x.mtl\n~usemtl a\n~g a\n~o b\n~"
    b"f 1//1 2//2~nan~inf~\\\n~map_Kd x.png\n~newmtl a\n~Kd 1 2\n~f 99999999999 1 2\n"
)
_PLY_WORDS = words(
    b"ply\n~format ascii 1.0\n~format binary_little_endian 1.0\n~"
    b"format binary_big_endian 1.0\n~element vertex 999999999\n~element face -1\n~"
    b"property list uchar int vertex_indices\n~property float x\n~"
    b"property list int float x\n~end_header\n~comment TextureFile x.png\n~"
    b"property double nx\n~property uchar red\n"
)
_STL_WORDS = words(
    b"solid a\n~facet normal 0 0 1\n~outer loop\n~vertex 1 2 3\n~endloop\n~endfacet\n~"
    b"endsolid\n~vertex nan"
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
    height, up = 12 * ball()[..., 0], np.tile([0.0, 0, 1], (24, 20, 1))
    ours = build_mesh(height, up, ball().max(2) > 0, ball().astype(np.float32)).glb()
    cubes = (_solid(), _textured(), _solid(colours=True))
    cases = []
    for data in (*(_exported(cube, "glb") for cube in cubes), ours):
        tree, content = _glb_parts(data)
        text = Case("a.glb", tree, _read, functools.partial(_with_buffer, content))
        buffer = Case("a.glb", content, _read, functools.partial(glb, tree))
        cases += [Case("a.glb", data, _read), text, text, buffer]
    tree, content = _glb_parts(_exported(_textured(), "glb"))
    described = json.loads(tree)
    described["buffers"][0]["uri"] = "a.bin"
    text = Case("a.gltf", json.dumps(described).encode(), _read, beside={"a.bin": content})
    return (*cases, text)


def _beside_obj(path: Path) -> object:
    return _read(path.with_name("a.obj"))


def _obj() -> tuple[Case, ...]:
    plain, material = _exported(_solid(), "obj"), b"newmtl a\nKd 0.5 0.4 0.3\nmap_Kd a.png\n"
    textured = b"mtllib a.mtl\nusemtl a\n" + plain.replace(b"f ", b"vt 0.1 0.2\nf ", 1)
    picture = saved("png")
    return (
        Case("a.obj", plain, _read),
        Case("a.obj", _exported(_solid(colours=True), "obj"), _read),
        Case("a.obj", textured, _read, beside={"a.mtl": material, "a.png": picture}),
        Case("a.mtl", material, _beside_obj, beside={"a.obj": textured, "a.png": picture}),
        Case("a.png", picture, _beside_obj, beside={"a.obj": textured, "a.mtl": material}),
    )


def _ply() -> tuple[Case, ...]:
    kinds = [(colours, encoding) for colours in (False, True) for encoding in ("ascii", "binary")]
    files = [_exported(_solid(colours), "ply", encoding=encoding) for colours, encoding in kinds]
    return tuple(Case("a.ply", data, _read) for data in files)


def _stl() -> tuple[Case, ...]:
    return tuple(Case("a.stl", _exported(_solid(), kind), _read) for kind in ("stl", "stl_ascii"))


def _off() -> tuple[Case, ...]:
    return (Case("a.off", _exported(_solid(), "off"), _read),)


MESHES = (
    Target("glb", _glb, _GLTF_WORDS),
    Target("obj", _obj, _OBJ_WORDS),
    Target("ply", _ply, _PLY_WORDS),
    Target("stl", _stl, _STL_WORDS),
    Target("off", _off, words(b"OFF\n~8 12 0\n~3 0 1 2\n~COFF~nan~-1~99999999999 ")),
)
