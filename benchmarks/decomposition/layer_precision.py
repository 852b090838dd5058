"""How exactly the specular layer has to be known before shape, light and reflectance gain by taking
it off.

  python -m benchmarks.decomposition.layer_precision --glossy DIR -o OUT [--sets level-25_natural,...] [--objects
  a,b]

DIR: as `isc synth glossy-mit` writes it, whose true layers are known. SIRFS is given the photo less
what somebody would take off who knew

    80 %, 50 %           that share of the specular layer at every pixel blurred 2 %, 5 %     the
    layer, blurred by so much of the object's diagonal mean                 its mean over the
    object, in all three channels mirrored light       how much of all light is specular, and the
    lobe; its form is what the light and the normals mirror that SIRFS
                         recovers from the photo

Writes OUT/rows.jsonl, a row a run, which is not run again, and OUT/tables.md, laid out as those of
`benchmarks.decomposition.joint_models`.
"""

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.ndimage import map_coordinates

from benchmarks.decomposition.joint_models import photo_of, row_of, run, tables
from benchmarks.records import append_row, read_rows
from isc_core.datasets.mit_berkeley import MitBerkeleyObject, list_objects
from isc_core.evaluation.evaluate import Estimate
from isc_core.imaging.smoothing import masked_gaussian
from isc_core.shading.environment_map import environment_from_shading
from synth.glossy_mit.gloss import environment_gloss
from synth.glossy_mit.settings import GlossySettings

_STEPS = 41  # normals across the disc that a gloss is tabulated on
_MOST = 0.9  # of a pixel's light that is taken off

# What is taken off a photo (H, W, 3), given its specular layer (H, W, 3), mask (H, W) and the plain
# answer.
Taken = Callable[[np.ndarray, np.ndarray, Estimate], np.ndarray]


def blurred(layer: np.ndarray, mask: np.ndarray, share: float) -> np.ndarray:
    """`layer` (H, W, 3), blurred inside `mask` by that share of the object's diagonal."""
    return masked_gaussian(layer, mask, share * float(np.hypot(*np.ptp(np.argwhere(mask), axis=0))))


def mirrored(layer: np.ndarray, mask: np.ndarray, plain: Estimate) -> np.ndarray:
    """What a lobe of the set's exponent mirrors of the recovered light at the recovered normals, as
    much of it as there is of `layer`.
    """
    x, y = np.meshgrid(np.linspace(-1, 1, _STEPS), np.linspace(-1, 1, _STEPS))
    inward = np.minimum(1, 1 / np.maximum(np.hypot(x, y), 1e-9))
    x, y = x * inward, y * inward
    normals = np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 1e-6))], -1).reshape(-1, 3)
    table = environment_gloss(
        environment_from_shading(plain.light), normals, GlossySettings().exponent
    ).reshape(_STEPS, _STEPS, 3)
    places = [(plain.normal[mask][:, k] + 1) * (_STEPS - 1) / 2 for k in (1, 0)]
    seen = np.stack(
        [map_coordinates(table[..., k], places, order=1, mode="nearest") for k in range(3)], -1
    )
    taken = np.zeros_like(layer)
    taken[mask] = seen * (layer[mask].sum() / max(float(seen.sum()), 1e-12))
    return taken


TAKEN: dict[str, Taken] = {
    "80 %": lambda layer, mask, plain: 0.8 * layer,
    "50 %": lambda layer, mask, plain: 0.5 * layer,
    "blurred 2 %": lambda layer, mask, plain: blurred(layer, mask, 0.02),
    "blurred 5 %": lambda layer, mask, plain: blurred(layer, mask, 0.05),
    "mean": lambda layer, mask, plain: np.broadcast_to(layer[mask].mean(axis=0), layer.shape),
    "mirrored light": lambda layer, mask, plain: mirrored(layer, mask, plain),
}


def measure(given: argparse.Namespace) -> list[dict[str, object]]:
    """All rows: those that are on disk, and new ones."""
    path = given.output / "rows.jsonl"
    rows = read_rows(path)
    done = {(row["set"], row["object"], row["model"]) for row in rows}

    def solved(
        label: str, name: str, model: str, image: np.ndarray, seen: MitBerkeleyObject
    ) -> Estimate:
        answer, seconds = run("plain", replace(seen, image=image), seen, None)
        if (label, name, model) not in done:
            rows.append(row_of(label, name, model, seen, answer, seconds))
            append_row(path, rows[-1])
        return answer

    for folder in sorted(
        path
        for path in given.glossy.iterdir()
        if path.is_dir() and path.name in (given.sets or [path.name])
    ):
        for name in given.objects or list_objects(folder, "laboratory"):
            missing = [
                model
                for model in ("plain", *TAKEN, "true diffuse")
                if (folder.name, name, model) not in done
            ]
            if not missing:
                continue
            seen, diffuse = photo_of(folder, name)
            plain = solved(folder.name, name, "plain", seen.image, seen)
            layer = np.where(seen.valid[..., None], np.maximum(seen.image - diffuse.image, 0), 0)
            for model in missing:
                if model == "true diffuse":
                    solved(folder.name, name, model, diffuse.image, seen)
                elif model != "plain":
                    taken = np.minimum(TAKEN[model](layer, seen.valid, plain), _MOST * seen.image)
                    solved(folder.name, name, model, seen.image - taken, seen)
    return rows


def main() -> None:
    """Runs, prints and writes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--glossy", type=Path, required=True, help="what isc synth glossy-mit wrote"
    )
    parser.add_argument("--objects", type=lambda text: text.split(","), default=[])
    parser.add_argument("--sets", type=lambda text: text.split(","), default=[])
    parser.add_argument("-o", "--output", type=Path, required=True)
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    text = tables(measure(given), ("plain", *TAKEN, "true diffuse"))
    (given.output / "tables.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
