"""Ambient occlusion of a height map: the share of a uniform sky's light that reaches each pixel.

Problem: engines darken ambient light where the surface itself hides the sky. They take this share
from a texture.

Equation: in the plane through the view and one of eight azimuths, t1 <= 0 <= t2 are the angles of
the horizon from the view, the largest slopes of the height map on both sides. With the normal n
projected onto that plane, of length |m| and angle g from the view, the light that arrives is

    |m| (a(t1) + a(t2)),  a(t) = (cos g - cos(2 |t| - g') + 2 |t| sin g') / 4,

g' being g on the side of t2 and -g on that of t1. t is at most the angle g + pi/2 or g - pi/2 at
which the surface itself begins. The result is the sum over the azimuths, divided by what it would
be without a horizon: 1 for every plane.

The horizon is sought at distances that grow by a tenth, along steps of the pixel grid:
(1, 0), (2, 1), (1, 1) and so on. Each azimuth counts by the angles that it stands for.

Cost: linear in the pixels; some 600 values are read for each.

Citation: L. Bavoil, M. Sainz, R. Dimitrov, "Image-space horizon-based ambient occlusion", SIGGRAPH
2008 talks, doi:10.1145/1401032.1401061 (the horizon); J. Jimenez et al., "Practical real-time
strategies for accurate indirect occlusion", SIGGRAPH 2016 courses (the integral; no DOI).

Limits: nothing beyond the mask hides the sky, and nothing beyond the largest distance; ridges
narrower than the steps are missed at that distance. Light that surfaces reflect is not counted. The
height map is taken for an orthographic view. Grooves of known opening angles come out within .05.
"""

import numpy as np

from ..imaging.bounding_box import FramePart, mask_box

_STEPS = ((0, 1), (1, 2), (1, 1), (2, 1), (1, 0), (2, -1), (1, -1), (1, -2))  # row and column
_GROWTH = 1.1
_REACH = 0.25  # of the object's longer side
_ROWS = 128  # at once


def ambient_occlusion(height: np.ndarray, mask: np.ndarray, reach: float = _REACH) -> np.ndarray:
    """Compute the ambient occlusion of a height map.

    Parameters
    ----------
    height : (H, W) ndarray
        Pixels, toward the viewer.
    mask : (H, W) bool ndarray
    reach : float
        Largest distance of the horizon, as a share of the object's longer side.

    Returns
    -------
    (H, W) float32 ndarray
        In [0, 1], 1 is unoccluded; 1 outside the mask.
    """
    far = max(2, round(reach * max(mask_box(mask)[2:])))
    part = FramePart.around(mask, 0)
    inside = part.cut(mask)
    here = np.where(inside, part.cut(height), -np.inf).astype(np.float32)
    level = np.pad(here, far, "constant", constant_values=-np.inf)
    share = np.ones(inside.shape, np.float32)
    for top in range(0, len(inside), _ROWS):
        bottom = min(top + _ROWS, len(inside))
        with np.errstate(invalid="ignore"):  # outside of the mask
            some = _unoccluded(level[top : bottom + 2 * far], far)
        share[top:bottom] = np.where(inside[top:bottom], some, 1)
    return part.placed(share, np.ones(()))


def _unoccluded(level: np.ndarray, far: int) -> np.ndarray:
    """The shares of a block of rows; `level` has a frame of `far` pixels and is -inf outside."""
    right, down = (_slope(level, far, step) for step in ((0, 1), (1, 0)))
    steepness = np.sqrt(1 + right**2 + down**2)
    open_sky, plane = np.zeros_like(right), np.zeros_like(right)
    for (row, column), weight in zip(_STEPS, _weights(), strict=True):
        slope = (right * column + down * row) / np.float32(np.hypot(row, column))
        turned = -np.arctan(slope)  # g
        length = np.float32(weight) * np.sqrt(1 + slope**2) / steepness
        for sign in (1, -1):
            side = sign * turned
            surface = side + np.float32(np.pi / 2)
            horizon = np.float32(np.pi / 2) - np.arctan(
                _largest_slope(level, far, (sign * row, sign * column))
            )
            open_sky += length * _arc(np.minimum(horizon, surface), side)
            plane += length * _arc(surface, side)
    return np.clip(open_sky / plane, 0, 1)


def _moved(level: np.ndarray, far: int, row: int, column: int) -> np.ndarray:
    """The block without its frame, as seen from pixels further on."""
    return level[far + row : len(level) - far + row, far + column : level.shape[1] - far + column]


def _slope(level: np.ndarray, far: int, step: tuple[int, int]) -> np.ndarray:
    """Slope along a step: the mean of both neighbours' inside, 0 where there is none."""
    here = _moved(level, far, 0, 0)
    ahead, behind = (_moved(level, far, sign * step[0], sign * step[1]) for sign in (1, -1))
    total, count = np.zeros_like(here), np.zeros_like(here)
    for rise in (ahead - here, here - behind):
        inside = np.isfinite(rise)
        total += np.where(inside, rise, 0)
        count += inside
    return total / np.maximum(count, 1)


def _largest_slope(level: np.ndarray, far: int, step: tuple[int, int]) -> np.ndarray:
    """The largest slope from each pixel to those in a direction, up to the distance `far`."""
    here, length = _moved(level, far, 0, 0), float(np.hypot(*step))
    largest = np.full_like(here, -np.inf)
    for count in _counts(far / length):
        rise = _moved(level, far, count * step[0], count * step[1]) - here
        rise *= np.float32(1 / (count * length))
        np.fmax(largest, rise, out=largest)
    return largest


def _arc(angle: np.ndarray, side: np.ndarray) -> np.ndarray:
    """a(t) of the module."""
    return (np.cos(side) - np.cos(2 * angle - side) + 2 * angle * np.sin(side)) / 4


def _counts(most: float) -> list[int]:
    """Numbers of steps up to `most` whose ratio is about `_GROWTH`."""
    found, distance = [1], 1.0
    while (distance := distance * _GROWTH) <= most:
        if round(distance) > found[-1]:
            found.append(round(distance))
    return found


def _weights() -> np.ndarray:
    """The share of all azimuths that each of `_STEPS` stands for."""
    angles = np.sort([np.arctan2(-row, column) % np.pi for row, column in _STEPS])
    place = np.argsort(np.argsort([np.arctan2(-row, column) % np.pi for row, column in _STEPS]))
    after, before = np.roll(angles, -1), np.roll(angles, 1)
    after[-1] += np.pi
    before[0] -= np.pi
    return ((after - before) / (2 * np.pi))[place]
