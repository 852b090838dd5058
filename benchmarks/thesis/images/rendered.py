"""Test images rendered by the project itself, on first use; no data set is needed.

Problem: family `scene` has glossy objects under softboxes, as a photographer takes them. `glossy`
has the composition of `isc synth glossy-mit`, on MIT-Berkeley objects where a copy is given, else
on own shapes and albedos; its shading is exp(SH(normal)) exactly. `synth` has scenes of `isc
synth`. All have the ground truth of every layer, stored like that of MIT-Berkeley.

Citation: H. Akbar (2016), thesis, whose MIT-Berkeley-UTeM set is not public: `glossy` replaces it.

Limits: a cached image is identified by its file name, which contains the program's version and a
digest of the MIT-Berkeley files.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from isc_core import __version__
from isc_core.datasets.mit_berkeley import MitBerkeleyObject
from isc_core.evaluation.metrics import truth_normal
from isc_core.io.atomic import new_file
from isc_core.progress import Monitor
from isc_core.shading.environment_map import shading_under
from isc_core.shading.spherical_harmonics import light_to_reference
from synth.albedos import make_albedo
from synth.capture.recipe import FamilyMember, PictureSettings, Sources, camera_around, photograph
from synth.capture.truth import GroundTruth, exposed, fit_light, render_truth
from synth.dataset.splits import Choices, make_pools
from synth.demo_scene import demo_scene
from synth.glossy_mit.files import exposed as exposed_layers
from synth.glossy_mit.layers import make_layers
from synth.glossy_mit.settings import GlossySettings
from synth.glossy_mit.source import Source, load_source
from synth.light_rigs import make_lights
from synth.rendering import RenderOptions
from synth.scene import Scene
from synth.scene.lights import EnvironmentLight
from synth.scene.materials import Material
from synth.scene.variant import load_mitsuba
from synth.shapes import make_shape

from .subject import QUICK_SIZE, Subject

_SAMPLES, _QUICK_SAMPLES = 128, 32
_LEVEL = 25.0  # specular share of the light, per cent
_SYNTH_SEEDS = (2, 21)
_ARRAYS = ("image", "valid", "mask", "height", "shading", "reflectance", "light")


@dataclass(frozen=True)
class _RenderedObject:
    """Own object: a member of a shape family with an albedo family and a specular lobe."""

    name: str
    shape: str
    member: int
    albedo: str
    exponent: float = 100.0
    strength: float = 0.1

    def part(self, seed: int) -> FamilyMember:
        """Return the shape's member; another seed selects another one."""
        return FamilyMember(self.shape, self.member + seed)


_SCENES = (
    _RenderedObject("fruit", "lathe", 8, "patches", 80.0),
    _RenderedObject("pebble", "displaced", 7, "uniform", 60.0),
    _RenderedObject("soap", "superquadric", 11, "noise", 80.0),
    _RenderedObject("tin", "lathe", 7, "print", 120.0),
)
_GLOSSY = (
    _RenderedObject("bowl", "lathe", 6, "patches"),
    _RenderedObject("stone", "displaced", 3, "uniform"),
    _RenderedObject("seal", "blobby", 11, "patches"),
)

Layers = tuple[MitBerkeleyObject, np.ndarray]  # ground truth, diffuse layer (H, W, 3)


def rendered_subjects(
    family: str,
    folder: Path,
    root: Path | None,
    version: str,
    objects: Sequence[str],
    size: int,
    seed: int,
    monitor: Monitor,
) -> Iterator[Subject]:
    """Yield the subjects of a family, from the cache where possible.

    Parameters
    ----------
    family : str
        "scene", "glossy" or "synth".
    folder : Path
        Cache of rendered images.
    root : Path or None
        MIT-Berkeley folder used by "glossy"; None uses own objects.
    version : str
        Digest of that folder.
    objects : sequence of str
        MIT-Berkeley objects used by "glossy".
    size : int
        Side of the square images, pixels.
    seed : int
        Seed of shapes, albedos, lights and samples.
    monitor : Monitor
        Progress and cancellation.

    Yields
    ------
    Subject
        One subject with its layers and ground truth.

    Raises
    ------
    InputError
        If Mitsuba is required and not installed.
    Cancelled
        If the user cancels.
    """
    origin = f"-{version}" if root is not None and family == "glossy" else ""
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
    """List the names of a family and the function that renders each."""
    if family == "scene":
        gourd = ("gourd", partial(_of_scene, demo_scene, size, seed))
        return [
            gourd,
            *(
                (object_.name, partial(_of_scene, partial(_scene, object_, seed), size, seed))
                for object_ in _SCENES
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
        (object_.name, partial(_of_glossy, partial(_own_source, object_, size, seed), seed))
        for object_ in _GLOSSY
    ]


def _scene(object_: _RenderedObject, seed: int, size: int) -> Scene:
    """Build a glossy object under softboxes."""
    shape = object_.part(seed)
    albedo = make_albedo(object_.albedo, shape.generator("albedo"))
    mesh = make_shape(object_.shape, shape.generator("shape"))
    material = Material(albedo, "blinn_phong", object_.exponent, object_.strength)
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
    """Render a glossy scene of `isc synth`."""
    choices = Choices(materials=("blinn_phong", "ggx", "roughplastic"), splits=("train",))
    picture = PictureSettings(size, _QUICK_SAMPLES if size <= QUICK_SIZE else _SAMPLES)
    recipe = make_pools(choices, Sources()).recipe(number, picture, Sources())
    return _layers(photograph(recipe, monitor)[1], recipe.name)


def _layers(truth: GroundTruth, name: str) -> Layers:
    """Convert a rendered truth; image values above 1 are clipped, as by a sensor."""
    image = np.minimum(truth.image, 1).astype(float)
    height = np.where(truth.mask, truth.height, np.nan).astype(float)
    valid = truth.mask & (truth.diffuse > 0).all(-1)
    layers = (truth.shading.astype(float), truth.reflectance.astype(float))
    return (
        MitBerkeleyObject(
            name,
            "laboratory",
            image,
            valid,
            truth.mask,
            height,
            *layers,
            light_to_reference(truth.illumination),
        ),
        np.minimum(truth.diffuse, 1),
    )


def _own_source(object_: _RenderedObject, size: int, seed: int) -> Source:
    """Build an own object as input of the glossy set: shape, albedo and environment map."""
    shape = object_.part(seed)
    mesh = make_shape(object_.shape, shape.generator("shape"))
    material = Material(make_albedo(object_.albedo, shape.generator("albedo")), "lambert")
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
        object_.name,
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


def _of_glossy(load: Callable[[], Source], seed: int, monitor: Monitor) -> Layers:
    """Light an object by its light and an area light; a quarter of the light is specular."""
    source = load()
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
    valid = source.mask & (image > 0).all(-1)
    truth = MitBerkeleyObject(
        source.name,
        "laboratory",
        image,
        valid,
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
