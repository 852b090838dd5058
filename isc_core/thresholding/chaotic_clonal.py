"""Clonal selection with chaotic numbers (chaotic ClonalG; Akbar, Suryana & Sahib 2015).

Problem: as in `clonal_selection`. The hypothesis is that chaotic instead of pseudo-random numbers
lead to better thresholds.

Equation: the logistic map x <- 4x (1 - x), made uniform by u = (2 / pi) asin(sqrt(x)), supplies the
numbers for three steps: the first population, the affinity maturation (the mutation of clones) and
the new antibodies. Everything else is `clonal_selection.search`.

Citation: H. Akbar, N. Suryana and S. Sahib, "Chaotic clonal selection optimisation for
multi-threshold segmentation", International Journal of Signal and Imaging Systems Engineering 8(5),
298-315 (2015), doi:10.1504/IJSISE.2015.071953.

Limits: consecutive values of one orbit are dependent (see `logistic_map`). Here, consecutive
numbers are taken from different orbits, and only every eighth value of an orbit is used: the
numbers are then practically independent, and the search performs as well as with pseudo-random
ones.
"""

from .clonal_selection import ClonalOptions, search
from .logistic_map import ChaoticNumbers
from .optimum import Optimum
from .otsu import OtsuObjective


def maximise(
    objective: OtsuObjective,
    count: int,
    evaluations: int = 20_000,
    seed: int = 0,
    options: ClonalOptions | None = None,
) -> Optimum:
    """Maximise by chaotic ClonalG.

    Parameters
    ----------
    objective : OtsuObjective
    count : int
        Number of thresholds.
    evaluations : int
        Budget.
    seed : int
        Of the starting points of the orbits; not negative.
    options : ClonalOptions, optional

    Returns
    -------
    Optimum

    Raises
    ------
    InputError
        If options are invalid, or the budget is below the first population.
    """
    return search(objective, count, evaluations, ChaoticNumbers(seed), options or ClonalOptions())
