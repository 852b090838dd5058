"""A height map as a mesh whose rendering reproduces the map pixel by pixel.

Equation: pixel (r, c) of a map of W x H pixels has its centre at x = (c + 1/2 - W / 2) / s, y = (H
/ 2 - r - 1/2) / s and z = (height - offset) / s, with s pixels per unit: the mapping of
`synth.scene.camera.Camera(W, H, s)`, to the last bit. There is a vertex at each centre, with the
normal (-dh/dx, -dh/dy, 1) of central differences (one-sided at the rim), and one at each corner of
a pixel, at the mean of the linear extrapolations from the pixels around it; so the mesh covers
exactly the pixels that have a height.

Citation: J. T. Barron, J. Malik (2015), "Shape, illumination, and reflectance from shading",
doi:10.1109/TPAMI.2014.2377712 (the heights of the MIT-Berkeley objects, `Z.mat`).

Limits: one side only, open at the rim and behind. Discontinuities between neighbouring pixels
become steep walls, not gaps.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from isc_core.errors import InputError
from isc_core.io.exr import read_channels
from isc_core.io.matlab import read_matrix
from isc_core.io.npy import ARCHIVE, read_array
from isc_core.io.regular_files import require_regular

from ..scene.camera import LARGEST, SMALLEST, Camera
from ..scene.meshes import Mesh

FEWEST = 64  # pixels with a height
# Range of heights relative to the larger side of the object: beyond it the unit is not the pixel.
_DEEPEST = 20.0
_READERS = {".mat": "a MATLAB file", ".npy": "a NumPy array", ".exr": "an OpenEXR file"}
# Around a pixel's centre, counter-clockwise from the upper left: rows down, columns to the right.
_CORNERS = ((0, 0), (1, 0), (1, 1), (0, 1))


@dataclass(frozen=True)
class HeightField:
    """A height map as a mesh.

    Attributes
    ----------
    mesh : Mesh
        In the camera frame; the object's larger side is 2 units, its place is that in the map.
    pixels_per_unit : float
        The scale s.
    width, height : int
        Size of the map in pixels.
    offset : float
        Height at z = 0 in pixels: height = z * pixels_per_unit + offset.
    """

    mesh: Mesh
    pixels_per_unit: float
    width: int
    height: int
    offset: float

    @property
    def camera(self) -> Camera:
        """The camera whose pixels are those of the map."""
        return Camera(self.width, self.height, self.pixels_per_unit)


def read_height(path: str | Path) -> np.ndarray:
    """Read a height map from a file.

    Parameters
    ----------
    path : Path or str
        A .mat file with the variable `depth`; an .npy file; or an .exr file with the channel
        `height.Z`, `Z`, `Y` or a single one, and optionally `mask.A`, which must be at least one
        half.

    Returns
    -------
    (H, W) ndarray of float64
        Pixels toward the viewer, NaN outside the object.

    Raises
    ------
    InputError
        If the file cannot be read or contains no height map.
    """
    path = Path(path)
    if path.suffix.lower() not in _READERS:
        raise InputError(f"{path}: heights are read from {', '.join(_READERS)} files")
    if not path.exists():
        raise InputError(f"{path} does not exist")
    require_regular(path, remedy="use a height map")
    reader = {".mat": _read_mat, ".npy": _read_npy, ".exr": _read_exr}[path.suffix.lower()]
    return check_height(reader(path), str(path))


def check_height(height: np.ndarray, what: str = "this height map") -> np.ndarray:
    """Check a height map.

    Parameters
    ----------
    height : (H, W) ndarray
        Pixels toward the viewer.
    what : str, optional
        Name of the map in messages.

    Returns
    -------
    (H, W) ndarray of float64
        The map, NaN where it is not finite.

    Raises
    ------
    InputError
        If it is not a map, too small or large, empty, or too deep.
    """
    height = np.asarray(height)
    if height.ndim != 2 or height.dtype.kind not in "fiu":
        raise InputError(
            f"{what}: a height map is an array (H, W) of numbers, not of shape {height.shape} and "
            f"type {height.dtype}"
        )
    if not all(SMALLEST <= side <= LARGEST for side in height.shape):
        size = f"{height.shape[1]} x {height.shape[0]}"
        raise InputError(
            f"{what}: {size} pixels cannot be rendered: crop or resize it to {SMALLEST} to "
            f"{LARGEST} a side"
        )
    height = np.where(np.isfinite(height), height, np.nan).astype(np.float64)
    known = np.isfinite(height)
    if known.sum() < FEWEST:
        raise InputError(
            f"{what}: {known.sum()} pixels have a height, at least {FEWEST} are needed: use NaN "
            "only outside the object"
        )
    deep, side = np.ptp(height[known]), max(_extents(known))
    if deep > _DEEPEST * side:
        raise InputError(
            f"{what}: heights range over {deep:.4g} pixels, the object is {side} wide: give "
            "heights in pixels, NaN outside"
        )
    return height


def place_height(height: np.ndarray) -> HeightField:
    """Convert a height map to a mesh and its camera.

    Parameters
    ----------
    height : (H, W) ndarray
        Pixels toward the viewer, NaN outside.

    Returns
    -------
    HeightField
        The mesh.

    Raises
    ------
    InputError
        As `check_height`.
    """
    height = check_height(height)
    known = np.isfinite(height)
    rows, columns = height.shape
    scale = max(_extents(known)) / 2
    offset = float((np.nanmin(height) + np.nanmax(height)) / 2)
    across, down = _slopes(height)
    normals = np.stack([-across, down, np.ones_like(across)], -1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    corner_height, corner_normals = _corners(height, across, down, normals)
    corner = np.isfinite(corner_height)
    corner_normals = corner_normals[corner] / np.linalg.norm(
        corner_normals[corner], axis=-1, keepdims=True
    )

    def vertices(values: np.ndarray, where: np.ndarray, half: float) -> np.ndarray:
        row, column = np.nonzero(where)
        # Same order of operations as in the camera, so that rays and vertices meet exactly.
        x, y = (column + half - columns / 2) / scale, (rows / 2 - row - half) / scale
        return np.stack([x, y, (values[where] - offset) / scale], -1)

    points = np.concatenate([vertices(height, known, 0.5), vertices(corner_height, corner, 0.0)])
    uv = np.concatenate([_coordinates(known, known, 0.5), _coordinates(corner, known, 0.0)])
    mesh = Mesh(points, np.concatenate([normals[known], corner_normals]), uv, _fans(known, corner))
    return HeightField(mesh, scale, columns, rows, offset)


def mesh_of_height(height: np.ndarray) -> Mesh:
    """Return only the mesh of `place_height`.

    Parameters
    ----------
    height : (H, W) ndarray
        Pixels toward the viewer, NaN outside.

    Returns
    -------
    Mesh
        In object units.

    Raises
    ------
    InputError
        As `check_height`.
    """
    return place_height(height).mesh


def _extents(known: np.ndarray) -> tuple[int, int]:
    """Rows and columns of the bounding box."""
    row, column = np.nonzero(known)
    return int(np.ptp(row)) + 1, int(np.ptp(column)) + 1


def _slopes(height: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Height per pixel to the right and down (H, W): the mean of the differences to known
    neighbours, 0 without any.
    """
    slopes = []
    for axis in (1, 0):
        step = np.diff(height, axis=axis)
        pad = [(0, 0), (0, 0)]
        pad[axis] = (1, 1)
        steps = np.pad(step, pad, constant_values=np.nan)
        both = np.stack([np.delete(steps, -1, axis), np.delete(steps, 0, axis)])
        found = np.isfinite(both)
        slopes.append(np.where(found, both, 0).sum(0) / np.maximum(found.sum(0), 1))
    return slopes[0], slopes[1]


