"""Limited-memory BFGS with a strong Wolfe line search, in place and in the storage type of the
unknowns.

Equation: the direction is computed by the two-loop recursion from the inner products of the stored
vectors only, so each iteration reads these vectors twice: once for the products, once for the
direction. Products are float64 sums in a fixed order (see `numerics`).

Citation: J. Nocedal 1980, doi:10.1090/S0025-5718-1980-0572855-7 (two-loop recursion); W. Chen, Z.
Wang, J. Zhou, "Large-scale L-BFGS using MapReduce", NIPS 2014 (on inner products); J. Nocedal, S.
J. Wright, "Numerical Optimization" (2006), section 3.5, doi:10.1007/978-0-387-40065-5 (line
search).

Limits: smooth unconstrained functions; small discontinuities of the gradient are tolerated, but not
resolved.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np


@dataclass(frozen=True)
class LbfgsOptions:
    """History size, limits and tolerances of a minimisation.

    Attributes
    ----------
    memory : int
        Number of stored pairs of step and gradient change.
    iterations, evaluations : int
        Maximum number of each.
    loss_tolerance : float
        Stop once `loss_window` previous losses are within this relative distance of the current
        one.
    loss_window : int
        Number of previous losses compared.
    gradient_tolerance : float
        Stop if the largest gradient component is at most this.
    step_tolerance : float
        Stop if the largest step component, or the change of the loss, is below this.
    armijo, wolfe : float
        Constants of the strong Wolfe conditions.
    trials : int
        Maximum number of evaluations of one line search.
    """

    memory: int = 10
    iterations: int = 2000
    evaluations: int = 1000
    loss_tolerance: float = 5e-5
    loss_window: int = 5
    gradient_tolerance: float = 1e-5
    step_tolerance: float = 1e-9
    armijo: float = 1e-4
    wolfe: float = 0.9
    trials: int = 25


@dataclass(frozen=True)
class LbfgsResult:
    """The end of a minimisation.

    Attributes
    ----------
    loss : float
        Final value.
    iterations, evaluations : int
        Steps taken, and evaluations of the function.
    reason : str
        Why it stopped: "loss", "gradient", "step", "iterations" or "evaluations".
    """

    loss: float
    iterations: int
    evaluations: int
    reason: str

    @property
    def converged(self) -> bool:
        """Whether it stopped because a tolerance was met."""
        return self.reason in ("loss", "gradient", "step")


class Algebra(Protocol):
    """The two operations on the stored vectors."""

    def products(self, vectors: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Return all inner products.

        Parameters
        ----------
        vectors : (K, N) ndarray
        others : (M, N) ndarray

        Returns
        -------
        (K, M) float64 ndarray
        """
        ...

    def combine(self, coefficients: np.ndarray, vectors: np.ndarray, out: np.ndarray) -> None:
        """Write sum_k coefficients[k] vectors[k] into `out`.

        Parameters
        ----------
        coefficients : (K,) ndarray
        vectors : (K, N) ndarray
        out : (N,) ndarray
        """
        ...


