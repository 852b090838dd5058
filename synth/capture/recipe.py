"""The recipe of a scene: the names and numbers from which it is built.

Objects, materials and lights are members of families: "lathe03" is the fourth lathe object, the
same in every scene, with any material and light. Each member therefore has its own random numbers,
seeded by its name; properties of a single scene (framing, exposure, samples, noise) are drawn from
streams of the scene's seed.

Equation: member (aspect, family, number): SeedSequence((crc32 aspect, crc32 family, number));
scene: SeedSequence(seed, spawn_key=(k,)). The camera: pixels_per_unit = fill * size / extent, the
extent being the wider side of the object's silhouette.

Citation: M. E. O'Neill, "PCG: a family of simple fast space-efficient statistically good algorithms
for random number generation", Harvey Mudd College HMC-CS-2014-0905 (2014) (NumPy's generator).

Limits: members depend on the version of the code that draws them, which `scene.json` records.
"""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import cast
from zlib import crc32

import numpy as np

from isc_core.datasets.mit_berkeley import load_natural_lights
from isc_core.errors import InputError
from isc_core.progress import Monitor
from isc_core.shading.environment_map import environment_from_shading
from isc_core.shading.spherical_harmonics import light_from_reference

from ..albedos import image_albedo, make_albedo
from ..light_rigs import make_lights
from ..light_rigs.files import read_panorama
from ..rendering import Renderer, RenderOptions
from ..scene.camera import Camera
from ..scene.lights import EnvironmentLight, Light
from ..scene.materials import Material, Model
from ..scene.meshes import Mesh
from ..scene.scene import Scene
from ..shapes import make_shape
from ..shapes.height_field import mesh_of_height, read_height
from ..shapes.mesh_file import read_mesh_file
from .finishes import make_material
from .sensor import Sensor, observe
from .truth import GroundTruth, exposed, render_truth

# Families that are read from a user's file instead of drawn; "mesh" is also the albedo of a mesh.
MESH_FILE, HEIGHT_FILE, IMAGE_FILE = "mesh", "height", "image"
_DISTANCE = 5.0  # of a pinhole, object units: as for objects on a table
_FILL = (0.85, 0.90)  # of the picture's side, by the object
_LEVEL = (0.50, 0.75)  # of the brightest diffuse light
_MOST_CLIPPED = 0.1  # of the image's values: an acceptable amount of clipped highlights
_FRAMING, _EXPOSURE, _SAMPLES, _NOISE = range(4)  # streams of a scene's seed


@dataclass(frozen=True)
class FamilyMember:
    """A member of a family of objects, materials or lights: the family's name, and a number
    from 0.
    """

    family: str
    number: int

    @property
    def name(self) -> str:
        """Its name in folder names: `lathe03`."""
        return f"{self.family}{self.number:02d}"

    def generator(self, aspect: str) -> np.random.Generator:
        """Return the random numbers of one aspect of this member.

        Parameters
        ----------
        aspect : str
            "shape", "albedo", "gloss" or "light".

        Returns
        -------
        numpy.random.Generator
            Depends on the aspect, the family and the number only.
        """
        words = (crc32(text.encode()) for text in (aspect, self.family))
        return np.random.default_rng(np.random.SeedSequence([*words, self.number]))


@dataclass(frozen=True)
class Sources:
    """A user's files, or None.

    Attributes
    ----------
    mesh, height : Path or None
        Objects.
    albedo_image : Path or None
        An albedo.
    natural_lights : Path or None
        The folder of natural_lights.mat.
    hdr : tuple of Path
        Environments, one light each, in alphabetical order.
    """

    mesh: Path | None = None
    height: Path | None = None
    albedo_image: Path | None = None
    natural_lights: Path | None = None
    hdr: tuple[Path, ...] = ()

    def check(self) -> bool:
        """Read the files once, before any work.

        Returns
        -------
        bool
            Whether the mesh has colours.

        Raises
        ------
        InputError
            If a file cannot be used.
        """
        if self.height is not None:
            read_height(self.height)
        if self.albedo_image is not None:
            image_albedo(self.albedo_image)
        for path in self.hdr:
            read_panorama(path)
        return self.mesh is not None and read_mesh_file(self.mesh).albedo is not None


