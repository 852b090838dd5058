"""Data, SIRFS problems and scores shared by the benchmarks on MIT-Berkeley."""

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from isc_core.datasets.mit_berkeley import MitBerkeleyObject, load_object
from isc_core.evaluation.metrics import Scores, score
from isc_core.shading.occluding_contour import occluding_contour
from isc_core.shading.spherical_harmonics import (
    light_from_reference,
    normal_from_reference,
    real_sh,
)
from isc_core.shading.surface_stencils import normals
from isc_core.sirfs.priors.priors import Priors
from isc_core.sirfs.problem import Problem
from isc_core.sirfs.settings import Weights
from isc_core.sirfs.silhouette import normals_from_silhouette
from isc_core.sirfs.solver import SirfsResult

LIGHTS = ("natural", "laboratory")
_LAST_DIGIT = 1e-7


def parser(text: str | None) -> argparse.ArgumentParser:
    """Build a command-line parser with the options of every benchmark.

    Parameters
    ----------
    text : str or None
        Description.

    Returns
    -------
    argparse.ArgumentParser
        With `--shared` and `--json`.
    """
    options = argparse.ArgumentParser(description=text)
    options.add_argument(
        "--shared", type=Path, default=Path("../shared"), help="folder with data/ and anchors/"
    )
    options.add_argument("--json", type=Path, help="JSON file to write")
    return options


def training_object(shared: Path, name: str, illumination: str) -> MitBerkeleyObject:
    """Read a training object with its diffuse image.

    Parameters
    ----------
    shared : Path
        Folder with data/.
    name : str
        The object.
    illumination : str
        One of `LIGHTS`.

    Returns
    -------
    MitBerkeleyObject
    """
    return load_object(shared / "data" / "mit_berkeley_train", name, illumination, "diffuse")


def rounded(photo: MitBerkeleyObject, number: int) -> MitBerkeleyObject:
    """Perturb the last digits of a photo.

    Parameters
    ----------
    photo : MitBerkeleyObject
        The photo.
    number : int
        Chooses the perturbation; 0: none.

    Returns
    -------
    MitBerkeleyObject
        The perturbed photo.
    """
    return replace(photo, image=rounded_image(photo.image, number))


def rounded_image(image: np.ndarray, number: int) -> np.ndarray:
    """Perturb the last digits of an image.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear light.
    number : int
        Number of the perturbation; 0: none.

    Returns
    -------
    (H, W, 3) ndarray
    """
    return (
        image * (1 + _LAST_DIGIT * np.random.default_rng(number).standard_normal(image.shape))
        if number
        else image
    )


def greyed(photo: MitBerkeleyObject) -> MitBerkeleyObject:
    """Remove the colours of a photo: all channels become their mean.

    Parameters
    ----------
    photo : MitBerkeleyObject
        The photo.

    Returns
    -------
    MitBerkeleyObject
        With grey image, shading and log light, and the matching reflectance.
    """
    image, shading, light = (
        np.repeat(part.mean(axis=-1, keepdims=True), 3, axis=-1)
        for part in (photo.image, photo.shading, photo.light)
    )
    lit = shading > 0
    reflectance = np.where(
        lit, image / np.where(lit, shading, 1), photo.reflectance.mean(axis=-1, keepdims=True)
    )
    return replace(
        photo,
        image=image,
        valid=image[..., 0] > 0,
        shading=shading,
        reflectance=reflectance,
        light=light,
    )


def reference_results(shared: Path, illumination: str) -> dict[str, dict[str, float]]:
    """Read the reference program's scores for diffuse input.

    Parameters
    ----------
    shared : Path
        Folder with anchors/.
    illumination : str
        One of `LIGHTS`.

    Returns
    -------
    dict of str to dict
        Scores by name, by object.
    """
    results: dict[str, dict[str, float]] = json.loads(
        (shared / "anchors" / "sirfs_reference.json").read_text()
    )["results"][f"{illumination}/diffuse"]
    return results


def problem(truth: MitBerkeleyObject, priors: Priors, weights: Weights) -> Problem:
    """Pose the problem of the reference program.

    The crop is that of the data set; contour points near its edge are dropped.

    Parameters
    ----------
    truth : MitBerkeleyObject
        The object.
    priors : Priors
        Their number of channels is that of the problem.
    weights : Weights
        Of the loss.

    Returns
    -------
    Problem
        The problem.
    """
    image = truth.image[..., : priors.channels]
    log_image = np.where(truth.valid[..., None], np.log(np.where(image > 0, image, 1)), 0.0)
    contour = occluding_contour(truth.mask, drop_near_edge=True)
    profile = priors.silhouette
    expected = None if profile is None else normals_from_silhouette(truth.mask, profile)
    return Problem(
        log_image, truth.valid, truth.mask, contour, priors, weights, silhouette=expected
    )


def scores(truth: MitBerkeleyObject, result: SirfsResult) -> Scores:
    """Score a solution.

    Parameters
    ----------
    truth : MitBerkeleyObject
        Ground truth.
    result : SirfsResult
        The solution.

    Returns
    -------
    Scores
        The six errors.
    """
    normal = normal_from_reference(normals(result.height))
    light = light_from_reference(result.light)
    light = np.broadcast_to(light, (len(light), 3))
    shading = np.exp(real_sh(normal) @ light)
    return score(
        truth,
        height=result.height,
        normal=normal,
        shading=shading,
        reflectance=truth.image / shading,
        light=light,
    )


def write_json(path: Path | None, figures: object) -> None:
    """Write the figures, if a path is given.

    Parameters
    ----------
    path : Path or None
        File to write.
    figures : object
        Anything that JSON can store.
    """
    if path is not None:
        path.write_text(json.dumps(figures, indent=1) + "\n")
