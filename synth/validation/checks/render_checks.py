"""Checks of a data set: the identities of its layers, and its shading against an independent
render.

Identities, on every scene: image = diffuse + specular + residual and diffuse = reflectance *
shading, to 1e-5 of the image's maximum. Renders, on a few scenes: the scene is rebuilt from its
description with a white albedo and rendered with another seed; the stored shading must agree within
the noise of both (`pixel_test`, over blocks of pixels, whose means are nearly normal). With
interreflections the object keeps its albedo, since a white one would light itself more.

Limits: an independent seed reveals errors of sampling and storage, not those of a shared formula,
which the generator's own tests cover. Scenes that need a user's files cannot be rebuilt.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from isc_core.errors import InputError
from isc_core.extras import install_command
from isc_core.progress import Monitor

from ...capture.recipe import FamilyMember, PictureSettings, Recipe, build
from ...capture.truth import ENVIRONMENT_ROWS, GroundTruth, render_truth
from ...dataset.reading import read_description, read_truth
from ...scene.lights import lights_as_environment
from .pixel_test import PixelTestOptions, PixelTestResult, pixel_test, pooled

_TOLERANCE = 1e-5
_LEVEL = 0.01  # probability that correct renders are rejected, over all scenes of a run
_BLOCK = 4  # pixels a side
_OTHER_SEED = 0x5EED


@dataclass(frozen=True, eq=False)
class RenderCheck:
    """One check of one scene.

    Attributes
    ----------
    scene, what : str
        The scene, and the check.
    error, limit : float
        The largest error, and its limit.
    maps : mapping of str to (H, W) ndarray
        Channels that show why the check failed, empty if it passed.
    """

    scene: str
    what: str
    error: float
    limit: float
    maps: Mapping[str, np.ndarray] = field(default_factory=dict, repr=False, compare=False)

    @property
    def passed(self) -> bool:
        """Whether the error is within the limit."""
        return self.error <= self.limit

    @property
    def text(self) -> str:
        """The check as one line."""
        verb = "is within" if self.passed else "exceeds"
        return f"{self.scene}: {self.what}: {self.error:.3g} {verb} the limit {self.limit:.3g}"


def check_dataset(
    folders: Sequence[Path], renders: int, seed: int, monitor: Monitor
) -> tuple[tuple[RenderCheck, ...], tuple[str, ...]]:
    """Check the identities of every scene, and new renders of some.

    Parameters
    ----------
    folders : sequence of Path
        The scenes.
    renders : int
        Number of scenes to render again, drawn by `seed`.
    seed : int
        Seed of the draw.
    monitor : Monitor
        Progress and cancellation.

    Returns
    -------
    checks : tuple of RenderCheck
        The checks.
    notes : tuple of str
        Checks that were not possible.

    Raises
    ------
    InputError
        If a scene cannot be read.
    Cancelled
        If the user cancels.
    """
    checks: list[RenderCheck] = []
    for done, folder in enumerate(folders):
        monitor.part(0, 0.2).report("checking the dataset", done / len(folders))
        checks += check_identities(folder.name, read_truth(folder))
    if not renders:
        return tuple(checks), ("no scene was rendered again",)
    if find_spec("mitsuba") is None:
        return tuple(checks), (
            f"no scene was rendered again: install Mitsuba with `{install_command('synth')}`",
        )
    chosen = [folder for folder in folders if not needs_files(folder)]
    order = np.random.default_rng(seed).permutation(len(chosen))[:renders]
    for done, index in enumerate(order):
        monitor.report("rendering again", 0.2 + 0.8 * done / len(order))
        checks.append(check_shading(chosen[index], _LEVEL / len(order)))
    return tuple(checks), () if chosen else (
        "no scene was rendered again: all of them need your own files",
    )


def check_identities(name: str, truth: GroundTruth) -> tuple[RenderCheck, ...]:
    """Check sum and product of a scene's layers, relative to the image's maximum.

    Parameters
    ----------
    name : str
        The scene.
    truth : GroundTruth
        Its layers.

    Returns
    -------
    tuple of RenderCheck
        One per identity.
    """
    scale = max(float(np.abs(truth.image).max()), 1e-12)
    image, diffuse, specular, residual, reflectance, shading = (
        getattr(truth, layer).astype(float)
        for layer in ("image", "diffuse", "specular", "residual", "reflectance", "shading")
    )
    errors = {
        "image = diffuse + specular + residual": image - diffuse - specular - residual,
        "diffuse = reflectance * shading": (diffuse - reflectance * shading)[truth.mask],
    }
    return tuple(
        RenderCheck(name, what, float(np.abs(error).max()) / scale, _TOLERANCE)
        for what, error in errors.items()
    )


def check_shading(folder: Path, level: float) -> RenderCheck:
    """Compare the stored shading of a scene with a new render with another seed.

    The new render is white; with interreflections it has the scene's albedo.

    Parameters
    ----------
    folder : Path
        The scene.
    level : float
        Probability that a correct scene is rejected.

    Returns
    -------
    RenderCheck
        The check.

    Raises
    ------
    InputError
        If the scene cannot be rebuilt.
    """
    stored = read_truth(folder)
    recipe = read_recipe(folder)
    scene = build(recipe)
    gain = stored.environment.sum(dtype=float) / max(
        float(lights_as_environment(scene.lights, ENVIRONMENT_ROWS).sum(dtype=float)), 1e-30
    )
    options = recipe.render_options()
    if not options.bounces:
        scene = replace(scene, material=replace(scene.material, albedo=np.ones((1, 1, 3))))
    again = render_truth(scene, replace(options, seed=options.seed ^ _OTHER_SEED)).brightened(
        float(gain)
    )
    if not np.array_equal(again.mask, stored.mask):
        return RenderCheck(
            folder.name,
            "silhouette of the rebuilt object, pixels that differ",
            float((again.mask ^ stored.mask).sum()),
            0,
        )
    difference = again.shading.astype(float) - stored.shading
    variance = again.shading_variance.astype(float) + stored.shading_variance
    result = _tested(difference, variance, float(stored.shading.max()), level)
    worst = max(
        result.worst / result.threshold,
        abs(result.bias) / result.global_threshold,
        result.spread / result.global_threshold,
    )
    maps = (
        {}
        if result.accepted
        else {"difference": difference, "variance": variance, "again": again.shading}
    )
    channels = {
        f"{name}.{letter}": image[..., k]
        for name, image in maps.items()
        for k, letter in enumerate("RGB")
    }
    what = "shading against an independent render, largest z relative to its threshold"
    return RenderCheck(folder.name, what, float(worst), 1.0, channels)


def read_recipe(folder: Path) -> Recipe:
    """Read the recipe of a scene, except for the sensor, from its `scene.json`.

    Parameters
    ----------
    folder : Path
        The scene.

    Returns
    -------
    Recipe
        The recipe.

    Raises
    ------
    InputError
        If the file does not contain it.
    """
    content = read_description(folder)
    try:
        parts = {
            what: FamilyMember(content[what]["family"], content[what]["number"])
            for what in ("object", "light")
        }
        model, name = content["material"]["model"], content["material"]["id"]
        number, picture = int(name.removeprefix(model)), content["picture"]
        settings = PictureSettings(
            size=picture["size"],
            samples=picture["samples"],
            bounces=picture["bounces"],
            perspective=picture["perspective"],
            renderer=picture["renderer"],
        )
        return Recipe(
            content["seed"],
            parts["object"],
            FamilyMember(model, number),
            model,
            content["albedo"]["family"],
            parts["light"],
            settings,
        )
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{folder / 'scene.json'} does not describe how the scene was made: {error}"
        ) from error


def needs_files(folder: Path) -> bool:
    """Return whether a scene was made with a user's files.

    Parameters
    ----------
    folder : Path
        The scene.

    Returns
    -------
    bool
        True for a mesh, height map, albedo image or environment from a file.

    Raises
    ------
    InputError
        As `read_description`.
    """
    content = read_description(folder)
    families = [content.get(what, {}).get("family") for what in ("object", "albedo", "light")]
    return any(family in ("mesh", "height", "image", "natural", "hdr") for family in families)


def _tested(
    difference: np.ndarray, variance: np.ndarray, brightest: float, level: float
) -> PixelTestResult:
    blocks = pooled(difference, _BLOCK), pooled(variance, _BLOCK, variance=True)
    return pixel_test(*blocks, PixelTestOptions(level=level, tolerance=_TOLERANCE * brightest))
