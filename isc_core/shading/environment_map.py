"""Environment maps: the light from every direction as a latitude-longitude image, and the shading
of Lambertian surfaces in it.

An image (rows, 2 rows, 3) holds linear radiance. Row 0 is straight up (+y). Its first column looks
away from the viewer (-z), a quarter along is right (+x), the middle is toward the viewer (+z),
three quarters along is left: pixel centres at the polar angle t = (row + .5) pi / rows from +y and
the azimuth a = (column + .5) pi / rows look toward (sin t sin a, cos t, -sin t cos a). Mitsuba
reads this layout as it is; Blender's is the same, rolled by a quarter.

Problem: the recovered illumination is log shading, S(n) = exp(SH(n)), for the normals that face the
viewer; a renderer needs the radiance L(w) from each direction.

Equation: a Lambertian surface of albedo 1 has, without shadows, the shading

    S(n) = 1/pi * integral of L(w) max(n . w, 0) dw = sum_j K(n, w_j) L_j,        L >= 0

Many environments give the same shading. From a uniform one the Richardson-Lucy iteration finds a
smooth one, never negative:

    L <- L * (K'(S / (K L)) + c) / (K'(1) + c)

with c = 0. A direction behind the object is seen by few normals, all near the rim. There, 100 steps
amplify the errors of these few: one pixel right behind an object reached 80 times the mean light,
which a glossy surface mirrors at its rim. With c of a twentieth of the largest K'(1),
`recovered_environment` has the same fixed points and as good a shading, and such directions stay
near the mean light. Both are meant for equal solid angles.

Citation: W. H. Richardson 1972, doi:10.1364/JOSA.62.000055; L. B. Lucy 1974, doi:10.1086/111605;
irradiance as a convolution with the clamped cosine: R. Ramamoorthi, P. Hanrahan 2001,
doi:10.1145/383259.383317.

Limits: a shading that varies faster than a clamped cosine allows (a strong contrast in the
logarithm) is matched in the sense of least relative error only; light from behind, which lights no
visible normal, is a guess, near the mean light; the object's own shadows come on top.
"""

import numpy as np

from .lights import VIEW
from .perspective import rotation_between
from .spherical_harmonics import real_sh

# Normals at a time: their kernel is a matrix with a column for every pixel of the environment.
_CHUNK = 4096
_DAMPING = 0.05  # chosen on scenes 6 to 32 of `benchmarks.refinement.gloss_scenes`


def directions(rows: int) -> np.ndarray:
    """Return the direction of each pixel's centre.

    Parameters
    ----------
    rows : int

    Returns
    -------
    (rows, 2 rows, 3) ndarray
        Unit vectors, camera frame.
    """
    polar, turn = np.meshgrid(
        (np.arange(rows) + 0.5) * np.pi / rows,
        (np.arange(2 * rows) + 0.5) * np.pi / rows,
        indexing="ij",
    )
    return np.stack(
        [np.sin(polar) * np.sin(turn), np.cos(polar), -np.sin(polar) * np.cos(turn)], -1
    )


def solid_angles(rows: int) -> np.ndarray:
    """Return the solid angle of each pixel.

    Parameters
    ----------
    rows : int

    Returns
    -------
    (rows, 2 rows) ndarray
        Steradians; they sum to 4 pi.
    """
    edges = np.cos(np.arange(rows + 1) * np.pi / rows)
    return np.broadcast_to(
        ((edges[:-1] - edges[1:]) * np.pi / rows)[:, None], (rows, 2 * rows)
    ).copy()


def mean_radiance(radiance: np.ndarray) -> np.ndarray:
    """Compute the mean over all directions: a row near a pole counts less than one at the horizon.

    Parameters
    ----------
    radiance : (rows, 2 rows, C) ndarray

    Returns
    -------
    (C,) ndarray
    """
    weights = solid_angles(len(radiance))
    return np.asarray(np.einsum("hw,hwc->c", weights, radiance) / (4 * np.pi))


