"""The names of transfer curves, and suffixes of photo files; without imports, so that the command
line starts fast.
"""

TRANSFERS = ("auto", "srgb", "linear")

# Suffixes of photos when a folder is listed; the format of a file is detected from its content.
_OF_CAMERAS = ".dng .cr2 .cr3 .nef .nrw .arw .orf .rw2 .raf .pef .srw"
UNUSUAL_SUFFIXES = (".heic", ".heif", ".hif", ".avif", *_OF_CAMERAS.split())
"""Suffixes of photos that few programs open; Blender does not."""
PHOTO_SUFFIXES = (
    *(".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".ppm", ".pgm", ".exr", ".hdr"),
    *UNUSUAL_SUFFIXES,
)
