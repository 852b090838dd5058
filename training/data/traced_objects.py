"""Objects of which it is known what each of many lamps would reach: to be lit anew, by any of them,
whenever a network learns from one.

  python -m training.data.traced_objects -o DIR [--count N] [--first K] [--groups]
  python -m training.data.traced_objects -o DIR --data ROOT

DIR/NUMBER.npz: mask (SIZE, SIZE); normals (SIZE, SIZE, 3) and albedos (PAINTS, SIZE, SIZE, 3)
float16; toward (LAMPS, 3) float32, unit vectors to far lamps before the object; reached (LAMPS,
SIZE, SIZE) bool, packed along its last axis (`numpy.packbits`): which pixels see them; shape, its
family's name. An object that is there is not made again. Shapes and paints are those of `isc
synth`; with `--groups` mostly up to five bodies of them that have grown together, each turned
anyhow. With `--data` the MIT-Berkeley objects that ROOT holds, each with three pairs of those
paints: DIR/NAME-K.npz, shape its name.

Limits: light that goes from one part of the object to another is left to whoever lights it.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from isc_core.datasets.mit_berkeley import list_objects, load_object
from isc_core.decompose.settings import LABORATORY
from isc_core.io.atomic import new_file
from synth.albedos import ALBEDOS, make_albedo
from synth.capture.recipe import camera_around, centred
from synth.light_rigs.placing import toward
from synth.scene.materials import texture_at
from synth.scene.meshes import Mesh
from synth.scene.tracing import LIFT, Tracer
from synth.shapes import SHAPES, make_shape
from synth.shapes.height_field import mesh_of_height

SIZE, LAMPS, PAINTS = 160, 32, 2
_FILL = 0.9
WIDEST = 80.0  # degrees from the viewer
GROUP = "group"
_TOGETHER, _COPIES = 0.75, 3
_SIZES, _STRETCHED = (
    (0.25, 0.8),
    0.3,
)  # of the smaller bodies of a group; how unequally, as a logarithm


@dataclass(frozen=True)
class Unlit:
    """See the module."""

    mask: np.ndarray
    normals: np.ndarray
    albedos: np.ndarray
    toward: np.ndarray
    reached: np.ndarray
    shape: str


def make_object(number: int) -> dict[str, np.ndarray]:
    """Object `number`, always the same, as it is written."""
    rng = np.random.default_rng([17, number])
    family = str(rng.choice(SHAPES))
    return traced(make_shape(family, rng), family, rng)


def make_group(number: int) -> dict[str, np.ndarray]:
    """Group `number`, always the same, as it is written; one in four is a single body."""
    rng = np.random.default_rng([18, number])
    return traced(
        _grown_together(rng) if rng.random() < _TOGETHER else _turned(str(rng.choice(SHAPES)), rng),
        GROUP,
        rng,
    )


def measured_objects(root: Path) -> Iterator[tuple[str, dict[str, np.ndarray]]]:
    """Names of files and what they hold, of the MIT-Berkeley objects below `root`."""
    for k, name in enumerate(list_objects(root, LABORATORY)):
        truth = load_object(root, name, LABORATORY)
        mesh = centred(mesh_of_height(np.where(truth.mask, truth.height, np.nan)))
        for copy in range(_COPIES):
            yield f"{name}-{copy}", traced(mesh, name, np.random.default_rng([19, k, copy]))


def _turned(family: str, rng: np.random.Generator) -> Mesh:
    """A body of a family, seen from anywhere."""
    return (
        make_shape(family, rng)
        .rotated(Rotation.random(random_state=int(rng.integers(2**31))).as_matrix())
        .fitted()
    )


def _grown_together(rng: np.random.Generator) -> Mesh:
    """Two to five bodies, the smaller ones on the surface of the first."""
    bodies = [family for family in SHAPES if family != "height_field"]
    parts = [_turned(str(rng.choice(bodies)), rng)]
    for _ in range(int(rng.integers(1, 5))):
        part, at = (
            _turned(str(rng.choice(bodies)), rng),
            parts[0].vertices[int(rng.integers(len(parts[0].vertices)))],
        )
        size = rng.uniform(*_SIZES) * np.exp(rng.normal(0, _STRETCHED, 3))
        normals = part.normals / size
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        parts.append(
            Mesh(part.vertices * size + at * rng.uniform(0.7, 1.05), normals, part.uv, part.faces)
        )
    first = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = np.concatenate([part.faces + k for part, k in zip(parts, first, strict=False)])
    vertices, normals, uv = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("vertices", "normals", "uv")
    )
    return Mesh(vertices, normals, uv, faces).fitted()


def traced(mesh: Mesh, shape: str, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """A mesh with lamps and paints drawn from `rng`, as it is written."""
    camera, tracer = camera_around(mesh, SIZE, _FILL), Tracer(mesh)
    hits = tracer.hits(*(part.reshape(-1, 3) for part in camera.rays()))
    mask = hits.valid.reshape(SIZE, SIZE)
    lamps = np.stack(
        [
            toward(float(angle), float(rng.uniform(0, 360)))
            for angle in np.degrees(np.arccos(_evenly(rng)))
        ]
    )
    from_, reached = (
        hits.position[hits.valid] + LIFT * hits.normal[hits.valid],
        np.zeros((LAMPS, SIZE, SIZE), bool),
    )
    for lamp, seen in zip(lamps, reached, strict=True):
        seen[mask] = ~tracer.blocked(from_, np.broadcast_to(lamp, from_.shape), np.inf)
    normals, albedos = (
        np.zeros((SIZE, SIZE, 3), np.float16),
        np.zeros((PAINTS, SIZE, SIZE, 3), np.float16),
    )
    normals[mask] = hits.normal[hits.valid]
    for paint in albedos:
        paint[mask] = texture_at(
            make_albedo(str(rng.choice(ALBEDOS)), rng, 256), hits.uv[hits.valid]
        )
    packed = np.packbits(reached, axis=-1)
    return {
        "mask": mask,
        "normals": normals,
        "albedos": albedos,
        "toward": lamps.astype(np.float32),
        "reached": packed,
        "shape": np.array(shape),
    }


def _evenly(rng: np.random.Generator) -> np.ndarray:
    """The cosines (LAMPS,) of directions that lie evenly on the sky before the object, in any
    order.
    """
    return np.asarray(
        1
        - rng.permutation(np.arange(LAMPS) + rng.random(LAMPS))
        / LAMPS
        * (1 - np.cos(np.radians(WIDEST)))
    )


def objects_in(folder: Path) -> Iterator[Unlit]:
    """The objects of a folder, by name."""
    for path in sorted(folder.glob("*.npz")):
        with np.load(path, allow_pickle=False) as data:
            reached = np.unpackbits(data["reached"], axis=-1).astype(bool)
            yield Unlit(
                data["mask"],
                data["normals"],
                data["albedos"],
                data["toward"],
                reached,
                str(data["shape"]),
            )


def main() -> None:
    """Makes the objects that are not there yet."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    parser.add_argument("--count", type=int, default=1000, metavar="N")
    parser.add_argument("--first", type=int, default=0, metavar="K", help="the first one's number")
    parser.add_argument("--groups", action="store_true", help="bodies that have grown together")
    parser.add_argument(
        "--data", type=Path, metavar="ROOT", help="the MIT-Berkeley objects that this folder holds"
    )
    wanted = parser.parse_args()
    wanted.output.mkdir(parents=True, exist_ok=True)
    if wanted.data is not None:
        for name, parts in measured_objects(wanted.data):
            _write(wanted.output / f"{name}.npz", parts)
        return
    for number in range(wanted.first, wanted.first + wanted.count):
        path = wanted.output / f"{number:06d}.npz"
        if not path.exists():
            _write(path, (make_group if wanted.groups else make_object)(number))


def _write(path: Path, parts: dict[str, np.ndarray]) -> None:
    with new_file(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **parts)  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
