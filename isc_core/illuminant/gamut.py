"""Tests whether white is among an object's colours, as under common lamps. Otherwise the light, or
the whole albedo, has a strong colour.

Problem: a separation assumes white light. Under red light everything is red, including highlights;
an estimate from single highlights cannot detect this if it searches colours near white only.

Equation: the colours c of an object under light of the colour l are c = l r, r those under white
light, so that the whole gamut is scaled by l (Forsyth 1990). With chromaticities p(c) of all but
the darkest colours, in the plane of colours of mean 1 with white at 0, the distance of white from
their hull, ignoring 5 % of them as outliers, is

    max over unit u of the 5 % quantile of u . p.

The gamut may also exclude white because of the albedo. Then highlights provide evidence: the
chromaticities of their flanks lie on lines toward that of the light (Lehmann & Palm 2001), here
toward white. A change dI of a colour I is weighted by |I x dI|, and by how well white, or the best
of the colours near it, lies in its plane and in the direction of the change.

Citation: D. A. Forsyth 1990, doi:10.1007/BF00056770; T. M. Lehmann, C. Palm 2001,
doi:10.1364/JOSAA.18.002679.

Limits: diffuse albedo of one strong colour cannot be distinguished from grey albedo under light of
that colour, and is classified in the same way. Light that moves grey by at most .3 from white, such
as (1.2, 1, .8), is not detected; nor is stronger light on albedo with many strong colours, or with
a colour that compensates for it.
"""

import numpy as np

from ..imaging.channels import length, smallest, total

# An orthonormal basis of the colours with sum 0, (3, 2).
PLANE = np.array([[1, -1, 0], [1, 1, -2]]).T / np.sqrt([2.0, 6.0])
# Quantiles: of the intensity, below which colours are ignored; of the outliers of the hull.
_DARK, _OUTLIERS = 0.3, 0.05
_MAX_DISTANCE = 0.3  # of white from the hull
_DIRECTIONS = 72  # a multiple of 12 treats the channels equally
# Smallest changes of a flank: of the intensity, relative to bright pixels; of the chromaticity.
_RISE, _CHROMATICITY_CHANGE = 0.03, 0.05
_TOWARD = 0.7  # cosine between the change of chromaticity and the direction to the light
_TOLERANCE = 0.04  # of n . L / |n|
_NEAR, _STEP = 0.25, 0.1  # radius of the colours that count as white, and spacing of their grid
# Number of flanks, and mean weight over all changes, below which flanks carry no information.
_MIN_FLANKS, _MIN_WEIGHT = 20, 1e-4
_MAX_SAMPLES = 20_000  # colours or flanks: more do not improve the estimate
_SHARE = 0.2  # of the flanks that change toward white


def lacks_white(colour: np.ndarray, change: np.ndarray) -> bool:
    """Check that white is neither among the colours nor in the direction of highlights.

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
    if len(colour) < _MIN_FLANKS:
        return False
    return distance_of_white(colour) > _MAX_DISTANCE and share_toward_white(colour, change) < _SHARE


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
    chromaticities = 3 * colour[bright] / intensity[bright, None] @ PLANE
    chromaticities = chromaticities[_thinned(len(chromaticities))]
    angle = np.arange(_DIRECTIONS) * (2 * np.pi / _DIRECTIONS)
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ chromaticities.T
    return float(np.quantile(along, _OUTLIERS, axis=1, overwrite_input=True).max())


def share_toward_white(colour: np.ndarray, change: np.ndarray) -> float:
    """Compute the share of apparent flanks of highlights that change toward a colour near white.

    Parameters
    ----------
    colour, change : (N, 3) ndarray
        As for `lacks_white`.

    Returns
    -------
    float
        In [0, 1]; 0 without flanks.
    """
    here, change_direction, rising = chromaticity_changes(colour, change)
    flanks = np.flatnonzero(rising)
    normal = np.cross(colour[flanks], change[flanks])
    if len(flanks) < _MIN_FLANKS or length(normal).sum() < _MIN_WEIGHT * len(colour):
        return 0.0
    kept = _thinned(len(flanks))
    flanks, normal = flanks[kept], normal[kept]
    weight = length(normal)
    end = colour[flanks] + change[flanks] / 2
    end /= total(end)[:, None]
    return max(
        float(
            weight
            @ _agreement(
                white, normal / weight[:, None], here[flanks], end, change_direction[flanks]
            )
            / weight.sum()
        )
        for white in _whites()
    )


def chromaticity_changes(
    colour: np.ndarray, change: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find potential flanks of highlights: all channels increase, and the chromaticity changes.

    Parameters
    ----------
    colour, change : (N, 3) ndarray
        As for `lacks_white`.

    Returns
    -------
    here, change_direction : (N, 3) ndarray
        The chromaticity, and that of the change minus it.
    rising : (N,) ndarray of bool
        Potential flanks.
    """
    rise = total(change)
    here = colour / np.maximum(total(colour), 1e-12)[:, None]
    change_direction = change / np.maximum(rise, 1e-12)[:, None] - here
    return (
        here,
        change_direction,
        (rise > _RISE) & (smallest(change) > 0) & (length(change_direction) > _CHROMATICITY_CHANGE),
    )


def points_toward(light: np.ndarray, here: np.ndarray, change_direction: np.ndarray) -> np.ndarray:
    """Check which changes of chromaticity are directed toward that of a light.

    Parameters
    ----------
    light : (3,) ndarray
        Colour of the light.
    here, change_direction : (N, 3) ndarray
        From `chromaticity_changes`.

    Returns
    -------
    (N,) ndarray of bool
    """
    toward = light / light.sum() - here
    return (
        total(change_direction * toward)
        / np.maximum(length(change_direction) * length(toward), 1e-12)
        > _TOWARD
    )


def _thinned(number: int) -> slice:
    return slice(None, None, -(-number // _MAX_SAMPLES))


def _whites() -> np.ndarray:
    """The colours (M, 3) of mean 1 that count as white."""
    axis = np.arange(-int(_NEAR / _STEP), int(_NEAR / _STEP) + 1) * _STEP
    chromaticities = np.stack(np.meshgrid(axis, axis), -1).reshape(-1, 2)
    return np.ones(3) + chromaticities[np.linalg.norm(chromaticities, axis=1) < _NEAR] @ PLANE.T


def _agreement(
    white: np.ndarray,
    normal: np.ndarray,
    here: np.ndarray,
    end: np.ndarray,
    change_direction: np.ndarray,
) -> np.ndarray:
    """How well a light (3,) explains flanks (N, 3), in [0, 1], (N,); `end`: the chromaticity at
    their end.
    """
    residual = normal @ (white / np.linalg.norm(white))
    ahead = total((white / white.sum() - end) * change_direction) > 0
    return np.where(
        ahead & points_toward(white, here, change_direction),
        1 / (1 + np.square(residual / _TOLERANCE)),
        0.0,
    )
