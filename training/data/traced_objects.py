"""Objects with precomputed shadows of many distant lights, to be relit during training.

  python -m training.data.traced_objects -o DIR [--count N] [--first K] [--groups]
  python -m training.data.traced_objects -o DIR --data ROOT

Equation: DIR/NUMBER.npz holds mask (SIZE, SIZE); normals (SIZE, SIZE, 3) and albedos (ALBEDOS,
SIZE, SIZE, 3), float16; toward (LIGHTS, 3), float32, unit vectors to distant lights; reached
(LIGHTS, SIZE, SIZE) bool, packed along its last axis (`numpy.packbits`): the pixels that each light
reaches; shape, the name of the shape family. Existing objects are kept. Shapes and albedos are
those of `isc synth`. With `--groups`, most objects are fusions of up to five bodies, each rotated
at random. With `--data`, the MIT-Berkeley objects of ROOT, each with three pairs of albedos:
DIR/NAME-K.npz, shape its name.

Limits: no interreflection; `training.data.relighting` approximates it.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from isc_core.datasets.mit_berkeley import list_objects, load_object
from isc_core.decomposition.settings import Illumination
from isc_core.io.atomic import new_file
from synth.albedos import ALBEDOS as TEXTURES
from synth.albedos import make_albedo
from synth.capture.recipe import camera_around, centred
from synth.light_rigs.placing import toward
from synth.scene.materials import texture_at
from synth.scene.meshes import Mesh
from synth.scene.tracing import LIFT, Tracer
from synth.shapes import SHAPES, make_shape
from synth.shapes.height_field import mesh_of_height

SIZE, LIGHTS, ALBEDOS = 160, 32, 2
WIDEST = 80.0  # degrees between a light and the viewing direction
GROUP = "group"
FILL = 0.9  # longer side of an object, relative to the image
_FUSED, _COPIES = 0.75, 3
# of the smaller bodies of a group: size relative to the first, deviation of the log of its axes
_BODY_SIZES, _BODY_STRETCH = (0.25, 0.8), 0.3


@dataclass(frozen=True)
class TracedObject:
    """An object with known shadows.

    Attributes
    ----------
    mask : (SIZE, SIZE) ndarray of bool
        Pixels of the object.
    normals : (SIZE, SIZE, 3) ndarray
        Camera frame: x right, y up, z toward the viewer.
    albedos : (ALBEDOS, SIZE, SIZE, 3) ndarray
        Linear, in [0, 1].
    toward : (LIGHTS, 3) ndarray
        Unit vectors to the lights.
    reached : (LIGHTS, SIZE, SIZE) ndarray of bool
        Pixels that each light reaches.
    shape : str
        Shape family, or name of the data set's object.
    """

    mask: np.ndarray
    normals: np.ndarray
    albedos: np.ndarray
    toward: np.ndarray
    reached: np.ndarray
    shape: str


def make_object(number: int) -> dict[str, np.ndarray]:
    """Make the arrays of an object's file; the same for the same number.

    Parameters
    ----------
    number : int
        Number of the object, the random seed.

    Returns
    -------
    dict of str to ndarray
        Content of the file.
    """
    rng = np.random.default_rng([17, number])
    family = str(rng.choice(SHAPES))
    return traced(make_shape(family, rng), family, rng)


def make_group(number: int) -> dict[str, np.ndarray]:
    """Make the arrays of a group's file; the same for the same number.

    One group in four is a single body.

    Parameters
    ----------
    number : int
        Number of the group, the random seed.

    Returns
    -------
    dict of str to ndarray
        Content of the file.
    """
    rng = np.random.default_rng([18, number])
    fused = rng.random() < _FUSED
    mesh = _fused_bodies(rng) if fused else _random_body(str(rng.choice(SHAPES)), rng)
    return traced(mesh, GROUP, rng)


def measured_objects(root: Path) -> Iterator[tuple[str, dict[str, np.ndarray]]]:
    """Make the arrays of the MIT-Berkeley objects.

    Parameters
    ----------
    root : Path
        The MIT-Berkeley set.

    Yields
    ------
    name : str
        Name of the file, without suffix.
    arrays : dict of str to ndarray
        Content of the file.
    """
    for k, name in enumerate(list_objects(root, Illumination.LABORATORY)):
        truth = load_object(root, name, Illumination.LABORATORY)
        mesh = centred(mesh_of_height(np.where(truth.mask, truth.height, np.nan)))
        for copy in range(_COPIES):
            yield f"{name}-{copy}", traced(mesh, name, np.random.default_rng([19, k, copy]))


def _random_body(family: str, rng: np.random.Generator) -> Mesh:
    """A body of a shape family, rotated at random."""
    shape = make_shape(family, rng)
    rotation = Rotation.random(random_state=int(rng.integers(2**31))).as_matrix()
    return shape.rotated(rotation).fitted()


def _fused_bodies(rng: np.random.Generator) -> Mesh:
    """Two to five bodies, the smaller ones on the surface of the first."""
    families = [family for family in SHAPES if family != "height_field"]
    parts = [_random_body(str(rng.choice(families)), rng)]
    for _ in range(int(rng.integers(1, 5))):
        part = _random_body(str(rng.choice(families)), rng)
        at = parts[0].vertices[int(rng.integers(len(parts[0].vertices)))]
        size = rng.uniform(*_BODY_SIZES) * np.exp(rng.normal(0, _BODY_STRETCH, 3))
        normals = part.normals / size
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        vertices = part.vertices * size + at * rng.uniform(0.7, 1.05)
        parts.append(Mesh(vertices, normals, part.uv, part.faces))
    first = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = np.concatenate([part.faces + k for part, k in zip(parts, first, strict=False)])
    vertices, normals, uv = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("vertices", "normals", "uv")
    )
    return Mesh(vertices, normals, uv, faces).fitted()


def traced(mesh: Mesh, shape: str, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Trace the shadows of random lights on a mesh and draw its albedos.

    Parameters
    ----------
    mesh : Mesh
        Centred at the origin.
    shape : str
        Name to store.
    rng : np.random.Generator
        Draws lights and albedos.

    Returns
    -------
    dict of str to ndarray
        Content of the file.
    """
    camera, tracer = camera_around(mesh, SIZE, FILL), Tracer(mesh)
    hits = tracer.hits(*(part.reshape(-1, 3) for part in camera.rays()))
    mask = hits.valid.reshape(SIZE, SIZE)
    angles = np.degrees(np.arccos(_stratified_cosines(rng)))
    lights = np.stack([toward(float(angle), float(rng.uniform(0, 360))) for angle in angles])
    origins = hits.position[hits.valid] + LIFT * hits.normal[hits.valid]
    reached = np.zeros((LIGHTS, SIZE, SIZE), bool)
    for light, pixels in zip(lights, reached, strict=True):
        pixels[mask] = ~tracer.blocked(origins, np.broadcast_to(light, origins.shape), np.inf)
    normals = np.zeros((SIZE, SIZE, 3), np.float16)
    albedos = np.zeros((ALBEDOS, SIZE, SIZE, 3), np.float16)
    normals[mask] = hits.normal[hits.valid]
    for albedo in albedos:
        texture = make_albedo(str(rng.choice(TEXTURES)), rng, 256)
        albedo[mask] = texture_at(texture, hits.uv[hits.valid])
    return {
        "mask": mask,
        "normals": normals,
        "albedos": albedos,
        "toward": lights.astype(np.float32),
        "reached": np.packbits(reached, axis=-1),
        "shape": np.array(shape),
    }


