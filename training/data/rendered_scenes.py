"""Rendered photos of scenes that satisfy ISC's assumptions, and of scenes that do not.

  python -m training.data.rendered_scenes -o DIR [--count N] [--first K] [--kinds KIND...]
  [--hdr DIR] [--meshes DIR]

Equation: DIR/KIND_NUMBER.npz holds layers (K, SIZE, SIZE, 3), float16, linear, whose sum is the
photo; mask; shape; surroundings, the name of the environment. Existing scenes are kept. Kinds:

  light        glossy, one small or extended light, weak ambient light
  environment  glossy, in an environment
  diffuse      Lambertian, either light
  mirror       polished metals, in an environment
  glass        clear or tinted, in an environment
  lights       glossy, two to four lights, white or coloured
  rig          glossy; a layer for each of four white lights and one for ambient light

Shapes and albedos are those of `isc synth`. Mitsuba's path tracer renders. `--hdr` and `--meshes`
replace the procedural environments and shapes by panoramas and mesh files, in turn: for
measurements on data that no network has been fitted to.

Limits: glass is solid. Metals and glass appear in environments only: under directional lights alone
they are black.
"""

import argparse
import tempfile
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

from isc_core.errors import InputError
from isc_core.io.atomic import new_file
from synth.albedos import ALBEDOS, make_albedo
from synth.capture.recipe import camera_around
from synth.light_rigs.files import PANORAMAS, read_panorama
from synth.light_rigs.placing import toward
from synth.scene.camera import FAR
from synth.scene.meshes import Mesh, write_ply
from synth.scene.variant import load_mitsuba
from synth.shapes import SHAPES, make_shape
from synth.shapes.mesh_file import read_mesh_file

from .environments import ENVIRONMENTS, make_environment

SIZE, SAMPLES = 192, 64  # pixels; samples per pixel


class SceneKind(StrEnum):
    """What a scene shows; see the module."""

    LIGHT = "light"
    ENVIRONMENT = "environment"
    DIFFUSE = "diffuse"
    MIRROR = "mirror"
    GLASS = "glass"
    SEVERAL_LIGHTS = "lights"
    RIG = "rig"


# Names up to version 0.1: of files, and of the random streams, which stay the same.
_FORMER_NAMES = {
    SceneKind.LIGHT: "lamp",
    SceneKind.ENVIRONMENT: "place",
    SceneKind.DIFFUSE: "matt",
    SceneKind.SEVERAL_LIGHTS: "lamps",
}
_KINDS_BY_NAME = {kind.value: kind for kind in SceneKind} | {
    name: kind for kind, name in _FORMER_NAMES.items()
}
_MESHES = (".ply", ".obj", ".glb")
_OPEN_SHAPES = ("height_field",)
_LEAST_ANGLE, _TRIES = 40.0, 500  # degrees between lights; attempts to place them
_TILT = 20.0  # degrees by which environments are tilted, at most
_WHITE_QUANTILE = 0.98  # of the brightest channel, to expose near white


@dataclass(frozen=True)
class SceneFiles:
    """Files that replace what would be drawn.

    Attributes
    ----------
    panorama : Path or None
        Environment map.
    mesh : Path or None
        Closed mesh.
    """

    panorama: Path | None = None
    mesh: Path | None = None


def make_scene(
    kind: SceneKind, number: int, files: SceneFiles = SceneFiles()
) -> dict[str, np.ndarray]:
    """Render a scene; the same for the same kind and number.

    Parameters
    ----------
    kind : SceneKind
        What it shows.
    number : int
        Number of the scene.
    files : SceneFiles, optional
        Files to use instead of procedural shapes and environments.

    Returns
    -------
    dict of str to ndarray
        Content of the scene's file.

    Raises
    ------
    InputError
        If a file cannot be used.
    """
    stream = _FORMER_NAMES.get(kind, kind.value)
    rng = np.random.default_rng([zlib.crc32(stream.encode()), number])
    closed = [name for name in SHAPES if kind != SceneKind.GLASS or name not in _OPEN_SHAPES]
    family = str(rng.choice(closed))
    mesh = make_shape(family, rng)
    if files.mesh is not None:
        family = files.mesh.stem
        mesh = read_mesh_file(files.mesh).mesh.rotated(_random_pose(rng)).fitted()
    environment, lights = _lights(kind, rng, files.panorama)
    camera = camera_around(mesh, SIZE, float(rng.uniform(0.85, 0.9)))
    layers, mask = _rendered(mesh, _bsdf(kind, rng), lights, camera.pixels_per_unit, number)
    if kind != SceneKind.RIG:
        level = float(np.quantile(layers.sum(0)[mask].max(-1), _WHITE_QUANTILE))
        layers *= rng.uniform(0.6, 1.1) / max(level, 1e-9)
    return {
        "layers": layers.astype(np.float16),
        "mask": mask,
        "shape": np.array(family),
        "surroundings": np.array(environment),
    }


