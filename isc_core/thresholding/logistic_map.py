"""The logistic map x <- r x (1 - x): orbits, bifurcation, and uniform numbers.

Problem: a chaotic sequence is to replace pseudo-random numbers, which have to be uniform on [0, 1)
and independent.

Equation: at r = 4 the map is chaotic on [0, 1] and its orbits have the density 1 / (pi sqrt(x (1 -
x))), which is U-shaped. The transformation u = (2 / pi) asin(sqrt(x)) makes it uniform. In u, the
map is the tent map u <- 1 - |1 - 2u|: the next number is a function of the last one, so consecutive
numbers lie on a line in the unit square. After `stride` steps, that line has 2^stride branches:
with every stride-th value of an orbit, and consecutive values from different orbits, the dependence
is not detectable at the resolution at which the numbers are used.

Citation: S. M. Ulam and J. von Neumann, "On combination of stochastic and deterministic processes",
Bulletin of the American Mathematical Society 53(11), 1120 (1947) (the density). R. M. May, "Simple
mathematical models with very complicated dynamics", Nature 261, 459-467 (1976),
doi:10.1038/261459a0 (the bifurcation).

Limits: 0 and .75 are fixed points at r = 4; .25, .5 and 1 lead to them. An orbit in floating
point can round to 1 and then to 0 (about once in 10^8 steps): such orbits are restarted.
"""

import numpy as np

from ..errors import InputError

DEGENERATE = (0.0, 0.25, 0.5, 0.75, 1.0)
_BURN_IN = 64  # steps after which no digit of the start remains


def orbit(start: np.ndarray | float, length: int, rate: float = 4.0) -> np.ndarray:
    """Iterate the map.

    Parameters
    ----------
    start : ndarray or float
        In (0, 1); the first value.
    length : int
    rate : float
        r, in (0, 4].

    Returns
    -------
    (length, ...) ndarray

    Raises
    ------
    InputError
        If a start is outside (0, 1) or, at rate 4, degenerate; or the rate is out of range.
    """
    if not 0 < rate <= 4:
        raise InputError(
            f"the logistic map stays within [0, 1] for rates above 0 and up to 4, not {rate}"
        )
    x = np.asarray(start, np.float64)
    if not ((x > 0) & (x < 1)).all() or (rate == 4 and np.isin(x, DEGENERATE).any()):
        raise InputError(
            f"an orbit must start within (0, 1) and, at rate 4, outside {DEGENERATE}, where it is "
            "constant"
        )
    values = np.empty((length, *x.shape))
    for k in range(length):
        values[k] = x
        x = rate * x * (1 - x)
    return values


def bifurcation(rates: np.ndarray, settle: int = 1000, keep: int = 200) -> np.ndarray:
    """Return the values of orbits at each rate after a transient.

    Parameters
    ----------
    rates : (n,) ndarray
        In (0, 4].
    settle : int
        Steps to discard.
    keep : int
        Steps to return.

    Returns
    -------
    (keep, n) ndarray
    """
    x = np.full(np.shape(rates), 0.3)
    values = np.empty((keep, len(rates)))
    for k in range(-settle, keep):
        x = rates * x * (1 - x)
        if k >= 0:
            values[k] = x
    return values


def density(x: np.ndarray) -> np.ndarray:
    """Return the invariant density of the orbits at rate 4.

    Parameters
    ----------
    x : ndarray
        In (0, 1).

    Returns
    -------
    ndarray
        Of the shape of `x`.
    """
    return 1 / (np.pi * np.sqrt(x * (1 - x)))


def uniformised(x: np.ndarray) -> np.ndarray:
    """Transform values with the invariant density of rate 4 to uniform ones.

    Parameters
    ----------
    x : ndarray
        In [0, 1].

    Returns
    -------
    ndarray
        In [0, 1], of the shape of `x`.
    """
    return (2 / np.pi) * np.arcsin(np.sqrt(x))


class ChaoticNumbers:
    """A source of uniform numbers in [0, 1) from many orbits of the map at rate 4."""

    def __init__(self, seed: int, orbits: int = 1024, stride: int = 8) -> None:
        """`seed` >= 0 determines the starting points of the `orbits`;

        `stride`: number of steps of an orbit between two numbers taken from it.
        """
        if seed < 0 or orbits < 1 or stride < 1:
            raise InputError(
                "chaotic numbers need a seed >= 0, and at least one orbit and a stride of at least "
                "one step"
            )
        self._stride = stride
        self._restarts = 0
        self._seed = seed
        self._x = self._starts(np.arange(orbits))
        self._advance(_BURN_IN)
        self._block = np.empty(0)

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
        count = int(np.prod(shape))
        blocks, available = [self._block], len(self._block)
        while available < count:
            self._advance(self._stride)
            blocks.append(np.minimum(uniformised(self._x), np.nextafter(1, 0)))
            available += len(self._x)
        numbers = np.concatenate(blocks)
        self._block = numbers[count:]
        return numbers[:count].reshape(shape)

    def _starts(self, which: np.ndarray) -> np.ndarray:
        """Starting points of the orbits `which` (n,), spread over (0, 1) by multiples of irrational
        numbers; none is degenerate.
        """
        turns = (
            (which + 1) * np.sqrt(2)
            + (self._seed + 1) * (np.sqrt(5) - 1) / 2
            + self._restarts * np.sqrt(3)
        )
        x = 0.01 + 0.98 * (turns % 1)
        return np.where(np.isin(x, DEGENERATE), x + 1e-3, x)

    def _advance(self, steps: int) -> None:
        x = self._x
        for _ in range(steps):
            x = 4 * x * (1 - x)
        stuck = np.isin(x, DEGENERATE)  # from such a point, an orbit reaches a fixed point
        if stuck.any():
            self._restarts += 1
            x[stuck] = self._starts(np.flatnonzero(stuck))
        self._x = x
