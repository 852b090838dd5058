"""Photos of things that ISC's assumptions hold for, and of things they do not: mirrors, glass,
several lamps.

  python -m training.data.rendered_scenes -o DIR [--count N] [--first K] [--kinds KIND...] [--hdr DIR]
  [--meshes DIR]

DIR/KIND_NUMBER.npz: layers (K, SIZE, SIZE, 3) float16 linear, whose sum is the photo; mask, shape,
surroundings. A scene that is there is not made again. Kinds:

    lamp     paint, one small or wide lamp, weak light from around       mirror   metals, polished
    place    paint in surroundings                                       glass    clear or tinted
    matt     either, without gloss                                       lamps    glossy paint, two
    to four lamps, white or coloured rig      glossy paint under four white lamps, a layer each, and
    under light from around: one has one lamp or several of it

Shapes and paints are those of `isc synth`. Rendered by Mitsuba's path tracer. `--hdr`, `--meshes`:
photographed panoramas instead of invented surroundings, mesh files instead of invented shapes, one
after the other: to measure with what nothing was fitted to.

Limits: glass is solid. Metals and glass stand in surroundings only, for under lamps alone they are
black.
"""

import argparse
import tempfile
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
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
from training.data.environments import PLACES, make_surroundings

SIZE, SAMPLES = 192, 64
KINDS = ("lamp", "place", "matt", "mirror", "glass", "lamps", "rig")
_MESHES = (".ply", ".obj", ".glb")
_OPEN = ("height_field",)  # shapes that have no inside
_APART, _TRIES = 40.0, 500  # degrees between lamps, at least; how often a place is looked for
_TIP = 20.0  # degrees that surroundings are tipped, at most
_WHITE_AT = 0.98  # quantile that a photographer puts near white


@dataclass(frozen=True)
class Given:
    """What is taken from files instead of drawn, or None: a `panorama`, a `mesh`."""

    panorama: Path | None = None
    mesh: Path | None = None


def make_scene(kind: str, number: int, given: Given = Given()) -> dict[str, np.ndarray]:
    """Scene `number` of `kind`, always the same, as it is written.

    Raises `InputError` for files that cannot be used.
    """
    rng = np.random.default_rng([zlib.crc32(kind.encode()), number])
    family = str(rng.choice([name for name in SHAPES if kind != "glass" or name not in _OPEN]))
    mesh = make_shape(family, rng)
    if given.mesh is not None:
        family, mesh = given.mesh.stem, read_mesh_file(given.mesh).mesh.rotated(_pose(rng)).fitted()
    place, lights = _lights(kind, rng, given.panorama)
    camera = camera_around(mesh, SIZE, float(rng.uniform(0.85, 0.9)))
    layers, mask = _rendered(mesh, _surface(kind, rng), lights, camera.pixels_per_unit, number)
    if kind != "rig":
        level = float(np.quantile(layers.sum(0)[mask].max(-1), _WHITE_AT))
        layers *= rng.uniform(0.6, 1.1) / max(level, 1e-9)
    return {
        "layers": layers.astype(np.float16),
        "mask": mask,
        "shape": np.array(family),
        "surroundings": np.array(place),
    }


@dataclass(frozen=True)
class Scene:
    """A scene as it was written:

    `layers` (K, SIZE, SIZE, 3) float32; `kind`, of KINDS; `shape`, `surroundings`: their names.
    """

    layers: np.ndarray
    mask: np.ndarray
    kind: str
    shape: str
    surroundings: str


def scenes_in(folder: Path) -> Iterator[Scene]:
    """The scenes of a folder, by name."""
    for path in sorted(folder.glob("*_*.npz")):
        with np.load(path, allow_pickle=False) as data:
            layers, mask, names = (
                data["layers"].astype(np.float32),
                data["mask"],
                (str(data["shape"]), str(data["surroundings"])),
            )
        yield Scene(layers, mask, path.stem.partition("_")[0], *names)


def _lights(
    kind: str, rng: np.random.Generator, panorama: Path | None
) -> tuple[str, list[dict[str, Any]]]:
    """The name of what is around, and the lights of each layer."""
    if kind == "rig":
        return "lamps", _rig(rng)
    if kind in ("lamp", "lamps") or (kind == "matt" and rng.random() < 0.5):
        return "lamps", [_lamps(rng, several=kind == "lamps")]
    place = str(rng.choice(PLACES))
    if panorama is None:
        return place, [_around(make_surroundings(place, rng), rng)]
    return panorama.stem, [_around(read_panorama(panorama), rng)]