class NumpyAlgebra:
    """`Algebra` in plain NumPy."""

    def products(self, vectors: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Return all inner products, see `Algebra`.

        Parameters
        ----------
        vectors : (K, N) ndarray
        others : (M, N) ndarray

        Returns
        -------
        (K, M) float64 ndarray
        """
        return np.stack([np.einsum("kn,n->k", vectors, v, dtype=float) for v in others], axis=1)

    def combine(self, coefficients: np.ndarray, vectors: np.ndarray, out: np.ndarray) -> None:
        """Write sum_k coefficients[k] vectors[k] into `out`, see `Algebra`.

        Parameters
        ----------
        coefficients : (K,) ndarray
        vectors : (K, N) ndarray
        out : (N,) ndarray
            Overwritten.
        """
        np.einsum("k,kn->n", coefficients.astype(out.dtype), vectors, out=out)


Function = Callable[[np.ndarray, np.ndarray], float]


# Cosine between a step and the change of the gradient; below it, the pair has no usable curvature.
_MIN_COSINE = 1e-10


class PairMemory:
    """Steps and gradient changes, with the inner products between all of them.

    Attributes
    ----------
    vectors : (2 m + 1, N) ndarray
        Rows: m steps, m changes, the gradient.
    order : list of int
        Slots that contain a pair, oldest first.

    Parameters
    ----------
    size : int
        m.
    length : int
        N.
    dtype : dtype
    algebra : Algebra
    """

    def __init__(self, size: int, length: int, dtype: np.dtype, algebra: Algebra) -> None:  # type: ignore[type-arg]
        self.size = size
        self.vectors = np.zeros((2 * size + 1, length), dtype)
        self._gram = np.zeros((2 * size + 1, 2 * size + 1))
        self.order: list[int] = []
        self._algebra = algebra

    @property
    def gradient(self) -> np.ndarray:
        """Row of the gradient."""
        return self.vectors[-1]

    def next_slot(self) -> int:
        """Return a free slot, or otherwise that of the oldest pair.

        (After a skipped pair, any slot may be free.)
        """
        return next(
            (k for k in range(self.size) if k not in self.order),
            self.order[0] if self.order else 0,
        )

    def refresh(self, slot: int | None) -> None:
        """Add the rows of a slot as the newest pair, and update the inner products.

        A pair without positive curvature is skipped.

        Parameters
        ----------
        slot : int or None
            None if only the gradient has changed.
        """
        rows = [2 * self.size] if slot is None else [slot, self.size + slot, 2 * self.size]
        products = self._algebra.products(self.vectors, self.vectors[rows])
        self._gram[:, rows] = products
        self._gram[rows, :] = products.T
        if slot is None:
            return
        self.order = [k for k in self.order if k != slot]
        change = self.size + slot
        if self._gram[slot, change] > _MIN_COSINE * np.sqrt(
            self._gram[slot, slot] * self._gram[change, change]
        ):
            self.order.append(slot)

    def direction(self, out: np.ndarray) -> float:
        """Write the descent direction into `out`.

        Parameters
        ----------
        out : (N,) ndarray
            Overwritten.

        Returns
        -------
        float
            Inner product of the direction with the gradient.
        """
        m, g = self.size, self._gram
        c = np.zeros(2 * m + 1)
        c[-1] = -1
        alpha = {}
        for k in reversed(self.order):
            alpha[k] = float(c @ g[:, k]) / g[k, m + k]
            c[m + k] -= alpha[k]
        if self.order:
            newest = self.order[-1]
            c *= g[newest, m + newest] / g[m + newest, m + newest]
        for k in self.order:
            c[k] += alpha[k] - float(c @ g[:, m + k]) / g[k, m + k]
        self._algebra.combine(c, self.vectors, out)
        return float(c @ g[:, -1])

    def forget(self) -> None:
        """Drop all pairs."""
        self.order = []


def minimise(
    function: Function,
    x: np.ndarray,
    options: LbfgsOptions,
    algebra: Algebra,
    each: Callable[[int, float], None] = lambda iteration, loss: None,
) -> LbfgsResult:
    """Minimise a function in place.

    Parameters
    ----------
    function : callable
        ``function(x, gradient_out) -> loss``.
    x : (N,) ndarray
        Starting point; the minimum on return.
    options : LbfgsOptions
    algebra : Algebra
    each : callable, optional
        ``each(iteration, loss)``, called after every step; an exception it raises ends the run.

    Returns
    -------
    LbfgsResult
    """
    return Minimisation(function, x, options, algebra).run(each)


class Minimisation:
    """A minimisation that can be suspended and resumed without changing its result.

    Attributes
    ----------
    x : (N,) ndarray
        Current point, changed in place.
    loss : float
        Loss there.

    Parameters
    ----------
    function : callable
        ``function(x, gradient_out) -> loss``.
    x : (N,) ndarray
        Start.
    options : LbfgsOptions
    algebra : Algebra
    """

    def __init__(
        self, function: Function, x: np.ndarray, options: LbfgsOptions, algebra: Algebra
    ) -> None:
        self.x, self._function, self._options = x, function, options
        self._memory = PairMemory(options.memory, x.size, x.dtype, algebra)
        self._direction = np.empty_like(x)
        self.loss = function(x, self._memory.gradient)
        self._losses, self._evaluations = [self.loss], 1
        self._converged = ""  # reason to stop, once converged
        self._memory.refresh(None)

    def run(
        self,
        each: Callable[[int, float], None] = lambda iteration, loss: None,
        evaluations: int | None = None,
    ) -> LbfgsResult:
        """Continue until convergence, or until a number of evaluations.

        Parameters
        ----------
        each : callable, optional
            As for `minimise`.
        evaluations : int, optional
            Total number of evaluations; by default, that of the options.

        Returns
        -------
        LbfgsResult
        """
        limit = (
            self._options.evaluations
            if evaluations is None
            else min(evaluations, self._options.evaluations)
        )
        while not (reason := self._stop(limit)):
            self._step()
            each(self._iterations, self.loss)
        return LbfgsResult(self.loss, self._iterations, self._evaluations, reason)

    @property
    def _iterations(self) -> int:
        return len(self._losses) - 1

    def _stop(self, evaluations: int) -> str:
        """Return the reason to stop, or "" to continue."""
        if self._converged:
            return self._converged
        if _largest(self._memory.gradient) <= self._options.gradient_tolerance:
            return "gradient"
        if self._iterations >= self._options.iterations:
            return "iterations"
        return "evaluations" if self._evaluations >= evaluations else ""

    def _step(self) -> None:
        memory, options = self._memory, self._options
        slope = memory.direction(self._direction)
        if not slope < 0:
            memory.forget()
            slope = memory.direction(self._direction)
        first = (
            1.0
            if self._iterations
            else min(1.0, 1.0 / float(np.abs(memory.gradient).sum(dtype=float)))
        )
        slot = memory.next_slot()
        step_row, change = memory.vectors[slot], memory.vectors[memory.size + slot]
        np.copyto(step_row, self.x)  # start of the line search; afterwards the step
        np.copyto(change, memory.gradient)
        search = _Search(
            self._function, self.x, step_row, self._direction, memory.gradient, options
        )
        step, self.loss = search.run(self.loss, slope, first)
        self._evaluations += search.evaluations
        np.subtract(self.x, step_row, out=step_row)
        np.subtract(memory.gradient, change, out=change)
        memory.refresh(slot)
        recent = self._losses[-options.loss_window :]
        converged = all(
            abs(v - self.loss) <= options.loss_tolerance * abs(self.loss) for v in recent
        )
        if len(recent) == options.loss_window and converged:
            self._converged = "loss"
        elif (
            step * _largest(self._direction) < options.step_tolerance
            or abs(recent[-1] - self.loss) < options.step_tolerance
        ):
            self._converged = "step"
        self._losses.append(self.loss)


@dataclass(frozen=True)
class _Trial:
    step: float
    loss: float
    slope: float


class _Search:
    """One line search along `direction` from `start`.

    `x` and `gradient` end at the accepted point.
    """

    def __init__(
        self,
        function: Function,
        x: np.ndarray,
        start: np.ndarray,
        direction: np.ndarray,
        gradient: np.ndarray,
        options: LbfgsOptions,
    ) -> None:
        self._function, self._x, self._start, self._direction, self._gradient = (
            function,
            x,
            start,
            direction,
            gradient,
        )
        self._options = options
        self.evaluations = 0

    def run(self, loss: float, slope: float, first: float) -> tuple[float, float]:
        """Return the accepted step and its loss."""
        o = self._options
        origin = previous = _Trial(0.0, loss, slope)
        step = first
        while self.evaluations < o.trials:
            trial = self._try(step)
            if not np.isfinite(trial.loss):
                step = (previous.step + step) / 2
                continue
            if trial.loss > loss + o.armijo * step * slope or (
                self.evaluations > 1 and trial.loss >= previous.loss
            ):
                return self._zoom(origin, previous, trial)
            if abs(trial.slope) <= -o.wolfe * slope:
                return trial.step, trial.loss
            if trial.slope >= 0:
                return self._zoom(origin, trial, previous)
            step = float(
                np.clip(
                    _cubic_minimum(previous, trial), step + 0.01 * (step - previous.step), 10 * step
                )
            )
            previous = trial
        return self._return_to(previous)

    def _zoom(self, origin: _Trial, low: _Trial, high: _Trial) -> tuple[float, float]:
        o = self._options
        trial = low
        while self.evaluations < o.trials:
            width = abs(high.step - low.step)
            step = _cubic_minimum(low, high)
            left, right = min(low.step, high.step), max(low.step, high.step)
            step = float(np.clip(step, left + 0.1 * width, right - 0.1 * width))
            trial = self._try(step)
            if (
                not np.isfinite(trial.loss)
                or trial.loss > origin.loss + o.armijo * step * origin.slope
                or trial.loss >= low.loss
            ):
                high = trial if np.isfinite(trial.loss) else _Trial(step, low.loss + 1, 0.0)
            elif abs(trial.slope) <= -o.wolfe * origin.slope:
                return trial.step, trial.loss
            else:
                if trial.slope * (high.step - low.step) >= 0:
                    high = low
                low = trial
            if width * _largest(self._direction) < o.step_tolerance:
                break
        return (trial.step, trial.loss) if trial is low else self._return_to(low)

    def _try(self, step: float) -> _Trial:
        np.multiply(self._direction, self._x.dtype.type(step), out=self._x)
        self._x += self._start
        self.evaluations += 1
        loss = self._function(self._x, self._gradient)
        return _Trial(
            step, loss, float(np.einsum("n,n->", self._gradient, self._direction, dtype=float))
        )

    def _return_to(self, best: _Trial) -> tuple[float, float]:
        """Return to the best point so far, which is not necessarily the last one evaluated."""
        trial = self._try(best.step)
        return trial.step, trial.loss


def _largest(vector: np.ndarray) -> float:
    """The largest absolute component."""
    return max(float(vector.max()), -float(vector.min()))


def _cubic_minimum(a: _Trial, b: _Trial) -> float:
    """Return the minimum of the cubic through two losses and slopes; without one, the midpoint."""
    if a.step == b.step:
        return a.step
    d1 = a.slope + b.slope - 3 * (a.loss - b.loss) / (a.step - b.step)
    square = d1 * d1 - a.slope * b.slope
    if not square >= 0:
        return (a.step + b.step) / 2
    d2 = float(np.copysign(np.sqrt(square), b.step - a.step))
    divisor = b.slope - a.slope + 2 * d2
    if divisor == 0:
        return (a.step + b.step) / 2
    return b.step - (b.step - a.step) * (b.slope + d2 - d1) / divisor
