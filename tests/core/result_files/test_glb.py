"""Files of binary glTF, read according to the specification and by another program."""

import io
import json
import struct
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from isc_core.result_files.mesh.glb import TexturedMesh, encode_glb

MESH = TexturedMesh(
    np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.5]]),
    np.array([[0, 1, 2], [1, 3, 2]]),
    np.tile([0.0, 0, 1], (4, 1)),
    np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]]),
)
MATERIAL = {"name": "paint", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
GLOSS = {"extensions": {"KHR_materials_specular": {"specularFactor": 0.5}}}


def png(size: int) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(np.arange(3 * size * size, dtype=np.uint8).reshape(size, size, 3)).save(
        stream, format="png"
    )
    return stream.getvalue()


def parts(blob: bytes) -> tuple[dict[str, Any], bytes]:
    """The JSON tree and the buffer of a file, whose header and chunks must be consistent."""
    magic, version, total = struct.unpack_from("<4sII", blob)
    assert (magic, version, total) == (b"glTF", 2, len(blob))
    length, kind = struct.unpack_from("<I4s", blob, 12)
    assert kind == b"JSON" and length % 4 == 0
    tree = json.loads(blob[20 : 20 + length])
    size, kind = struct.unpack_from("<I4s", blob, 20 + length)
    assert kind == b"BIN\0" and size % 4 == 0 and 28 + length + size == total
    assert 0 <= size - tree["buffers"][0]["byteLength"] < 4
    return tree, blob[28 + length :]


def test_another_program_reads_what_was_written() -> None:
    scene = trimesh.load(
        io.BytesIO(encode_glb(MESH, MATERIAL, [png(5)])), file_type="glb", process=False
    )
    (read,) = scene.geometry.values()
    np.testing.assert_array_equal(read.vertices, MESH.vertices)
    np.testing.assert_array_equal(read.faces, MESH.faces)
    np.testing.assert_array_equal(read.vertex_normals, MESH.vertex_normals)
    np.testing.assert_array_equal(read.visual.uv, MESH.uv)
    assert read.visual.material.name == "paint"
    assert read.visual.material.baseColorTexture.size == (5, 5)


@pytest.mark.parametrize("sizes", [(1,), (2, 3), (4, 5, 6)])
def test_views_are_aligned_and_accessors_describe_them(sizes: tuple[int, ...]) -> None:
    pictures = [png(size) for size in sizes]
    tree, buffer = parts(encode_glb(MESH, MATERIAL, pictures))
    assert all(view["byteOffset"] % 4 == 0 for view in tree["bufferViews"])
    contents = [
        buffer[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        for view in tree["bufferViews"]
    ]
    assert [contents[image["bufferView"]] for image in tree["images"]] == pictures
    for accessor in tree["accessors"]:
        kind = {5126: "<f4", 5125: "<u4"}[accessor["componentType"]]
        values = np.frombuffer(contents[accessor["bufferView"]], kind)
        values = values.reshape(accessor["count"], -1)
        assert values.shape[1] == {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[accessor["type"]]
        assert accessor["min"] == values.min(axis=0).tolist()
        assert accessor["max"] == values.max(axis=0).tolist()


def test_extensions_are_listed_only_if_there_are_any() -> None:
    assert "extensionsUsed" not in parts(encode_glb(MESH, MATERIAL, [png(1)]))[0]
    used = parts(encode_glb(MESH, MATERIAL | GLOSS, [png(1)]))[0]["extensionsUsed"]
    assert used == ["KHR_materials_specular"]
