"""How the light of a photo looks: whether there is a lamp, or several, where the strongest stands,
and what the light is like as a whole.

`PLACES`, where a lamp may stand, are directions evenly over what is before the object and a little
behind it, on a spiral: R. Swinbank and R. J. Purser 2006, doi:10.1256/qj.05.227. `lamp_network`
finds all this.
"""

from dataclasses import dataclass

import numpy as np

_COUNT, _BEHIND = 256, -0.2  # directions; the least of their parts toward the viewer
_HELD = 0.68
_BLUR, _NARROWEST = (
    12.1,
    4.0,
)  # degrees: what the network's places were blurred over, 68 % of it; a cone, at least
_WIDEST_CONE, _LIKELY_NONE = 30.0, 0.5


def _spiral() -> np.ndarray:
    """Directions (256, 3), unit vectors."""
    k = np.arange(_COUNT) + 0.5
    z, turn = 1 - (1 - _BEHIND) * k / _COUNT, np.pi * (1 + np.sqrt(5)) * k
    across = np.sqrt(1 - z**2)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)


PLACES = _spiral()


@dataclass(frozen=True)
class LightEstimate:
    """`none`, `one`, `several`: probabilities, together 1; `places` (256,): of `PLACES`, for the
    strongest lamp, if there is any. `light` (8,): what the log shading is like, see
    `sirfs.priors.predicted_light`, `deviations` (8,): how uncertain that is.
    """

    none: float
    one: float
    several: float
    places: np.ndarray
    light: np.ndarray
    deviations: np.ndarray

    @property
    def direction(self) -> np.ndarray:
        """The unit vector (3,) toward the strongest lamp."""
        mean = self.places @ PLACES
        return np.asarray(mean / np.linalg.norm(mean))

    @property
    def cone(self) -> float:
        """Degrees: the lamp lies so near `direction` with a probability of 68 %;

        `places` without what they were blurred over.
        """
        off = np.degrees(np.arccos(np.clip(PLACES @ self.direction, -1, 1)))
        order = np.argsort(off)
        wide = float(np.interp(_HELD, np.cumsum(self.places[order]), off[order]))
        return float(np.sqrt(max(wide**2 - _BLUR**2, _NARROWEST**2)))

    @property
    def smooth(self) -> bool:
        """Whether there seems to be no lamp, but a light from all around."""
        return self.none > _LIKELY_NONE

    @property
    def determined(self) -> bool:
        """Whether there is a direction to speak of: a lamp, and a cone that is not half the sky."""
        return not self.smooth and self.cone <= _WIDEST_CONE