@dataclass(frozen=True)
class PictureSettings:
    """Settings of the camera, renderer and sensor.

    Attributes
    ----------
    size : int
        Side of the square picture in pixels.
    samples, bounces, renderer
        See `RenderOptions`.
    perspective : bool
        A pinhole instead of an orthographic camera.
    exposure : float or None
        The 99.5th percentile of the diffuse layer, > 0. None draws it for each scene from .5 to
        .75, and reduces it if more than a tenth of the image would be above 1.
    sensor : Sensor
        The sensor.

    Raises
    ------
    InputError
        For invalid values.
    """

    size: int = 256
    samples: int = 64
    bounces: int = 0
    perspective: bool = False
    exposure: float | None = None
    sensor: Sensor = field(default_factory=lambda: Sensor(clip=False))
    renderer: Renderer = "auto"

    def __post_init__(self) -> None:
        Camera(self.size, self.size, 1.0)
        RenderOptions(self.samples, 0, self.bounces, self.renderer)
        if self.exposure is not None and not 0 < self.exposure < np.inf:
            raise InputError("the exposure must be finite and above 0")


@dataclass(frozen=True)
class Recipe:
    """One scene.

    Attributes
    ----------
    seed : int
        >= 0.
    shape, material, light : FamilyMember
        Content of the scene.
    model : str
        The material's reflectance model, of `MODELS`.
    albedo : str
        Family of its albedo, of `ALBEDOS`, "image" or "mesh".
    picture : PictureSettings
        Camera, renderer and sensor.
    sources : Sources
        The user's files.
    """

    seed: int
    shape: FamilyMember
    material: FamilyMember
    model: str
    albedo: str
    light: FamilyMember
    picture: PictureSettings = field(default_factory=PictureSettings)
    sources: Sources = field(default_factory=Sources)

    @property
    def name(self) -> str:
        """Name of the scene's folder."""
        return f"{self.shape.name}_{self.material.name}_{self.light.name}_{self.seed:05d}"

    def stream(self, number: int) -> np.random.SeedSequence:
        """Return the scene's random numbers of one purpose.

        Parameters
        ----------
        number : int
            Number of the purpose, the spawn key.

        Returns
        -------
        numpy.random.SeedSequence
            Depends on the scene's seed and `number` only.
        """
        return np.random.SeedSequence(self.seed, spawn_key=(number,))

    def render_options(self) -> RenderOptions:
        """Return the options of `render_truth`."""
        seed = int(self.stream(_SAMPLES).generate_state(1)[0] & 0x7FFFFFFF)
        return RenderOptions(
            self.picture.samples, seed, self.picture.bounces, self.picture.renderer
        )


def build(recipe: Recipe) -> Scene:
    """Build a scene, its lights at their original brightness.

    Parameters
    ----------
    recipe : Recipe
        The recipe.

    Returns
    -------
    Scene
        The scene.

    Raises
    ------
    InputError
        For unknown names, and files that cannot be used.
    """
    mesh = _mesh(recipe)
    fill = float(np.random.default_rng(recipe.stream(_FRAMING)).uniform(*_FILL))
    return Scene(
        mesh,
        _material(recipe),
        _lights(recipe),
        camera_around(mesh, recipe.picture.size, fill, recipe.picture.perspective),
    )


