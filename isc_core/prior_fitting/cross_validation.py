"""How likely the fitted reflectance statistics find objects that they have not seen: what
smoothness is chosen by.

Leave-one-object-out cross-validation (M. Stone 1974, doi:10.1111/j.2517-6161.1974.tb00994.x) of the
table of absolute colour.
"""

from collections.abc import Mapping

import numpy as np

from ..progress import Monitor
from ..sirfs.priors.absolute_table import log_likelihood
from .absolute_color import TableFitOptions, fit_absolute_table
from .fit import color_histogram, fit_whitening, grey_histogram
from .statistics import ObjectStatistics


def held_out_log_likelihood(
    statistics: Mapping[str, ObjectStatistics],
    options: TableFitOptions,
    channels: int = 3,
    monitor: Monitor | None = None,
) -> np.ndarray:
    """Mean log likelihood of each object's pixels under the table fitted to all the others,
    (objects,), in order of name.

    Nodes of the grid are the outcomes: figures are comparable between `options`, not between
    numbers of `channels`.
    """
    monitor = monitor or Monitor()
    names = sorted(statistics)
    likelihoods = []
    for count, name in enumerate(names):
        monitor.report(f"without {name}", count / len(names))
        rest = [statistics[other] for other in names if other != name]
        if channels == 3:
            whiten = fit_whitening(rest)
            seen, unseen = (
                color_histogram(rest, whiten),
                color_histogram([statistics[name]], whiten),
            )
        else:
            seen, unseen = grey_histogram(rest), grey_histogram([statistics[name]])
        likelihoods.append(log_likelihood(fit_absolute_table(seen, options).table().values, unseen))
    return np.array(likelihoods)
