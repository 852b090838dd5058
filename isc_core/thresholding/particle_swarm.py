"""Particle swarm optimisation (Kennedy & Eberhart 1995).

Problem: maximise a function of K ascending integer thresholds within a budget of evaluations.

Equation: v <- w v + c u_1 (p - x) + c u_2 (g - x), x <- x + v, with p a particle's best position, g
the best of all, u uniform in [0, 1) for each coordinate, and the constriction w = .7298, c =
1.49618. Positions are real; thresholds are their rounded, sorted values.

Citation: J. Kennedy and R. Eberhart, "Particle swarm optimization", Proc. ICNN'95 4, 1942-1948
(1995), doi:10.1109/ICNN.1995.488968. M. Clerc and J. Kennedy, "The particle swarm: explosion,
stability, and convergence in a multidimensional complex space", IEEE Trans. Evolutionary
Computation 6(1), 58-73 (2002), doi:10.1109/4235.985692 (the constriction).

An inertia that decreases from .9 to .4, with c = 2, is the other common setting:
`DECREASING_INERTIA`. It searches longer before it converges.

Limits: a swarm that has converged to a local maximum stays there; the rest of its budget is wasted.
"""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from .optimum import Budget, Optimum
from .otsu import LEVELS, OtsuObjective

_TOP = LEVELS - 2  # the highest threshold with a level above it


@dataclass(frozen=True)
class SwarmOptions:
    """Options of the swarm.

    Attributes
    ----------
    particles : int
        At least 2.
    inertia, last_inertia : float
        Fraction w of the velocity that is kept, at the start and at the end of the budget, linear
        in between; in [0, 1).
    attraction : float
        c, the strength of both attractions, greater than 0.
    top_speed : float
        Largest move of a threshold in one step, in levels, greater than 0.
    """

    particles: int = 40
    inertia: float = 0.7298
    last_inertia: float = 0.7298
    attraction: float = 1.49618
    top_speed: float = 64.0


DECREASING_INERTIA = SwarmOptions(inertia=0.9, last_inertia=0.4, attraction=2.0)


def maximise(
    objective: OtsuObjective,
    count: int,
    evaluations: int = 20_000,
    seed: int = 0,
    options: SwarmOptions | None = None,
) -> Optimum:
    """Maximise by a particle swarm with pseudo-random numbers.

    Parameters
    ----------
    objective : OtsuObjective
    count : int
        Number of thresholds.
    evaluations : int
        Budget.
    seed : int
        Not negative.
    options : SwarmOptions, optional

    Returns
    -------
    Optimum

    Raises
    ------
    InputError
        If options are invalid, or the budget is below one step of the swarm.
    """
    options = options or SwarmOptions()
    _check(options)
    generator = np.random.default_rng(seed)
    budget = Budget(objective, evaluations, options.particles)
    shape = (options.particles, count)
    # Sorted, so that the first coordinate of every particle is the lowest threshold.
    positions = np.sort(generator.uniform(0, _TOP, shape), axis=1)
    velocities = np.zeros(shape)
    best = positions.copy()
    best_values = budget.evaluate(_thresholds(positions))
    while budget.left >= options.particles:
        global_best = best[np.argmax(best_values)]
        attractions = generator.random((2, *shape)) * options.attraction
        inertia = (
            options.last_inertia
            + (options.inertia - options.last_inertia) * budget.left / evaluations
        )
        velocities = (
            inertia * velocities
            + attractions[0] * (best - positions)
            + attractions[1] * (global_best - positions)
        )
        velocities = np.clip(velocities, -options.top_speed, options.top_speed)
        positions = np.clip(positions + velocities, 0, _TOP)
        values = budget.evaluate(_thresholds(positions))
        better = values > best_values
        best[better] = positions[better]
        best_values = np.maximum(values, best_values)
    return budget.close()


def _check(options: SwarmOptions) -> None:
    if options.particles < 2 or not options.attraction > 0 or not options.top_speed > 0:
        raise InputError("particles must be at least 2, attraction and top_speed above 0")
    if not 0 <= options.inertia < 1 or not 0 <= options.last_inertia < 1:
        raise InputError("inertia and last_inertia must be within [0, 1)")


def _thresholds(positions: np.ndarray) -> np.ndarray:
    return np.sort(np.rint(positions).astype(np.int64), axis=1)
