"""The demo's object: a glazed ceramic gourd with ribs below, a knob on top, and a pattern."""

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d

from ..scene.meshes import Mesh, swept

RIBS = 8

# (height, radius) along the outline from the top pole to the bottom one, in object units.
_OUTLINE = np.array(
    [
        (1.00, 0.00),
        (0.985, 0.10),
        (0.93, 0.165),
        (0.86, 0.155),
        (0.80, 0.12),
        (0.74, 0.16),
        (0.66, 0.31),
        (0.54, 0.43),
        (0.40, 0.475),
        (0.26, 0.45),
        (0.14, 0.43),
        (0.02, 0.50),
        (-0.14, 0.65),
        (-0.34, 0.755),
        (-0.54, 0.75),
        (-0.72, 0.64),
        (-0.86, 0.45),
        (-0.95, 0.22),
        (-0.97, 0.00),
    ]
)

TEAL, NAVY, CREAM, CORAL, GOLD = (
    np.array(c)
    for c in [
        (0.03, 0.30, 0.33),
        (0.03, 0.06, 0.22),
        (0.72, 0.62, 0.44),
        (0.70, 0.13, 0.07),
        (0.66, 0.40, 0.06),
    ]
)


def gourd(rows: int = 260, columns: int = 361) -> Mesh:
    """Make the gourd: about 1.5 wide and 2 high, centred on the origin, y up.

    Parameters
    ----------
    rows, columns : int, optional
        Size of its grid of vertices.

    Returns
    -------
    Mesh
        The object.
    """
    height, radius = _outline(rows)
    angle = np.linspace(0, 2 * np.pi, columns)
    ribbed = np.exp(-(((height + 0.42) / 0.32) ** 2))[:, None]
    swell = 1 + 0.05 * ribbed * (2 * np.sqrt(0.05 + np.cos(0.5 * RIBS * angle) ** 2) - 1)
    r = radius[:, None] * swell
    points = np.stack(
        [r * np.sin(angle), np.broadcast_to(height[:, None], r.shape), r * np.cos(angle)], -1
    )
    points[:, -1] = points[:, 0]
    return swept(points)


def _outline(rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Height and radius at `rows` equal steps along a smooth curve through the outline's points."""
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(_OUTLINE, axis=0), axis=1))])
    height, radius = PchipInterpolator(length, _OUTLINE)(np.linspace(0, length[-1], rows)).T
    # Beyond a pole the outline continues on the other side: the height is mirrored, the radius
    # changes its sign. This keeps the poles round.
    margin, width = rows // 4, rows / 60
    height = gaussian_filter1d(np.pad(height, margin, mode="reflect"), width)[margin:-margin]
    radius = gaussian_filter1d(np.pad(radius, margin, mode="reflect", reflect_type="odd"), width)[
        margin:-margin
    ]
    radius[[0, -1]] = 0
    return height, np.maximum(radius, 0)


def gourd_albedo(size: int = 1024) -> np.ndarray:
    """Draw the albedo of the gourd.

    Parameters
    ----------
    size : int, optional
        Width in texels.

    Returns
    -------
    (size // 2, size, 3) ndarray of float32
        Linear Rec.709 in [0, 1]; row 0 is the top of the object, columns go around it.
    """
    v, u = np.meshgrid(
        (np.arange(size // 2) + 0.5) / (size // 2), (np.arange(size) + 0.5) / size, indexing="ij"
    )
    soft = 2.0 / size
    skin = np.broadcast_to(TEAL, (*u.shape, 3))
    skin = _over(skin, NAVY, _edge(v - 0.80 - 0.012 * np.cos(2 * np.pi * RIBS * u), soft))
    skin = _over(skin, CREAM, _band(v, 0.375, 0.472, soft))
    skin = _over(skin, CORAL, _band(v, 0.358, 0.375, soft) + _band(v, 0.472, 0.489, soft))
    skin = _over(skin, CORAL, _dots(u, v, 2 * RIBS, 0.4235, 0.017, soft))
    skin = _over(skin, GOLD, _petals(u, v, RIBS, 0.645, soft))
    skin = _over(skin, CREAM, _dots(u, v, RIBS, 0.645, 0.018, soft))
    skin = _over(skin, CREAM, _dots(u + 0.5 / RIBS, v, RIBS, 0.56, 0.011, soft))
    skin = _over(skin, GOLD, 1 - _edge(v - 0.165, soft))
    skin = _over(skin, CREAM, _dots(u, v, RIBS, 0.275, 0.014, soft))
    return np.ascontiguousarray(skin, np.float32)


def _over(below: np.ndarray, colour: np.ndarray, cover: np.ndarray) -> np.ndarray:
    cover = np.clip(cover, 0, 1)[..., None]
    return below * (1 - cover) + colour * cover


def _edge(distance: np.ndarray, soft: float) -> np.ndarray:
    """0 where `distance` is negative, 1 where it is positive, a ramp of width `soft` between."""
    return np.clip(0.5 + distance / (2 * soft), 0, 1)


def _band(v: np.ndarray, top: float, bottom: float, soft: float) -> np.ndarray:
    return _edge(v - top, soft) * _edge(bottom - v, soft)


def _around(u: np.ndarray, count: int) -> np.ndarray:
    """Signed distance, in turns, to the nearest of `count` places evenly around the object."""
    return (np.mod(u * count + 0.5, 1) - 0.5) / count


def _dots(
    u: np.ndarray, v: np.ndarray, count: int, row: float, radius: float, soft: float
) -> np.ndarray:
    # The outline is about 3.2 long and the girth about 4, hence the factor 1.2 on turns.
    return _edge(radius - np.hypot(1.2 * _around(u, count), v - row), soft)


def _petals(u: np.ndarray, v: np.ndarray, count: int, row: float, soft: float) -> np.ndarray:
    """Flowers of six petals, one on each rib."""
    across, along = 1.2 * _around(u, count), v - row
    radius = 0.034 + 0.016 * np.cos(6 * np.arctan2(across, along))
    return _edge(radius - np.hypot(across, along), soft)
