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
from isc_core.batch.item import ImageRecipe
from isc_core.batch.manifest import Manifest
from isc_core.datasets.mit_berkeley import load_natural_lights, load_object
from isc_core.decomposition.pipeline import Settings, decompose
from isc_core.networks.scene_network import SceneNetwork
from isc_core.photo import read_photo
from isc_core.result_files.known_inputs import read_light
from isc_core.result_files.result_folder import load, save
from isc_core.scene.lobe_fit import Interval, LobeFit, LobeFitOutcome, LobeLight
from isc_core.separation.support.filter_statistics import read_table
from isc_core.sirfs.priors.prior_file import load_prior_set
from synth.dataset.reading import list_scenes, read_facts, read_truth
from synth.shapes.height_field import read_height
from synth.validation.measurement.bounds import read_bounds
from tests.fuzz.case import Case, Target, words
from tests.fuzz.pictures import ball, coded, codes

CORE = Path(__file__).resolve().parents[2] / "isc_core"
_MAT_WORDS = words(
    b"IM~MI~depth~\x0e\x00\x00\x00~\x0f\x00\x00\x00~\x01\x00\x00\x00~\t\x00\x00\x00~"
    b"\x06\x00\x00\x00\x08\x00\x00\x00~\x02\x00\x00\x00~MATLAB 7.3~diffuse~"
    b"\x05\x00\x00\x00\x08\x00\x00\x00"
)
_NPZ_WORDS = words(
    b"PK\x01\x02~PK\x03\x04~PK\x05\x06~\x93NUMPY\x01\x00~\x93NUMPY\x02\x00~'descr'~'|O'~"
    b"'<f8'~'<U9'~(3, 3)~()~True~.npy"
)
_JSON_WORDS = words(
    b'null~true~[]~{}~""~1e999~-1~NaN~"schema_version": 1~"scale": 0~"size": [1, 1]~[[~'
    b'"illumination"~"brdf"~"\\u0000"~"\\ud800"~"../../x"~"<script>"~'
    b"1111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111~"
    b"\xff\xfe"
)
_LIST_WORDS = words(
    b',~"~\r\n~\x00~image~mask~name~options~../../etc/x~/x~s3://a/b~file:///x~{}~'
    b'{"max_size": -1}~=1+1~<script>~\xff~\xef\xbb\xbf~nul~'
    b"aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa~"
    b"http://[~memory://"
)


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
    heights = (height, (2 * height).astype(np.float32), np.nan_to_num(9 * height).astype(np.int16))
    cases = []
    for values in heights:
        plain, packed = (matlab({"depth": values}, packed=packed) for packed in (False, True))
        cases += [Case("Z.mat", data, read_height) for data in (plain, packed)]
        cases += [Case("Z.mat", plain, read_height, deflated)]
    lights = matlab({"Ls": np.zeros((9, 3, 2))}, packed=False)
    cases += [Case("natural_lights.mat", lights, _natural_lights, deflated)]
    files = mit_object()
    for name, wrap in (
        *(("L.mat", bytes), ("L.mat", deflated), ("Z.mat", bytes), ("Z.mat", deflated)),
        ("crop_idx.mat", bytes),
    ):
        path = f"laboratory/nut/{name}"
        beside = {other: data for other, data in files.items() if other != path}
        cases += [Case(path, files[path], _laboratory, wrap, beside)]
    return tuple(cases)


def _natural_lights(path: Path) -> object:
    return load_natural_lights(path.parent)


def _laboratory(path: Path) -> object:
    return load_object(path.parents[2], "nut", "laboratory")