def photograph(recipe: Recipe, monitor: Monitor | None = None) -> tuple[Scene, GroundTruth]:
    """Build and render a scene, set its exposure, and apply the sensor.

    Parameters
    ----------
    recipe : Recipe
        The recipe.
    monitor : Monitor, optional
        Progress and cancellation.

    Returns
    -------
    scene : Scene
        With scaled lights.
    truth : GroundTruth
        With the sensor's effects applied.

    Raises
    ------
    InputError
        As `build`, and if Mitsuba is not installed.
    Cancelled
        If the user cancels.
    """
    scene = build(recipe)
    truth = render_truth(scene, recipe.render_options(), monitor)
    drawn = float(np.random.default_rng(recipe.stream(_EXPOSURE)).uniform(*_LEVEL))
    wanted = recipe.picture.exposure
    scene, truth = exposed(scene, truth, drawn if wanted is None else wanted)
    if wanted is None and (truth.image[truth.mask] > 1).mean() > _MOST_CLIPPED:
        scene, truth = exposed(scene, truth, 1.0, 1 - _MOST_CLIPPED, "image")
    return scene, observe(
        truth, recipe.picture.sensor, np.random.default_rng(recipe.stream(_NOISE))
    )


def camera_around(mesh: Mesh, size: int, fill: float, perspective: bool = False) -> Camera:
    """Return the camera that frames a mesh.

    Parameters
    ----------
    mesh : Mesh
        Centred in x and y.
    size : int
        Side of the picture in pixels.
    fill : float
        Share of the picture's side that the mesh fills, by its wider side.
    perspective : bool, optional
        A pinhole camera.

    Returns
    -------
    Camera
        The camera.
    """
    distance = _DISTANCE if perspective else np.inf
    nearer = 1 - mesh.vertices[:, 2:] / distance
    reach = float(np.abs(mesh.vertices[:, :2] / np.maximum(nearer, 0.1)).max())
    return Camera(size, size, fill * size / (2 * reach), distance)


def _mesh(recipe: Recipe) -> Mesh:
    shape, sources = recipe.shape, recipe.sources
    if shape.family == MESH_FILE:
        return centred(read_mesh_file(_given(sources.mesh, "--mesh")).mesh)
    if shape.family == HEIGHT_FILE:
        return centred(mesh_of_height(read_height(_given(sources.height, "--height"))))
    return centred(make_shape(shape.family, shape.generator("shape")))


def centred(mesh: Mesh) -> Mesh:
    """Return a mesh with the middle of its silhouette on the camera's axis.

    Parameters
    ----------
    mesh : Mesh
        The mesh.

    Returns
    -------
    Mesh
        Shifted in x and y by the middle of its bounding box.
    """
    low, high = mesh.vertices[:, :2].min(0), mesh.vertices[:, :2].max(0)
    return replace(mesh, vertices=mesh.vertices - (*(low + high) / 2, 0.0))


def _material(recipe: Recipe) -> Material:
    albedo: np.ndarray | None
    if recipe.albedo == IMAGE_FILE:
        albedo = image_albedo(_given(recipe.sources.albedo_image, "--albedo-image"))
    elif recipe.albedo == MESH_FILE:
        albedo = read_mesh_file(_given(recipe.sources.mesh, "--mesh")).albedo
        if albedo is None:
            raise InputError(
                f"{recipe.sources.mesh} has no colours of its own: choose other --albedos"
            )
    else:
        albedo = make_albedo(recipe.albedo, recipe.material.generator("albedo"))
    return make_material(cast(Model, recipe.model), albedo, recipe.material.generator("gloss"))


def _lights(recipe: Recipe) -> tuple[Light, ...]:
    light, sources = recipe.light, recipe.sources
    if light.family == "natural":  # by its number in the file, so that all members differ
        found = load_natural_lights(_given(sources.natural_lights, "--natural-lights"))
        return (
            EnvironmentLight(
                environment_from_shading(light_from_reference(found[..., light.number]))
            ),
        )
    source = (
        sources.hdr[light.number]
        if light.family == "hdr" and light.number < len(sources.hdr)
        else None
    )
    return make_lights(light.family, light.generator("light"), source)


def _given(path: Path | None, option: str) -> Path:
    if path is None:
        raise InputError(f"this scene needs a file: give {option}")
    return path
