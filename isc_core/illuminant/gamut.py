"""Whether white is among an object's colours, as under any lamp. Otherwise the light, or all of the
albedo, has a strong colour.

Problem: a separation assumes white light. Under red light everything is red, the highlights too; no
constraint on a single highlight shows that, if its colour is searched near white only.

Equation: the colours c of an object under light of the colour l are c = l r, r those under white
light, so that the whole gamut moves with l (Forsyth 1990). With chromaticities p(c) of all but the
darkest, in the plane of colours of mean 1 with white at 0, white's distance from their hull, except
for a twentieth of them, is

    max over unit u of the 5 % quantile of u . p.

A gamut may also lie off white because of the albedo. Then highlights bring it back: their flanks'
chromaticities move on lines toward the light's (Lehmann & Palm 2001), here toward white: a change
dI of a colour I counts by its |I x dI|, and by how well white, or the best of the colours near it,
lies in its plane and ahead of it.

Citation: D. A. Forsyth 1990, doi:10.1007/BF00056770; T. M. Lehmann, C. Palm 2001,
doi:10.1364/JOSAA.18.002679.

Limits: diffuse albedo of one strong colour cannot be distinguished from grey albedo under light of
that colour, and counts as the same. Light that moves grey at most .3 from white, such as (1.2, 1,
.8), is not detected; nor is stronger light on albedo of many strong colours, or of one that
compensates for it.
"""

import numpy as np

from ..imaging.channels import length, smallest, total

# An orthonormal basis of the colours with sum 0, (3, 2).
PLANE = np.array([[1, -1, 0], [1, 1, -2]]).T / np.sqrt([2.0, 6.0])
# Quantiles: of the intensity, below which colours do not count; of those beyond the hull.
_DARK, _STRAY = 0.3, 0.05
_FARTHEST = 0.3  # of white from the hull
_DIRECTIONS = 72  # a multiple of 12 makes the channels alike
# Of a flank: of the intensity, over the bright pixels'; of the chromaticity.
_RISE, _TURN = 0.03, 0.05
_TOWARD, _TOLERANCE = 0.7, 0.04  # the cosine of the turn's direction to the light; n . L / |n|
_NEAR, _STEP = 0.25, 0.1  # the colours that count as white, and their grid
# Flanks, and their mean weight over all changes, below which they carry no information.
_FEW, _FAINT = 20, 1e-4
_ENOUGH = 20_000  # colours or flanks: more add nothing
_SHARE = 0.2  # of the flanks that move toward white


def without_white(colour: np.ndarray, change: np.ndarray) -> bool:
    """Check whether white is neither among the colours nor where highlights lead.

    Parameters
    ----------
    colour, change : (N, 3) ndarray
        Colours and their upward changes over a short distance, >= 0, in units of the bright pixels'
        intensity.

    Returns
    -------
    bool
        Whether white is missing.
    """
    if len(colour) < _FEW:
        return False
    return distance_of_white(colour) > _FARTHEST and share_toward_white(colour, change) < _SHARE


def distance_of_white(colour: np.ndarray) -> float:
    """Return the distance of white from the hull of chromaticities.

    Parameters
    ----------
    colour : (N, 3) ndarray
        Colours, linear, not negative.

    Returns
    -------
    float
        In the chromaticity plane; negative inside the hull.
    """
    intensity = total(colour.astype(float, copy=False))
    bright = intensity >= max(float(np.quantile(intensity, _DARK)), 1e-12)
    if not bright.any():
        return 0.0
    places = 3 * colour[bright] / intensity[bright, None] @ PLANE
    places = places[_thinned(len(places))]
    angle = np.arange(_DIRECTIONS) * (2 * np.pi / _DIRECTIONS)
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ places.T
    return float(np.quantile(along, _STRAY, axis=1, overwrite_input=True).max())


def share_toward_white(colour: np.ndarray, change: np.ndarray) -> float:
    """Compute the share of apparent flanks of highlights that lead to a colour near white.

    Parameters
    ----------
    colour, change : (N, 3) ndarray
        As for `without_white`.

    Returns
    -------
    float
        In [0, 1]; 0 where there is nothing.
    """
    here, turn, rising = turns(colour, change)
    flanks = np.flatnonzero(rising)
    normal = np.cross(colour[flanks], change[flanks])
    if len(flanks) < _FEW or length(normal).sum() < _FAINT * len(colour):
        return 0.0
    kept = _thinned(len(flanks))
    flanks, normal = flanks[kept], normal[kept]
    weight = length(normal)
    end = colour[flanks] + change[flanks] / 2
    end /= total(end)[:, None]
    return max(
        float(
            weight
            @ _agreement(white, normal / weight[:, None], here[flanks], end, turn[flanks])
            / weight.sum()
        )
        for white in _whites()
    )


def turns(colour: np.ndarray, change: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find changes that may be flanks of highlights: all channels rise, and the chromaticity turns.

    Parameters
    ----------
    colour, change : (N, 3) ndarray
        As for `without_white`.

    Returns
    -------
    here, turn : (N, 3) ndarray
        The chromaticity, and the difference from it to the change's.
    rising : (N,) ndarray of bool
        Which may be flanks.
    """
    rise = total(change)
    here = colour / np.maximum(total(colour), 1e-12)[:, None]
    turn = change / np.maximum(rise, 1e-12)[:, None] - here
    return (
        here,
        turn,
        (rise > _RISE) & (smallest(change) > 0) & (length(turn) > _TURN),
    )


def leads_to(light: np.ndarray, here: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Check which turns of chromaticity go toward a light's.

    Parameters
    ----------
    light : (3,) ndarray
        Colour of the light.
    here, turn : (N, 3) ndarray
        As `turns` returns them.

    Returns
    -------
    (N,) ndarray of bool
        Which do.
    """
    way = light / light.sum() - here
    return total(turn * way) / np.maximum(length(turn) * length(way), 1e-12) > _TOWARD


def _thinned(number: int) -> slice:
    return slice(None, None, -(-number // _ENOUGH))


def _whites() -> np.ndarray:
    """The colours (M, 3) of mean 1 that count as white."""
    axis = np.arange(-int(_NEAR / _STEP), int(_NEAR / _STEP) + 1) * _STEP
    places = np.stack(np.meshgrid(axis, axis), -1).reshape(-1, 2)
    return np.ones(3) + places[np.linalg.norm(places, axis=1) < _NEAR] @ PLANE.T


def _agreement(
    white: np.ndarray, normal: np.ndarray, here: np.ndarray, end: np.ndarray, turn: np.ndarray
) -> np.ndarray:
    """How well that light (3,) explains flanks (N, 3), in [0, 1], (N,); `end`: the chromaticity
    there.
    """
    off = normal @ (white / np.linalg.norm(white))
    ahead = total((white / white.sum() - end) * turn) > 0
    return np.where(ahead & leads_to(white, here, turn), 1 / (1 + np.square(off / _TOLERANCE)), 0.0)
