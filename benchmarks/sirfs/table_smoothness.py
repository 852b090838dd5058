"""Cross-validate the smoothness of the tables of absolute reflectance.

  python -m benchmarks.sirfs.table_smoothness [--grey]

Prints the log likelihood of each object under the table of the others.
"""

from dataclasses import replace

from benchmarks.program import run_program
from isc_core.prior_fitting.cross_validation import held_out_log_likelihood
from isc_core.prior_fitting.fit import FitOptions
from isc_core.prior_fitting.statistics import collect_statistics
from isc_core.prior_fitting.training_objects import read_training_objects

from .mit_berkeley import parser


def main() -> None:
    """Run the command line."""
    options = parser(__doc__)
    options.add_argument("--grey", action="store_true", help="use the grey tables")
    given = options.parse_args()
    statistics = collect_statistics(
        read_training_objects(given.shared / "data" / "mit_berkeley_train")
    )
    if given.grey:
        plain, constants, channels = FitOptions().grey_absolute, [6.0, 12.0, 24.0, 48.0, 96.0], 1
    else:
        plain, constants, channels = (
            FitOptions().absolute,
            [64.0, 128.0, 256.0, 512.0, 1024.0, 2048.0],
            3,
        )
    for constant in constants:
        likelihood = held_out_log_likelihood(
            statistics, replace(plain, smoothness=constant), channels
        )
        print(
            f"{constant:7.0f}: mean {likelihood.mean():8.4f}   by object {likelihood.round(2)}",
            flush=True,
        )


if __name__ == "__main__":
    run_program(main)
