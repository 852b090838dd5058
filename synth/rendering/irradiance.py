"""Irradiance of diffuse surfaces under extended lights without occlusion: the part of their shading
that needs no random numbers.

Problem: S(n) = 1/pi * integral of L(w) max(n . w, 0) dw for many normals, L being constant on a
panel, or on each pixel of an image laid out as in `isc_core.shading.environment_map`. Its function
`shading_under` puts each pixel's light at its centre, which is off by 2e-4 at 64 rows, and its
matrix has an entry for every normal and pixel.

Equation: with the pixel's moment v = integral of w dw (closed form), a pixel entirely above the
horizon of n contributes n . v and one below contributes 0. A pixel on the horizon is treated as
flat: over it n . w is the mean m plus two independent uniform numbers in [-a, a] and [-b, b], so
the mean of the part above 0 is (F(m + a + b) - F(m + a - b) - F(m - a + b) + F(m - a - b)) / (4 a
b), F(x) = max(x, 0)^3 / 6. Normals are processed in small groups: the pixels above the horizon of a
whole group are one 3 x 3 matrix, and only a band around the horizon is summed.

A panel: S = L / (2 pi) sum over its edges, clipped at the horizon, of the angle that the edge
subtends times the cosine between the normal and the plane of the edge (Lambert).

Citation: J. H. Lambert, "Photometria", Augsburg (1760), which has no DOI; D. R. Baum, H. E.
Rushmeier, J. M. Winget, "Improving radiosity solutions through the use of analytically determined
form-factors", SIGGRAPH 1989, doi:10.1145/74333.74367. R. Ramamoorthi, P. Hanrahan, "An efficient
representation for irradiance environment maps", SIGGRAPH 2001, doi:10.1145/383259.383317
(irradiance of the normal).

Limits: the panel's formula is exact. An environment's error comes from treating pixels as flat and
decreases with the square of their size: 2e-5 of the shading at 32 rows of noise, 1e-5 at 64. A
single lit pixel, the worst case: 1e-4 of its largest shading, 2e-3 at the poles, where pixels are
triangles.
"""

import numpy as np

from isc_core.shading.environment_map import solid_angles

from ..scene.lights import PanelLight

_CELLS = 10  # normals in one cube of side 1 / _CELLS make a group
_THINNEST = 1e-3  # of a pixel: a narrower spread would cancel in the differences of third powers
_BLOCK = 512  # normals at a time
_FEWEST = 32  # rows: larger pixels are not flat enough and are divided


