"""Bodies that are cut where the depth jumps, for `benchmarks.blender.depth_edges`.

Method: where neighbours differ in height by a step, the higher one is the rim of a part in front.
Triangles of cells that the step crosses are taken out of the visible side. The rim is lowered as a
circle of `ROUND` pixels is. The surface behind goes on for `REACH` pixels under the part in front,
at the height of its edge.

Limits: an experiment; see the research log.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from isc_core.result_files.solids.solid_mesh import SolidMesh, continued

ROUND, REACH = 1.0, 8
_BELOW = 0.5  # pixels between the part in front and what goes on under it


@dataclass(frozen=True, eq=False)
class Steps:
    """Where the depth jumps.

    Attributes
    ----------
    front, behind : (H, W) bool ndarray
        Pixels on either side.
    cells : (H - 1, W - 1) bool ndarray
        Cells of four pixels that a step crosses.
    """

    front: np.ndarray
    behind: np.ndarray
    cells: np.ndarray


def steps_of(height: np.ndarray, mask: np.ndarray, least: float) -> Steps:
    """Return where a height map jumps.

    Parameters
    ----------
    height : (H, W) ndarray
    mask : (H, W) bool ndarray
    least : float
        Pixels between neighbours.

    Returns
    -------
    Steps
    """
    front, behind = np.zeros_like(mask), np.zeros_like(mask)
    crossed = []
    for axis in (0, 1):
        first = np.s_[:-1] if axis == 0 else np.s_[:, :-1]
        second = np.s_[1:] if axis == 0 else np.s_[:, 1:]
        step = np.where(mask[first] & mask[second], height[second] - height[first], 0)
        front[second] |= step > least
        behind[first] |= step > least
        front[first] |= step < -least
        behind[second] |= step < -least
        crossed.append(np.abs(step) > least)
    vertical, horizontal = crossed
    cells = vertical[:, :-1] | vertical[:, 1:] | horizontal[:-1] | horizontal[1:]
    return Steps(front, behind & ~front, cells)


def cut(
    body: SolidMesh, height: np.ndarray, mask: np.ndarray, steps: Steps
) -> tuple[np.ndarray, np.ndarray]:
    """Cut a body, and let the surface behind go on.

    Parameters
    ----------
    body : SolidMesh
        With a vertex at each pixel.
    height : (H, W) ndarray
    mask : (H, W) bool ndarray
    steps : Steps

    Returns
    -------
    vertices : (V, 3) ndarray
        Pixels: column, minus row, height.
    faces : (F, 3) ndarray
    """
    behind = steps.behind
    rows, columns = body.pixels.T
    heights = body.heights - np.where(body.front, _rounded(steps, mask)[rows, columns], 0)
    cell = body.places[body.faces].min(1).astype(int)
    cell = np.minimum(cell, np.array(steps.cells.shape) - 1)
    taken = body.front[body.faces].all(1) & steps.cells[cell[:, 0], cell[:, 1]]
    under = continued(np.where(behind, height, 0.0), behind, mask)
    zone = behind | (ndimage.binary_dilation(behind, iterations=REACH) & _parts(steps, mask))
    under = np.where(behind, height, np.minimum(under, height - _BELOW))
    vertices, faces = _sheet(under, zone & mask)
    seen = np.stack([body.places[:, 1], -body.places[:, 0], heights], -1)
    joined = np.concatenate([body.faces[~taken], faces + len(seen)])
    return np.concatenate([seen, vertices]), joined


def _parts(steps: Steps, mask: np.ndarray) -> np.ndarray:
    """Pixels of parts in front, near the step."""
    return np.asarray(
        ndimage.binary_dilation(steps.front, iterations=REACH, mask=mask & ~steps.behind)
    )


def _rounded(steps: Steps, mask: np.ndarray) -> np.ndarray:
    """By how much the rims of parts in front are lowered, (H, W)."""
    away = ndimage.distance_transform_edt(~steps.behind)
    depth = np.clip(ROUND - away, 0, ROUND)
    fall = ROUND - np.sqrt(ROUND**2 - depth**2)
    return np.where(_parts(steps, mask), fall, 0)


def _sheet(height: np.ndarray, inside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two triangles for each cell of four pixels inside."""
    width = inside.shape[1]
    cells = inside[:-1, :-1] & inside[1:, :-1] & inside[:-1, 1:] & inside[1:, 1:]
    row, column = np.nonzero(cells)
    corner = row * width + column
    faces = np.concatenate(
        [
            np.stack([corner, corner + width, corner + width + 1], -1),
            np.stack([corner, corner + width + 1, corner + 1], -1),
        ]
    )
    used, faces = np.unique(faces, return_inverse=True)
    rows, columns = np.divmod(used, width)
    vertices = np.stack([columns, -rows, height[rows, columns]], -1).astype(np.float64)
    return vertices, faces.reshape(-1, 3)