def _stratified_cosines(rng: np.random.Generator) -> np.ndarray:
    """Cosines (LIGHTS,), in random order, of directions uniform over the cap of WIDEST degrees."""
    return np.asarray(
        1
        - rng.permutation(np.arange(LIGHTS) + rng.random(LIGHTS))
        / LIGHTS
        * (1 - np.cos(np.radians(WIDEST)))
    )


def objects_in(folder: Path) -> Iterator[TracedObject]:
    """Read the objects of a folder, ordered by name.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    iterator of TracedObject
    """
    for path in sorted(folder.glob("*.npz")):
        with np.load(path, allow_pickle=False) as data:
            yield TracedObject(
                data["mask"],
                data["normals"],
                data["albedos"],
                data["toward"],
                np.unpackbits(data["reached"], axis=-1).astype(bool),
                str(data["shape"]),
            )


def main() -> None:
    """Run the command line: make the objects that do not exist yet."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("-o", "--output", type=Path, required=True, metavar="DIR", help="folder to write to")
    add("--count", type=int, default=1000, metavar="N", help="objects (default: %(default)s)")
    add("--first", type=int, default=0, metavar="K", help="number of the first object")
    add("--groups", action="store_true", help="make fusions of up to five bodies")
    add("--data", type=Path, metavar="ROOT", help="use the MIT-Berkeley objects of this folder")
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    if arguments.data is not None:
        for name, arrays in measured_objects(arguments.data):
            _write(arguments.output / f"{name}.npz", arrays)
        return
    for number in range(arguments.first, arguments.first + arguments.count):
        path = arguments.output / f"{number:06d}.npz"
        if not path.exists():
            _write(path, (make_group if arguments.groups else make_object)(number))


def _write(path: Path, arrays: dict[str, np.ndarray]) -> None:
    with new_file(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
