"""The names of transfer curves, the choice of the whole frame, and suffixes of photo files; without
slow imports, so that the command line starts fast.
"""

from enum import Enum, auto

TRANSFERS = ("auto", "srgb", "linear")


class WholeFrame(Enum):
    """Whether all pixels of a photo are used where no mask is given.

    Attributes
    ----------
    NEVER
        A photo without an object is refused.
    WITHOUT_MASK
        Where it has no alpha channel and no black border, and the mask finder, if any, finds no
        object.
    ALWAYS
        Whatever the photo shows.
    """

    NEVER = auto()
    WITHOUT_MASK = auto()
    ALWAYS = auto()


# Suffixes of photos when a folder is listed; the format of a file is detected from its content.
_OF_CAMERAS = ".dng .cr2 .cr3 .nef .nrw .arw .orf .rw2 .raf .pef .srw"
UNUSUAL_SUFFIXES = (".heic", ".heif", ".hif", ".avif", *_OF_CAMERAS.split())
"""Suffixes of photos that few programs open; Blender does not."""
PHOTO_SUFFIXES = (
    *(".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".ppm", ".pgm", ".exr", ".hdr"),
    *UNUSUAL_SUFFIXES,
)