@dataclass(frozen=True)
class RenderedScene:
    """A scene read from its file.

    Attributes
    ----------
    layers : (K, SIZE, SIZE, 3) ndarray
        float32, linear; their sum is the photo.
    mask : (SIZE, SIZE) ndarray of bool
        Pixels of the object.
    kind : SceneKind
        What it shows.
    shape : str
        Shape family, or name of the mesh file.
    environment : str
        Name of the environment, or of the panorama.
    """

    layers: np.ndarray
    mask: np.ndarray
    kind: SceneKind
    shape: str
    environment: str


def scenes_in(folder: Path) -> Iterator[RenderedScene]:
    """Read the scenes of a folder, ordered by file name.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    iterator of RenderedScene
    """
    for path in sorted(folder.glob("*_*.npz")):
        with np.load(path, allow_pickle=False) as data:
            yield RenderedScene(
                data["layers"].astype(np.float32),
                data["mask"],
                _KINDS_BY_NAME[path.stem.partition("_")[0]],
                str(data["shape"]),
                str(data["surroundings"]),
            )


def _lights(
    kind: SceneKind, rng: np.random.Generator, panorama: Path | None
) -> tuple[str, list[dict[str, Any]]]:
    """The name of the environment, and the lights of each layer."""
    if kind == SceneKind.RIG:
        return "lamps", _rig(rng)
    lit = kind in (SceneKind.LIGHT, SceneKind.SEVERAL_LIGHTS)
    if lit or (kind == SceneKind.DIFFUSE and rng.random() < 0.5):
        return "lamps", [_light_set(rng, several=kind == SceneKind.SEVERAL_LIGHTS)]
    name = str(rng.choice(ENVIRONMENTS))
    if panorama is None:
        return name, [_envmap(make_environment(name, rng), rng)]
    return panorama.stem, [_envmap(read_panorama(panorama), rng)]


