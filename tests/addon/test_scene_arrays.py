"""Reading the arrays of a result: values are unchanged, damaged files are refused in one line."""

import json
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from blender_addon.files.result_arrays import ResultArrays, read_result
from isc_core.errors import InputError
from tests.addon.scene_fixture import bump, write_result

Arrays = dict[str, np.ndarray]
FORMER_NAMES = {"sky"}


def environment_of(arrays: Mapping[str, np.ndarray]) -> np.ndarray:
    return arrays["environment_map" if "environment_map" in arrays else "sky"]


def test_all_arrays_are_read(bump_folder: Path) -> None:
    result, d = read_result(bump_folder), bump()
    for name in (
        "image",
        "diffuse",
        "specular",
        "reflectance",
        "shading",
        "normal",
        "height",
        "mask",
        "confidence",
    ):
        assert np.array_equal(getattr(result, name), getattr(d, name)), name
    with np.load(bump_folder / "arrays.npz") as file:
        assert {name for name in file.files if not hasattr(result, name)} <= FORMER_NAMES
        assert np.array_equal(
            result.environment_map, environment_of(file)
        ) and result.reflectance_scale == float(file["reflectance_scale"])
    assert (
        result.size == (88, 64)
        and result.name == "bump"
        and result.description["settings"]["model"] == "mdr"
    )
    assert np.isnan(result.roughness) and result.specular_variation is None


@pytest.mark.slow
def test_a_photo_without_a_name_takes_the_folders(tmp_path: Path) -> None:
    folder = write_result(tmp_path / "my cup")
    (folder / "decomposition.json").write_text("{}", encoding="utf-8")
    assert read_result(folder).name == "my cup"


def test_a_folder_without_a_result_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="decomposition.json"):
        read_result(tmp_path)
    (tmp_path / "decomposition.json").write_text("{}", encoding="utf-8")
    with pytest.raises(InputError, match="isc arrays"):
        read_result(tmp_path)


@pytest.mark.parametrize("text", ["", "[]", "{", '{"input": 3}', '{"settings": []}'])
def test_damaged_descriptions_are_refused(tmp_path: Path, bump_folder: Path, text: str) -> None:
    folder = shutil.copytree(bump_folder, tmp_path / "copy")
    (folder / "decomposition.json").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="decompose the photo again"):
        read_result(folder)


def without(arrays: Arrays, name: str) -> Arrays:
    return {other: values for other, values in arrays.items() if other != name}


def spoilt(arrays: Arrays, name: str, value: float) -> Arrays:
    values = arrays[name].copy()
    values.reshape(-1)[0] = value
    return arrays | {name: values}


DAMAGES: dict[str, Callable[[Arrays], Arrays]] = {
    "environment_map is missing": lambda a: without(without(a, "sky"), "environment_map"),
    "normal has the shape": lambda a: a | {"normal": a["normal"][:-1]},
    "diffuse is float64": lambda a: a | {"diffuse": a["diffuse"].astype(float)},
    "base_color contains NaN": lambda a: spoilt(a, "base_color", np.nan),
    "contains no object": lambda a: a | {"mask": np.zeros_like(a["mask"])},
    "refers to missing vertices or pixels": lambda a: spoilt(a, "faces", len(a["vertices"])),
    "the mesh refers": lambda a: spoilt(a, "vertex_pixel", -1),
}


@pytest.mark.parametrize("message", DAMAGES)
def test_damaged_arrays_are_refused(tmp_path: Path, bump_folder: Path, message: str) -> None:
    folder = shutil.copytree(bump_folder, tmp_path / "copy")
    with np.load(folder / "arrays.npz") as file:
        arrays = {name: file[name] for name in file.files}
    np.savez(folder / "arrays.npz", **DAMAGES[message](arrays))
    with pytest.raises(InputError, match=message) as caught:
        read_result(folder)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("keep", [0, 10, 5000])
def test_half_written_arrays_are_refused(tmp_path: Path, bump_folder: Path, keep: int) -> None:
    folder = shutil.copytree(bump_folder, tmp_path / "copy")
    (folder / "arrays.npz").write_bytes((folder / "arrays.npz").read_bytes()[:keep])
    with pytest.raises(InputError, match="damaged"):
        read_result(folder)


def test_the_specular_variation_is_read(tmp_path: Path, bump_folder: Path) -> None:
    folder = shutil.copytree(bump_folder, tmp_path / "copy")
    with np.load(folder / "arrays.npz") as file:
        arrays = {name: file[name] for name in file.files}
    np.savez(folder / "arrays.npz", **arrays, specular_variation=arrays["confidence"])
    result: ResultArrays = read_result(folder)
    assert result.specular_variation is not None and np.array_equal(
        result.specular_variation, arrays["confidence"]
    )


def test_the_description_is_kept_completely(tmp_path: Path, bump_folder: Path) -> None:
    """The description is kept whole, letters of all languages too."""
    folder = shutil.copytree(bump_folder, tmp_path / "copy")
    said = {"input": {"name": "чашка/杯.png"}, "settings": {}, "status": {"text": "收敛"}}
    (folder / "decomposition.json").write_text(
        json.dumps(said, ensure_ascii=False), encoding="utf-8"
    )
    assert read_result(folder).description == said


@pytest.mark.parametrize("name", ["sky", "environment_map"])
def test_former_and_current_names_of_arrays_are_read(
    tmp_path: Path, bump_folder: Path, name: str
) -> None:
    folder = shutil.copytree(bump_folder, tmp_path / "copy")
    with np.load(folder / "arrays.npz") as file:
        arrays = {key: file[key] for key in file.files}
    environment = environment_of(arrays)
    arrays = without(without(arrays, "sky"), "environment_map") | {name: environment}
    np.savez(folder / "arrays.npz", **arrays)
    assert np.array_equal(read_result(folder).environment_map, environment)
