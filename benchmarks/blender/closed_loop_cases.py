"""Objects of the closed loop: masked photos, and rendered scenes with known truth when relit.

Every object is decomposed once, by the users' command, into FOLDER/results/NAME. Of a rendered
scene, the photo is in FOLDER/photos, the truth under new lights in FOLDER/truth, and the true maps,
as a result of their own, in FOLDER/results/NAME_true. Existing files are kept.

Equation: a new light is made as bright as the old one, E' = E mean(S) / mean(S'), where S and S'
are the true shadings: relit images are then measured at the photo's own scale.

Limits: the scale between reflectance and light cannot be known from one photo; a relit image is
right up to one gain at best.
"""

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from isc_core.cli.main import main as isc
from isc_core.errors import InputError
from isc_core.result_files.arrays_file import ARRAYS, write_arrays
from isc_core.result_files.result_folder import save
from isc_core.scene.decomposition import Decomposition, Provenance
from isc_core.scene.part_of_result import ResultPart
from synth.capture.recipe import FamilyMember, PictureSettings, Recipe, photograph
from synth.capture.sensor import write_photo
from synth.capture.truth import GroundTruth, exposed, render_truth
from synth.demo_scene import demo_scene
from synth.light_rigs import make_lights
from synth.light_rigs.placing import toward
from synth.rendering import RenderOptions
from synth.scene import Scene
from synth.scene.lights import DirectionalLight, EnvironmentLight, Light, lights_as_environment

PHOTOS = ("Banana", "Basketball", "Cup", "Helmet", "Shrek")
RENDERED = ("gourd", "vase", "blob")
NEW_LIGHTS = ("sun", "sky")
_MEMBERS = {
    "vase": ("lathe", "print", "area"),
    "blob": ("blobby", "patches", "sh"),
}  # shape, albedo and light, see `synth.capture.recipe`
# The gourd's brightest value; share of the image's side that no object exceeds, so that none is
# scaled.
_LEVEL, _FILL = 0.9, 0.91
_SKY_ROWS = 32
_PARTS = ("sky", "sun_direction", "sun_irradiance", "image", "diffuse")


@dataclass(frozen=True, eq=False)
class RelitTruth:
    """A rendered scene under a new light.

    Attributes
    ----------
    light : str
        One of `NEW_LIGHTS`.
    sky : (rows, 2 rows, 3) ndarray
        Environment map without the sun.
    sun_direction : (3,) ndarray
        Unit vector to the sun, camera frame.
    sun_irradiance : (3,) ndarray
        0 without a sun.
    image, diffuse : (H, W, 3) ndarray
        Mitsuba's ground truth.
    """

    light: str
    sky: np.ndarray
    sun_direction: np.ndarray
    sun_irradiance: np.ndarray
    image: np.ndarray
    diffuse: np.ndarray


@dataclass(frozen=True)
class LoopCase:
    """One object.

    Attributes
    ----------
    name : str
        Of `PHOTOS` or `RENDERED`.
    result : Path
        Folder of its decomposition.
    truth : Path or None
        Folder of the true maps; None for photos.
    relit : tuple of RelitTruth
        Ground truth under new lights; empty for photos.
    """

    name: str
    result: Path
    truth: Path | None = None
    relit: tuple[RelitTruth, ...] = ()


@dataclass(frozen=True)
class CaseOptions:
    """How objects are made.

    Attributes
    ----------
    folder : Path
        For all files.
    photos : Path or None
        Folder of the real photos.
    size : int
        Long side of the object, in pixels of the maps.
    samples : int
        Mitsuba's samples per pixel.
    """

    folder: Path
    photos: Path | None
    size: int = 256
    samples: int = 256


def add_case_arguments(parser: argparse.ArgumentParser, size: int, samples: int) -> None:
    """Add the options of programs that measure cases.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    size, samples : int
        Defaults.
    """
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder to write to")
    parser.add_argument("--photos", type=Path, help="folder of the real photos")
    parser.add_argument(
        "--names", nargs="+", help=f"objects to measure: {', '.join(RENDERED + PHOTOS)}"
    )
    parser.add_argument(
        "--size",
        type=int,
        default=size,
        help="long side of the objects in pixels (default: %(default)s)",
    )
    parser.add_argument(
        "--samples",
        type=int,
        default=samples,
        help="samples of Cycles per pixel (default: %(default)s)",
    )


def run_cases(
    parser: argparse.ArgumentParser,
    measure: Callable[[argparse.Namespace], None],
    arguments: Sequence[str] | None,
) -> int:
    """Run a program that measures cases.

    Parameters
    ----------
    parser : argparse.ArgumentParser
    measure : callable
        Of the parsed options.
    arguments : sequence of str, optional
        By default those of the process.

    Returns
    -------
    int
        0, or 2 after an error message.
    """
    try:
        measure(parser.parse_args(arguments))
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


