"""Sound files of numbers and descriptions: MAT, NPZ, JSON, lists of images."""

import functools
import io
import json
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

from blender_addon.files.result_arrays import read_result
from isc_core.batch.item import Recipe
from isc_core.batch.manifest import Manifest
from isc_core.datasets.mit_berkeley import load_natural_lights, load_object
from isc_core.decompose.pipeline import Settings, decompose
from isc_core.networks.layer_network import read_network
from isc_core.networks.light_network import read_lamp_network
from isc_core.networks.scene_classifier import read_appearance
from isc_core.photo import read_photo
from isc_core.result_files.known_inputs import read_light
from isc_core.result_files.result_folder import load, save
from isc_core.scene.lobe_fit import Interval, LobeFit, LobeFitOutcome, LobeLight
from isc_core.separation.support.filter_statistics import read_table
from isc_core.sirfs.priors.prior_file import load_prior_set
from synth.dataset.reading import list_scenes, read_facts, read_truth
from synth.shapes.height_field import read_height
from synth.validation.measurement.bounds import read_bounds

from .case import Case, Target
from .pictures import ball, coded, codes

_DATA = Path(__file__).resolve().parents[2] / "isc_core" / "data"
_MAT_WORDS = (
    b"IM",
    b"MI",
    b"depth",
    b"\x0e\0\0\0",
    b"\x0f\0\0\0",
    b"\x01\0\0\0",
    b"\x09\0\0\0",
    b"\x06\0\0\0\x08\0\0\0",
    b"\x02\0\0\0",
    b"MATLAB 7.3",
    b"diffuse",
    b"\x05\0\0\0\x08\0\0\0",
)
_NPZ_WORDS = (
    b"PK\x01\x02",
    b"PK\x03\x04",
    b"PK\x05\x06",
    b"\x93NUMPY\x01\0",
    b"\x93NUMPY\x02\0",
    b"'descr'",
    b"'|O'",
    b"'<f8'",
    b"'<U9'",
    b"(3, 3)",
    b"()",
    b"True",
    b".npy",
)
_JSON_WORDS = (
    b"null",
    b"true",
    b"[]",
    b"{}",
    b'""',
    b"1e999",
    b"-1",
    b"NaN",
    b'"schema_version": 1',
    b'"scale": 0',
    b'"size": [1, 1]',
    b"[[",
    b'"illumination"',
    b'"brdf"',
    b'"\\u0000"',
    b'"\\ud800"',
    b'"../../x"',
    b'"<script>"',
    b"1" * 400,
    b"\xff\xfe",
)
_LIST_WORDS = (
    b",",
    b'"',
    b"\r\n",
    b"\0",
    b"image",
    b"mask",
    b"name",
    b"options",
    b"../../etc/x",
    b"/x",
    b"s3://a/b",
    b"file:///x",
    b"{}",
    b'{"max_size": -1}',
    b"=1+1",
    b"<script>",
    b"\xff",
    b"\xef\xbb\xbf",
    b"nul",
    b"a" * 300,
    b"http://[",
    b"memory://",
)


# --- MAT ------------------------------------------------------------------------------------------


def matlab(variables: dict[str, Any], *, packed: bool) -> bytes:
    """A MATLAB file of version 5."""
    stream = io.BytesIO()
    scipy.io.savemat(stream, variables, do_compression=packed)
    return stream.getvalue()


def deflated(data: bytes) -> bytes:
    """A MATLAB file whose first element, stored plainly in `data`, is deflated."""
    packed = zlib.compress(data[128:])
    return data[:128] + struct.pack("<II", 15, len(packed)) + packed


