"""Why a mask that was found is not used.

Problem: a wrong mask spoils everything that follows.

Equation: without hints, a mask is used if its confidence (`confidence`) is at least
`MIN_CONFIDENCE`, and if it has no second component of at least .3 of the area of the largest. With
hints, the user decides, and a mask is used at any confidence.

Limits: the thresholds were chosen on composites, see docs/methods/automatic_mask.md. Objects that
touch are found as one, and used as one.
"""

from ..networks.mask_network import Count
from ..photo.found_mask import FoundMask
from ..photo.masks import MIN_MASK_PIXELS
from .components import shows_several
from .hints import Hints

MIN_CONFIDENCE = 0.4  # of a mask that is used without hints
REMEDY = (
    "mark the object with --box x,y,width,height or --point x,y, or make a mask by hand and "
    "give it with --mask"
)


def refusal_reason(
    found: FoundMask, hints: Hints | None = None, minimum: float = MIN_CONFIDENCE
) -> str:
    """Return why a mask is refused.

    Parameters
    ----------
    found : FoundMask
    hints : Hints, optional
        With hints, the confidence is not checked.
    minimum : float, optional
        Minimum confidence of a mask that is used.

    Returns
    -------
    str
        What is wrong and what to do; "" if the mask is used.
    """
    enough = int(found.mask.sum()) >= MIN_MASK_PIXELS
    if hints:
        return "" if enough else "no object found there: put --point on it, or --box around it"
    several = enough and shows_several(found.mask)
    if enough and found.confidence >= minimum and not several:
        return ""
    kind = Count(int(found.counts.argmax()))
    if several or kind == Count.SEVERAL:
        return f"it seems to show several objects: {REMEDY}; --each processes each of them"
    if kind == Count.NONE or not enough:
        return f"no distinct object found: {REMEDY}"
    return f"its mask is uncertain (confidence {found.confidence:.0%}): {REMEDY}"
