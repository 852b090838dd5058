"""One object of the MIT-Berkeley set in the generator's format: known pixels as a list, and their
frame.

Limits: a pixel is used where the mask is set, the reflectance is above 0 and all heights around it
are known, so that its normal is exact.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from isc_core.datasets.mit_berkeley import ILLUMINATIONS, load_object
from isc_core.errors import InputError
from isc_core.evaluation.metrics import truth_normal
from isc_core.io.matlab import read_matrix
from isc_core.photo import read_raster
from isc_core.shading.spherical_harmonics import light_from_reference


@dataclass(frozen=True, eq=False)
class Source:
    """An object of the set.

    Attributes
    ----------
    name : str
        Its name.
    frame : (int, int)
        Rows and columns of the set's files.
    rows, columns : (h,) and (w,) ndarray of int
        0-based indices of its evaluation crop.
    mask : (h, w) ndarray of bool
        The N pixels that are used.
    height : (h, w) ndarray
        Pixels toward the viewer, NaN outside `mask`.
    reflectance, normal : (N, 3) ndarray
        Reflectance and unit normals.
    lights : dict of str to (9, 3) ndarray
        Log-shading coefficients of each illumination, camera frame.
    crop_file : bytes
        Content of crop_idx.mat.
    """

    name: str
    frame: tuple[int, int]
    rows: np.ndarray
    columns: np.ndarray
    mask: np.ndarray
    height: np.ndarray
    reflectance: np.ndarray
    normal: np.ndarray
    lights: dict[str, np.ndarray]
    crop_file: bytes

    @property
    def pixels_per_unit(self) -> float:
        """Pixels per object unit: the object is two units wide or high, as in
        `synth.shapes.height_field`.
        """
        return float(max(np.ptp(places) + 1 for places in np.nonzero(self.mask))) / 2

    def whole(self, values: np.ndarray, outside: float = 0.0) -> np.ndarray:
        """Arrange values of the pixels as an image of the whole frame.

        Parameters
        ----------
        values : (N,) or (N, C) ndarray
            One value per pixel.
        outside : float, optional
            Value elsewhere.

        Returns
        -------
        (H, W) or (H, W, C) ndarray
            The image.
        """
        crop = np.full((*self.mask.shape, *values.shape[1:]), outside, values.dtype)
        crop[self.mask] = values
        frame = np.full((*self.frame, *values.shape[1:]), outside, values.dtype)
        frame[np.ix_(self.rows, self.columns)] = crop
        return frame


def load_source(root: Path, name: str) -> Source:
    """Read an object.

    Parameters
    ----------
    root : Path
        Folder of the set.
    name : str
        The object.

    Returns
    -------
    Source
        The object.

    Raises
    ------
    InputError
        If a file is missing or damaged, or no height is known.
    """
    truths = {illumination: load_object(root, name, illumination) for illumination in ILLUMINATIONS}
    truth = truths["laboratory"]
    folder = next(
        path
        for path in (root / "laboratory" / name, root / "MIT-Berkeley-Laboratory" / name)
        if path.is_dir()
    )
    rows, columns = (
        read_matrix(folder / "crop_idx.mat", key).ravel().astype(int) - 1
        for key in ("crop_idx1", "crop_idx2")
    )
    normal = truth_normal(truth.height)
    frame = read_raster(folder / "mask.png").values.shape
    mask = truth.mask & np.isfinite(normal).all(-1) & (truth.reflectance > 0).all(-1)
    if not mask.any():
        raise InputError(
            f"{name}: no pixel of its mask has a known height and reflectance: omit the object"
        )
    return Source(
        name=name,
        frame=(frame[0], frame[1]),
        rows=rows,
        columns=columns,
        mask=mask,
        height=np.where(mask, truth.height, np.nan),
        reflectance=truth.reflectance[mask],
        normal=normal[mask],
        lights={
            illumination: light_from_reference(found.light)
            for illumination, found in truths.items()
        },
        crop_file=(folder / "crop_idx.mat").read_bytes(),
    )
