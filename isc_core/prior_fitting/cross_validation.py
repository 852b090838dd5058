"""The likelihood of held-out objects under reflectance statistics fitted to the others, the
criterion that selects the smoothness of the table.

Citation: M. Stone 1974, doi:10.1111/j.2517-6161.1974.tb00994.x (leave-one-out cross-validation).
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
    """Score each object under the table fitted to all the others.

    The distribution is over the nodes of the grid: values are comparable between `options`, but not
    between numbers of `channels`.

    Parameters
    ----------
    statistics : mapping of str to ObjectStatistics
    options : TableFitOptions
    channels : int
        3 or 1.
    monitor : Monitor, optional

    Returns
    -------
    (objects,) ndarray
        Mean log likelihood of each object's pixels, in order of name.
    """
    monitor = monitor or Monitor()
    names = sorted(statistics)
    likelihoods = []
    for count, name in enumerate(names):
        monitor.report(f"without {name}", count / len(names))
        rest = [statistics[other] for other in names if other != name]
        if channels == 3:
            whiten = fit_whitening(rest)
            fitted = color_histogram(rest, whiten)
            held_out = color_histogram([statistics[name]], whiten)
        else:
            fitted, held_out = grey_histogram(rest), grey_histogram([statistics[name]])
        table = fit_absolute_table(fitted, options).table().values
        likelihoods.append(log_likelihood(table, held_out))
    return np.array(likelihoods)
