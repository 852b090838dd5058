"""The base colour of a mesh: scaled reflectance, extended beyond the mask.

Equation: k * reflectance, with k such that the 99.5th percentile of the reflectance's largest
channel becomes 0.9; the matching light is the recovered one divided by k, that is log shading - log
k. Beyond the mask the texture repeats the nearest colour inside, so that filtering causes no dark
fringe.

Limits: reflectances above 1 / k are clipped (at most 0.5 % of the pixels).
"""

import numpy as np

from ...filters.distance import distance_to, distances, nearest_pixels
from ...imaging.bounding_box import mask_slices
from ...imaging.channels import largest
from ...imaging.row_blocks import row_blocks

_BRIGHT = 0.9  # linear base colour of the 99.5th percentile of the reflectance
_FADING = 0.01  # of the object's longer side: widest dark border that may be a fading outline
_AS_BRIGHT = 0.8  # of the brightness inside


def base_color(reflectance: np.ndarray, mask: np.ndarray, bleed: int) -> tuple[np.ndarray, float]:
    """Return the texture and its scale.

    Parameters
    ----------
    reflectance : (H, W, 3) ndarray
    mask : (H, W) bool ndarray
    bleed : int
        Pixels by which it is extended beyond the mask; farther out it is the mean colour, so that
        the smallest mipmaps approach it.

    Returns
    -------
    color : (H, W, 3) ndarray
        k * reflectance, linear.
    k : float
    """
    inside = reflectance[mask]
    bright = float(np.percentile(largest(inside).astype(np.float64), 99.5))
    k = _BRIGHT / bright if bright > 0 else 1.0
    mean = inside.mean(0, dtype=np.float64)
    depth = _depth_near(mask, 2 * _widest_fading(mask) + 3)
    rings = dark_rings(reflectance, depth)
    inner = depth > rings
    near, source = nearest_inside(inner, bleed + rings)
    color = np.where(inner[..., None], reflectance, mean)
    color.reshape(-1, 3)[near] = reflectance.reshape(-1, 3)[source]
    color *= k
    return color, k


def _widest_fading(inside: np.ndarray) -> int:
    """Largest width in pixels of a border that may be the fading outline of an object."""
    return max(1, round(_FADING * max(inside[mask_slices(inside)].shape)))


def _depth_near(mask: np.ndarray, reach: int) -> np.ndarray:
    """The distance (H, W) of a mask's pixels from its outside, exact up to `reach` and larger
    beyond; 0 outside.
    """
    depth = np.full(mask.shape, np.inf, np.float32)
    for block in row_blocks(mask.shape, reach):
        near = mask[block.wide]
        if not near.all():
            depth[block.rows] = distance_to(~near)[block.own]
    return depth


def dark_rings(reflectance: np.ndarray, depth: np.ndarray) -> int:
    """Count the outermost rings of a mask that show black background rather than the object.

    A soft outline against black fades over several pixels, which a mask may include; on the sides
    of the mesh they would be stretched to a black band. A wider dark border is paint.

    Parameters
    ----------
    reflectance : (H, W, 3) ndarray
    depth : (H, W) ndarray
        Distance of the mask's pixels from its outside; 0 outside.

    Returns
    -------
    int
        Pixels; 0 if the border is as bright as the inside.
    """
    most = _widest_fading(depth > 0)

    def light(above: int, most: int) -> np.ndarray:
        between = (depth > above) & (depth <= most)
        return np.asarray(reflectance[between].mean(axis=-1, dtype=np.float64))

    within = light(most + 1, 2 * most + 2)
    if not within.size:
        return 0
    enough = _AS_BRIGHT * float(np.median(within))
    for rings in range(most + 1):
        if float(np.median(light(rings, rings + 1))) >= enough:
            return rings
    return 0


def nearest_inside(mask: np.ndarray, distance: int) -> tuple[np.ndarray, np.ndarray]:
    """Find the nearest mask pixel to each pixel around the mask.

    Parameters
    ----------
    mask : (H, W) bool ndarray
    distance : int
        Largest distance in pixels.

    Returns
    -------
    near : (N,) ndarray
        Flat indices of the pixels outside the mask within that distance.
    source : (N,) ndarray
        Flat index of the nearest pixel inside to each.
    """
    width, found = mask.shape[1], [np.zeros((2, 0), np.int64)]
    for block in row_blocks(mask.shape, distance):
        inside, first = mask[block.wide], block.wide.start
        if not inside.any():
            continue
        rows, columns = nearest_pixels(inside)
        near = ~inside & (distances(rows, columns) <= distance)
        near[: block.own.start] = near[block.own.stop :] = False
        row, column = np.nonzero(near)
        source = (rows[near].astype(np.int64) + first) * width + columns[near]
        found.append(np.stack([(row + first) * width + column, source]))
    near, source = np.concatenate(found, axis=1)
    return near, source