def unoccluded_shading(radiance: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return the shading of white diffuse surfaces under an environment, without shadows.

    Parameters
    ----------
    radiance : (rows, 2 rows, 3) ndarray
        The environment.
    normals : (N, 3) ndarray
        Unit normals.

    Returns
    -------
    (N, 3) ndarray
        The shading.
    """
    parts = -(-_FEWEST // len(radiance))
    pixels = _Pixels(np.asarray(radiance, float).repeat(parts, axis=0).repeat(parts, axis=1))
    normals = np.asarray(normals, float)
    shading = np.zeros((len(normals), 3))
    for group in _groups(normals):
        shading[group] = pixels.shading(normals[group])
    return shading


def unoccluded_panel(panel: PanelLight, positions: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return the shading of white diffuse points under a panel, without shadows.

    Parameters
    ----------
    panel : PanelLight
        The panel.
    positions, normals : (N, 3) ndarray
        The points and their unit normals.

    Returns
    -------
    (N, 3) ndarray
        The shading.
    """
    corners = [
        panel.centre + a * panel.right + b * panel.up - positions
        for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    heights = [np.einsum("nk,nk->n", corner, normals) for corner in corners]
    total = np.zeros(len(positions))
    leaves, enters = np.zeros_like(positions), np.zeros_like(positions)
    for k in range(4):
        a, b, high_a, high_b = corners[k - 1], corners[k], heights[k - 1], heights[k]
        crosses = (high_a > 0) != (high_b > 0)
        share = high_a / np.where(crosses, high_a - high_b, 1)
        met = a + share[:, None] * (b - a)
        start = np.where((crosses & (high_b > 0))[:, None], met, a)
        end = np.where((crosses & (high_a > 0))[:, None], met, b)
        total += np.where((high_a > 0) | (high_b > 0), _edge(start, end, normals), 0)
        leaves = np.where((crosses & (high_a > 0))[:, None], met, leaves)
        enters = np.where((crosses & (high_b > 0))[:, None], met, enters)
    total += _edge(leaves, enters, normals)
    front = (positions - panel.centre) @ panel.normal > 0
    return np.where(front, np.abs(total) / (2 * np.pi), 0)[:, None] * panel.radiance


def _edge(a: np.ndarray, b: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """The angle between vectors (N, 3) times the cosine between the normal and that of their plane;
    0 where they are parallel.
    """
    across = np.cross(a, b)
    length = np.linalg.norm(across, axis=1)
    angle = np.arctan2(length, np.einsum("nk,nk->n", a, b))
    return angle * np.einsum("nk,nk->n", across, normals) / np.where(length > 0, length, 1)


def _groups(normals: np.ndarray) -> list[np.ndarray]:
    """Indices of normals that are close to each other."""
    cells = np.round(normals * _CELLS).astype(np.int64) @ np.array([1, 1000, 1000000])
    order = np.argsort(cells, kind="stable")
    starts = np.flatnonzero(np.diff(cells[order])) + 1
    groups = np.split(order, starts) if len(order) else []
    return [group[k : k + _BLOCK] for group in groups for k in range(0, len(group), _BLOCK)]


class _Pixels:
    """The lit pixels of an environment: their positions, sizes and light."""

    def __init__(self, radiance: np.ndarray) -> None:
        rows = len(radiance)
        self.power = (radiance * solid_angles(rows)[..., None]).reshape(-1, 3)
        lit = self.power.any(axis=1)
        self.power = self.power[lit]
        self.mean = (_moments(rows) / solid_angles(rows)[..., None]).reshape(-1, 3)[lit]
        self.down, self.along = (side.reshape(-1, 3)[lit] for side in _half_sides(rows))
        self.radius = 0.75 * np.pi / rows  # no corner is farther from the mean
        self.flow = self.mean[:, :, None] * self.power[:, None, :]

    def shading(self, normals: np.ndarray) -> np.ndarray:
        """The shading (N, 3) of normals that are close to each other."""
        centre = normals.mean(axis=0)
        centre /= np.linalg.norm(centre)
        spread = np.arccos(np.clip((normals @ centre).min(), -1, 1)) + self.radius
        height = self.mean @ centre
        margin = np.sin(min(spread, np.pi / 2)) + 1e-9
        band = np.abs(height) <= margin
        total = normals @ self.flow[height > margin].sum(axis=0)
        return (total + self._above(normals, band) @ self.power[band]) / np.pi

    def _above(self, normals: np.ndarray, band: np.ndarray) -> np.ndarray:
        """The mean of max(n . w, 0) over each pixel of the band: (N, pixels)."""
        middle = normals @ self.mean[band].T
        least = _THINNEST * self.radius
        a, b = (
            np.maximum(np.abs(normals @ side[band].T), least) for side in (self.down, self.along)
        )
        crossed = np.abs(middle) < a + b
        above = np.maximum(middle, 0)
        m, a, b = middle[crossed], a[crossed], b[crossed]
        above[crossed] = (
            _third(m + a + b) - _third(m + a - b) - _third(m - a + b) + _third(m - a - b)
        ) / (4 * a * b)
        return above


def _third(x: np.ndarray) -> np.ndarray:
    x = np.maximum(x, 0)
    return x * x * x / 6


def _moments(rows: int) -> np.ndarray:
    """The integral of w over each pixel, (rows, 2 rows, 3)."""
    polar = np.arange(rows + 1) * np.pi / rows
    turn = np.arange(2 * rows + 1) * np.pi / rows
    across = np.diff(polar / 2 - np.sin(2 * polar) / 4)[:, None]
    up = np.broadcast_to(np.diff(np.sin(polar) ** 2 / 2)[:, None] * np.pi / rows, (rows, 2 * rows))
    return np.stack([across * -np.diff(np.cos(turn)), up, across * -np.diff(np.sin(turn))], -1)


def _half_sides(rows: int) -> tuple[np.ndarray, np.ndarray]:
    """From each pixel's centre to the middle of its lower side, and to that of its right side:
    (rows, 2 rows, 3) each.
    """
    polar, turn = np.meshgrid(
        (np.arange(rows) + 0.5) * np.pi / rows,
        (np.arange(2 * rows) + 0.5) * np.pi / rows,
        indexing="ij",
    )
    half = np.pi / rows / 2
    down = (
        np.stack([np.cos(polar) * np.sin(turn), -np.sin(polar), -np.cos(polar) * np.cos(turn)], -1)
        * half
    )
    along = (
        np.stack([np.cos(turn), np.zeros_like(turn), np.sin(turn)], -1)
        * (np.sin(polar) * half)[..., None]
    )
    return down, along
