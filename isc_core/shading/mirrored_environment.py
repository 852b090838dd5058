"""An environment map as a glossy surface mirrors it toward the viewer.

Equation: M(n) = sum over samples of f_r(n, v, l) max(0, n . l) L(l) w(l), w the solid angles. With
the viewer along z it depends on the normal alone, so that it is evaluated on a table of normals in
the stereographic plane (x, y) / (1 + z) and interpolated there. For other views, the normal is
looked up that mirrors the same light to a viewer along z.

Citation: R. Ramamoorthi, P. Hanrahan, "Frequency space environment map rendering", SIGGRAPH 2002,
doi:10.1145/566654.566611 (the integral; here it is summed directly).

Limits: no cast shadows, no interreflection. The lobe's width and Fresnel's factor are those of the
view along z. A lobe narrower than `narrowest_alpha` falls between the samples of the map and of the
table: an even sky would be mirrored in spots. Callers take a lobe of that width instead.
"""

import numpy as np

from ..imaging.row_blocks import row_blocks
from .brdf.model import Model
from .environment_map import directions, solid_angles
from .lights import VIEW
from .perspective import far_view_normals
from .radiance import DistantLights, radiance

_TABLE = 65  # samples of the stereographic plane along an axis
_SAMPLES = 2.0  # alpha times the rows: with it, an even sky is mirrored evenly within 3 %
_CHUNK = 1 << 17  # numbers looked up at a time, so that temporary arrays stay in the cache


def narrowest_alpha(rows: int) -> float:
    """Return the width of the narrowest lobe of which an environment map has enough samples.

    Parameters
    ----------
    rows : int
        Of the map.

    Returns
    -------
    float
        Alpha of GGX, or of the Blinn-Phong lobe with the exponent 2 / alpha^2 - 2; at most .5.
    """
    return min(_SAMPLES / min(rows, (_TABLE - 1) // 4), 0.5)


class MirroredEnvironment:
    """What a reflectance model mirrors of an environment: evaluated once, looked up often.

    Parameters
    ----------
    model : Model
        Its values have no colour; its lobe is at least as wide as `narrowest_alpha`.
    environment : (rows, 2 rows, 3) ndarray
        Linear radiance, see `environment_map`.
    """

    def __init__(self, model: Model, environment: np.ndarray) -> None:
        rows = len(environment)
        lit = (environment > 0).any(-1).reshape(-1)
        self._table = np.zeros((_TABLE, _TABLE, 3))
        if lit.any():
            lights = DistantLights(
                directions(rows).reshape(-1, 3)[lit],
                (solid_angles(rows)[..., None] * environment).reshape(-1, 3)[lit],
            )
            self._table = radiance(model, _table_normals(), VIEW, lights)

    def toward(self, normal: np.ndarray, view: np.ndarray = VIEW) -> np.ndarray:
        """Look up the radiance toward the viewer.

        Parameters
        ----------
        normal : (N, 3) ndarray
            Unit normals, camera frame.
        view : (3,) or (N, 3) ndarray, optional
            Unit vectors toward the viewer.

        Returns
        -------
        (N, 3) ndarray
        """
        if view.ndim > 1 or not np.array_equal(view, VIEW):
            normal = far_view_normals(normal, view)
        found = np.empty(normal.shape)
        for block in row_blocks(normal.shape, pixels=_CHUNK):
            found[block.rows] = self._looked_up(normal[block.rows])
        return found

    def _looked_up(self, normal: np.ndarray) -> np.ndarray:
        """The table (N, 3) at normals for the view along z."""
        places = (normal[:, :2] / (1 + np.maximum(normal[:, 2:], 0)) + 1) * (_TABLE - 1) / 2
        first = np.clip(places.astype(np.int64), 0, _TABLE - 2)
        u, v = np.clip(places - first, 0, 1).T[..., None]
        at, table = first[:, 0] * _TABLE + first[:, 1], self._table.reshape(-1, 3)
        a, b, c, d = (table.take(at + step, axis=0) for step in (0, 1, _TABLE, _TABLE + 1))
        return np.asarray((1 - u) * ((1 - v) * a + v * b) + u * ((1 - v) * c + v * d))


def _table_normals() -> np.ndarray:
    """The unit normals (N, N, 3) of the table's places."""
    axis = np.linspace(-1.0, 1.0, _TABLE)
    u, v = np.meshgrid(axis, axis, indexing="ij")
    # The corners lie behind the horizon, where no normal is looked up.
    square = np.minimum(u * u + v * v, 1)
    shrink = np.sqrt(square / np.maximum(u * u + v * v, 1e-12))
    normals = np.stack([2 * u * shrink, 2 * v * shrink, 1 - square], -1) / (1 + square)[..., None]
    normals[_TABLE // 2, _TABLE // 2] = VIEW
    return np.asarray(normals / np.linalg.norm(normals, axis=-1, keepdims=True))
