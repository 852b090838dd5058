"""The panels of a contact sheet: squares of one size, with the object at the same position."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from PIL import Image, ImageFilter

from ..imaging.bounding_box import mask_slices
from ..imaging.channels import largest, length

SIDE = 320  # pixels
MARGIN = 0.06  # room around the object, of the panel's side


@dataclass(frozen=True, eq=False)
class Panel:
    """One picture of a sheet.

    Attributes
    ----------
    color : (N, N, 3) ndarray
        Linear.
    coverage : (N, N) ndarray
        In [0, 1].
    label, remark : str
    keys : tuple of (str, tuple of int)
        Legend of colours: text and sRGB code, drawn instead of the remark.
    """

    color: np.ndarray
    coverage: np.ndarray
    label: str
    remark: str = ""
    keys: tuple[tuple[str, tuple[int, int, int]], ...] = ()


@dataclass(frozen=True, eq=False)
class Frame:
    """Placement of a map in a panel: the object's bounding box, scaled and centred.

    Attributes
    ----------
    mask : (H, W) bool ndarray
        The object.
    box : tuple of int
        First row, end row, first column, end column.
    zoom : float
        Panel pixels per map pixel.
    """

    mask: np.ndarray
    box: tuple[int, int, int, int]
    zoom: float

    @classmethod
    def around(cls, mask: np.ndarray) -> "Frame":
        """Frame an object.

        Parameters
        ----------
        mask : (H, W) bool ndarray
            Not empty.

        Returns
        -------
        Frame
        """
        rows, columns = mask_slices(mask)
        box = int(rows.start), int(rows.stop), int(columns.start), int(columns.stop)
        return cls(mask, box, SIDE * (1 - 2 * MARGIN) / max(box[1] - box[0], box[3] - box[2]))

    @cached_property
    def coverage(self) -> np.ndarray:
        """Coverage of each pixel of the panel, (N, N), by the object; the outline of a small object
        is smoothed.
        """
        zoom = max(1.0, self.zoom)
        soft = Image.fromarray(np.rint(255 * self._weight).astype(np.uint8))
        if zoom > 1:
            soft = soft.filter(ImageFilter.GaussianBlur(0.9 * zoom))
        return np.clip((np.asarray(soft, np.float32) / 255 - 0.5) * zoom + 0.5, 0, 1)

    def scaled(self, values: np.ndarray) -> np.ndarray:
        """Scale a map to the panel, with the mask as weight.

        Parameters
        ----------
        values : (H, W) or (H, W, C) ndarray

        Returns
        -------
        (N, N) or (N, N, C) ndarray
            0 outside the mask.
        """
        if values.ndim == 3:
            return np.stack([self.scaled(plane) for plane in np.moveaxis(values, -1, 0)], -1)
        found = self._resized(np.where(self.mask[self._part], values[self._part], 0))
        found *= self._gain
        return found

    def inside(self, values: np.ndarray) -> np.ndarray:
        """Return the values of the object.

        Parameters
        ----------
        values : (H, W) or (H, W, C) ndarray

        Returns
        -------
        (n,) or (n, C) ndarray
        """
        return values[self._part][self.mask[self._part]]

    def place(self, x: float, y: float) -> tuple[float, float]:
        """Convert a position in the map to the panel.

        Parameters
        ----------
        x, y : float
            Pixels from the map's left and upper edge.

        Returns
        -------
        tuple of float
            x and y in the panel.
        """
        top, left, height, width = self._window
        first_row, end_row, first_column, end_column = self.box
        across, down = width / (end_column - first_column + 2), height / (end_row - first_row + 2)
        return left + across * (x - first_column + 1), top + down * (y - first_row + 1)

    @property
    def _part(self) -> tuple[slice, slice]:
        """Rows and columns of the box."""
        first_row, end_row, first_column, end_column = self.box
        return slice(first_row, end_row), slice(first_column, end_column)

    @cached_property
    def _window(self) -> tuple[int, int, int, int]:
        """Top, left, height and width, in the panel, of the box with a border of one pixel."""
        first_row, end_row, first_column, end_column = self.box
        height, width = (
            min(SIDE, max(1, round(self.zoom * (n + 2))))
            for n in (end_row - first_row, end_column - first_column)
        )
        return (SIDE - height) // 2, (SIDE - width) // 2, height, width

    @cached_property
    def _weight(self) -> np.ndarray:
        return self._resized(self.mask[self._part])

    @cached_property
    def _gain(self) -> np.ndarray:
        """One over the weight; 0 outside the mask."""
        return np.where(self._weight > 1e-3, 1 / np.maximum(self._weight, 1e-3), np.float32(0))

    def _resized(self, plane: np.ndarray) -> np.ndarray:
        """A plane of the box in the panel, (N, N)."""
        # An empty border, so that the object's outline is antialiased on all sides.
        window = np.pad(plane.astype(np.float32), 1)
        top, left, height, width = self._window
        panel = np.zeros((SIDE, SIDE), np.float32)
        panel[top : top + height, left : left + width] = Image.fromarray(window).resize(
            (width, height), Image.Resampling.BILINEAR
        )
        return panel


def exposure(inside: np.ndarray) -> float:
    """Return the gain that maps the 99.5th percentile of the largest channel to .95.

    Parameters
    ----------
    inside : (N, 3) ndarray
        Linear light of the object.

    Returns
    -------
    float
        1 for a black or empty object.
    """
    bright = float(np.percentile(largest(inside), 99.5)) if inside.size else 0.0
    return 0.95 / bright if bright > 0 else 1.0


def unit_normals(scaled: np.ndarray) -> np.ndarray:
    """Return the unit normals of a scaled map of normals.

    Parameters
    ----------
    scaled : (..., 3) ndarray
        From `Frame.scaled`: shorter than 1, and 0 outside the object.

    Returns
    -------
    (..., 3) ndarray
        (0, 0, 1) for zero vectors.
    """
    size = length(scaled)
    unit = scaled / np.maximum(size, 1e-6)[..., None]
    unit[size <= 1e-6] = 0, 0, 1
    return unit