def chosen_cases(given: argparse.Namespace, samples: int) -> Iterator[LoopCase]:
    """Make the objects that a command line names: by default those of `RENDERED`, and `PHOTOS`
    where there are any.

    Parameters
    ----------
    given : argparse.Namespace
        With the options of `add_case_arguments`.
    samples : int
        Mitsuba's samples per pixel.

    Yields
    ------
    LoopCase

    Raises
    ------
    InputError
        For an unknown name, a missing photo, or a failed run.
    """
    options = CaseOptions(given.output, given.photos, given.size, samples)
    for name in given.names or RENDERED + (PHOTOS if given.photos else ()):
        if name in RENDERED:
            yield _rendered(options, name)
        elif options.photos is not None and (path := options.photos / f"{name}.png").is_file():
            yield LoopCase(name, _decomposed(options, name, path))
        else:
            raise InputError(f"no photo named `{name}`; rendered objects are {', '.join(RENDERED)}")


def _decomposed(options: CaseOptions, name: str, photo: Path) -> Path:
    result = options.folder / "results" / f"{name}_{options.size}"
    if not (result / ARRAYS).is_file():
        size = str(options.size)
        if (
            isc(
                [
                    "decompose",
                    str(photo),
                    "--max-size",
                    size,
                    "--arrays",
                    "--quiet",
                    "-o",
                    str(result),
                ]
            )
            != 0
        ):
            raise InputError(f"cannot decompose `{photo}`")
    return result


def _rendered(options: CaseOptions, name: str) -> LoopCase:
    photo, relit = (
        options.folder / "photos" / f"{name}_{options.size}.png",
        options.folder / "truth" / f"{name}_{options.size}.npz",
    )
    truth = options.folder / "results" / f"{name}_true_{options.size}"
    if not (relit.is_file() and photo.is_file() and (truth / ARRAYS).is_file()):
        scene, truth_maps = _photographed(options, name)
        for path in (photo, relit):
            path.parent.mkdir(parents=True, exist_ok=True)
        write_photo(photo, truth_maps)
        np.savez(relit, **_new_truths(options, scene, truth_maps))
        _save_truth(truth_maps, truth)
    with np.load(relit, allow_pickle=False) as stored:
        lights = tuple(
            RelitTruth(light, *(stored[f"{light}_{part}"] for part in _PARTS))
            for light in NEW_LIGHTS
        )
    return LoopCase(name, _decomposed(options, name, photo), truth, lights)


def _photographed(options: CaseOptions, name: str) -> tuple[Scene, GroundTruth]:
    """The scene under its own lights, exposed near white."""
    side = round(options.size / _FILL)
    if name == "gourd":
        scene = demo_scene(side)
        return exposed(
            scene, render_truth(scene, RenderOptions(options.samples)), level=_LEVEL, layer="image"
        )
    shape, albedo, light = _MEMBERS[name]
    picture = PictureSettings(size=side, samples=options.samples)
    return photograph(
        Recipe(
            7,
            FamilyMember(shape, 3),
            FamilyMember("ggx", 2),
            "ggx",
            albedo,
            FamilyMember(light, 1),
            picture,
        )
    )


def _save_truth(truth: GroundTruth, folder: Path) -> None:
    """Save the true maps as a perfect decomposition; its light is the best smooth fit."""
    layers = (
        truth.image,
        truth.diffuse,
        truth.specular,
        truth.residual,
        truth.reflectance,
        truth.shading,
    )
    certain = truth.mask.astype(np.float32)
    height = np.where(truth.mask, truth.height - truth.height[truth.mask].min(), 0)
    d = Decomposition(
        *layers, truth.normal, height, truth.mask, certain, truth.illumination, Provenance()
    )
    save(d, folder)
    write_arrays(ResultPart.of(d), folder / ARRAYS)


def _new_truths(
    options: CaseOptions, scene: Scene, photographed: GroundTruth
) -> dict[str, np.ndarray]:
    made: dict[str, np.ndarray] = {}
    for name in NEW_LIGHTS:
        lights = _new_lights(name)
        truth = render_truth(replace(scene, lights=lights), RenderOptions(options.samples))
        gain = float(
            photographed.shading[photographed.mask].mean() / truth.shading[truth.mask].mean()
        )
        truth = truth.brightened(gain)
        sky = lights_as_environment(
            [one for one in lights if isinstance(one, EnvironmentLight)], _SKY_ROWS
        )
        suns = [one for one in lights if isinstance(one, DirectionalLight)]
        direction, irradiance = (
            (suns[0].direction, suns[0].irradiance)
            if suns
            else (np.array([0.0, 0, 1]), np.zeros(3))
        )
        values = (gain * sky, direction, gain * np.asarray(irradiance), truth.image, truth.diffuse)
        made |= {f"{name}_{part}": value for part, value in zip(_PARTS, values, strict=True)}
    return made


def _new_lights(name: str) -> tuple[Light, ...]:
    """A low sun from the right with a little sky, or a smooth sky alone."""
    if name == "sky":
        return make_lights("sh", np.random.default_rng(11))
    fill = np.broadcast_to(np.array([0.10, 0.13, 0.18]), (_SKY_ROWS, 2 * _SKY_ROWS, 3)).copy()
    return DirectionalLight(toward(55, 70), np.pi * np.array([1.0, 0.93, 0.82])), EnvironmentLight(
        fill
    )
