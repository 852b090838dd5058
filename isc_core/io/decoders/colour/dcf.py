"""Adobe RGB in files of cameras: marked in EXIF, without a profile.

Citation: CIPA DC-009-2010, "Design rule for Camera File system: DCF version 2.0": a file of the
optional colour space has the interoperability index "R03"; Adobe Systems, "Adobe RGB (1998) Color
Image Encoding" (2005).
"""

import struct

import numpy as np
from PIL import Image

from .space import ColourSpace, PowerCurve, colorants_of

_INTEROPERABILITY, _INDEX = 0xA005, 1
_ADOBE_RGB = ((0.64, 0.33), (0.21, 0.71), (0.15, 0.06), (0.3127, 0.3290))


def space_of_exif(image: Image.Image) -> ColourSpace | None:
    """Return Adobe RGB if a camera marked the picture so.

    Parameters
    ----------
    image : PIL.Image.Image

    Returns
    -------
    ColourSpace or None
        None without the mark, or with unreadable metadata.
    """
    try:
        marked = str(image.getexif().get_ifd(_INTEROPERABILITY).get(_INDEX)).startswith("R03")
    except (OSError, SyntaxError, ValueError, TypeError, KeyError, struct.error):
        return None
    if not marked:
        return None
    colorants = colorants_of(np.array(_ADOBE_RGB))
    return ColourSpace("Adobe RGB (1998)", (PowerCurve(563 / 256),), colorants)
