"""Options that mark highlights: --highlight, --not-highlight."""

import argparse
from dataclasses import replace

import numpy as np

from ...photo.highlight_marks import HighlightMarks, Place, mark_radius
from ...photo.photo import Photo
from ...scene.decomposition import Decomposition
from .options import add_pixels


def add_highlight_marks(group: argparse._ArgumentGroup) -> None:
    """Add --highlight and --not-highlight.

    Parameters
    ----------
    group : argparse._ArgumentGroup
        Changed in place.
    """
    add_pixels(group, "--highlight", "highlights", "a highlight to remove (--model joint)")
    add_pixels(
        group,
        "--not-highlight",
        "paint",
        "print or paint that looks like a highlight (--model joint)",
    )


def marks_of(options: argparse.Namespace) -> HighlightMarks:
    """Return the marks of a command line.

    Parameters
    ----------
    options : argparse.Namespace

    Returns
    -------
    HighlightMarks
        At the centres of the pixels.
    """
    highlights, paint = (
        tuple((x + 0.5, y + 0.5) for x, y in places)
        for places in (options.highlights, options.paint)
    )
    return HighlightMarks(highlights, paint)


def with_marks(photo: Photo, options: argparse.Namespace) -> Photo:
    """Return a photo with the marks of a command line.

    Parameters
    ----------
    photo : Photo
    options : argparse.Namespace

    Returns
    -------
    Photo
    """
    return replace(photo, marks=marks_of(options))


def mark_notes(photo: Photo, result: Decomposition) -> list[str]:
    """Return notes on marked highlights at which no specular light was found.

    Parameters
    ----------
    photo : Photo
        With its marks, at full size.
    result : Decomposition

    Returns
    -------
    list of str
    """
    scale = result.mask.shape[1] / photo.mask.shape[1]
    reach = mark_radius(result.mask)
    return [
        f"no highlight was removed at {int(x)},{int(y)}: neither colour nor shape distinguishes it "
        "from paint"
        for x, y in photo.marks.highlights
        if not _shines_near(result.specular, (scale * x, scale * y), reach)
    ]


def _shines_near(specular: np.ndarray, place: Place, reach: float) -> bool:
    rows, columns = np.nonzero(specular.any(axis=2))
    return bool((np.hypot(columns + 0.5 - place[0], rows + 0.5 - place[1]) <= reach).any())
