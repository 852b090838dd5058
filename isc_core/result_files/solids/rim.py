"""Where a body ends, and where its rim is soft.

Problem: a smooth rim is an outline: the surface turns away from the viewer, and a back begins. Hair
and fur have none. What they cover fades, and a back behind them would be seen through them.

Model: where the rim is soft, the mesh goes on to where next to nothing is covered, and fades by its
texture's opacity. The body proper, which has a rim and a back, ends where the cover falls below
`_WHOLE`; beyond, the mesh is one sheet, so that light passes one layer and the opacity seen is the
cover.

Citation: the cover as opacity: T. Porter and T. Duff, "Compositing digital images", SIGGRAPH 1984,
doi:10.1145/800031.808606.

Limits: strands lie in the sheet: from the side it is thin.
"""

from dataclasses import dataclass

import numpy as np

_WHOLE = 0.95
_LEAST = 0.04


@dataclass(frozen=True)
class Rim:
    """How the object ends.

    Attributes
    ----------
    cover : (H, W) ndarray
        Share of each pixel that the object covers.
    soft : (H, W) bool ndarray or None
        Where the rim is soft; None for nowhere.
    """

    cover: np.ndarray
    soft: np.ndarray | None = None

    @property
    def outline(self) -> np.ndarray:
        """The map (H, W) whose contour at one half is the end of the mesh."""
        if self.soft is None:
            return self.cover
        return np.where(self.soft, np.clip(self.cover / (2 * _LEAST), 0, 1), self.cover)

    @property
    def sheet(self) -> np.ndarray:
        """Pixels (H, W) of the single sheet: soft ones that are not wholly covered."""
        if self.soft is None:
            return np.zeros(self.cover.shape, bool)
        return self.soft & (self.cover < _WHOLE)
