"""Gaussian mixtures of colours.

Equation: the density of a colour z is sum_k w_k N(z; m_k, C_k). Colours are first assigned to
components by splitting: the component of the largest variance along one axis is split at its mean,
across that axis, until there are enough. Later each colour is assigned to the component under which
it is most likely.

Citation: M. Orchard, C. Bouman, "Color quantization of images", IEEE Transactions on Signal
Processing 39 (1991), doi:10.1109/78.107417.

Limits: assignments are hard, as in GrabCut.
"""

from dataclasses import dataclass

import numpy as np

COMPONENTS = 5
_NOISE = 0.1  # added to the variances of codes, so that uniform colours have some
_TINY = 1e-12


@dataclass(frozen=True, eq=False)
class ColourMixture:
    """A mixture of K Gaussians.

    Attributes
    ----------
    shares : (K,) ndarray
        Sum to 1; 0 for a component without colours.
    means : (K, 3) ndarray
    roots : (K, 3, 3) ndarray
        Lower triangular; root @ root.T is the inverse of a covariance.
    """

    shares: np.ndarray
    means: np.ndarray
    roots: np.ndarray

    @staticmethod
    def fitted(colours: np.ndarray, assignments: np.ndarray) -> "ColourMixture":
        """Fit components to colours.

        Parameters
        ----------
        colours : (N, 3) ndarray
            N > 0.
        assignments : (N,) int ndarray
            Component of each, below `COMPONENTS`.

        Returns
        -------
        ColourMixture
        """
        moments = [_moments(colours, assignments, k) for k in range(COMPONENTS)]
        counts, means, covariances = (np.stack(parts) for parts in zip(*moments, strict=True))
        inverse = np.linalg.inv(covariances + _NOISE * np.eye(3))
        return ColourMixture(counts / counts.sum(), means, np.linalg.cholesky(inverse))

    def costs(self, colours: np.ndarray) -> np.ndarray:
        """Return the negative logarithms of w_k N(z; m_k, C_k), up to a constant.

        Parameters
        ----------
        colours : (N, 3) ndarray

        Returns
        -------
        (K, N) ndarray
        """
        result = np.empty((len(self.means), len(colours)))
        for k, (mean, root) in enumerate(zip(self.means, self.roots, strict=True)):
            x, y, z = (colours[:, c] - mean[c] for c in range(3))
            scaled = [x * root[0, j] + y * root[1, j] + z * root[2, j] for j in range(3)]
            constant = np.log(max(self.shares[k], _TINY)) + np.log(np.diag(root)).sum()
            result[k] = 0.5 * (scaled[0] ** 2 + scaled[1] ** 2 + scaled[2] ** 2) - constant
        return result

    def cost(self, colours: np.ndarray) -> np.ndarray:
        """Return the negative logarithms of the densities, up to a constant.

        Parameters
        ----------
        colours : (N, 3) ndarray

        Returns
        -------
        (N,) ndarray
        """
        each = self.costs(colours)
        least = each.min(axis=0)
        lowest: np.ndarray = least - np.log(np.exp(least - each).sum(axis=0))
        return lowest


def split_colours(colours: np.ndarray) -> np.ndarray:
    """Assign colours to components by splitting.

    Parameters
    ----------
    colours : (N, 3) ndarray
        N > 0.

    Returns
    -------
    (N,) int ndarray
        Component of each.
    """
    assignments = np.zeros(len(colours), int)
    axes = [_axis(colours, assignments, 0)]
    for new in range(1, COMPONENTS):
        widest = int(np.argmax([spread for spread, _, _ in axes]))
        _, axis, mean = axes[widest]
        beyond = sum((colours[:, c] - mean[c]) * axis[c] for c in range(3)) > 0
        assignments[(assignments == widest) & beyond] = new
        axes[widest] = _axis(colours, assignments, widest)
        axes.append(_axis(colours, assignments, new))
    return assignments


def _axis(
    colours: np.ndarray, assignments: np.ndarray, component: int
) -> tuple[float, np.ndarray, np.ndarray]:
    """Sum of squares along the principal axis of a component, this axis, and its mean."""
    count, mean, covariance = _moments(colours, assignments, component)
    values, vectors = np.linalg.eigh(covariance)
    return count * float(values[-1]), vectors[:, -1], mean


def _moments(
    colours: np.ndarray, assignments: np.ndarray, component: int
) -> tuple[int, np.ndarray, np.ndarray]:
    """Count, mean and covariance of a component's colours, summed in a fixed order."""
    chosen = colours[assignments == component]
    if not len(chosen):
        return 0, np.zeros(3), np.eye(3)
    mean = chosen.mean(axis=0)
    apart = chosen - mean
    products = [(apart[:, a] * apart[:, b]).mean() for a in range(3) for b in range(3)]
    return len(chosen), mean, np.reshape(products, (3, 3))
