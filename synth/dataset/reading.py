"""Reading a data set of rendered scenes: which scenes there are, what they are, and their truth."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from isc_core.errors import InputError
from isc_core.io.exr import read_channels
from isc_core.io.json_files import numbers, read_json
from isc_core.result_files.result_folder import LAYERS

from ..capture.truth import GroundTruth
from .description import KIND, SCHEMA_VERSION
from .scene_folder import DATA_FILES, VARIANCES, checksum
from .splits import SPLITS

MANIFEST = "manifest.json"
_Kind = TypeVar("_Kind", str, int, float)


@dataclass(frozen=True)
class SceneFacts:
    """What slices of a data set are made by. `name`: of the folder. `split`: of `SPLITS`. `object`,
    `material`, `light`: names of members ("lathe03"). `albedo`, `model`, `light_kind`: families.
    `gloss_class`: "matt", "broad", "medium" or "sharp". `specular_share`: of all light inside the
    mask, [0, 1]. `mask_pixels`: the object's. `seed`: of the scene. `folder`: where it lies.
    """

    name: str
    split: str
    object: str
    material: str
    light: str
    albedo: str
    model: str
    gloss_class: str
    light_kind: str
    specular_share: float
    mask_pixels: int
    seed: int
    folder: Path


def list_scenes(root: Path | str, split: str | None = None) -> tuple[Path, ...]:
    """The folders of a data set's finished scenes, of one split or of all in the order of `SPLITS`,
    by name.

    Raises `InputError` where `root` is no data set of `isc synth`, for an unknown split, and where
    there is no scene.
    """
    root = Path(root)
    if split is not None and split not in SPLITS:
        raise InputError(f"unknown split {split!r}: choose of {', '.join(SPLITS)}")
    if not (root / MANIFEST).is_file():
        raise InputError(f"{root} is not a data set of isc synth (it has no {MANIFEST})")
    wanted = SPLITS if split is None else (split,)
    found = tuple(
        path.parent for name in wanted for path in sorted((root / name).glob("[!.]*/scene.json"))
    )
    if not found:
        raise InputError(
            f"{root} holds no finished scene{f' of the split {split}' if split else ''}: run isc synth to its end"
        )
    return found


def read_facts(folder: Path | str) -> SceneFacts:
    """What `scene.json` says about a scene.

    Raises `InputError` where it is absent, damaged, or not ours.
    """
    place = Path(folder)
    content = read_description(place)

    def fact(kind: type[_Kind], *keys: str) -> _Kind:
        return _value(content, place, kind, *keys)

    return SceneFacts(
        name=place.name,
        split=fact(str, "split"),
        object=fact(str, "object", "id"),
        material=fact(str, "material", "id"),
        light=fact(str, "light", "id"),
        albedo=fact(str, "albedo", "family"),
        model=fact(str, "material", "model"),
        gloss_class=fact(str, "material", "gloss_class"),
        light_kind=fact(str, "light", "family"),
        specular_share=fact(float, "measured", "specular_share"),
        mask_pixels=fact(int, "measured", "mask_pixels"),
        seed=fact(int, "seed"),
        folder=place,
    )


def read_truth(folder: Path | str) -> GroundTruth:
    """The truth as it was rendered.

    Raises `InputError` where a file is absent, is not the one that was written, or does not fit.
    """
    folder = Path(folder)
    content = read_description(folder)
    require_intact(folder, content)
    maps = _layers(folder / "maps.exr", dict(LAYERS))
    material = _layers(folder / "material.exr", {"strength": "Y", "gloss": "Y"})
    variance = _layers(folder / "variance.exr", dict.fromkeys(VARIANCES, "RGB"))
    environment = read_channels(folder / "environment.exr")
    if missing := [name for name in "RGB" if name not in environment]:
        raise InputError(
            f"{folder / 'environment.exr'} lacks the channel {missing[0]}: it is damaged"
        )
    del maps["confidence"]
    return GroundTruth(
        **{**maps, "mask": maps["mask"] > 0.5},
        **material,
        shading_variance=variance["shading"],
        specular_variance=variance["specular"],
        illumination=_coefficients(content, folder),
        light_fit_residual=_value(content, folder, float, "illumination", "light_fit_residual"),
        environment=np.stack([environment[name] for name in "RGB"], -1),
    )


def read_description(folder: Path) -> dict[str, Any]:
    """The content of `scene.json`.

    Raises `InputError` where it is absent, damaged, not ours, or of a newer version.
    """
    path = folder / "scene.json"
    if not path.is_file():
        raise InputError(f"{folder} is not a scene of isc synth (it has no scene.json)")
    content = read_object(path)
    if content.get("kind") != KIND or not isinstance(content.get("schema_version"), int):
        raise InputError(f"{path} was not written by isc synth")
    if content["schema_version"] > SCHEMA_VERSION:
        raise InputError(
            f"{path} was written by a newer version (schema {content['schema_version']}): update ISC"
        )
    return content


def read_object(path: Path) -> dict[str, Any]:
    """A file that holds one JSON object. Raises `InputError` for anything else."""
    content = read_json(path)
    if not isinstance(content, dict):
        raise InputError(f"{path} is damaged: it holds no JSON object")
    return content


def require_intact(folder: Path, content: dict[str, Any]) -> None:
    """Raises `InputError` unless every file beside `scene.json` is the one that was written with
    it.
    """
    for name in DATA_FILES:
        path = folder / name
        if not path.is_file():
            raise InputError(
                f"{path} does not exist: the scene is not whole; make it again with isc synth"
            )
        if checksum(path) != _value(content, folder, str, "files", name):
            raise InputError(
                f"{path} is not the file that isc synth wrote: it is damaged or was changed; make the scene again"
            )


def _value(content: dict[str, Any], folder: Path, kind: type[_Kind], *keys: str) -> _Kind:
    value: Any = content
    for key in keys:
        value = value.get(key) if isinstance(value, dict) else None
    allowed = (int, float) if kind is float else kind
    if (
        not isinstance(value, allowed)
        or isinstance(value, bool)
        or (kind is float and numbers(value, ()) is None)
    ):
        raise InputError(f"{folder / 'scene.json'} has no usable {'.'.join(keys)}: it is damaged")
    return kind(value)


def _layers(path: Path, layers: dict[str, str]) -> dict[str, np.ndarray]:
    channels = read_channels(path)
    stacks = {}
    for layer, letters in layers.items():
        names = [f"{layer}.{letter}" for letter in letters]
        if missing := [name for name in names if name not in channels]:
            raise InputError(
                f"{path} lacks the channel {missing[0]}: it is not a file of isc synth, or is damaged"
            )
        stack = np.stack([channels[name] for name in names], -1)
        stacks[layer] = stack if len(names) > 1 else stack[..., 0]
    return stacks


def _coefficients(content: dict[str, Any], folder: Path) -> np.ndarray:
    given = content.get("illumination")
    light = numbers(given.get("coefficients"), (9, 3)) if isinstance(given, dict) else None
    if light is None:
        raise InputError(
            f"{folder / 'scene.json'} has no illumination of 9 x 3 numbers: it is damaged"
        )
    return light
