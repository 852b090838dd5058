"""Objects of which it is known what each of many lamps would reach: to be lit anew, by any of them, whenever a network learns from one.

  python -m benchmarks.unlit_objects -o DIR [--count N] [--first K]

DIR/NUMBER.npz: mask (SIZE, SIZE); normals (SIZE, SIZE, 3) and albedos (PAINTS, SIZE, SIZE, 3) float16; toward (LAMPS, 3) float32, unit
vectors to far lamps before the object; reached (LAMPS, SIZE, SIZE) bool, packed along its last axis (`numpy.packbits`): which pixels see
them; shape, its family's name. An object that is there is not made again. Shapes and paints are those of `isc synth`.

Limits: light that goes from one part of the object to another is left to whoever lights it.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from isc_core.atomic import new_file
from synth.albedos import ALBEDOS, make_albedo
from synth.light_rigs.placing import toward
from synth.materials import texture_at
from synth.recipe import camera_around
from synth.shapes import SHAPES, make_shape
from synth.tracing import LIFT, Tracer

SIZE, LAMPS, PAINTS = 160, 32, 2
_FILL = 0.9
WIDEST = 80.0  # degrees from the viewer


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
    mesh = make_shape(family, rng)
    camera, tracer = camera_around(mesh, SIZE, _FILL), Tracer(mesh)
    hits = tracer.hits(*(part.reshape(-1, 3) for part in camera.rays()))
    mask = hits.valid.reshape(SIZE, SIZE)
    lamps = np.stack([toward(float(angle), float(rng.uniform(0, 360))) for angle in np.degrees(np.arccos(_evenly(rng)))])
    from_, reached = hits.position[hits.valid] + LIFT * hits.normal[hits.valid], np.zeros((LAMPS, SIZE, SIZE), bool)
    for lamp, seen in zip(lamps, reached, strict=True):
        seen[mask] = ~tracer.blocked(from_, np.broadcast_to(lamp, from_.shape), np.inf)
    normals, albedos = np.zeros((SIZE, SIZE, 3), np.float16), np.zeros((PAINTS, SIZE, SIZE, 3), np.float16)
    normals[mask] = hits.normal[hits.valid]
    for paint in albedos:
        paint[mask] = texture_at(make_albedo(str(rng.choice(ALBEDOS)), rng, 256), hits.uv[hits.valid])
    packed = np.packbits(reached, axis=-1)
    return {
        "mask": mask,
        "normals": normals,
        "albedos": albedos,
        "toward": lamps.astype(np.float32),
        "reached": packed,
        "shape": np.array(family),
    }


def _evenly(rng: np.random.Generator) -> np.ndarray:
    """The cosines (LAMPS,) of directions that lie evenly on the sky before the object, in any order."""
    return np.asarray(1 - rng.permutation(np.arange(LAMPS) + rng.random(LAMPS)) / LAMPS * (1 - np.cos(np.radians(WIDEST))))


def objects_in(folder: Path) -> Iterator[Unlit]:
    """The objects of a folder, by name."""
    for path in sorted(folder.glob("*.npz")):
        with np.load(path, allow_pickle=False) as data:
            reached = np.unpackbits(data["reached"], axis=-1).astype(bool)
            yield Unlit(data["mask"], data["normals"], data["albedos"], data["toward"], reached, str(data["shape"]))


def main() -> None:
    """Makes the objects that are not there yet."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    parser.add_argument("--count", type=int, default=1000, metavar="N")
    parser.add_argument("--first", type=int, default=0, metavar="K", help="the first one's number")
    wanted = parser.parse_args()
    wanted.output.mkdir(parents=True, exist_ok=True)
    for number in range(wanted.first, wanted.first + wanted.count):
        path = wanted.output / f"{number:06d}.npz"
        if not path.exists():
            with new_file(path) as temporary, temporary.open("wb") as file:
                np.savez_compressed(file, **make_object(number))  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
