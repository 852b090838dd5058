"""Measure how accurate a specular layer must be for shape, light and reflectance to gain from it.

  python -m benchmarks.decomposition.layer_precision --glossy DIR -o OUT
      [--sets level-25_natural,...] [--objects a,b]

DIR is a run of `isc synth glossy-mit`, whose true layers are known. SIRFS receives the photo minus
an approximate specular layer:

  80 %, 50 %         that share of the true layer
  blurred 2 %, 5 %   the true layer, blurred by that share of the object's diagonal
  mean               its mean over the object, per channel
  mirrored light     its total, distributed as the lobe mirrors the light and normals that SIRFS
                     recovers from the photo

Writes OUT/rows.jsonl, one row per run, which is kept, and OUT/tables.md, in the layout of
`benchmarks.decomposition.joint_models`.
"""

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.ndimage import map_coordinates

from benchmarks.decomposition.joint_models import photo_of, row_of, run_model, tables
from benchmarks.program import run_program
from benchmarks.records import append_row, read_rows
from isc_core.datasets.mit_berkeley import MitBerkeleyObject, list_objects
from isc_core.evaluation.evaluate import Estimate
from isc_core.imaging.smoothing import masked_gaussian
from isc_core.shading.environment_map import environment_from_shading
from synth.glossy_mit.gloss import environment_gloss
from synth.glossy_mit.settings import GlossySettings

_STEPS = 41  # normals across the disc on which the lobe is tabulated
_LARGEST_SHARE = 0.9  # of a pixel's light that may be specular

# An approximate specular layer (H, W, 3) from the true one, the mask (H, W) and the plain result.
Approximation = Callable[[np.ndarray, np.ndarray, Estimate], np.ndarray]


def blurred(layer: np.ndarray, mask: np.ndarray, share: float) -> np.ndarray:
    """Blur a layer inside the mask by a share of the object's diagonal.

    Parameters
    ----------
    layer : (H, W, 3) ndarray
        Linear.
    mask : (H, W) ndarray of bool
        Pixels of the object.
    share : float
        Standard deviation of the Gaussian over the diagonal of the mask's bounding box.

    Returns
    -------
    (H, W, 3) ndarray
    """
    return masked_gaussian(layer, mask, share * float(np.hypot(*np.ptp(np.argwhere(mask), axis=0))))


def mirrored(layer: np.ndarray, mask: np.ndarray, plain: Estimate) -> np.ndarray:
    """Mirror the recovered light at the recovered normals.

    Parameters
    ----------
    layer : (H, W, 3) ndarray
        True specular layer; only its sum is used.
    mask : (H, W) ndarray of bool
        Pixels of the object.
    plain : Estimate
        SIRFS on the photo.

    Returns
    -------
    (H, W, 3) ndarray
        The lobe of the set's exponent, scaled to the same sum.
    """
    x, y = np.meshgrid(np.linspace(-1, 1, _STEPS), np.linspace(-1, 1, _STEPS))
    inward = np.minimum(1, 1 / np.maximum(np.hypot(x, y), 1e-9))
    x, y = x * inward, y * inward
    normals = np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 1e-6))], -1).reshape(-1, 3)
    table = environment_gloss(
        environment_from_shading(plain.light), normals, GlossySettings().exponent
    ).reshape(_STEPS, _STEPS, 3)
    places = [(plain.normal[mask][:, k] + 1) * (_STEPS - 1) / 2 for k in (1, 0)]
    lobe = np.stack(
        [map_coordinates(table[..., k], places, order=1, mode="nearest") for k in range(3)], -1
    )
    found = np.zeros_like(layer)
    found[mask] = lobe * (layer[mask].sum() / max(float(lobe.sum()), 1e-12))
    return found


APPROXIMATIONS: dict[str, Approximation] = {
    "80 %": lambda layer, mask, plain: 0.8 * layer,
    "50 %": lambda layer, mask, plain: 0.5 * layer,
    "blurred 2 %": lambda layer, mask, plain: blurred(layer, mask, 0.02),
    "blurred 5 %": lambda layer, mask, plain: blurred(layer, mask, 0.05),
    "mean": lambda layer, mask, plain: np.broadcast_to(layer[mask].mean(axis=0), layer.shape),
    "mirrored light": lambda layer, mask, plain: mirrored(layer, mask, plain),
}


def measure(given: argparse.Namespace) -> list[dict[str, object]]:
    """Measure what is missing; return all rows, old and new.

    Parameters
    ----------
    given : argparse.Namespace
        Arguments of the command line.

    Returns
    -------
    list of dict
        One row per set, object and model.
    """
    path = given.output / "rows.jsonl"
    rows = read_rows(path)
    done = {(row["set"], row["object"], row["model"]) for row in rows}

    def solved(
        label: str, name: str, model: str, image: np.ndarray, photo: MitBerkeleyObject
    ) -> Estimate:
        answer, seconds = run_model("plain", replace(photo, image=image), photo, None)
        if (label, name, model) not in done:
            rows.append(row_of(label, name, model, photo, answer, seconds))
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
                for model in ("plain", *APPROXIMATIONS, "true diffuse")
                if (folder.name, name, model) not in done
            ]
            if not missing:
                continue
            photo, diffuse = photo_of(folder, name)
            plain = solved(folder.name, name, "plain", photo.image, photo)
            layer = np.where(photo.valid[..., None], np.maximum(photo.image - diffuse.image, 0), 0)
            for model in missing:
                if model == "true diffuse":
                    solved(folder.name, name, model, diffuse.image, photo)
                elif model != "plain":
                    specular = np.minimum(
                        APPROXIMATIONS[model](layer, photo.valid, plain),
                        _LARGEST_SHARE * photo.image,
                    )
                    solved(folder.name, name, model, photo.image - specular, photo)
    return rows


def _names(text: str) -> list[str]:
    return text.split(",")


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--glossy", type=Path, required=True, help="a run of isc synth glossy-mit")
    parser.add_argument("--objects", type=_names, default=[], help="comma-separated (default: all)")
    parser.add_argument("--sets", type=_names, default=[], help="comma-separated (default: all)")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder to write to")
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    text = tables(measure(given), ("plain", *APPROXIMATIONS, "true diffuse"))
    (given.output / "tables.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    run_program(main)
