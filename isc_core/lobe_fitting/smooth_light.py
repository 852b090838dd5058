"""Tests whether smooth light explains a specular image as well as lamps do.

Equation: mirror-like reflection of the radiance sum_j c_j p_j(r) of degree 4 in the mirrored view r
= 2 n_z n - v gives F(n) times it; the c_j are found by re-weighted least squares with the loss of
`lamps`. p_j: the monomials x^a y^b z^c, c <= 1, 25 of them, which span the spherical harmonics to
that degree. A rough lobe under smooth light gives such an image, too: roughness only makes it
smoother.

Citation: R. Ramamoorthi, P. Hanrahan, "A signal-processing framework for inverse rendering",
SIGGRAPH 2001, doi:10.1145/383259.383271 (the effect of a lobe on a light's frequencies).

Limits: lobes with an alpha above about .35 are nearly as smooth themselves.
"""

import numpy as np

from .lamps import weighted_product
from .pixels import Pixels
from .response import mirrored_uniform

_DEGREE = 4
_STEPS = 5
_RIDGE = 1e-7


def smooth_loss(pixels: Pixels) -> float:
    """Compute the loss of the best smooth light.

    Parameters
    ----------
    pixels : Pixels
        The fitted pixels.

    Returns
    -------
    float
        Comparable with `lamps.Fitted.loss`.
    """
    normal = pixels.normal
    mirrored = 2 * normal[:, 2:] * normal - np.array([0.0, 0, 1])
    x, y, z = mirrored.T
    columns = [
        x**a * y**b * z**c
        for c in (0, 1)
        for a in range(_DEGREE + 1)
        for b in range(_DEGREE + 1)
        if a + b + c <= _DEGREE
    ]
    basis = np.stack(columns, axis=1) * (mirrored_uniform(normal) / pixels.sigma)[:, None]
    target, weight = pixels.value / pixels.sigma, pixels.weight
    residual = target
    for _ in range(_STEPS):
        matrix = weighted_product(basis, weight, basis)
        matrix += _RIDGE * float(np.trace(matrix)) / len(matrix) * np.eye(len(matrix))
        residual = (
            basis @ np.linalg.solve(matrix, weighted_product(basis, weight, target[:, None])[:, 0])
            - target
        )
        residual = np.where(pixels.clipped & (residual > 0), 0, residual)
        weight = pixels.weight / np.sqrt(1 + residual**2)
    return float(pixels.weight @ (2 * (np.sqrt(1 + residual**2) - 1)))
