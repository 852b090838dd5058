"""Detection of soft rims (hair, fur, mist), as opposed to antialiased outlines.

Problem: any mask may have values between 0 and 1. Those of an outline give its position within a
pixel, and the object remains opaque. Only a rim without an outline needs transparency.

Rule: across a smooth outline at most w pixels are partly covered (.1 to .9): 3 by an alpha channel;
6, or 2.5 % of the object's length, by a mask, which `masking.refinement` may have feathered along
the colours of the photo. A rim is soft where at least .6 of the pixels of a window of 2 w + 1 are
partly covered, so that both strands and mist are detected. There must be at least as many such
pixels as the object is long, else nothing is soft. In each connected zone, at least a sixth of the
partly covered pixels must be covered by more than half: hair is attached to the object, whereas a
region beyond a step, such as a shadow in the alpha channel, is not part of it.

Citation: none; the rule is our own. On soft masks in general: J. Wang and M. F. Cohen, "Image and
video matting: a survey", Foundations and Trends in Computer Graphics and Vision 3 (2007),
doi:10.1561/0600000019.

Limits: a deliberately blurred mask is soft. A mask that was found automatically is an outline
feathered over a few pixels, and is never soft.
"""

import numpy as np

from ..filters.box import box_average
from ..filters.components import labelled
from ..filters.extrema import window_maximum
from ..imaging.bounding_box import mask_slices

_PARTLY = (0.1, 0.9)
_DENSE = 0.6  # share of partly covered pixels in a window
_ABOVE = 1 / 6  # share of those that are covered by more than half
_EDGE = 3  # w of an alpha channel, pixels
_FEATHER, _FEATHER_SHARE = 6, 0.025  # w of masks: pixels, and of the object's longer side


def soft_rim(share: np.ndarray, mask: np.ndarray, own: bool) -> np.ndarray | None:
    """Return the regions in which the rim of an object is soft.

    Parameters
    ----------
    share : (H, W) ndarray
        Coverage of each pixel.
    mask : (H, W) bool ndarray
        The object.
    own : bool
        Whether `share` is the alpha channel of the photo.

    Returns
    -------
    (H, W) bool ndarray or None
        Dilated by half a window; None without soft regions.
    """
    longest = max(mask[mask_slices(mask)].shape)
    window = 2 * _edge(longest, own) + 1
    partly = (share > _PARTLY[0]) & (share < _PARTLY[1])
    density = box_average(partly.astype(np.float32), window)
    dense = partly & (density >= _DENSE)
    if dense.sum() < longest:
        return None
    zone = window_maximum(dense, window + 2)
    labels, count = labelled(zone)
    found, above = (
        np.bincount(labels[kind], minlength=count + 1) for kind in (partly, partly & (share > 0.5))
    )
    zone &= (above >= _ABOVE * found)[labels]
    return np.asarray(zone) if zone.any() else None


def rim_reach(mask: np.ndarray, own: bool) -> int:
    """Return how far the soft rim may extend beyond pixels that are partly covered.

    Parameters
    ----------
    mask : (H, W) bool ndarray
        The object.
    own : bool
        As of `soft_rim`.

    Returns
    -------
    int
        Pixels; farther away, coverage of 0 has no effect on the rim.
    """
    return 2 * _edge(max(mask[mask_slices(mask)].shape), own) + 2


def _edge(longest: int, own: bool) -> int:
    """w, pixels."""
    return _EDGE if own else max(_FEATHER, round(_FEATHER_SHARE * longest))