def mit_object() -> dict[str, bytes]:
    """The files of one object of the MIT-Berkeley set, by their paths."""
    picture = coded(".png", codes(16))
    names = ("diffuse.png", "original.png", "reflectance.png")
    files = {
        **dict.fromkeys(names, picture),
        "mask.png": coded(".png", (ball().max(2) > 0).astype(np.uint8) * 255),
    }
    tables: dict[str, dict[str, Any]] = {
        "Z.mat": {"depth": 9 * ball()[..., 0]},
        "L.mat": {"color_lights": {"diffuse": np.zeros((9, 3)), "name": "x"}},
        "crop_idx.mat": {"crop_idx1": np.arange(2, 20), "crop_idx2": np.arange(3, 18)},
        "shading_corrected_color.mat": {"shading_correct": np.ones((24, 20, 3))},
    }
    files |= {name: matlab(table, packed=False) for name, table in tables.items()}
    return {f"laboratory/nut/{name}": data for name, data in files.items()}


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
    shapes = {"weight": (9, 4, 4), "bias": (4,)}
    stream = io.BytesIO()
    np.savez(
        stream,
        **{f"{kind}{k:02d}": np.ones(shapes[kind], np.float16) for k in (0, 1) for kind in shapes},
    )
    network, result = stream.getvalue(), result_files()
    description = {"decomposition.json": result["decomposition.json"]}
    priors = (CORE / "sirfs/priors/data/priors.npz").read_bytes()
    table = (CORE / "separation/support/data/filter_statistics.npz").read_bytes()
    return (
        *_npz_cases("priors.npz", priors, load_prior_set),
        *_npz_cases("table.npz", table, read_table),
        *_npz_cases("network.npz", network, SceneNetwork.read),
        *_npz_cases("arrays.npz", result["arrays.npz"], _read_result, description),
    )


def _read_result(path: Path) -> object:
    return read_result(path.parent)


@cache
def result_files() -> dict[str, bytes]:
    """The files of a result folder, with a fitted lobe."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "ball.png").write_bytes(coded(".png", codes()))
        found = decompose(read_photo(folder / "ball.png"), Settings(model="naive"), name="ball.png")
        interval, spread = Interval(0.2, 0.3), Interval(np.full(3, 0.5), np.full(3, 2.0))
        light = LobeLight(np.array([0.0, 0.6, 0.8]), 4.0, np.ones(3), spread)
        lobe = LobeFit(
            model="ggx",
            outcome=LobeFitOutcome.DETERMINED,
            alpha=0.25,
            alpha_interval=interval,
            lights=(light,),
            strength=np.ones(3),
            strength_interval=spread,
            explained=0.5,
            predicted=found.specular,
        )
        save(replace(found, brdf=lobe), folder / "result", arrays=True)
        return {
            path.name: path.read_bytes()
            for path in (folder / "result").iterdir()
            if path.suffix in (".json", ".exr", ".npz")
        }


def scene_files() -> dict[str, bytes]:
    """The description of a rendered scene; its maps are missing, so its truth is refused."""
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
    beside, scene = dict(result_files()), scene_files()
    description = beside.pop("decomposition.json")
    limit = {"stage": "separation", "metric": "psnr", "kind": "all", "value": "all", "limit": 20.5}
    bounds = json.dumps({"schema_version": 1, "bounds": [limit]}).encode()
    maps = {"set/train/a/maps.exr": scene["maps.exr"], "set/manifest.json": b"{}"}
    light, path = json.dumps([[0.1, 0.2, 0.3]] * 9).encode(), "set/train/a/scene.json"
    return (
        Case("decomposition.json", description, lambda path: load(path.parent), beside=beside),
        Case("decomposition.json", description, _read_result, beside=beside),
        Case("decomposition.json", description, read_light),
        Case("light.json", light, read_light),
        Case(path, scene["scene.json"], _facts, beside=maps),
        Case(path, scene["scene.json"], lambda path: read_truth(path.parent), beside=maps),
        Case("bounds.json", bounds, read_bounds),
    )


def _list(path: Path) -> object:
    return list(Manifest(str(path), ImageRecipe()))


def _lists() -> tuple[Case, ...]:
    rows = (
        {"image": "cup.png", "mask": "cup_mask.png", "name": "cup", "options": {"max_size": 256}},
        {"image": "s3://photos/jug.png"},
        {"image": "a.png", "transfer": "linear", "full_size": True},
    )
    lines = "\n".join(json.dumps(row) for row in rows).encode()
    table = (
        b"image,mask,name,max_size,transfer\n"
        b'cup.png,cup_mask.png,cup,256,srgb\n"a, b.png",,,,\njug.png,,jug,,linear\n'
    )
    packed = b'image,options\ncup.png,"{""max_size"": 64, ""model"": ""mdr""}"\n'
    files = (("list.csv", table), ("list.csv", packed), ("list.jsonl", lines))
    return tuple(Case(name, data, _list) for name, data in files)


DATA_FILES = (
    Target("mat", _mat, _MAT_WORDS),
    Target("npz", _npz, _NPZ_WORDS),
    Target("json", _json, _JSON_WORDS),
    Target("csv", _lists, _LIST_WORDS),
)
