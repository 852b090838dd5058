"""The result of a threshold optimiser, and its budget of evaluations."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import InputError


@dataclass(frozen=True, eq=False)
class Optimum:
    """The best thresholds found.

    Attributes
    ----------
    thresholds : (K,) ndarray
        Integer levels, ascending; class 0 contains all levels up to the first; the class between
        equal ones is empty.
    value : float
        The objective.
    evaluations : int
        Number of candidates evaluated.
    history : (m, 2) ndarray
        Number of evaluations and best value after each batch of candidates.
    """

    thresholds: np.ndarray
    value: float
    evaluations: int
    history: np.ndarray


class Budget:
    """Evaluates candidates within a budget and records the best one and the history."""

    def __init__(
        self, objective: Callable[[np.ndarray], np.ndarray], budget: int, minimum: int
    ) -> None:
        """`objective`: values (n,) of candidates (n, K).

        `budget`: maximum number of evaluations; `InputError` if fewer than `minimum`.
        """
        if budget < minimum:
            raise InputError(
                f"the search needs at least {minimum} evaluations, not {budget}: raise the budget "
                "or reduce the population"
            )
        self._objective = objective
        self.left = budget
        self._used = 0
        self._best: np.ndarray | None = None
        self._value = -np.inf
        self._history: list[tuple[int, float]] = []

    def evaluate(self, thresholds: np.ndarray) -> np.ndarray:
        """Return the values of candidates and record the best one.

        Parameters
        ----------
        thresholds : (n, K) int ndarray
            Candidates, each in ascending order; n at most `left`.

        Returns
        -------
        (n,) ndarray
        """
        values = self._objective(thresholds)
        self.left -= len(values)
        self._used += len(values)
        best = int(np.argmax(values))
        if values[best] > self._value:
            self._best, self._value = thresholds[best].copy(), float(values[best])
        self._history.append((self._used, self._value))
        return values

    def close(self) -> Optimum:
        """Return the best candidate; at least one must have been evaluated."""
        assert self._best is not None
        return Optimum(self._best, self._value, self._used, np.array(self._history))
