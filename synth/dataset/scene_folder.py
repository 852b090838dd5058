"""The files of one rendered scene.

`maps.exr` has the channels of a result folder of `isc decompose`, so that ground truth and result
compare by name. `material.exr`: `strength.Y` and `gloss.Y` of the material. `variance.exr`: of the
Monte Carlo estimates of diffuse, specular and shading. `environment.exr`: all lights as seen from
the origin. `photo.png`: the photo, the mask as alpha. `preview.png`: a contact sheet. `scene.json`:
all other values, with the checksums of the other files (see `description`).
"""

import hashlib
import json
from pathlib import Path

import numpy as np
from PIL import Image

from isc_core.io.atomic import new_folder
from isc_core.io.exr import write_channels
from isc_core.result_files.contact_sheet import contact_sheet
from isc_core.result_files.maps_file import LAYERS
from isc_core.scene.decomposition import COLOR_MAPS, Decomposition, Provenance

from ..capture.recipe import Recipe
from ..capture.sensor import write_photo
from ..capture.truth import GroundTruth
from ..scene.scene import Scene
from .description import describe

DATA_FILES = (
    "maps.exr",
    "material.exr",
    "variance.exr",
    "environment.exr",
    "photo.png",
    "preview.png",
)
FILES = ("scene.json", *DATA_FILES)
VARIANCES = ("diffuse", "specular", "shading")
_PREVIEW = 0.5  # of the sheet's size


def write_scene(folder: Path, split: str, recipe: Recipe, scene: Scene, truth: GroundTruth) -> None:
    """Write a scene's folder, completely or not at all.

    Parameters
    ----------
    folder : Path
        The folder.
    split : str
        The scene's split.
    recipe : Recipe
        Its recipe.
    scene : Scene
        Lights, material and camera.
    truth : GroundTruth
        The maps.

    Raises
    ------
    InputError
        If the folder contains other files or cannot be written.
    """
    with new_folder(folder, FILES) as partial:
        write_channels(partial / "maps.exr", map_channels(truth))
        write_channels(
            partial / "material.exr", {"strength.Y": truth.strength, "gloss.Y": truth.gloss}
        )
        write_channels(partial / "variance.exr", _variance_channels(truth))
        write_channels(partial / "environment.exr", planes(truth.environment, "RGB"))
        write_photo(partial / "photo.png", truth, recipe.picture.sensor.bits or 16)
        _preview(recipe, truth).save(partial / "preview.png")
        checksums = {name: checksum(partial / name) for name in DATA_FILES}
        text = json.dumps(
            describe(split, recipe, scene, truth, checksums), indent=2, allow_nan=False
        )
        (partial / "scene.json").write_text(text + "\n", encoding="utf-8")


def map_channels(truth: GroundTruth) -> dict[str, np.ndarray]:
    """Return the channels of `maps.exr`.

    Ground truth is certain: confidence is the mask.

    Parameters
    ----------
    truth : GroundTruth
        The scene's maps.

    Returns
    -------
    dict of str to (H, W) ndarray
        By channel name: "diffuse.R".
    """
    mask = truth.mask.astype(np.float32)
    channels: dict[str, np.ndarray] = {}
    for name, letters in LAYERS.items():
        values = mask if name in ("mask", "confidence") else getattr(truth, name)
        channels |= planes(values, letters, f"{name}.")
    return channels


def planes(values: np.ndarray, letters: str, prefix: str = "") -> dict[str, np.ndarray]:
    """Split a map (H, W) or (H, W, C) into channels.

    Parameters
    ----------
    values : (H, W) or (H, W, C) ndarray
        The map.
    letters : str
        One letter per channel.
    prefix : str, optional
        Prefix of the names.

    Returns
    -------
    dict of str to (H, W) ndarray
        The channels.
    """
    stack = values if values.ndim == 3 else values[..., None]
    return {f"{prefix}{letter}": stack[..., index] for index, letter in enumerate(letters)}


def checksum(path: Path) -> str:
    """Return the SHA-256 of a file.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    str
        Hexadecimal digits.
    """
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _variance_channels(truth: GroundTruth) -> dict[str, np.ndarray]:
    variance = {
        "diffuse": truth.reflectance**2 * truth.shading_variance,
        "specular": truth.specular_variance,
        "shading": truth.shading_variance,
    }
    return {
        name: values
        for layer in VARIANCES
        for name, values in planes(variance[layer], "RGB", f"{layer}.").items()
    }


def _preview(recipe: Recipe, truth: GroundTruth) -> Image.Image:
    words = {
        "model": recipe.model,
        "separator": f"{recipe.albedo} albedo",
        "illumination": f"{recipe.light.family} light",
    }
    layers = {
        name: getattr(truth, name)
        for name in (*COLOR_MAPS, "normal", "height", "mask", "illumination")
    }
    confidence = truth.mask.astype(np.float32)
    sheet = contact_sheet(
        Decomposition(
            **layers,
            confidence=confidence,
            provenance=Provenance(words, input={"name": recipe.name}),
        )
    )
    return sheet.resize(
        (round(_PREVIEW * sheet.width), round(_PREVIEW * sheet.height)), Image.Resampling.LANCZOS
    )