def _mat() -> tuple[Case, ...]:
    height = np.where(ball().max(2) > 0, 9 * ball()[..., 0], np.nan)
    lights = {"Ls": np.zeros((9, 3, 2))}
    cases = []
    for values in (
        height,
        (2 * height).astype(np.float32),
        np.nan_to_num(9 * height).astype(np.int16),
    ):
        cases += [
            Case("Z.mat", matlab({"depth": values}, packed=packed), read_height)
            for packed in (False, True)
        ]
        cases += [Case("Z.mat", matlab({"depth": values}, packed=False), read_height, deflated)]
    cases += [
        Case(
            "natural_lights.mat",
            matlab(lights, packed=False),
            lambda path: load_natural_lights(path.parent),
            deflated,
        )
    ]
    beside = _object()
    for name, wraps in (
        ("L.mat", (bytes, deflated)),
        ("Z.mat", (bytes, deflated)),
        ("crop_idx.mat", (bytes,)),
    ):
        path = f"laboratory/nut/{name}"
        own = {other: data for other, data in beside.items() if other != path}
        cases += [Case(path, beside[path], _laboratory, wrap, own) for wrap in wraps]
    return tuple(cases)


def _laboratory(path: Path) -> object:
    return load_object(path.parents[2], "nut", "laboratory")


def _object() -> dict[str, bytes]:
    """The files of one object of the MIT-Berkeley set, by their names below its folder."""
    picture, mask = (
        coded(".png", codes(16)),
        coded(".png", (ball().max(2) > 0).astype(np.uint8) * 255),
    )
    files = {
        "diffuse.png": picture,
        "original.png": picture,
        "reflectance.png": picture,
        "mask.png": mask,
    }
    tables: dict[str, dict[str, Any]] = {
        "Z.mat": {"depth": 9 * ball()[..., 0]},
        "L.mat": {"color_lights": {"diffuse": np.zeros((9, 3)), "name": "x"}},
        "crop_idx.mat": {"crop_idx1": np.arange(2, 20), "crop_idx2": np.arange(3, 18)},
        "shading_corrected_color.mat": {"shading_correct": np.ones((24, 20, 3))},
    }
    files |= {name: matlab(table, packed=False) for name, table in tables.items()}
    return {f"laboratory/nut/{name}": data for name, data in files.items()}


# --- NPZ ------------------------------------------------------------------------------------------