def _rendered(
    mesh: Mesh,
    bsdf: dict[str, Any],
    lights: list[dict[str, Any]],
    pixels_per_unit: float,
    seed: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Photos (K, SIZE, SIZE, 3) float32, 0 outside the mask, and the mask (SIZE, SIZE)."""
    mi = load_mitsuba()
    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "object.ply"
        write_ply(path, mesh)
        shape = mi.load_dict({"type": "ply", "filename": str(path), "bsdf": bsdf})
        for k, light in enumerate(lights):
            parts = {"type": "scene", "object": shape, **_camera(pixels_per_unit), **light}
            pictures.append(np.array(mi.render(mi.load_dict(parts), seed=8 * seed + k)))
    mask = pictures[0][..., -1] > FAR - 5
    images = [np.where(mask[..., None], np.maximum(one[..., :3], 0), 0) for one in pictures]
    return np.stack(images).astype(np.float32), mask


def _camera(pixels_per_unit: float) -> dict[str, Any]:
    """Integrator and orthographic sensor."""
    frame, half = load_mitsuba().ScalarTransform4f, SIZE / 2 / pixels_per_unit
    return {
        "integrator": {
            "type": "aov",
            "aovs": "depth:depth",
            "image": {"type": "path", "max_depth": 10},
        },
        "sensor": {
            "type": "orthographic",
            "to_world": frame().look_at([0, 0, FAR], [0, 0, 0], [0, 1, 0])
            @ frame().scale([-half, half, 1]),
            "film": {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}},
            "sampler": {"type": "independent", "sample_count": SAMPLES},
        },
    }


def _random_pose(rng: np.random.Generator) -> np.ndarray:
    """A rotation (3, 3): any angle about the vertical, then up to 0.4 rad about x."""
    turn, tip = rng.uniform(0, 2 * np.pi), rng.uniform(-0.4, 0.4)
    c, s, k, t = np.cos(turn), np.sin(turn), np.cos(tip), np.sin(tip)
    about_x = np.array([[1, 0, 0], [0, k, -t], [0, t, k]])
    return about_x @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def _bsdf(kind: SceneKind, rng: np.random.Generator) -> dict[str, Any]:
    if kind == SceneKind.MIRROR:
        return _metal(rng)
    if kind == SceneKind.GLASS:
        return _glass(rng)
    albedo = np.ascontiguousarray(make_albedo(str(rng.choice(ALBEDOS)), rng, 256), np.float32)
    mi = load_mitsuba()
    texture = {
        "type": "bitmap",
        "bitmap": mi.Bitmap(albedo),
        "raw": True,
        "filter_type": "bilinear",
        "to_uv": mi.ScalarTransform4f().scale([1, -1, 1]),
    }
    if kind == SceneKind.DIFFUSE:
        return {"type": "diffuse", "reflectance": texture}
    smooth = kind == SceneKind.SEVERAL_LIGHTS or (kind == SceneKind.RIG and rng.random() < 0.7)
    roughest = 0.2 if smooth else 0.35
    return {
        "type": "roughplastic",
        "diffuse_reflectance": texture,
        "alpha": float(np.exp(rng.uniform(np.log(0.03), np.log(roughest)))),
        "int_ior": float(rng.uniform(1.35, 1.8)),
    }


def _metal(rng: np.random.Generator) -> dict[str, Any]:
    tint = np.clip(rng.uniform(0.5, 1) * np.exp(rng.normal(0, 0.15, 3)), 0, 1)
    metal: dict[str, Any] = {"specular_reflectance": _rgb(tint)}
    if rng.random() < 0.5:
        metal = {"material": str(rng.choice(["Ag", "Al", "Au", "Cr", "Cu"]))}
    if rng.random() < 0.4:
        return {"type": "roughconductor", "alpha": float(rng.uniform(0.01, 0.08)), **metal}
    return {"type": "conductor", **metal}


def _glass(rng: np.random.Generator) -> dict[str, Any]:
    tint = np.ones(3)
    if rng.random() < 0.5:
        tint = np.clip(np.exp(-np.abs(rng.normal(0, 0.15, 3))), 0, 1)
    return {
        "type": "dielectric",
        "int_ior": float(rng.uniform(1.3, 1.7)),
        "specular_transmittance": _rgb(tint),
    }


def _envmap(radiance: np.ndarray, rng: np.random.Generator) -> dict[str, Any]:
    """An environment map, rotated about the vertical and tilted.

    Mitsuba reads the layout of `isc_core.shading.environment_map` as it is.
    """
    mi = load_mitsuba()
    turned = np.roll(radiance, int(rng.integers(radiance.shape[1])), axis=1)
    tilt = mi.ScalarTransform4f().rotate([1, 0, 0], float(rng.uniform(-_TILT, _TILT)))
    bitmap = mi.Bitmap(np.ascontiguousarray(turned, np.float32))
    return {"ambient": {"type": "envmap", "bitmap": bitmap, "to_world": tilt}}


def _light_set(rng: np.random.Generator, several: bool) -> dict[str, Any]:
    places = _separate_directions(rng, int(rng.integers(2, 5)) if several else 1)
    colourfulness = 0.6 if several and rng.random() < 0.5 else 0.03
    extended = bool(rng.random() < 0.3)
    ambient = np.exp(rng.uniform(np.log(0.02), np.log(0.25))) * np.exp(rng.normal(0, 0.05, 3))
    powers = [rng.uniform(0.6, 1) * np.exp(rng.normal(0, colourfulness, 3)) for _ in places]
    lights = {
        f"lamp{k}": _light(place, power, extended, rng)
        for k, (place, power) in enumerate(zip(places, powers, strict=True))
    }
    return {"around": {"type": "constant", "radiance": _rgb(ambient)}, **lights}


def _rig(rng: np.random.Generator) -> list[dict[str, Any]]:
    """Four equal white lights and ambient light, each alone."""
    extended = bool(rng.random() < 0.35)
    places = _separate_directions(rng, 4)
    lights = [{"lamp": _light(place, np.ones(3), extended, rng)} for place in places]
    return [*lights, {"around": {"type": "constant", "radiance": _rgb(np.ones(3))}}]


def _separate_directions(rng: np.random.Generator, count: int) -> list[np.ndarray]:
    """Up to `count` unit vectors to lights, at least 40 degrees apart."""
    places, tries = [toward(rng.uniform(10, 65), rng.uniform(0, 360))], 0
    while len(places) < count and tries < _TRIES:
        one, tries = toward(rng.uniform(10, 75), rng.uniform(0, 360)), tries + 1
        angles = [np.degrees(np.arccos(np.clip(one @ other, -1, 1))) for other in places]
        if min(angles) > _LEAST_ANGLE:
            places.append(one)
    return places


def _light(
    place: np.ndarray, power: np.ndarray, extended: bool, rng: np.random.Generator
) -> dict[str, Any]:
    """A directional light or a disc that gives a white surface facing it radiance `power` (3,)."""
    if not extended:
        irradiance = _rgb(np.pi * power)
        return {"type": "directional", "direction": (-place).tolist(), "irradiance": irradiance}
    to_world, radius = _disc(place, float(rng.uniform(4, 6)), rng)
    emitter = {"type": "area", "radiance": _rgb(power / radius**2)}
    return {"type": "disk", "to_world": to_world, "emitter": emitter}


def _disc(place: np.ndarray, distance: float, rng: np.random.Generator) -> tuple[Any, float]:
    """The transform of a disc that faces the object, and the tangent of its half angle."""
    frame, radius = load_mitsuba().ScalarTransform4f, float(np.tan(np.radians(rng.uniform(3, 10))))
    facing = frame().look_at((distance * place).tolist(), [0, 0, 0], [0.01, 1, 0.02])
    return facing @ frame().scale([distance * radius, distance * radius, 1]), radius


def _rgb(values: np.ndarray) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(value) for value in values]}


def _files_in(folder: Path | None, suffixes: Sequence[str]) -> Sequence[Path | None]:
    """The folder's files with these suffixes, ordered by name; [None] without a folder."""
    if folder is None:
        return [None]
    if not folder.is_dir():
        raise InputError(f"`{folder}` is not a folder")
    found = sorted(path for path in folder.iterdir() if path.suffix in suffixes)
    if not found:
        raise InputError(f"no {', '.join(suffixes)} files in `{folder}`")
    return found


def _make_missing(arguments: argparse.Namespace) -> None:
    """Render the scenes that do not exist yet."""
    panoramas = _files_in(arguments.hdr, PANORAMAS)
    meshes = _files_in(arguments.meshes, _MESHES)
    arguments.output.mkdir(parents=True, exist_ok=True)
    for number in range(arguments.first, arguments.first + arguments.count):
        files = SceneFiles(
            panoramas[number % len(panoramas)], meshes[number // len(panoramas) % len(meshes)]
        )
        for kind in arguments.kinds:
            path = arguments.output / f"{kind.value}_{number:05d}.npz"
            if not path.exists():
                scene: dict[str, Any] = make_scene(kind, number, files)
                with new_file(path) as temporary, temporary.open("wb") as file:
                    np.savez_compressed(file, **scene)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("-o", "--output", type=Path, required=True, metavar="DIR", help="folder to write to")
    add("--count", type=int, default=300, metavar="N", help="scenes of each kind")
    add("--first", type=int, default=0, metavar="K", help="number of the first scene")
    add(
        "--kinds",
        nargs="+",
        type=SceneKind,
        choices=list(SceneKind),
        default=list(SceneKind),
        metavar="KIND",
        help="kinds to render (default: all): " + ", ".join(SceneKind),
    )
    add("--hdr", type=Path, metavar="DIR", help="latitude-longitude panoramas (.hdr, .exr)")
    add("--meshes", type=Path, metavar="DIR", help="closed meshes (.ply, .obj, .glb)")
    arguments = parser.parse_args()
    try:
        _make_missing(arguments)
    except InputError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
