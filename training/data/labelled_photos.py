"""Photos with the label of the scene classifier.

Equation: every drawn photo has a set of allowed labels. A second light nearly as strong as the
first, and surroundings with several small lights, allow both "ordinary" and "several lights".

Limits: the labels of photographed objects are assumed: all of them count as ordinary.
"""

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from isc_core.datasets.mit_berkeley import list_objects, load_object
from isc_core.io.exr import read_channels
from isc_core.networks.scene_classifier import GLASS, LAMPS, LONG_SIDE, MIRROR, ORDINARY

from .augmentation import INSIDE, placed_in_square, random_tint, rescaled, simulate_sensor
from .packing import as_half, pack_object
from .random_draws import log_uniform
from .rendered_scenes import SceneKind, scenes_in

SIDE = 160  # pixels of a training image
RIG = "rig"  # the group whose lights are combined anew in every sample
_EITHER = "either"
_ALLOWED = {
    ORDINARY: (1, 0, 0, 0), MIRROR: (0, 1, 0, 0), GLASS: (0, 0, 1, 0), LAMPS: (0, 0, 0, 1),
    _EITHER: (1, 0, 0, 1),
}  # fmt: skip
_LABELS = {SceneKind.MIRROR: MIRROR, SceneKind.GLASS: GLASS, SceneKind.SEVERAL_LIGHTS: LAMPS}
_SECOND_LIGHT = 0.35  # of the strongest light's irradiance: from here on either label is right
_SEVERAL_SMALL_LIGHTS = {"room", "studio", "clutter", "interior", "night"}  # environments

Sample = tuple[torch.Tensor, torch.Tensor, tuple[int, ...]]  # image, mask, allowed labels


@dataclass(frozen=True)
class LabelledObject:
    """An object whose photos are drawn.

    Attributes
    ----------
    layers : (K, 3, SIDE, SIDE) tensor
        float16; their sum is the photo. Of a rig: one layer per light, then ambient light.
    mask : (SIDE, SIDE) tensor
        1 on the object.
    label : str
        Key of the allowed labels; "" for rigs.
    group : str
        Sampling group.
    family : str
        Shape family, or name of the data set's object.
    environment : str
        Name of the environment; "" if unknown.
    """

    layers: torch.Tensor
    mask: torch.Tensor
    label: str
    group: str
    family: str
    environment: str = ""


def rendered_objects(folder: Path) -> Iterator[LabelledObject]:
    """Read the scenes written by `training.data.rendered_scenes`.

    Parameters
    ----------
    folder : Path
        Folder of the scenes.

    Returns
    -------
    iterator of LabelledObject
    """
    for scene in scenes_in(folder):
        label = _LABELS.get(scene.kind, ORDINARY)
        if scene.kind is SceneKind.ENVIRONMENT and scene.environment in _SEVERAL_SMALL_LIGHTS:
            label = _EITHER
        yield LabelledObject(
            *_packed(scene.layers, scene.mask),
            "" if scene.kind is SceneKind.RIG else label,
            scene.kind.value,
            scene.shape,
            scene.environment,
        )


def synthetic_objects(run: Path) -> Iterator[LabelledObject]:
    """Read the training scenes of a run of `isc synth`.

    Parameters
    ----------
    run : Path
        Output folder of the run.

    Returns
    -------
    iterator of LabelledObject
    """
    for path in sorted((run / "train").rglob("maps.exr")):
        record = json.loads((path.parent / "scene.json").read_text(encoding="utf-8"))
        second = _second_light(record["light"].get("sources", []))
        channels = read_channels(path)
        image = np.stack([channels[f"image.{letter}"] for letter in "RGB"], -1)
        yield LabelledObject(
            *_packed(image[None], channels["mask.A"] > 0.5),
            _EITHER if second > _SECOND_LIGHT else ORDINARY,
            "synth",
            record["object"]["family"],
        )


