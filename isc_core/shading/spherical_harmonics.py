"""Two conventions for normals and lights, and the exact conversion between them.

Ours: normals in the camera frame (x right, y up, z toward the viewer); log shading of a channel =
sum_k L_k Y_k(n), Y the orthonormal real spherical harmonics up to degree 2, all with positive
constants, in the order (0,0) (1,-1) (1,0) (1,1) (2,-2) (2,-1) (2,0) (2,1) (2,2).

The SIRFS reference's (J. T. Barron, J. Malik 2015, doi:10.1109/TPAMI.2014.2377712): normals (down,
right, toward the viewer); the irradiance quadratic of R. Ramamoorthi, P. Hanrahan (2001), "An
efficient representation for irradiance environment maps", doi:10.1145/383259.383317, with its
rounded constants.

Equation: both bases span the quadratics on the sphere, so one 9 x 9 matrix M with b(n) = M Y(n)
holds for every unit normal; hence L_ours = M^T L_reference. The reference's seventh function is no
multiple of Y(2,0): its remainder goes into the constant term.
"""

from functools import cache
from math import pi, sqrt

import numpy as np

from .irradiance_basis import basis


def real_sh(normal: np.ndarray) -> np.ndarray:
    """Evaluate the orthonormal real spherical harmonics up to degree 2.

    Parameters
    ----------
    normal : (..., 3) ndarray
        Unit vectors, camera frame.

    Returns
    -------
    (..., 9) ndarray
    """
    x, y, z = _components(normal)
    linear, quadratic, zonal = sqrt(3 / (4 * pi)), sqrt(15 / (4 * pi)), sqrt(5 / (16 * pi))
    return np.stack(
        [
            np.full_like(x, sqrt(1 / (4 * pi))),
            linear * y,
            linear * z,
            linear * x,
            quadratic * x * y,
            quadratic * y * z,
            zonal * (3 * z * z - 1),
            quadratic * x * z,
            quadratic / 2 * (x * x - y * y),
        ],
        axis=-1,
    )


def reference_basis(normal: np.ndarray) -> np.ndarray:
    """Evaluate the reference's nine basis functions.

    Parameters
    ----------
    normal : (..., 3) ndarray
        Unit vectors, camera frame (not the reference's).

    Returns
    -------
    (..., 9) ndarray
    """
    return np.moveaxis(basis(*_components(normal_to_reference(normal))), 0, -1)


def normal_to_reference(normal: np.ndarray) -> np.ndarray:
    """Convert vectors from the camera frame to the reference frame.

    Parameters
    ----------
    normal : (..., 3) ndarray
        In the camera frame: x right, y up, z toward the viewer.

    Returns
    -------
    (..., 3) ndarray
        In the reference frame: (down, right, toward the viewer).
    """
    x, y, z = _components(normal)
    return np.stack([-y, x, z], axis=-1)


def normal_from_reference(normal: np.ndarray) -> np.ndarray:
    """Convert vectors from the reference frame to the camera frame.

    Parameters
    ----------
    normal : (..., 3) ndarray
        In the reference frame: (down, right, toward the viewer).

    Returns
    -------
    (..., 3) ndarray
        In the camera frame: x right, y up, z toward the viewer.
    """
    down, right, toward = _components(normal)
    return np.stack([right, -down, toward], axis=-1)


def light_from_reference(light: np.ndarray) -> np.ndarray:
    """Convert coefficients of the reference's basis to those of `real_sh`; same log shading.

    Parameters
    ----------
    light : (9, ...) ndarray

    Returns
    -------
    (9, ...) ndarray
    """
    return np.tensordot(_basis_change().T, np.asarray(light, float), axes=1)


def light_to_reference(light: np.ndarray) -> np.ndarray:
    """Convert coefficients of `real_sh` to those of the reference's basis; same log shading.

    Parameters
    ----------
    light : (9, ...) ndarray

    Returns
    -------
    (9, ...) ndarray
    """
    return np.tensordot(np.linalg.inv(_basis_change().T), np.asarray(light, float), axes=1)


def _components(vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    vectors = np.asarray(vectors)
    if not np.issubdtype(vectors.dtype, np.floating):
        vectors = vectors.astype(np.float64)
    return vectors[..., 0], vectors[..., 1], vectors[..., 2]


@cache
def _basis_change() -> np.ndarray:
    """M of `reference_basis = M real_sh`, from both bases at nine directions that determine a
    quadratic on the sphere.
    """
    half = sqrt(0.5)
    directions = np.array(
        [
            [1, 0, 0],
            [-1, 0, 0],
            [0, 1, 0],
            [0, -1, 0],
            [0, 0, 1],
            [0, 0, -1],
            [half, half, 0],
            [half, 0, half],
            [0, half, half],
        ]
    )
    change = np.linalg.solve(real_sh(directions), reference_basis(directions)).T
    # Each function answers to at most two of the others; what else is left of the elimination is
    # rounding.
    change[np.abs(change) < 1e-12] = 0.0
    change.setflags(write=False)
    return change
