"""A bounded, smooth change of a height: Gaussian bumps on grids of a few spacings.

Equation: z(r, c) = sum_s a_s sum_jk u_sjk exp(-((r - j d_s)^2 + (c - k d_s)^2) / (2 d_s^2)), d_s
the spacing. For independent u of deviation 1, the slopes of each scale have the requested
deviation: a = slope d / sqrt(pi / 2). Bumps are separable, so z is the product of small matrices;
sums are taken in a fixed order.

Citation: C. E. Rasmussen, C. K. I. Williams, "Gaussian processes for machine learning" (2006),
section 2.2 (a Gaussian process as a sum of such functions; no DOI).

Limits: no detail finer than the smallest spacing.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class HeightBumps:
    """Changes of a height map (H, W).

    Attributes
    ----------
    rows : tuple of (H, j) ndarray
        Of each scale: the factors of the bumps along the rows.
    columns : tuple of (W, k) ndarray
        Along the columns.
    amplitudes : tuple of float
        a, in pixels of this map.
    """

    rows: tuple[np.ndarray, ...]
    columns: tuple[np.ndarray, ...]
    amplitudes: tuple[float, ...]

    @staticmethod
    def spaced(
        shape: tuple[int, int],
        spacings: tuple[float, ...],
        slopes: tuple[float, ...],
        step: int = 1,
    ) -> "HeightBumps":
        """Return the bumps of a map.

        Parameters
        ----------
        shape : tuple of int
            (H, W) of the map to which the spacings refer.
        spacings, slopes : tuple of float
            Of each scale: pixels of that map, and the deviation of the slope.
        step : int, optional
            Pixels per pixel of that map: above 1, the same bumps on a finer map of H step rows and
            W step columns.

        Returns
        -------
        HeightBumps
        """
        factors = [
            tuple(_factors(length, spacing, step) for spacing in spacings) for length in shape
        ]
        amplitudes = tuple(
            slope * spacing * step / np.sqrt(np.pi / 2)
            for spacing, slope in zip(spacings, slopes, strict=True)
        )
        return HeightBumps(factors[0], factors[1], amplitudes)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return sum(r.shape[1] * c.shape[1] for r, c in zip(self.rows, self.columns, strict=True))

    def height(self, unknowns: np.ndarray) -> np.ndarray:
        """Compute z.

        Parameters
        ----------
        unknowns : (size,) ndarray

        Returns
        -------
        (H, W) ndarray
        """
        total, first = np.zeros((len(self.rows[0]), len(self.columns[0]))), 0
        for rows, columns, amplitude in zip(self.rows, self.columns, self.amplitudes, strict=True):
            shape = rows.shape[1], columns.shape[1]
            part = unknowns[first : first + shape[0] * shape[1]].reshape(shape)
            wide = np.einsum("jk,wk->jw", part, columns)
            total += amplitude * np.einsum("hj,jw->hw", rows, wide)
            first += part.size
        return total

    def adjoint(self, gradient: np.ndarray) -> np.ndarray:
        """Compute the gradient of the unknowns from that of z.

        Parameters
        ----------
        gradient : (H, W) ndarray

        Returns
        -------
        (size,) ndarray
        """
        parts = []
        for rows, columns, amplitude in zip(self.rows, self.columns, self.amplitudes, strict=True):
            narrow = np.einsum("hw,wk->hk", gradient, columns)
            parts.append(amplitude * np.einsum("hj,hk->jk", rows, narrow).ravel())
        return np.concatenate(parts)


def _factors(length: int, spacing: float, step: int) -> np.ndarray:
    positions = (np.arange(length * step) + 0.5) / step - 0.5
    centres = np.arange(-spacing, length + 1.5 * spacing, spacing)
    return np.exp(-0.5 * np.square((positions[:, None] - centres) / spacing))
