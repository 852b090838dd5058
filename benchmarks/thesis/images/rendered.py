"""The project's own images, rendered on first use, so that everything runs without anybody's data.

"scene": glossy things under softboxes, as a photographer would take them. "glossy": the arithmetic
of `isc synth glossy-mit`, on objects of MIT-Berkeley where a copy is given, else on our own shapes
and paints: shading is exp(SH(normal)) exactly. "synth": scenes as `isc synth` draws them. All have
the truth of every layer, laid out as that of MIT-Berkeley.

Citation: H. Akbar (2016), thesis, whose MIT-Berkeley-UTeM set is not public: "glossy" stands in for
it.

Limits: what is kept in the folder is found by its name: it belongs to one version of the program.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from isc_core import __version__
from isc_core.atomic import new_file
from isc_core.datasets import MitBerkeleyObject
from isc_core.environment import shading_under
from isc_core.metrics import truth_normal
from isc_core.progress import Monitor
from isc_core.sirfs.frames import light_to_reference
from synth.albedos import make_albedo
from synth.dataset.splits import Choices, make_pools
from synth.demo_scene import demo_scene
from synth.glossy_mit.files import exposed as exposed_layers
from synth.glossy_mit.layers import make_layers
from synth.glossy_mit.settings import GlossySettings
from synth.glossy_mit.source import Source, load_source
from synth.light_rigs import make_lights
from synth.lights import EnvironmentLight
from synth.materials import Material
from synth.recipe import Part, Picture, Sources, camera_around, photograph
from synth.rendering import RenderOptions
from synth.scene import Scene
from synth.shapes import make_shape
from synth.truth import GroundTruth, exposed, fit_light, render_truth
from synth.variant import load_mitsuba

from .subjects import QUICK_SIZE, Subject

_SAMPLES, _QUICK_SAMPLES = 128, 32
_LEVEL = 25.0  # per cent of the light that is specular
_SYNTH_SEEDS = (2, 21)
_ARRAYS = ("image", "valid", "mask", "height", "shading", "reflectance", "light")


@dataclass(frozen=True)
class _Thing:
    """An object of ours: a member of a family of shapes, painted from a family of albedos.

    `exponent`, `strength`: of its gloss.
    """

    name: str
    shape: str
    member: int
    paint: str
    exponent: float = 100.0
    strength: float = 0.1

    def part(self, seed: int) -> Part:
        """The shape's member; another seed takes another one."""
        return Part(self.shape, self.member + seed)


_SCENES = (
    _Thing("fruit", "lathe", 8, "patches", 80.0),
    _Thing("pebble", "displaced", 7, "uniform", 60.0),
    _Thing("soap", "superquadric", 11, "noise", 80.0),
    _Thing("tin", "lathe", 7, "print", 120.0),
)
_GLOSSY = (
    _Thing("bowl", "lathe", 6, "patches"),
    _Thing("stone", "displaced", 3, "uniform"),
    _Thing("seal", "blobby", 11, "patches"),
)

Layers = tuple[MitBerkeleyObject, np.ndarray]  # the truth, and the diffuse layer (H, W, 3)


def rendered(
    family: str,
    folder: Path,
    root: Path | None,
    objects: Sequence[str],
    size: int,
    seed: int,
    monitor: Monitor,
) -> Iterator[Subject]:
    """The subjects of a family, "scene", "glossy" or "synth", one by one, from `folder` where they
    are kept.

    `root`, `objects`: the folder of MIT-Berkeley and which of its objects "glossy" takes; None for
    our own. `size`: of the square pictures, pixels. Raises `InputError` where Mitsuba is not
    installed; `Cancelled`.
    """
    origin = "-data" if root is not None and family == "glossy" else ""
    for name, make in _plans(family, root, objects, size, seed):
        path = folder / f"{family}-{name}-{size}-{seed}-{__version__}{origin}.npz"
        if not path.is_file():
            monitor.report(f"rendering {name}", 0.0)
            load_mitsuba()
            _keep(path, *make(Monitor(cancelled=monitor.cancelled)))
        yield _kept(path, name, "specular" if family == "scene" else "synthetic")


def _plans(
    family: str, root: Path | None, objects: Sequence[str], size: int, seed: int
) -> list[tuple[str, Callable[[Monitor], Layers]]]:
    """Names, and what makes them."""
    if family == "scene":
        gourd = ("gourd", partial(_of_scene, demo_scene, size, seed))
        return [
            gourd,
            *(
                (thing.name, partial(_of_scene, partial(_scene, thing, seed), size, seed))
                for thing in _SCENES
            ),
        ]
    if family == "synth":
        return [
            (f"scene{number}", partial(_of_synth, number + seed, size)) for number in _SYNTH_SEEDS
        ]
    if root is not None:
        return [
            (name, partial(_of_glossy, partial(load_source, root, name), seed)) for name in objects
        ]
    return [
        (thing.name, partial(_of_glossy, partial(_own_source, thing, size, seed), seed))
        for thing in _GLOSSY
    ]


