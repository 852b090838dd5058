"""The sky that lights a surface as the recovered illumination does.

Problem: the decomposition knows shading, S(n) = exp(SH(n)), for the normals that face the viewer; a renderer wants the radiance L(w) that
comes from each direction. A Lambertian surface of albedo 1 under it has, without shadows, the shading

    S(n) = 1/pi * integral of L(w) max(n . w, 0) dw = sum_j K(n, w_j) L_j,        L >= 0

Many skies give the same shading. The iteration of Richardson and Lucy, from a uniform sky, finds a smooth one that is never negative:

    L <- L * K'(S / (K L)) / K'(1)

References: W. H. Richardson 1972, doi:10.1364/JOSA.62.000055; L. B. Lucy 1974, doi:10.1086/111605; irradiance as a convolution with the
clamped cosine: R. Ramamoorthi, P. Hanrahan 2001, doi:10.1145/383259.383317.

Limits: a shading that turns faster than a clamped cosine allows (a strong contrast in the logarithm) is matched in the sense of least
relative error only; light from behind that no visible normal can see is a guess; the object's own shadows come on top.
"""

import numpy as np

from isc_core.sirfs.frames import real_sh


def sky_from_shading(illumination: np.ndarray, rows: int = 32, iterations: int = 100) -> np.ndarray:
    """The radiance of the sky, (rows, 2 rows, 3) float32 >= 0, linear; see `sky_directions` for which pixel looks where.

    `illumination`: (9, 3) coefficients of log shading in the camera's frame, as in `decomposition.json`.
    """
    towards, solid_angle = sky_directions(rows)
    normals = _facing_normals(24)
    kernel = np.clip(normals @ towards.reshape(-1, 3).T, 0, None) * solid_angle.reshape(-1) / np.pi
    wanted = np.exp(real_sh(normals) @ illumination)
    seen = kernel.sum(0)[:, None]
    sky = np.broadcast_to(wanted.mean(0), (kernel.shape[1], 3)).copy()
    for _ in range(iterations):
        correction = kernel.T @ (wanted / np.maximum(kernel @ sky, 1e-12))
        sky *= np.where(seen > 1e-9, correction / np.maximum(seen, 1e-9), 1)
    return np.ascontiguousarray(sky.reshape(rows, 2 * rows, 3), np.float32)


def shading_under(sky: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """The shading, (N, 3), that a sky (rows, 2 rows, 3) gives to unshadowed surfaces with the unit normals (N, 3)."""
    towards, solid_angle = sky_directions(sky.shape[0])
    kernel = np.clip(normals @ towards.reshape(-1, 3).T, 0, None) * solid_angle.reshape(-1) / np.pi
    return kernel @ sky.reshape(-1, 3)


def sky_directions(rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Where each pixel of the sky's picture looks, (rows, 2 rows, 3) unit vectors in the camera's frame; its solid angle.

    Row 0 is straight up. The middle column looks to the right (+x); three quarters along it looks toward the viewer (+z), as in Blender's
    equirectangular maps once the camera's frame has been turned into Blender's.
    """
    polar = (np.arange(rows) + 0.5) * np.pi / rows
    turn = (0.5 - (np.arange(2 * rows) + 0.5) / (2 * rows)) * 2 * np.pi
    polar, turn = np.meshgrid(polar, turn, indexing="ij")
    # Blender's axes are (right, away from the viewer, up).
    right, away, up = np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)
    edges = np.cos(np.arange(rows + 1) * np.pi / rows)
    solid_angle = np.broadcast_to(((edges[:-1] - edges[1:]) * np.pi / rows)[:, None], polar.shape)
    return np.stack([right, up, -away], -1), solid_angle


def _facing_normals(steps: int) -> np.ndarray:
    """Normals that face the viewer, (N, 3), spread evenly over what an orthographic camera sees of a sphere."""
    x, y = np.meshgrid((np.arange(steps) + 0.5) * 2 / steps - 1, (np.arange(steps) + 0.5) * 2 / steps - 1)
    inside = x * x + y * y < 1
    x, y = x[inside], y[inside]
    return np.stack([x, y, np.sqrt(1 - x * x - y * y)], -1)
