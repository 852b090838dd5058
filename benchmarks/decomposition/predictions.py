"""What the scene network alone says of the MIT-Berkeley objects, which it has not seen.

  python -m benchmarks.decomposition.predictions --data ROOT [--weights NPZ] [--json FILE]

For each of the twenty images without highlights: the mean angular error of the normals, the mean
absolute error of the log shading up to a constant, and the error of the light's coefficients
without their brightness. "Within" is the share of pixels within the stated scale: .68 for normals
(both components, their normal distribution), .63 for the mean absolute error of a Laplace
distribution.

Limits: ten objects.
"""

import argparse
import json
from pathlib import Path

import numpy as np

from isc_core.datasets.mit_berkeley import MitBerkeleyObject, list_objects, load_object
from isc_core.decomposition.settings import Illumination
from isc_core.errors import InputError
from isc_core.evaluation.metrics import truth_normal
from isc_core.networks.scene_network import SceneNetwork, predict_scene
from isc_core.shading.spherical_harmonics import light_from_reference

_LEAST = 1e-4


def measure(truth: MitBerkeleyObject, network: SceneNetwork | None) -> dict[str, float]:
    """Compare a prediction with the truth.

    Parameters
    ----------
    truth : MitBerkeleyObject
    network : SceneNetwork or None

    Returns
    -------
    dict of str to float
        By column.
    """
    found = predict_scene(truth.image, truth.mask, network)
    known = truth.mask & np.isfinite(truth.height) & truth.valid
    normal = truth_normal(np.where(known, truth.height, np.nan))
    sure = known & np.isfinite(normal).all(-1)
    predicted = found.normals.normal[sure]
    unit = predicted / np.maximum(np.linalg.norm(predicted, axis=1, keepdims=True), 1e-6)
    degrees = np.degrees(np.arccos(np.clip((unit * normal[sure]).sum(1), -1, 1)))
    off = np.abs(predicted[:, :2] - normal[sure][:, :2]) <= found.normals.deviation[sure, None]
    shading = np.log(np.maximum(truth.shading[sure], _LEAST)) - found.shading.log_shading[sure]
    shading_error = np.abs(shading - np.median(shading))
    light = light_from_reference(truth.light) - found.light.mean
    return {
        "degrees": float(degrees.mean()),
        "normals within": float(off.mean()),
        "log shading": float(shading_error.mean()),
        "shading within": float(
            (shading_error <= found.shading.deviation[sure, None] / np.sqrt(2)).mean()
        ),
        "light": float(np.abs(light[1:]).mean()),
    }


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, required=True, help="the MIT-Berkeley set")
    parser.add_argument(
        "--weights", type=Path, help="archive of a network (default: the shipped one)"
    )
    parser.add_argument("--json", type=Path, help="write the rows to this file")
    given = parser.parse_args()
    try:
        network = None if given.weights is None else SceneNetwork.read(given.weights)
    except InputError as error:
        parser.error(str(error))
    rows: dict[str, dict[str, dict[str, float]]] = {}
    for light in (Illumination.NATURAL, Illumination.LABORATORY):
        rows[light] = {}
        for name in list_objects(given.data, light):
            truth = load_object(given.data, name, light)
            row = measure(truth, network)
            rows[light][name] = row
            print(f"{light:11}{name:10}", *(f"{key} {value:.3f}" for key, value in row.items()))
        means = {key: np.mean([one[key] for one in rows[light].values()]) for key in row}
        print(f"{light:11}{'mean':10}", *(f"{key} {value:.3f}" for key, value in means.items()))
    if given.json:
        given.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
