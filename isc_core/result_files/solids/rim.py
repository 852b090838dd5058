"""The outline of a solid, and its soft rims.

Problem: at a smooth rim the surface turns away from the viewer, and a back begins. Hair and fur
have no such outline: their coverage fades, and a back would be visible through them.

Model: where the rim is soft, the mesh extends until the coverage is almost 0, and fades by its
texture's opacity. The core, which has a rim and a back, ends where the coverage falls below
`_WHOLE`; beyond, the mesh is a single sheet, so that the visible opacity is that of one layer, the
coverage.

Citation: coverage as opacity: T. Porter and T. Duff, "Compositing digital images", SIGGRAPH 1984,
doi:10.1145/800031.808606.

Limits: strands lie in the sheet, which is thin when seen from the side.
"""

from dataclasses import dataclass

import numpy as np

_WHOLE = 0.95
_LEAST = 0.04


@dataclass(frozen=True, eq=False)
class Rim:
    """The rim of the object.

    Attributes
    ----------
    cover : (H, W) ndarray
        Coverage of each pixel by the object.
    soft : (H, W) bool ndarray or None
        Where the rim is soft; None without a soft rim.
    """

    cover: np.ndarray
    soft: np.ndarray | None = None

    @property
    def outline(self) -> np.ndarray:
        """The map (H, W) whose contour at one half is the boundary of the mesh."""
        if self.soft is None:
            return self.cover
        return np.where(self.soft, np.clip(self.cover / (2 * _LEAST), 0, 1), self.cover)

    @property
    def sheet(self) -> np.ndarray:
        """Pixels (H, W) of the single sheet: soft ones that are not fully covered."""
        if self.soft is None:
            return np.zeros(self.cover.shape, bool)
        return self.soft & (self.cover < _WHOLE)
