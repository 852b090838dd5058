"""Axes of a fixed size in a PNG file, drawn with Matplotlib."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

COLOURS = ("#1b6ca8", "#d1495b", "#2e8b57", "#e09f3e", "#6a4c93")
_INCHES, _DOTS_PER_INCH = (6.4, 4.0), 100


@dataclass(frozen=True)
class AxesOptions:
    """Labels and ranges of a pair of axes.

    Attributes
    ----------
    title : str
        Above the axes.
    x_label, y_label : str
        Beside the axes.
    x_range, y_range : tuple of float
        Lower and upper limit.
    """

    title: str
    x_label: str
    y_label: str
    x_range: tuple[float, float]
    y_range: tuple[float, float]


@contextmanager
def png_axes(path: Path, options: AxesOptions) -> Iterator[Axes]:
    """Open a pair of axes and write it when the block ends.

    Parameters
    ----------
    path : Path
        The PNG file.
    options : AxesOptions
        Labels and ranges.

    Yields
    ------
    matplotlib.axes.Axes
        To draw into. Labelled artists appear in a legend.
    """
    figure = Figure(_INCHES, dpi=_DOTS_PER_INCH, layout="constrained")
    axes = figure.add_subplot()
    axes.set(
        title=options.title,
        xlabel=options.x_label,
        ylabel=options.y_label,
        xlim=options.x_range,
        ylim=options.y_range,
    )
    axes.grid(color="#e4e4e4")
    axes.set_axisbelow(True)
    yield axes
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="upper right")
    figure.savefig(path)