def shading_under(radiance: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Compute the shading of unshadowed Lambertian surfaces in an environment.

    Parameters
    ----------
    radiance : (rows, 2 rows, 3) ndarray
        Linear radiance.
    normals : (N, 3) ndarray
        Unit normals, camera frame.

    Returns
    -------
    (N, 3) ndarray
    """
    flat = radiance.reshape(-1, 3)
    parts = [
        _kernel(normals[k : k + _CHUNK], len(radiance)) @ flat
        for k in range(0, len(normals), _CHUNK)
    ]
    return np.concatenate(parts) if parts else np.zeros((0, 3))


def environment_from_shading(
    illumination: np.ndarray,
    rows: int = 32,
    iterations: int = 100,
    viewer: np.ndarray | None = None,
    damping: float = 0.0,
) -> np.ndarray:
    """Find an environment in which Lambertian surfaces look as in a recovered light.

    Parameters
    ----------
    illumination : (9, 3) ndarray
        Log-shading SH coefficients, camera frame, as in `decomposition.json`.
    rows : int
    iterations : int
        Of Richardson-Lucy.
    viewer : (3,) ndarray, optional
        Unit vector from the object toward the viewer, camera frame; z by default.
    damping : float, optional
        c over the largest K'(1) of a solid angle, 0 or more: keeps directions that few normals see
        near the mean light.

    Returns
    -------
    (rows, 2 rows, 3) float32 ndarray
        Linear radiance, >= 0.
    """
    normals = _facing_normals(24)
    if viewer is not None and not np.array_equal(viewer, VIEW):
        normals = np.einsum("ij,nj->ni", rotation_between(VIEW, viewer), normals)
    kernel = _kernel(normals, rows)
    wanted = np.exp(real_sh(normals) @ illumination)
    reach = kernel.sum(0)[:, None]
    size = solid_angles(rows).reshape(-1, 1)
    damped = damping * (reach / size).max() * size
    radiance = np.broadcast_to(wanted.mean(0), (kernel.shape[1], 3)).copy()
    for _ in range(iterations):
        correction = kernel.T @ (wanted / np.maximum(kernel @ radiance, 1e-12))
        correction = (correction + damped) / np.maximum(reach + damped, 1e-9)
        radiance *= np.where(reach > 1e-9, correction, 1)
    return np.ascontiguousarray(radiance.reshape(rows, 2 * rows, 3), np.float32)


def recovered_environment(
    illumination: np.ndarray, rows: int = 32, viewer: np.ndarray | None = None
) -> np.ndarray:
    """Find the environment of a recovered light that glossy surfaces may mirror, too.

    Parameters
    ----------
    illumination, rows, viewer
        As of `environment_from_shading`.

    Returns
    -------
    (rows, 2 rows, 3) float32 ndarray
        Linear radiance, >= 0; from behind about the mean light.
    """
    return environment_from_shading(illumination, rows, viewer=viewer, damping=_DAMPING)


def resampled(radiance: np.ndarray, rows: int) -> np.ndarray:
    """Resample an environment to another number of rows.

    Each pixel gets the mean radiance of the solid angle it covers, so that light is preserved.

    Parameters
    ----------
    radiance : (r, 2 r, 3) ndarray
    rows : int

    Returns
    -------
    (rows, 2 rows, 3) ndarray
        Of the same type.
    """
    old = len(radiance)
    down = _shares(
        np.cos(np.arange(old + 1) * np.pi / old), np.cos(np.arange(rows + 1) * np.pi / rows)
    )
    across = _shares(np.arange(2 * old + 1) * -np.pi / old, np.arange(2 * rows + 1) * -np.pi / rows)
    return np.einsum("ri,ijc,sj->rsc", down, radiance, across, optimize=True).astype(
        np.result_type(radiance, np.float32)
    )


def _shares(old: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Share (m, n) of each new interval that lies in each old one, between falling edges (n + 1,)
    and (m + 1,).
    """
    overlap = np.minimum(old[:-1], new[:-1, None]) - np.maximum(old[1:], new[1:, None])
    return np.maximum(overlap, 0) / (new[:-1] - new[1:])[:, None]


def _kernel(normals: np.ndarray, rows: int) -> np.ndarray:
    """K (N, pixels): the share of each pixel's radiance in the shading of each normal."""
    return (
        np.clip(normals @ directions(rows).reshape(-1, 3).T, 0, None)
        * solid_angles(rows).reshape(-1)
        / np.pi
    )


def _facing_normals(steps: int) -> np.ndarray:
    """Normals (N, 3) that face the viewer, evenly over an orthographic view of a sphere."""
    x, y = np.meshgrid(
        (np.arange(steps) + 0.5) * 2 / steps - 1, (np.arange(steps) + 0.5) * 2 / steps - 1
    )
    inside = x * x + y * y < 1
    x, y = x[inside], y[inside]
    return np.stack([x, y, np.sqrt(1 - x * x - y * y)], -1)
