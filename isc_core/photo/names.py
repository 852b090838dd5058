"""The names of the transfer curves, and of photo files; without imports, for a command line that
starts fast.
"""

TRANSFERS = ("auto", "srgb", "linear")

# Suffixes by which folders are listed; files are recognised by their content.
_OF_CAMERAS = ".dng .cr2 .cr3 .nef .nrw .arw .orf .rw2 .raf .pef .srw"
UNUSUAL_SUFFIXES = (".heic", ".heif", ".hif", ".avif", *_OF_CAMERAS.split())
"""Suffixes of photos that few programs open, Blender among those that do not."""
PHOTO_SUFFIXES = (
    *(".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".ppm", ".pgm", ".exr", ".hdr"),
    *UNUSUAL_SUFFIXES,
)
