"""Reading a data set of rendered scenes: the list of scenes, their properties and their ground
truth.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from isc_core.errors import InputError
from isc_core.io.exr import read_channels
from isc_core.io.json_files import numbers, read_json
from isc_core.result_files.maps_file import LAYERS

from ..capture.truth import GroundTruth
from .description import KIND, SCHEMA_VERSION
from .scene_folder import DATA_FILES, VARIANCES, checksum
from .splits import SPLITS

MANIFEST = "manifest.json"
_OLD_GLOSS_CLASSES = {"matt": "diffuse"}  # schema 1
_Kind = TypeVar("_Kind", str, int, float)


@dataclass(frozen=True)
class SceneFacts:
    """Properties of a scene, by which slices of a data set are made.

    Attributes
    ----------
    name : str
        Name of the folder.
    split : str
        One of `SPLITS`.
    object, material, light : str
        Names of family members ("lathe03").
    albedo, model, light_kind : str
        Families.
    gloss_class : str
        "diffuse", "broad", "medium" or "sharp".
    specular_share : float
        Specular share of all light inside the mask, [0, 1].
    mask_pixels : int
        Size of the object.
    seed : int
        Seed of the scene.
    folder : Path
        Its folder.
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
    """Return the folders of a data set's finished scenes, sorted by split and name.

    Parameters
    ----------
    root : Path or str
        Folder of the data set.
    split : str, optional
        One of `SPLITS`; all of them by default.

    Returns
    -------
    tuple of Path
        The folders.

    Raises
    ------
    InputError
        If `root` is not a data set of `isc synth`, the split is unknown, or there is no scene.
    """
    root = Path(root)
    if split is not None and split not in SPLITS:
        raise InputError(f"unknown split {split!r}: choose {', '.join(SPLITS)}")
    if not (root / MANIFEST).is_file():
        raise InputError(f"{root} is not a data set of isc synth (it has no {MANIFEST})")
    wanted = SPLITS if split is None else (split,)
    found = tuple(
        path.parent for name in wanted for path in sorted((root / name).glob("[!.]*/scene.json"))
    )
    if not found:
        which = f" of the split {split}" if split else ""
        raise InputError(f"{root} has no finished scene{which}: let isc synth finish")
    return found


def read_facts(folder: Path | str) -> SceneFacts:
    """Read the properties of a scene from its `scene.json`.

    Parameters
    ----------
    folder : Path or str
        The scene.

    Returns
    -------
    SceneFacts
        The properties.

    Raises
    ------
    InputError
        If the file is missing, damaged or of another kind.
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
        gloss_class=current_gloss_class(fact(str, "material", "gloss_class")),
        light_kind=fact(str, "light", "family"),
        specular_share=fact(float, "measured", "specular_share"),
        mask_pixels=fact(int, "measured", "mask_pixels"),
        seed=fact(int, "seed"),
        folder=place,
    )


def current_gloss_class(name: str) -> str:
    """Return the current name of a gloss class; schema 1 called "diffuse" "matt".

    Parameters
    ----------
    name : str
        Name in a `scene.json` of any schema.

    Returns
    -------
    str
        As in `gloss_class`.
    """
    return _OLD_GLOSS_CLASSES.get(name, name)


def read_truth(folder: Path | str) -> GroundTruth:
    """Read the ground truth of a scene.

    Parameters
    ----------
    folder : Path or str
        The scene.

    Returns
    -------
    GroundTruth
        The maps as rendered.

    Raises
    ------
    InputError
        If a file is missing, was modified, or does not fit.
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
    """Read the content of a `scene.json`.

    Parameters
    ----------
    folder : Path
        The scene.

    Returns
    -------
    dict
        The JSON object, of the current or an older schema.

    Raises
    ------
    InputError
        If the file is missing, damaged, of another kind, or of a newer version.
    """
    path = folder / "scene.json"
    if not path.is_file():
        raise InputError(f"{folder} is not a scene of isc synth (it has no scene.json)")
    content = read_object(path)
    if content.get("kind") != KIND or not isinstance(content.get("schema_version"), int):
        raise InputError(f"{path} was not written by isc synth")
    if content["schema_version"] > SCHEMA_VERSION:
        raise InputError(
            f"{path} was written by a newer version (schema {content['schema_version']}): update "
            "ISC"
        )
    return content


def read_object(path: Path) -> dict[str, Any]:
    """Read a file that contains one JSON object.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    dict
        The JSON object.

    Raises
    ------
    InputError
        If the file cannot be read, or contains anything else.
    """
    content = read_json(path)
    if not isinstance(content, dict):
        raise InputError(f"{path} is damaged: it contains no JSON object")
    return content


def require_intact(folder: Path, content: dict[str, Any]) -> None:
    """Check that the files of a scene are those that were written with its `scene.json`.

    Parameters
    ----------
    folder : Path
        The scene.
    content : dict
        The content of `scene.json`.

    Raises
    ------
    InputError
        If a file is missing or was modified.
    """
    for name in DATA_FILES:
        path = folder / name
        if not path.is_file():
            raise InputError(
                f"{path} is missing, the scene is incomplete: render it again with isc synth"
            )
        if checksum(path) != _value(content, folder, str, "files", name):
            raise InputError(
                f"{path} is damaged or was modified: render the scene again with isc synth"
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
                f"{path} lacks the channel {missing[0]}: it is damaged or not a file of isc synth"
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
