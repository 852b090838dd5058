"""One object of the MIT-Berkeley set, as the generator needs it: known pixels as a list, and the
frame that they came from.

Limits: a pixel counts where the mask holds, the reflectance is above 0 and all heights around it
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


@dataclass(frozen=True)
class Source:
    """`frame`: rows and columns of the set's files. `rows`, `columns`: 0-based, of its evaluation
    crop, (h,) and (w,). `mask`: (h, w) bool, the N pixels that are used. `height`: (h, w) pixels
    toward the viewer, NaN outside `mask`. `reflectance`, `normal`: (N, 3). `lights`: for each
    illumination the (9, 3) coefficients of log shading, in our convention. `crop_file`: the bytes
    of crop_idx.mat.
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
        """Pixels of one object unit: the object is two units wide or high, as in
        `synth.shapes.height_field`.
        """
        return float(max(np.ptp(places) + 1 for places in np.nonzero(self.mask))) / 2

    def whole(self, values: np.ndarray, outside: float = 0.0) -> np.ndarray:
        """Values (N[, C]) of the pixels as a picture of the whole frame, `outside` elsewhere."""
        crop = np.full((*self.mask.shape, *values.shape[1:]), outside, values.dtype)
        crop[self.mask] = values
        frame = np.full((*self.frame, *values.shape[1:]), outside, values.dtype)
        frame[np.ix_(self.rows, self.columns)] = crop
        return frame


def load_source(root: Path, name: str) -> Source:
    """Reads an object.

    Raises `InputError` for files that are missing or damaged, and where no height is known.
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
            f"{name}: no pixel of its mask has a known height and reflectance: leave the object out"
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