def _rendered(
    mesh: Mesh,
    surface: dict[str, Any],
    lights: list[dict[str, Any]],
    pixels_per_unit: float,
    seed: int,
) -> tuple[np.ndarray, np.ndarray]:
    """The photo under each of the lights, (K, SIZE, SIZE, 3) float32, 0 outside the mask (SIZE,
    SIZE) bool, and the mask.
    """
    mi = load_mitsuba()
    frame, half = mi.ScalarTransform4f, SIZE / 2 / pixels_per_unit
    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        write_ply(Path(folder) / "object.ply", mesh)
        shape = mi.load_dict(
            {"type": "ply", "filename": str(Path(folder) / "object.ply"), "bsdf": surface}
        )
        for k, light in enumerate(lights):
            scene = mi.load_dict(
                {
                    "type": "scene",
                    "integrator": {
                        "type": "aov",
                        "aovs": "depth:depth",
                        "image": {"type": "path", "max_depth": 10},
                    },
                    "sensor": {
                        "type": "orthographic",
                        "to_world": frame().look_at([0, 0, FAR], [0, 0, 0], [0, 1, 0])
                        @ frame().scale([-half, half, 1]),
                        "film": {
                            "type": "hdrfilm",
                            "width": SIZE,
                            "height": SIZE,
                            "rfilter": {"type": "box"},
                        },
                        "sampler": {"type": "independent", "sample_count": SAMPLES},
                    },
                    "object": shape,
                    **light,
                }
            )
            pictures.append(np.array(mi.render(scene, seed=8 * seed + k)))
    mask = pictures[0][..., -1] > FAR - 5
    return np.stack(
        [np.where(mask[..., None], np.maximum(picture[..., :3], 0), 0) for picture in pictures]
    ).astype(np.float32), mask


def _pose(rng: np.random.Generator) -> np.ndarray:
    """A rotation (3, 3): any turn about the vertical, and some about the other axes."""
    turn, tip = rng.uniform(0, 2 * np.pi), rng.uniform(-0.4, 0.4)
    c, s, k, t = np.cos(turn), np.sin(turn), np.cos(tip), np.sin(tip)
    return np.array([[1, 0, 0], [0, k, -t], [0, t, k]]) @ np.array(
        [[c, 0, s], [0, 1, 0], [-s, 0, c]]
    )


def _surface(kind: str, rng: np.random.Generator) -> dict[str, Any]:
    if kind == "mirror":
        metal = {
            "specular_reflectance": _rgb(
                np.clip(rng.uniform(0.5, 1) * np.exp(rng.normal(0, 0.15, 3)), 0, 1)
            )
        }
        if rng.random() < 0.5:
            metal = {"material": str(rng.choice(["Ag", "Al", "Au", "Cr", "Cu"]))}  # type: ignore[dict-item]
        rough = rng.random() < 0.4
        return (
            {"type": "roughconductor", "alpha": float(rng.uniform(0.01, 0.08)), **metal}
            if rough
            else {"type": "conductor", **metal}
        )
    if kind == "glass":
        tint = (
            np.clip(np.exp(-np.abs(rng.normal(0, 0.15, 3))), 0, 1)
            if rng.random() < 0.5
            else np.ones(3)
        )
        return {
            "type": "dielectric",
            "int_ior": float(rng.uniform(1.3, 1.7)),
            "specular_transmittance": _rgb(tint),
        }
    albedo = np.ascontiguousarray(make_albedo(str(rng.choice(ALBEDOS)), rng, 256), np.float32)
    mi = load_mitsuba()
    upright = mi.ScalarTransform4f().scale([1, -1, 1])
    paint = {
        "type": "bitmap",
        "bitmap": mi.Bitmap(albedo),
        "raw": True,
        "filter_type": "bilinear",
        "to_uv": upright,
    }
    if kind == "matt":
        return {"type": "diffuse", "reflectance": paint}
    low, high = (
        (0.03, 0.2) if kind == "lamps" or (kind == "rig" and rng.random() < 0.7) else (0.03, 0.35)
    )
    alpha = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    return {
        "type": "roughplastic",
        "diffuse_reflectance": paint,
        "alpha": alpha,
        "int_ior": float(rng.uniform(1.35, 1.8)),
    }


def _around(surroundings: np.ndarray, rng: np.random.Generator) -> dict[str, Any]:
    """Mitsuba reads `isc_core.shading.environment_map`'s layout as it is.

    Turned about the vertical, and tipped by up to 20 degrees.
    """
    mi, turned = (
        load_mitsuba(),
        np.roll(surroundings, int(rng.integers(surroundings.shape[1])), axis=1),
    )
    tip = mi.ScalarTransform4f().rotate([1, 0, 0], float(rng.uniform(-_TIP, _TIP)))
    return {
        "around": {
            "type": "envmap",
            "bitmap": mi.Bitmap(np.ascontiguousarray(turned, np.float32)),
            "to_world": tip,
        }
    }


