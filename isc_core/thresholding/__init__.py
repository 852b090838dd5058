"""Multilevel thresholding: Otsu's objective, its exact maximum, and the optimisers of the thesis.

Each optimiser is a module with `maximise(objective, count, evaluations, seed, options) -> Optimum`;
`exact` computes the maximum by dynamic programming.
"""

from ..errors import InputError
from . import chaotic_clonal, clonal_selection, particle_swarm
from .optimum import Optimum
from .otsu import LEVELS, OtsuObjective, exact, quantise

__all__ = ["OPTIMISERS", "OtsuObjective", "Optimum", "exact", "maximise", "quantise"]

OPTIMISERS = ("exact", "chaotic_clonal", "clonal_selection", "particle_swarm")


def maximise(
    optimiser: str,
    objective: OtsuObjective,
    count: int,
    *,
    evaluations: int = 20_000,
    seed: int = 0,
) -> Optimum:
    """Find thresholds with a named optimiser, within a budget of evaluations.

    Parameters
    ----------
    optimiser : str
        "exact" ignores budget and seed.
    objective : OtsuObjective
    count : int
        Number of thresholds, 1 to 254.
    evaluations : int
        Budget.
    seed : int
        Not negative; the same seed gives the same thresholds.

    Returns
    -------
    Optimum

    Raises
    ------
    InputError
        If the name is unknown or a number is out of range.
    """
    if not 1 <= count < LEVELS - 1:
        raise InputError(
            f"the number of thresholds must be between 1 and {LEVELS - 2}, not {count}"
        )
    if seed < 0:
        raise InputError(f"the seed must be 0 or more, not {seed}")
    if optimiser == "exact":
        return exact(objective, count)
    for module in (chaotic_clonal, clonal_selection, particle_swarm):
        if optimiser == module.__name__.rpartition(".")[2]:
            return module.maximise(objective, count, evaluations, seed)
    raise InputError(f"unknown optimiser {optimiser!r}: choose one of {', '.join(OPTIMISERS)}")
