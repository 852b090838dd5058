"""The objects of the closed loop: masked photos, and rendered scenes whose truth under another
light is known.

Every case is decomposed once, by the command that users run, into FOLDER/results/NAME; for rendered
scenes the photo lies in FOLDER/photos, the truth under new lights in FOLDER/truth, and the true
maps, as a result of their own, in FOLDER/results/NAME_true. What is there is not made again.

Equation: a new light is made as bright as the old one, E' = E mean(S) / mean(S'), S and S' being
the true shadings: relit pictures are then judged on the photo's own scale.

Limits: the scale between reflectance and light cannot be known from one photo, so that a relit
picture is right up to one gain at best.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from isc_core.cli.main import main as isc
from isc_core.errors import InputError
from isc_core.result_files.arrays_file import ARRAYS, write_arrays
from isc_core.result_files.result_folder import save
from isc_core.scene.decomposition import Decomposition, Provenance
from synth.capture.recipe import Part, Picture, Recipe, photograph
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
}  # shape, paint and light, see `synth.capture.recipe`
_LEVEL, _FILL = (
    0.9,
    0.91,
    # the gourd's brightest value; share of the picture's side that no object exceeds, so that none
    # is scaled
)
_SKY_ROWS = 32
_PARTS = ("sky", "sun_direction", "sun_irradiance", "image", "diffuse")


@dataclass(frozen=True)
class Relit:
    """A rendered scene under a new light. `light`: its name, of `NEW_LIGHTS`. `sky`: (rows, 2 rows,
    3) radiance, what is not the sun; `sun_direction` (3,) unit, toward it, camera frame;
    `sun_irradiance` (3,), 0 for none. `image`, `diffuse`: (H, W, 3) Mitsuba's truth.
    """

    light: str
    sky: np.ndarray
    sun_direction: np.ndarray
    sun_irradiance: np.ndarray
    image: np.ndarray
    diffuse: np.ndarray


@dataclass(frozen=True)
class Case:
    """One object. `result`: folder of its decomposition. `truth`: folder of the true maps as if
    they had been recovered, None for photos. `relit`: truths under new lights, none for photos.
    """

    name: str
    result: Path
    truth: Path | None = None
    relit: tuple[Relit, ...] = ()


@dataclass(frozen=True)
class Making:
    """How cases are made. `folder`: for all files. `photos`: of the real photos, None without.
    `size`: the object's long side in pixels of the maps. `samples`: light paths a pixel of
    Mitsuba's pictures.
    """

    folder: Path
    photos: Path | None
    size: int = 256
    samples: int = 256


def cases(making: Making, names: Iterable[str]) -> Iterator[Case]:
    """The cases of these names, of `PHOTOS` and `RENDERED`.

    Raises `InputError` for other names, photos not given, and failed runs.
    """
    for name in names:
        if name in RENDERED:
            yield _rendered(making, name)
        elif making.photos is not None and (path := making.photos / f"{name}.png").is_file():
            yield Case(name, _decomposed(making, name, path))
        else:
            raise InputError(
                f"{name}: there is no such photo; rendered objects are {', '.join(RENDERED)}"
            )


def _decomposed(making: Making, name: str, photo: Path) -> Path:
    result = making.folder / "results" / f"{name}_{making.size}"
    if not (result / ARRAYS).is_file():
        size = str(making.size)
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
            raise InputError(f"{photo} could not be decomposed")
    return result


def _rendered(making: Making, name: str) -> Case:
    photo, relit = (
        making.folder / "photos" / f"{name}_{making.size}.png",
        making.folder / "truth" / f"{name}_{making.size}.npz",
    )
    truth = making.folder / "results" / f"{name}_true_{making.size}"
    if not (relit.is_file() and photo.is_file() and (truth / ARRAYS).is_file()):
        scene, seen = _photographed(making, name)
        for path in (photo, relit):
            path.parent.mkdir(parents=True, exist_ok=True)
        write_photo(photo, seen)
        np.savez(relit, **_new_truths(making, scene, seen))
        _save_truth(seen, truth)
    with np.load(relit, allow_pickle=False) as stored:
        lights = tuple(
            Relit(light, *(stored[f"{light}_{part}"] for part in _PARTS)) for light in NEW_LIGHTS
        )
    return Case(name, _decomposed(making, name, photo), truth, lights)


def _photographed(making: Making, name: str) -> tuple[Scene, GroundTruth]:
    """The scene under its own lights, exposed as a photographer does."""
    side = round(making.size / _FILL)
    if name == "gourd":
        scene = demo_scene(side)
        return exposed(
            scene, render_truth(scene, RenderOptions(making.samples)), level=_LEVEL, layer="image"
        )
    shape, albedo, light = _MEMBERS[name]
    picture = Picture(size=side, samples=making.samples)
    return photograph(
        Recipe(7, Part(shape, 3), Part("ggx", 2), "ggx", albedo, Part(light, 1), picture)
    )


def _save_truth(truth: GroundTruth, folder: Path) -> None:
    """The true maps as the result of a decomposition that makes no mistake; its light is the smooth
    one that fits best.
    """
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
    write_arrays(d, folder / ARRAYS)


def _new_truths(making: Making, scene: Scene, seen: GroundTruth) -> dict[str, np.ndarray]:
    made: dict[str, np.ndarray] = {}
    for name in NEW_LIGHTS:
        lights = _new_lights(name)
        truth = render_truth(replace(scene, lights=lights), RenderOptions(making.samples))
        gain = float(seen.shading[seen.mask].mean() / truth.shading[truth.mask].mean())
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
    """A low sun from the right with a little blue sky, or a smooth sky alone: both unlike the
    lights of the photos.
    """
    if name == "sky":
        return make_lights("sh", np.random.default_rng(11))
    fill = np.broadcast_to(np.array([0.10, 0.13, 0.18]), (_SKY_ROWS, 2 * _SKY_ROWS, 3)).copy()
    return DirectionalLight(toward(55, 70), np.pi * np.array([1.0, 0.93, 0.82])), EnvironmentLight(
        fill
    )