def photographed_objects(data: Path, glossy: Iterable[Path]) -> Iterator[LabelledObject]:
    """Read the MIT-Berkeley objects and their glossy versions.

    Parameters
    ----------
    data : Path
        The MIT-Berkeley set.
    glossy : iterable of Path
        Runs of `isc synth glossy-mit`.

    Yields
    ------
    LabelledObject
        Each object with and without gloss, under laboratory and natural lights.
    """
    photos = [
        (data, "laboratory", "original"),
        (data, "laboratory", "diffuse"),
        (data, "natural", "diffuse"),
    ]
    photos += [
        (folder, "laboratory", "original")
        for run in glossy
        for folder in sorted(run.glob("level-*"))
    ]
    for root, light, layer in photos:
        for name in list_objects(root, light):
            photo = load_object(root, name, light, layer)
            packed = _packed(np.maximum(photo.image, 0)[None], photo.valid)
            yield LabelledObject(*packed, ORDINARY, "photo", name)


def draw_photo(subject: LabelledObject, rng: np.random.Generator) -> Sample:
    """Draw a photo of an object as a camera may record it.

    Parameters
    ----------
    subject : LabelledObject
        The object. Of a rig, one or several lights are switched on.
    rng : np.random.Generator
        Draws lights, size, place and sensor.

    Returns
    -------
    image : (3, SIDE, SIDE) tensor
        Linear light.
    mask : (SIDE, SIDE) tensor
        1 on the object.
    allowed : tuple of int
        1 for each right label, in the order of the classifier.
    """
    image, label = _lit(subject, rng)
    layers = _transformed(torch.cat([image * subject.mask, subject.mask[None]]), rng)
    image, mask = layers[:3], (layers[3] > INSIDE).float()
    return simulate_sensor(image, mask, rng), mask, _ALLOWED[label]


def _second_light(sources: Sequence[dict[str, Any]]) -> float:
    """Irradiance of the second strongest light relative to the strongest."""
    strengths = [0.0, 0.0]
    for source in sources:
        if source["kind"] == "directional":
            strengths.append(np.mean(source["irradiance"]))
        elif source["kind"] == "point":
            strengths.append(np.mean(source["intensity"]) / np.square(source["position"]).sum())
        elif source["kind"] == "panel":
            area = 4 * np.linalg.norm(source["right"]) * np.linalg.norm(source["up"])
            distance = np.square(source["centre"]).sum()
            strengths.append(np.mean(source["radiance"]) * area / distance)
    second, first = sorted(strengths)[-2:]
    return float(second / first) if first > 0 else 0.0


def _packed(layers: np.ndarray, mask: np.ndarray) -> tuple[torch.Tensor, torch.Tensor]:
    packed = pack_object(list(layers), mask, LONG_SIDE, SIDE)
    level = float(packed.layers[:, :, packed.mask].mean()) + 1e-9
    return (
        torch.from_numpy(as_half(packed.layers / level)),
        torch.from_numpy(packed.mask.astype(np.float32)),
    )


def _lit(subject: LabelledObject, rng: np.random.Generator) -> tuple[torch.Tensor, str]:
    """The photo (3, SIDE, SIDE) and its label; of a rig one light or several are on."""
    layers = subject.layers.float()
    if subject.group != RIG:
        return layers.sum(0), subject.label
    several, lights = bool(rng.random() < 0.5) and len(layers) > 2, len(layers) - 1
    image = layers[-1] * log_uniform(rng, 0.02, 0.3) * random_tint(rng, 0.08)
    count = int(rng.integers(2, lights + 1)) if several else 1
    colourfulness = 0.6 if several and rng.random() < 0.5 else 0.05
    for light in rng.permutation(lights)[:count]:
        strength = float(rng.uniform(0.55, 1))
        image = image + layers[light] * strength * random_tint(rng, colourfulness)
    return image, LAMPS if several else ORDINARY


def _transformed(layers: torch.Tensor, rng: np.random.Generator) -> torch.Tensor:
    """The layers at another size and place, mirrored, rotated by multiples of 90 degrees."""
    layers = rescaled(layers, log_uniform(rng, 0.6, 1.05))
    if rng.random() < 0.5:
        layers = layers.flip(2)
    if rng.random() < 0.25:
        layers = layers.rot90(int(rng.integers(1, 4)), (1, 2))
    return placed_in_square(layers, SIDE, rng)
