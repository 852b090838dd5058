"""The linear map that whitens log reflectances, without centring: log 1 = 0 stays 0.

Equation: W ~ (C + floor I)^(-1/2) with C the mean of a a^T over the training log reflectances, NOT
centred, scaled so that the whitened data have unit root mean square.

Citation: J. T. Barron, J. Malik (2015), doi:10.1109/TPAMI.2014.2377712.
"""

import numpy as np


def parsimony_whitening(second_moment: np.ndarray, floor: float = 0.01) -> np.ndarray:
    """Return the whitening matrix W.

    Parameters
    ----------
    second_moment : (C, C) ndarray
        Of the log reflectances.
    floor : float

    Returns
    -------
    (C, C) ndarray
        Symmetric.
    """
    values, vectors = np.linalg.eigh(second_moment)
    whiten = (vectors / np.sqrt(values + floor)) @ vectors.T
    mean_square = np.trace(whiten @ second_moment @ whiten) / len(second_moment)
    return whiten / np.sqrt(mean_square)
