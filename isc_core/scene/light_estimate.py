"""The lamps predicted from a photo: whether there is one or several, and where the strongest is.

`PLACES`, possible directions of a lamp, are distributed evenly over the hemisphere in front of the
object and a little behind it, on a spiral: R. Swinbank and R. J. Purser 2006,
doi:10.1256/qj.05.227. `networks.scene_network` predicts them.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

_COUNT, _BEHIND = 256, -0.2  # directions; the least of their parts toward the viewer
_HELD = 0.68
_BLUR, _NARROWEST = 12.1, 4.0  # degrees: 68 % of the blur of `places`; the narrowest cone
_WIDEST_CONE, _LIKELY_NONE = 30.0, 0.5


def _spiral() -> np.ndarray:
    """Directions (256, 3), unit vectors."""
    k = np.arange(_COUNT) + 0.5
    z, turn = 1 - (1 - _BEHIND) * k / _COUNT, np.pi * (1 + np.sqrt(5)) * k
    across = np.sqrt(1 - z**2)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)


PLACES = _spiral()


@cache
def mirrored_places() -> np.ndarray:
    """Return the number (256,) of the place that mirrors each of `PLACES`."""
    return np.argmax((PLACES * (-1, 1, 1)) @ PLACES.T, axis=1)


@dataclass(frozen=True, eq=False)
class LightEstimate:
    """Predicted lamps of a photo.

    Attributes
    ----------
    none, one, several : float
        Probabilities of so many lamps; they sum to 1.
    places : (256,) ndarray
        Probability of each of `PLACES` for the strongest lamp, if there is one.
    """

    none: float
    one: float
    several: float
    places: np.ndarray

    @property
    def direction(self) -> np.ndarray:
        """The unit vector (3,) toward the strongest lamp, camera frame."""
        mean = self.places @ PLACES
        return np.asarray(mean / np.linalg.norm(mean))

    @property
    def cone(self) -> float:
        """Degrees from `direction` within which the lamp lies with a probability of 68 %, without
        the blur of `places`.
        """
        off = np.degrees(np.arccos(np.clip(PLACES @ self.direction, -1, 1)))
        order = np.argsort(off)
        wide = float(np.interp(_HELD, np.cumsum(self.places[order]), off[order]))
        return float(np.sqrt(max(wide**2 - _BLUR**2, _NARROWEST**2)))

    @property
    def smooth(self) -> bool:
        """Whether there seems to be no lamp, only light from all around."""
        return self.none > _LIKELY_NONE

    @property
    def determined(self) -> bool:
        """Whether there is a lamp in a cone well below a hemisphere."""
        return not self.smooth and self.cone <= _WIDEST_CONE
