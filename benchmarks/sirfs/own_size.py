"""The ten MIT-Berkeley objects as users run them, and as the data set's protocol does.

  python -m benchmarks.sirfs.own_size [--shared DIR] [--json FILE]

On the diffuse images, so that nothing is separated. `decompose`: the defaults of `isc decompose`
with fine relief, on the data set's crop. `evaluate`: SIRFS at the objects' own size with the same
priors and predictions, and, as `isc evaluate` does by default, with the data set's priors alone.
The table has each object's avg, and the geometric means over objects; below are their ratios.

Limits: the shipped priors were fitted to these objects.
"""

import json

import numpy as np

from benchmarks.program import run_program
from isc_core.datasets.mit_berkeley import list_objects
from isc_core.decomposition.settings import LightPrior, ShapePrior
from isc_core.evaluation.metrics import score
from isc_core.evaluation.runner import Protocol, RunnerOptions, make_runner
from isc_core.progress import Monitor
from isc_core.sirfs.priors.prior_file import shipped_prior_set

from .mit_berkeley import LIGHTS, parser, training_object

_PARTS = ("height", "normal", "shading", "reflectance", "light")
RUNS = {
    "decompose": RunnerOptions(threads=1, protocol=Protocol.USERS),
    "evaluate": RunnerOptions(
        threads=1, light_prior=LightPrior.PREDICTED, shape_prior=ShapePrior.PREDICTED
    ),
    "evaluate, data set's priors": RunnerOptions(threads=1),
}


def _row(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Run the command line."""
    given = parser(__doc__).parse_args()
    runners = [make_runner(options, shipped_prior_set()) for options in RUNS.values()]
    errors: dict[str, dict[str, list[float]]] = {}
    print(_row(["light", "object", *RUNS]) + "\n|" + "---|" * (2 + len(RUNS)), flush=True)
    for light in LIGHTS:
        errors[light] = {}
        for name in list_objects(given.shared / "data" / "mit_berkeley_train", light):
            truth, found = training_object(given.shared, name, light), list[float]()
            for run in runners:
                estimate = run(truth, Monitor())
                parts = {part: getattr(estimate, part) for part in _PARTS}
                found.append(score(truth, **parts).average)
            errors[light][name] = found
            print(_row([light, name, *(f"{error:.4f}" for error in found)]), flush=True)
        means = np.exp(np.log(list(errors[light].values())).mean(axis=0))
        print(_row([light, "mean", *(f"{mean:.4f}" for mean in means)]))
        for other, mean in list(zip(RUNS, means, strict=True))[1:]:
            print(f"{light}: decompose over {other}: {means[0] / mean:.3f}", flush=True)
    if given.json:
        given.json.write_text(json.dumps(errors, indent=2) + "\n")


if __name__ == "__main__":
    run_program(main)
