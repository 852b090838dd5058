"""Clonal selection (ClonalG): cloning, affinity-dependent mutation, replacement of the worst.

Problem: maximise a function of K ascending integer thresholds within a budget of evaluations.

Equation: a generation clones each of N antibodies N_c = round(beta N) times and moves the clones'
thresholds by at most s = 254 exp(-rho f) levels, f in [0, 1] being the antibody's affinity. Each
antibody is replaced by the best of its clones if that is not worse, and the d worst antibodies by
new ones.

Citation: L. N. de Castro and F. J. Von Zuben, "Learning and optimization using the clonal selection
principle", IEEE Trans. Evolutionary Computation 6(3), 239-251 (2002),
doi:10.1109/TEVC.2002.1011539. All antibodies are selected and have the same number of clones, as
they propose for optimisation; N, beta, rho and d are typical values of theirs. Two choices are
ours, and essential for the search. The affinity is the rank, scaled to [0, 1]: scaled objective
values are nearly 1 for all but the newest antibodies, so that mutations would be small. A mutation
moves a run of adjacent thresholds by one common step of at least one level, then sorts them: good
sets of thresholds lie on ridges along which adjacent thresholds move together; independent steps
rarely follow these, and stop one level from the maximum.

Limits: no proof of optimality; budgets are in evaluations. `numbers` is the only source of
randomness, so that sources can be compared with all else equal: see `chaotic_clonal`.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..errors import InputError
from .optimum import Budget, Optimum
from .otsu import LEVELS, OtsuObjective

_TOP = LEVELS - 2  # the highest threshold with a level above it


@dataclass(frozen=True)
class ClonalOptions:
    """Options of ClonalG.

    Attributes
    ----------
    population : int
        Number of antibodies N, at least 2.
    clone_share : float
        Clones of each antibody as a fraction beta of N, greater than 0.
    decay : float
        rho, the decay of mutations with affinity, greater than 0.
    replaced_share : float
        Fraction d / N of the worst antibodies that each generation replaces, in [0, 1).
    """

    population: int = 50
    clone_share: float = 0.1
    decay: float = 5.0
    replaced_share: float = 0.1


class NumberSource(Protocol):
    """A source of random numbers for an optimiser."""

    def uniform(self, shape: tuple[int, ...]) -> np.ndarray:
        """Return the next numbers.

        Parameters
        ----------
        shape : tuple of int

        Returns
        -------
        ndarray
            Of `shape`, uniform in [0, 1).
        """


class PseudoRandomNumbers:
    """NumPy's generator as a source of numbers."""

    def __init__(self, seed: int) -> None:
        self._generator = np.random.default_rng(seed)

    def uniform(self, shape: tuple[int, ...]) -> np.ndarray:
        """Return the next numbers.

        Parameters
        ----------
        shape : tuple of int

        Returns
        -------
        ndarray
            Of `shape`, uniform in [0, 1).
        """
        return self._generator.random(shape)


def maximise(
    objective: OtsuObjective,
    count: int,
    evaluations: int = 20_000,
    seed: int = 0,
    options: ClonalOptions | None = None,
) -> Optimum:
    """Maximise by ClonalG with pseudo-random numbers.

    Parameters
    ----------
    objective : OtsuObjective
    count : int
        Number of thresholds.
    evaluations : int
        Budget.
    seed : int
        Not negative.
    options : ClonalOptions, optional

    Returns
    -------
    Optimum

    Raises
    ------
    InputError
        If options are invalid, or the budget is below the first population.
    """
    return search(
        objective, count, evaluations, PseudoRandomNumbers(seed), options or ClonalOptions()
    )


def search(
    objective: OtsuObjective,
    count: int,
    evaluations: int,
    numbers: NumberSource,
    options: ClonalOptions,
) -> Optimum:
    """Maximise by ClonalG with any source of numbers.

    Parameters
    ----------
    objective : OtsuObjective
    count, evaluations : int
    numbers : NumberSource
    options : ClonalOptions

    Returns
    -------
    Optimum

    Raises
    ------
    InputError
        If the budget is below the first population.
    """
    _check(options)
    clones = max(1, round(options.clone_share * options.population))
    replaced = round(options.replaced_share * options.population)
    budget = Budget(objective, evaluations, options.population)
    antibodies = _new(numbers, options.population, count)
    values = budget.evaluate(antibodies)
    while budget.left >= options.population * clones + replaced:
        steps = np.repeat(_steps(values, options.decay), clones)
        offspring = _mutated(np.repeat(antibodies, clones, axis=0), steps, numbers)
        offspring_values = budget.evaluate(offspring).reshape(-1, clones)
        best = np.argmax(offspring_values, axis=1)
        chosen = np.arange(options.population), best
        better = offspring_values[chosen] >= values
        antibodies = np.where(
            better[:, None], offspring.reshape(-1, clones, count)[chosen], antibodies
        )
        values = np.where(better, offspring_values[chosen], values)
        if replaced:
            worst = np.argsort(values, kind="stable")[:replaced]
            antibodies[worst] = _new(numbers, replaced, count)
            values[worst] = budget.evaluate(antibodies[worst])
    return budget.close()


def mutation_rate(affinity: np.ndarray, decay: float) -> np.ndarray:
    """Return the mutation rate exp(-rho f).

    Parameters
    ----------
    affinity : ndarray
        f in [0, 1].
    decay : float
        rho, greater than 0.

    Returns
    -------
    ndarray
        In (0, 1], of the shape of `affinity`.
    """
    return np.exp(-decay * affinity)


def _check(options: ClonalOptions) -> None:
    if options.population < 2 or not options.clone_share > 0 or not options.decay > 0:
        raise InputError("population must be at least 2, clone_share and decay above 0")
    if not 0 <= options.replaced_share < 1:
        raise InputError("replaced_share must be within [0, 1)")


def _new(numbers: NumberSource, size: int, count: int) -> np.ndarray:
    return np.sort((numbers.uniform((size, count)) * (_TOP + 1)).astype(np.int64), axis=1)


def _steps(values: np.ndarray, decay: float) -> np.ndarray:
    """The largest step (n,) in levels, >= 1, of the clones of antibodies with `values` (n,)."""
    affinity = np.empty(len(values))
    affinity[np.argsort(values, kind="stable")] = np.linspace(0, 1, len(values))
    return np.maximum(1, _TOP * mutation_rate(affinity, decay))


def _mutated(clones: np.ndarray, steps: np.ndarray, numbers: NumberSource) -> np.ndarray:
    """The `clones` (n, K), each with a run of thresholds moved by one step of at most its entry of
    `steps` (n,), sorted.
    """
    size, count = clones.shape
    chance = numbers.uniform((size, 3))
    signed = 2 * chance[:, 0] - 1
    moves = np.where(signed < 0, -1, 1) * np.maximum(1, np.ceil(np.abs(signed) * steps)).astype(
        np.int64
    )
    ends = np.sort((chance[:, 1:] * count).astype(np.int64), axis=1)
    column = np.arange(count)
    moved = (column >= ends[:, :1]) & (column <= ends[:, 1:])
    return np.sort(np.clip(clones + moved * moves[:, None], 0, _TOP), axis=1)
