"""A safeguard: whether the object is saturated enough to distinguish highlights from reflectance.

Problem: white or pale reflectance beside a coloured one looks like a highlight to a method that
uses colour alone; on such objects methods do far more harm than all their highlights are worth.

Equation: the saturation sum(max I - min I) / sum(max I) over the object is near 1 for strong
colours and near 0 for grey; it does not depend on the exposure. Below a low value nothing is
removed, above a high one everything found, and in between a share that rises smoothly, so that no
small change of the photo flips the result.

Limits: nothing is detected here: highlights on grey objects remain, too. One number stands for the
whole object, so that white reflectance that covers little of it passes; and its two values were
chosen on a dozen objects.
"""

import numpy as np

from ...imaging.channels import saturation
from .highlight_cues import ramp

# Measured on objects with and without visible highlights: .11-.46 where removal by colour was
# harmful, .54-.74 where it helped.
_GREY, _COLOURED = 0.45, 0.55


def saturation_gate(image: np.ndarray, usable: np.ndarray) -> float:
    """Return the share of a highlight found by colour that may be removed.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    usable : (H, W) bool ndarray
        Pixels to decide by.

    Returns
    -------
    float
        In [0, 1]; 0 for no pixels.
    """
    return float(ramp(saturation(image[usable]), (_GREY, _COLOURED)))