def _lamps(rng: np.random.Generator, several: bool) -> dict[str, Any]:
    places = _apart(rng, int(rng.integers(2, 5)) if several else 1)
    coloured, wide = 0.6 if several and rng.random() < 0.5 else 0.03, bool(rng.random() < 0.3)
    ambient = np.exp(rng.uniform(np.log(0.02), np.log(0.25))) * np.exp(rng.normal(0, 0.05, 3))
    powers = [rng.uniform(0.6, 1) * np.exp(rng.normal(0, coloured, 3)) for _ in places]
    lamps = {
        f"lamp{k}": _lamp(place, power, wide, rng)
        for k, (place, power) in enumerate(zip(places, powers, strict=True))
    }
    return {"around": {"type": "constant", "radiance": _rgb(ambient)}, **lamps}


def _rig(rng: np.random.Generator) -> list[dict[str, Any]]:
    """Four lamps, white and equal, and light from around, each alone."""
    wide = bool(rng.random() < 0.35)
    lamps = [{"lamp": _lamp(place, np.ones(3), wide, rng)} for place in _apart(rng, 4)]
    return [*lamps, {"around": {"type": "constant", "radiance": _rgb(np.ones(3))}}]


def _apart(rng: np.random.Generator, count: int) -> list[np.ndarray]:
    """Unit vectors toward `count` lamps, or as many as can be found."""
    places, tries = [toward(rng.uniform(10, 65), rng.uniform(0, 360))], 0
    while len(places) < count and tries < _TRIES:
        one, tries = toward(rng.uniform(10, 75), rng.uniform(0, 360)), tries + 1
        if all(np.degrees(np.arccos(np.clip(one @ other, -1, 1))) > _APART for other in places):
            places.append(one)
    return places


def _lamp(
    place: np.ndarray, power: np.ndarray, wide: bool, rng: np.random.Generator
) -> dict[str, Any]:
    """Far away, or a disc; a white matt surface that faces it gets the radiance `power` (3,)."""
    if not wide:
        return {
            "type": "directional",
            "direction": (-place).tolist(),
            "irradiance": _rgb(np.pi * power),
        }
    to_world, radius = _disc(place, float(rng.uniform(4, 6)), rng)
    return {
        "type": "disk",
        "to_world": to_world,
        "emitter": {"type": "area", "radiance": _rgb(power / radius**2)},
    }


def _disc(place: np.ndarray, distance: float, rng: np.random.Generator) -> tuple[Any, float]:
    """A disc lamp's transform, facing the object, and the tangent of the half angle that it is seen
    under.
    """
    frame, radius = load_mitsuba().ScalarTransform4f, float(np.tan(np.radians(rng.uniform(3, 10))))
    there = frame().look_at((distance * place).tolist(), [0, 0, 0], [0.01, 1, 0.02])
    return there @ frame().scale([distance * radius, distance * radius, 1]), radius


def _rgb(values: np.ndarray) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(value) for value in values]}


def files_in(folder: Path | None, suffixes: Sequence[str]) -> Sequence[Path | None]:
    """The folder's files of these kinds by name; one None for no folder.

    Raises `InputError` where it has none.
    """
    if folder is None:
        return [None]
    found = (
        sorted(path for path in folder.iterdir() if path.suffix in suffixes)
        if folder.is_dir()
        else []
    )
    if not found:
        raise InputError(f"{folder} is no folder with {', '.join(suffixes)} files")
    return found


def run(wanted: argparse.Namespace) -> None:
    """Makes the scenes that are not there yet.

    Raises `InputError` for files that cannot be used.
    """
    panoramas, meshes = files_in(wanted.hdr, PANORAMAS), files_in(wanted.meshes, _MESHES)
    wanted.output.mkdir(parents=True, exist_ok=True)
    for number in range(wanted.first, wanted.first + wanted.count):
        given = Given(
            panoramas[number % len(panoramas)], meshes[number // len(panoramas) % len(meshes)]
        )
        for kind in wanted.kinds:
            path = wanted.output / f"{kind}_{number:05d}.npz"
            if not path.exists():
                with new_file(path) as temporary, temporary.open("wb") as file:
                    np.savez_compressed(file, **make_scene(kind, number, given))  # type: ignore[arg-type]


def main() -> None:
    """Makes the scenes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    parser.add_argument("--count", type=int, default=300, metavar="N", help="scenes of each kind")
    parser.add_argument("--first", type=int, default=0, metavar="K", help="the first one's number")
    parser.add_argument(
        "--kinds", nargs="+", choices=KINDS, default=KINDS, metavar="KIND", help=", ".join(KINDS)
    )
    parser.add_argument(
        "--hdr", type=Path, metavar="DIR", help="latitude-longitude panoramas (.hdr, .exr)"
    )
    parser.add_argument(
        "--meshes", type=Path, metavar="DIR", help="closed meshes (.ply, .obj, .glb)"
    )
    wanted = parser.parse_args()
    try:
        run(wanted)
    except InputError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