def _scene(thing: _Thing, seed: int, size: int) -> Scene:
    """A glossy object under softboxes."""
    shape = thing.part(seed)
    albedo = make_albedo(thing.paint, shape.generator("albedo"))
    mesh = make_shape(thing.shape, shape.generator("shape"))
    material = Material(albedo, "blinn_phong", thing.exponent, thing.strength)
    return Scene(
        mesh,
        material,
        make_lights("area", shape.generator("light")),
        camera_around(mesh, size, 0.92),
    )


def _of_scene(make: Callable[[int], Scene], size: int, seed: int, monitor: Monitor) -> Layers:
    scene = make(size)
    samples = _QUICK_SAMPLES if size <= QUICK_SIZE else _SAMPLES
    truth = render_truth(scene, RenderOptions(samples=samples, seed=seed), monitor)
    return _layers(exposed(scene, truth, 0.98, 0.9995, "image")[1], "scene")


def _of_synth(number: int, size: int, monitor: Monitor) -> Layers:
    """A scene of `isc synth`, glossy ones only."""
    choices = Choices(materials=("blinn_phong", "ggx", "roughplastic"), splits=("train",))
    picture = Picture(size, _QUICK_SAMPLES if size <= QUICK_SIZE else _SAMPLES)
    recipe = make_pools(choices, Sources()).recipe(number, picture, Sources())
    return _layers(photograph(recipe, monitor)[1], recipe.name)


def _layers(truth: GroundTruth, name: str) -> Layers:
    """A rendered truth as that of an object of the set; light above 1 is lost, as on a sensor."""
    image = np.minimum(truth.image, 1).astype(float)
    height = np.where(truth.mask, truth.height, np.nan).astype(float)
    seen = truth.mask & (truth.diffuse > 0).all(-1)
    layers = (truth.shading.astype(float), truth.reflectance.astype(float))
    return (
        MitBerkeleyObject(
            name,
            "laboratory",
            image,
            seen,
            truth.mask,
            height,
            *layers,
            light_to_reference(truth.illumination),
        ),
        np.minimum(truth.diffuse, 1),
    )


def _own_source(thing: _Thing, size: int, seed: int) -> Source:
    """An object of ours as the glossy set's arithmetic takes one of MIT-Berkeley: shape, paint and
    a light of its own.
    """
    shape = thing.part(seed)
    mesh = make_shape(thing.shape, shape.generator("shape"))
    material = Material(make_albedo(thing.paint, shape.generator("albedo")), "lambert")
    lights = make_lights("sh", shape.generator("light"))
    scene = Scene(mesh, material, lights, camera_around(mesh, size, 0.92))
    truth = render_truth(scene, RenderOptions(samples=2, seed=seed))
    height = np.where(truth.mask, truth.height, np.nan).astype(float)
    normal = truth_normal(height)
    mask = truth.mask & np.isfinite(normal).all(-1)
    assert isinstance(lights[0], EnvironmentLight)
    light = fit_light(normal[mask], shading_under(lights[0].radiance, normal[mask]))[0]
    rows, columns = (np.arange(side) for side in mask.shape)
    known = np.where(mask, height, np.nan)
    return Source(
        thing.name,
        mask.shape,
        rows,
        columns,
        mask,
        known,
        truth.reflectance[mask].astype(float),
        normal[mask],
        {"natural": light},
        b"",
    )


def _of_glossy(find: Callable[[], Source], seed: int, monitor: Monitor) -> Layers:
    """An object under its light and a panel, a quarter of the light being specular."""
    source = find()
    settings = GlossySettings(levels=(_LEVEL,), seed=seed)
    made = make_layers(source, settings, monitor)
    picture = exposed_layers(
        source, made["laboratory-area" if "laboratory" in made else "natural-area"], _LEVEL
    )

    def crop(values: np.ndarray) -> np.ndarray:
        image = np.zeros((*source.mask.shape, 3))
        image[source.mask] = values
        return image

    image, diffuse = (
        crop(np.minimum(values, 1))
        for values in (picture.diffuse + picture.specular(_LEVEL), picture.diffuse)
    )
    layers = (crop(picture.shading), crop(source.reflectance))
    seen = source.mask & (image > 0).all(-1)
    truth = MitBerkeleyObject(
        source.name,
        "laboratory",
        image,
        seen,
        source.mask,
        source.height,
        *layers,
        light_to_reference(picture.light),
    )
    return truth, diffuse


def _keep(path: Path, truth: MitBerkeleyObject, diffuse: np.ndarray) -> None:
    arrays = {name: np.asarray(getattr(truth, name)) for name in _ARRAYS}
    with new_file(path) as partial_path, partial_path.open("wb") as file:
        np.savez_compressed(file, diffuse_layer=diffuse, **arrays)


def _kept(path: Path, name: str, kind: str) -> Subject:
    with np.load(path, allow_pickle=False) as stored:
        arrays = {key: stored[key] for key in _ARRAYS}
        diffuse = stored["diffuse_layer"].astype(np.float32)
    image = arrays["image"].astype(np.float32)
    truth = MitBerkeleyObject(name=name, illumination="laboratory", **arrays)
    return Subject(name, kind, image, truth.mask, diffuse, np.maximum(image - diffuse, 0), truth)