def _corners(
    height: np.ndarray, across: np.ndarray, down: np.ndarray, normals: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Heights (H + 1, W + 1), NaN away from the object, and unnormalised normals (H + 1, W + 1, 3),
    at the pixels' corners.
    """
    rows, columns = height.shape
    known = np.isfinite(height)
    count, total = np.zeros((rows + 1, columns + 1)), np.zeros((rows + 1, columns + 1))
    sums = np.zeros((rows + 1, columns + 1, 3))
    for r, c in _CORNERS:
        at = (slice(r, r + rows), slice(c, c + columns))
        count[at] += known
        total[at] += np.where(known, height + across * (c - 0.5) + down * (r - 0.5), 0)
        sums[at] += np.where(known[..., None], normals, 0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan), sums


def _fans(known: np.ndarray, corner: np.ndarray) -> np.ndarray:
    """Four triangles per pixel, from its centre to its sides."""
    centre = np.arange(known.sum())
    number = np.full(corner.shape, -1)
    number[corner] = np.arange(corner.sum()) + len(centre)
    rows, columns = known.shape
    ring = [number[r : r + rows, c : c + columns][known] for r, c in _CORNERS]
    return np.concatenate([np.stack([centre, ring[i], ring[(i + 1) % 4]], -1) for i in range(4)])


def _coordinates(where: np.ndarray, known: np.ndarray, half: float) -> np.ndarray:
    """Texture coordinates of centres (`half` 0.5) or corners (0): the bounding box of the object,
    centred, its larger side filling [0, 1].
    """
    row, column = np.nonzero(known)
    middle = np.array([column.min() + column.max() + 1, row.min() + row.max() + 1]) / 2
    r, c = np.nonzero(where)
    return np.clip(0.5 + (np.stack([c, r], -1) + half - middle) / max(_extents(known)), 0, 1)


def _read_mat(path: Path) -> np.ndarray:
    return read_matrix(path, "depth")


def _read_npy(path: Path) -> np.ndarray:
    with path.open("rb") as file:
        if file.read(2) == ARCHIVE:
            raise InputError(
                f"{path} contains several arrays: save only the height map, with numpy.save"
            )
    return read_array(path)


def _read_exr(path: Path) -> np.ndarray:
    channels = read_channels(path)
    names = [name for name in ("height.Z", "Z", "Y") if name in channels] or list(channels)[
        : len(channels) == 1
    ]
    if not names:
        raise InputError(
            f"{path} has the channels {', '.join(channels)}: name the one with the heights "
            "height.Z, Z or Y"
        )
    height = channels[names[0]]
    return np.where(channels["mask.A"] >= 0.5, height, np.nan) if "mask.A" in channels else height
