"""Light transport from the pixels of an environment to the points of a result, with shadows.

Equation: T_pj = V_pj max(0, n_p . w_j) omega_j / pi; see the package. Rays start a pixel above the
surface.

Citation: P.-P. Sloan, J. Kautz, J. Snyder 2002, doi:10.1145/566654.566612.

Limits: one ray for each point and pixel of the environment, toward its centre. The surface is the
visible side: nothing behind it casts a shadow.
"""

from dataclasses import dataclass

import numpy as np

from isc_core.errors import InputError
from isc_core.progress import Monitor
from isc_core.scene.decomposition import Decomposition
from isc_core.shading.environment_map import directions, solid_angles
from isc_core.shading.perspective import lifted_points, object_axis

from ..scene.meshes import Mesh
from ..scene.tracing import Tracer

_AT_ONCE = 16  # directions traced at a time
_LIFT = 1.0  # pixels


@dataclass(frozen=True)
class Transport:
    """The transport of N points of the mask and J = 2 rows^2 pixels of an environment.

    Attributes
    ----------
    unshadowed : (N, J) ndarray of float32
        max(0, n . w) omega / pi.
    shadowed : (N, J) ndarray of float32
        The same, 0 where the object blocks the light.
    """

    unshadowed: np.ndarray
    shadowed: np.ndarray


def light_transport(d: Decomposition, rows: int, monitor: Monitor | None = None) -> Transport:
    """Trace the shadows of a result.

    Parameters
    ----------
    d : Decomposition
        Its height defines the surface, its normals the shading.
    rows : int
        Of the environment.
    monitor : Monitor, optional

    Returns
    -------
    Transport

    Raises
    ------
    InputError
        If Mitsuba is missing, or the mask has no block of 2 x 2 pixels for a surface.
    Cancelled
        If the user cancels.
    """
    monitor = monitor or Monitor()
    points, faces = _surface(d)
    normal = d.normal[d.mask].astype(float)
    tracer = Tracer(Mesh(points, normal, np.zeros((len(points), 2)), faces))
    towards = directions(rows).reshape(-1, 3)
    facing = np.clip(np.einsum("nk,jk->nj", normal, towards), 0, None)
    unshadowed = (facing * solid_angles(rows).reshape(-1) / np.pi).astype(np.float32)
    shadowed = unshadowed.copy()
    size = float(np.ptp(points[:, :2], axis=0).max())
    lifted = points + _LIFT * normal * size / max(d.mask.shape)
    for first in range(0, len(towards), _AT_ONCE):
        monitor.report("tracing shadows", first / len(towards))
        part = slice(first, first + _AT_ONCE)
        point, light = np.nonzero(unshadowed[:, part])
        hidden = tracer.blocked(lifted[point], towards[part][light], np.inf)
        shadowed[point[hidden], first + light[hidden]] = 0
    return Transport(unshadowed, shadowed)


def _surface(d: Decomposition) -> tuple[np.ndarray, np.ndarray]:
    """Points (N, 3) of the mask's pixels, about 2 wide, and triangles (M, 3) between them."""
    if d.camera is None:
        rows, columns = np.indices(d.mask.shape)
        points = np.stack([columns, -rows, d.height], axis=-1)[d.mask].astype(float)
    else:
        points = lifted_points(d.height, d.camera, object_axis(d.camera, d.mask))[d.mask]
    low, high = points.min(axis=0), points.max(axis=0)
    points = (points - (low + high) / 2) * (2 / max(float((high - low)[:2].max()), 1e-9))
    number = np.full(d.mask.shape, -1)
    number[d.mask] = np.arange(len(points))
    a, b, c, e = number[:-1, :-1], number[1:, :-1], number[:-1, 1:], number[1:, 1:]
    faces = np.concatenate(
        [np.stack(corners, axis=-1).reshape(-1, 3) for corners in ((a, b, c), (c, b, e))]
    )
    faces = faces[(faces >= 0).all(axis=1)]
    if not len(faces):
        raise InputError(
            "the mask holds no block of 2 x 2 pixels to cast a shadow: decompose a larger region"
        )
    return points, faces
