"""Rendered scenes for the refinement: truth, and the result that the refinement starts from.

Scene k has its own object, albedo, GGX lobe and light, drawn from (`SEED`, k). Of three scenes, two
have one or two lamps that cast shadows (directional, point or small panel) and one has smooth
light. Objects are those of `synth.shapes` with parts that shade each other, and some that have
none. FOLDER keeps what was rendered and decomposed.

Scenes below `CHOSEN_ON` were used to choose constants; those from there on are for reports.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from isc_core.decomposition.pipeline import decompose
from isc_core.photo import Photo, PhotoSource
from isc_core.result_files.result_folder import load, save
from isc_core.scene.decomposition import Decomposition
from synth.albedos import make_albedo
from synth.capture.recipe import camera_around
from synth.capture.truth import exposed, render_truth
from synth.light_rigs import make_lights
from synth.light_rigs.placing import ambient, places, white
from synth.rendering import RenderOptions
from synth.scene import Scene
from synth.scene.lights import Light, panel_toward_origin
from synth.scene.materials import Material
from synth.scene.meshes import Mesh
from synth.shapes import make_shape

SEED, CHOSEN_ON = 29, 100
LAMPS, SMOOTH = ("directional", "small", "point"), "sh"
_SHAPES = ("displaced", "blobby", "lathe", "extruded", "height_field")
_ALBEDOS = ("patches", "print", "uniform", "noise")
_ALPHAS = (0.08, 0.4)
_MAPS = ("image", "reflectance", "shading", "mask")
_SAMPLES, _LEVEL, _BEAM = 64, 0.6, 12.0


@dataclass(frozen=True, eq=False)
class RefinementScene:
    """A rendered scene.

    Attributes
    ----------
    number : int
        Number of the scene.
    light : str
        Kind of light, one of `LAMPS` or `SMOOTH`.
    truth : dict of str to ndarray
        True maps by name.
    start : Decomposition
        What the refinement starts from.
    folder : Path
        Its result folder.
    """

    number: int
    light: str
    truth: dict[str, np.ndarray]
    start: Decomposition
    folder: Path


def scene_of(folder: Path, number: int, size: int) -> RefinementScene:
    """Read a scene; render and decompose it if it is missing.

    Parameters
    ----------
    folder : Path
        Where scenes are kept.
    number : int
        Number of the scene.
    size : int
        Side of the image in pixels.

    Returns
    -------
    RefinementScene
        The scene.
    """
    place = folder / f"scene{number:04d}_{size}"
    truth = place / "truth.npz"
    if not truth.exists():
        place.mkdir(parents=True, exist_ok=True)
        maps = rendered(number, size)
        save(decompose(photo_of(maps), name=place.name), place / "start")
        np.savez(truth, **maps)
    with np.load(truth, allow_pickle=False) as stored:
        maps = {name: stored[name] for name in stored.files}
    start = place / "start"
    return RefinementScene(number, str(maps["light"]), maps, load(start), start)


def centred(mesh: Mesh) -> Mesh:
    """Move a mesh so that the middle of its box, seen from the front, is the origin.

    Parameters
    ----------
    mesh : Mesh

    Returns
    -------
    Mesh
    """
    low, high = mesh.vertices[:, :2].min(0), mesh.vertices[:, :2].max(0)
    return replace(mesh, vertices=mesh.vertices - (*(low + high) / 2, 0.0))


def photo_of(maps: dict[str, np.ndarray]) -> Photo:
    """Return the photo of a rendered scene.

    Parameters
    ----------
    maps : dict of str to ndarray
        With `image` and `mask`.

    Returns
    -------
    Photo
        Linear, of its own exposure.
    """
    mask = maps["mask"]
    source = PhotoSource("", (mask.shape[1], mask.shape[0]), 32, "linear", "file")
    return Photo(np.maximum(maps["image"], 0), mask, 1e-4, np.zeros_like(mask), source)


def rendered(number: int, size: int, names: Sequence[str] = _MAPS) -> dict[str, np.ndarray]:
    """Render a scene.

    Parameters
    ----------
    number : int
        Number of the scene.
    size : int
        Side of the image in pixels.
    names : sequence of str, optional
        True maps that are wanted.

    Returns
    -------
    dict of str to ndarray
        The maps by name, and `light`, the kind of light.
    """
    kind, scene = posed(number, size)
    _, truth = exposed(scene, render_truth(scene, RenderOptions(_SAMPLES, number)), _LEVEL)
    return {name: getattr(truth, name) for name in names} | {"light": np.array(kind)}


def posed(number: int, size: int) -> tuple[str, Scene]:
    """Make a scene, not yet exposed.

    Parameters
    ----------
    number : int
        Number of the scene.
    size : int
        Side of the image in pixels.

    Returns
    -------
    light : str
        Its kind.
    scene : Scene
    """
    rng = np.random.default_rng([SEED, number])
    kind = SMOOTH if number % 3 == 2 else LAMPS[(number // 3 + number % 3) % len(LAMPS)]
    mesh = centred(make_shape(_SHAPES[number % len(_SHAPES)], rng))
    alpha = float(np.exp(rng.uniform(*np.log(_ALPHAS))))
    strength = float(rng.uniform(0.6, 1.5))
    albedo = make_albedo(_ALBEDOS[(number // 2) % len(_ALBEDOS)], rng, 256)
    material = Material(albedo, "ggx", alpha, strength)
    return kind, Scene(mesh, material, _lights(kind, rng), camera_around(mesh, size, 0.88))


def _lights(kind: str, rng: np.random.Generator) -> tuple[Light, ...]:
    if kind == SMOOTH:
        return make_lights(kind, rng)
    fill = ambient(rng, 0.1, 0.35)
    if kind == "small":
        place, _ = places(rng)[0]
        strength = tuple(np.pi * _BEAM**2 / 4 * white(rng))
        return (panel_toward_origin(tuple(_BEAM * place), (2.0, 2.0), strength), fill)
    return (*(light for light in make_lights(kind, rng) if not _is_ambient(light)), fill)


def _is_ambient(light: Light) -> bool:
    return hasattr(light, "radiance") and not hasattr(light, "centre")
