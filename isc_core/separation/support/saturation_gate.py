"""Whether a photo's colours can tell highlights from paint at all.

Problem: white or pale paint beside coloured paint looks like a highlight to whoever judges by
colour alone; on such objects methods do far more harm than all their highlights are worth.
Equation: the colourfulness sum(max I - min I) / sum(max I) over the object lies near 1 for strong
paints and near 0 for grey ones; it does not depend on the exposure. Below a low value nothing is
removed, above a high one all that was found, and in between a share that rises smoothly, so that no
small change of the photo flips the result.

Limits: this is a guard and finds nothing: highlights on grey objects stay too. One number stands
for the whole object, so that white paint that covers little of it passes; and its two values were
chosen on a dozen objects.
"""

import numpy as np

from ...imaging.channels import saturation
from .highlight_cues import ramp

# Measured on objects with and without visible highlights: .11-.46 where removal by colour did harm,
# .54-.74 where it helped.
_GREY, _COLOURED = 0.45, 0.55


def saturation_gate(image: np.ndarray, usable: np.ndarray) -> float:
    """The share, in [0, 1], of a highlight found by colour that may be removed from `image` (H, W,
    3).

    `usable` (H, W) bool: the pixels to judge by. 0 where there are none.
    """
    return float(ramp(saturation(image[usable]), (_GREY, _COLOURED)))
