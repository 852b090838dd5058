"""Light transport from the pixels of an environment to points of a surface, with shadows and the
light that the surface itself reflects.

Equation: T_pj = V_pj max(0, n_p . w_j) omega_j / pi; see the package. Where a ray is blocked, it
meets the surface in a pixel q of the photo, which shows the radiance of q: the diffuse layer D_q,
with all bounces of light. So the indirect light is known without a simulation,

    I_p = sum_j (1 - V_pj) max(0, n_p . w_j) omega_j / pi D_q(p,j).

Citation: P.-P. Sloan, J. Kautz, J. Snyder 2002, doi:10.1145/566654.566612 (transport); S. K. Nayar,
K. Ikeuchi, T. Kanade 1991, doi:10.1007/BF00115695 (the facets of an image as sources of light).

Limits: one ray for each point and pixel of the environment, toward its centre. The surface is the
visible side: nothing behind it casts a shadow, and its back reflects nothing.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from isc_core.progress import Monitor
from isc_core.scene.decomposition import Decomposition
from isc_core.shading.environment_map import directions, solid_angles

from .surface import Surface, SurfacePoints

_AT_ONCE = 16  # directions traced at a time


@dataclass(frozen=True, eq=False)
class Transport:
    """The transport to N points from J = 2 rows^2 pixels of an environment.

    Attributes
    ----------
    unshadowed : (N, J) ndarray of float32
        max(0, n . w) omega / pi.
    shadowed : (N, J) ndarray of float32
        The same, 0 where the object blocks the light.
    indirect : (N, 3) ndarray of float32
        Shading by light that the surface reflects, I.
    """

    unshadowed: np.ndarray
    shadowed: np.ndarray
    indirect: np.ndarray

    def traced(self) -> dict[str, np.ndarray]:
        """Return what was traced, as arrays: which light is shadowed, one bit each, and I."""
        return {"hidden": np.packbits(self.shadowed == 0), "indirect": self.indirect}

    @staticmethod
    def restored(points: SurfacePoints, rows: int, traced: Mapping[str, np.ndarray]) -> "Transport":
        """Return the transport from what was traced.

        Parameters
        ----------
        points : SurfacePoints
        rows : int
            Of the environment.
        traced : mapping
            Of `traced`.

        Returns
        -------
        Transport
        """
        unshadowed = _unshadowed(points, rows)
        hidden = np.unpackbits(traced["hidden"], count=unshadowed.size).reshape(unshadowed.shape)
        shadowed = np.where(hidden.astype(bool), np.float32(0), unshadowed)
        return Transport(unshadowed, shadowed, traced["indirect"])

    def __getitem__(self, part: slice) -> "Transport":
        return Transport(self.unshadowed[part], self.shadowed[part], self.indirect[part])


def light_transport(
    surface: Surface, points: SurfacePoints, rows: int, monitor: Monitor | None = None
) -> Transport:
    """Trace shadows and reflected light.

    Parameters
    ----------
    surface : Surface
        What blocks and reflects light.
    points : SurfacePoints
        The N points that receive it.
    rows : int
        Of the environment.
    monitor : Monitor, optional

    Returns
    -------
    Transport

    Raises
    ------
    InputError
        If Mitsuba is missing.
    Cancelled
        If the user cancels.
    """
    monitor = monitor or Monitor()
    towards, unshadowed = directions(rows).reshape(-1, 3), _unshadowed(points, rows)
    shadowed, indirect = unshadowed.copy(), np.zeros((len(points), 3), np.float32)
    for first in range(0, len(towards), _AT_ONCE):
        monitor.report("tracing shadows", first / len(towards))
        part = slice(first, first + _AT_ONCE)
        point, light = np.nonzero(unshadowed[:, part])
        hidden = surface.tracer.blocked(points.lifted[point], towards[part][light], np.inf)
        point, light = point[hidden], first + light[hidden]
        shadowed[point, light] = 0
        reflected = surface.radiance(points.lifted[point], towards[light])
        np.add.at(indirect, point, unshadowed[point, light, None] * reflected)
    return Transport(unshadowed, shadowed, indirect)


def _unshadowed(points: SurfacePoints, rows: int) -> np.ndarray:
    """max(0, n . w) omega / pi, (N, J) float32."""
    towards = directions(rows).reshape(-1, 3)
    facing = np.clip(np.einsum("nk,jk->nj", points.normal, towards), 0, None)
    return np.asarray((facing * solid_angles(rows).reshape(-1) / np.pi).astype(np.float32))


def transport_of(d: Decomposition, rows: int) -> Transport:
    """Trace the transport to the pixels of a result.

    Parameters
    ----------
    d : Decomposition
        All of its transport is in memory at a time.
    rows : int
        Of the environment.

    Returns
    -------
    Transport
        To the pixels of the mask, row by row.

    Raises
    ------
    InputError
        If Mitsuba is missing.
    """
    surface = Surface(d)
    return light_transport(surface, surface.points(), rows)
