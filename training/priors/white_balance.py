"""The colour of the light as a camera's automatic white balance estimates it from a photo.

Problem: how nearly white a photo's light is depends on how well cameras find its colour.

Equation: with f the photo smoothed by a Gaussian of deviation s, the light's colour in channel c is

    e_c ~ (mean |D^n f_c|^p)^(1/p)

over the pixels that no channel clips, D^n the n-th derivative: n = 0, p = 1 is grey world, p = 6
shades of grey, n = 1, p = 6 the grey edge.

Citation: J. van de Weijer, T. Gevers, A. Gijsenij 2007, doi:10.1109/TIP.2007.901808; A. Gijsenij,
T. Gevers, J. van de Weijer 2011, doi:10.1109/TIP.2011.2118224 (survey, and the parameters).

Limits: cameras combine such statistics with knowledge of lamps and of their sensor, and are better;
their methods are not published.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

_CLIPPED = 0.98  # of white
_LEAST_PIXELS = 16
_LEAST = 1e-6


@dataclass(frozen=True)
class WhiteBalance:
    """An algorithm of the family.

    Attributes
    ----------
    order : int
        n, 0 or 1.
    power : float
        p.
    smoothing : float
        s, pixels.
    """

    order: int
    power: float
    smoothing: float

    def light(self, photo: np.ndarray) -> np.ndarray:
        """Estimate the colour of the light.

        Parameters
        ----------
        photo : (H, W, 3) ndarray
            Linear, white at 1.

        Returns
        -------
        (3,) ndarray
            Linear RGB of geometric mean 1; white where too few pixels are usable.
        """
        values = np.stack([self._values(photo[..., c]) for c in range(3)], axis=-1)
        used = values[ndimage.binary_erosion(photo.max(axis=-1) < _CLIPPED, border_value=1)]
        if len(used) < _LEAST_PIXELS:
            return np.ones(3)
        found = np.maximum(np.mean(used**self.power, axis=0) ** (1 / self.power), _LEAST)
        return np.asarray(found / np.prod(found) ** (1 / 3))

    def _values(self, channel: np.ndarray) -> np.ndarray:
        if self.order == 0:
            smooth = ndimage.gaussian_filter(channel, self.smoothing) if self.smoothing else channel
            return np.abs(smooth)
        return np.asarray(ndimage.gaussian_gradient_magnitude(channel, self.smoothing))


GREY_WORLD = WhiteBalance(0, 1, 0)
SHADES_OF_GREY = WhiteBalance(0, 6, 0)
GREY_EDGE = WhiteBalance(1, 6, 2)
ALGORITHMS = {
    "grey world": GREY_WORLD,
    "shades of grey": SHADES_OF_GREY,
    "grey edge": GREY_EDGE,
}
