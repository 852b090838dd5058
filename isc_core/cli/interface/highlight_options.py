"""Options that say what is a highlight: --highlight, --not-highlight."""

import argparse
from dataclasses import replace

import numpy as np

from ...photo.highlight_marks import HighlightMarks, Place
from ...photo.photo import Photo
from ...scene.decomposition import Decomposition
from .values import pixel

_NEAR = 0.02  # of the frame's longer side


def add_highlight_marks(group: argparse._ArgumentGroup) -> None:
    """Add --highlight and --not-highlight.

    Parameters
    ----------
    group : argparse._ArgumentGroup
        Changed in place.
    """
    for option, name, what in (
        ("--highlight", "highlights", "of a highlight, which is then taken off"),
        ("--not-highlight", "paint", "of what is no highlight, though it looks like one"),
    ):
        group.add_argument(
            option,
            type=pixel,
            action="append",
            default=[],
            dest=name,
            metavar="x,y",
            help=f"a pixel {what}; from the top left, can be repeated; for --model joint",
        )


def marks_of(options: argparse.Namespace) -> HighlightMarks:
    """Return the marks of a command line.

    Parameters
    ----------
    options : argparse.Namespace

    Returns
    -------
    HighlightMarks
        At the middles of the pixels.
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
    """Return notes on highlights that were marked, and are none to colour and form.

    Parameters
    ----------
    photo : Photo
        With its marks, at its own size.
    result : Decomposition

    Returns
    -------
    list of str
    """
    scale = result.mask.shape[1] / photo.mask.shape[1]
    return [
        f"no light was taken off at {int(x)},{int(y)}: neither colour nor form tells a highlight "
        "from the paint there"
        for x, y in photo.marks.highlights
        if not _near(result.specular, (scale * x, scale * y)).any()
    ]


def _near(layer: np.ndarray, place: Place) -> np.ndarray:
    reach = max(2, int(_NEAR * max(layer.shape[:2])))
    column, row = map(int, place)
    return layer[max(0, row - reach) : row + reach + 1, max(0, column - reach) : column + reach + 1]