def _archive(members: dict[str, bytes]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return stream.getvalue()


def _repacked(members: dict[str, bytes], name: str, damaged: bytes) -> bytes:
    return _archive({**members, name: damaged})


def _npz_cases(
    name: str, data: bytes, read: Callable[[Path], object], beside: dict[str, bytes] | None = None
) -> list[Case]:
    """The archive damaged as it is, and damaged in one of its members."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {member: archive.read(member) for member in archive.namelist()}
    inner = [
        Case(name, content, read, functools.partial(_repacked, members, member), beside or {})
        for member, content in members.items()
        if len(content) < 1 << 15
    ]
    return [Case(name, data, read, beside=beside or {}), *inner]


def _npz() -> tuple[Case, ...]:
    small = {
        f"{kind}{k:02d}": np.ones(shape, np.float16)
        for k in range(2)
        for kind, shape in (("weight", (9, 4, 4)), ("bias", (4,)))
    }
    stream = io.BytesIO()
    np.savez(stream, **small)
    result = _result()
    description = {"decomposition.json": result["decomposition.json"]}
    return (
        *_npz_cases("priors.npz", (_DATA / "priors.npz").read_bytes(), load_prior_set),
        *_npz_cases("table.npz", (_DATA / "filter_statistics.npz").read_bytes(), read_table),
        *_npz_cases("network.npz", stream.getvalue(), read_network),
        *_npz_cases("appearance.npz", stream.getvalue(), read_appearance),
        *_npz_cases("lamps.npz", stream.getvalue(), read_lamp_network),
        *_npz_cases(
            "arrays.npz", result["arrays.npz"], lambda path: read_result(path.parent), description
        ),
    )


# --- JSON -----------------------------------------------------------------------------------------


@cache
def _result() -> dict[str, bytes]:
    """The files of a result folder, with a fitted lobe."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "ball.png").write_bytes(coded(".png", codes()))
        found = decompose(read_photo(folder / "ball.png"), Settings(model="naive"), name="ball.png")
        interval, spread = Interval(0.2, 0.3), Interval(np.full(3, 0.5), np.full(3, 2.0))
        light = LobeLight(np.array([0.0, 0.6, 0.8]), 4.0, np.ones(3), spread)
        outcome = LobeFitOutcome.DETERMINED
        lobe = LobeFit(
            "ggx", outcome, 0.25, interval, (light,), np.ones(3), spread, 0.5, found.specular
        )
        save(replace(found, brdf=lobe), folder / "result", arrays=True)
        return {
            path.name: path.read_bytes()
            for path in (folder / "result").iterdir()
            if path.suffix in (".json", ".exr", ".npz")
        }


def _scene() -> dict[str, bytes]:
    """The description of a rendered scene; its maps are not there, so that truth is refused at the
    latest then.
    """
    content = {
        "schema_version": 1,
        "kind": "isc synth scene",
        "seed": 3,
        "split": "train",
        "object": {"id": "lathe03"},
        "material": {"id": "paint01", "model": "ggx", "gloss_class": "broad"},
        "albedo": {"family": "blotches"},
        "light": {"id": "sky02", "family": "studio"},
        "illumination": {"coefficients": [[0.0] * 3] * 9, "light_fit_residual": 0.01},
        "measured": {"specular_share": 0.1, "mask_pixels": 300},
        "files": {"maps.exr": "0" * 64},
    }
    return {"scene.json": json.dumps(content).encode(), "maps.exr": b"no maps"}


def _facts(path: Path) -> object:
    return [read_facts(found) for found in list_scenes(path.parents[2])]


def _json() -> tuple[Case, ...]:
    result, scene = _result(), _scene()
    description = result["decomposition.json"]
    beside = {name: data for name, data in result.items() if name != "decomposition.json"}
    bounds = {
        "schema_version": 1,
        "bounds": [
            {"stage": "separation", "metric": "psnr", "kind": "all", "value": "all", "limit": 20.5}
        ],
    }
    own = {f"set/train/a/{name}": data for name, data in scene.items() if name != "scene.json"} | {
        "set/manifest.json": b"{}"
    }
    return (
        Case("decomposition.json", description, lambda path: load(path.parent), beside=beside),
        Case(
            "decomposition.json", description, lambda path: read_result(path.parent), beside=beside
        ),
        Case("decomposition.json", description, read_light),
        Case("light.json", json.dumps([[0.1, 0.2, 0.3]] * 9).encode(), read_light),
        Case(
            "set/train/a/scene.json",
            scene["scene.json"],
            _facts,
            beside=own,
        ),
        Case(
            "set/train/a/scene.json",
            scene["scene.json"],
            lambda path: read_truth(path.parent),
            beside=own,
        ),
        Case("bounds.json", json.dumps(bounds).encode(), read_bounds),
    )


# --- lists of images ------------------------------------------------------------------------------


def _list(path: Path) -> object:
    return list(Manifest(str(path), Recipe()))


def _lists() -> tuple[Case, ...]:
    rows = [
        {"image": "cup.png", "mask": "cup_mask.png", "name": "cup", "options": {"max_size": 256}},
        {"image": "s3://photos/jug.png"},
    ]
    lines = "\n".join(
        json.dumps(row)
        for row in [*rows, {"image": "a.png", "transfer": "linear", "full_size": True}]
    )
    table = 'image,mask,name,max_size,transfer\ncup.png,cup_mask.png,cup,256,srgb\n"a, b.png",,,,\njug.png,,jug,,linear\n'
    packed = 'image,options\ncup.png,"{""max_size"": 64, ""model"": ""mdr""}"\n'
    return (
        Case("list.csv", table.encode(), _list),
        Case("list.csv", packed.encode(), _list),
        Case("list.jsonl", lines.encode(), _list),
    )


DATA_FILES = (
    Target("mat", _mat, _MAT_WORDS),
    Target("npz", _npz, _NPZ_WORDS),
    Target("json", _json, _JSON_WORDS),
    Target("csv", _lists, _LIST_WORDS),
)
