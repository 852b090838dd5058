"""Style of all figures: one letter size, colour-blind-safe colours, images in sRGB.

matplotlib's objects are used directly, without its global state, so that nothing has to be closed
or reset.

Citation: M. Okabe, K. Ito, "Color universal design" (2008) (the eight colours); the maps viridis
and cividis: J. R. Nuñez, C. R. Anderton, R. S. Renslow (2018), doi:10.1371/journal.pone.0199239.

Limits: values above 1 are shown as 1.
"""

from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from isc_core.imaging.srgb import linear_to_srgb

OKABE_ITO = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#F0E442")
WIDTH = 7.0  # inches
DPI = 110  # about as wide as pages are shown; all pictures together stay small
LETTERS = 8.0  # points
_BRIGHT = 0.9  # what all but the brightest hundredth of an image is shown below
_LABEL = 1.05  # inches left of a sheet, for the names of its rows
_LINE = 0.16  # inches that a line of letters takes
_LETTER = 0.062  # inches that a small letter takes, on the average
_BOLD = 1.15  # how much wider bold letters are
_GAP = 0.03  # inches between the rows of a sheet


def figure(
    rows: int,
    columns: int,
    *,
    width: float = WIDTH,
    height: float | None = None,
    sharex: bool = False,
    sharey: bool = False,
) -> tuple[Figure, np.ndarray]:
    """Create a figure with axes.

    Parameters
    ----------
    rows, columns : int
        Grid of the axes.
    width : float
        Inches.
    height : float, optional
        Inches; by default rows are three quarters as high as columns are wide.
    sharex, sharey : bool
        Share axes between columns and rows.

    Returns
    -------
    figure : Figure
        The figure.
    axes : (rows, columns) ndarray
        Its axes.
    """
    tall = height if height is not None else max(2.2, 0.75 * width * rows / columns)
    with matplotlib.rc_context(
        {"font.size": LETTERS, "axes.titlesize": LETTERS, "axes.linewidth": 0.6}
    ):
        made = Figure(figsize=(width, tall), dpi=DPI, layout="constrained")
        axes = made.subplots(rows, columns, squeeze=False, sharex=sharex, sharey=sharey)
    for each in axes.flat:
        each.set_prop_cycle(color=OKABE_ITO)
        each.tick_params(labelsize=LETTERS - 1, width=0.6)
        for side in ("top", "right"):
            each.spines[side].set_visible(False)
    return made, axes


def unify_titles(made: Figure) -> None:
    """Set all titles to the common letter size.

    Parameters
    ----------
    made : Figure
        Changed in place.
    """
    for axes in made.axes:
        axes.title.set_fontsize(LETTERS)


def table_figure(header: Sequence[str], rows: Sequence[Sequence[str]], caption: str = "") -> Figure:
    """Draw a table as a picture, for viewers without Markdown.

    Parameters
    ----------
    header : sequence of str
        Column names.
    rows : sequence of sequence of str
        Cells as shown.
    caption : str
        One line above the table.

    Returns
    -------
    Figure
        Columns as wide as their longest cell, every second row shaded.
    """
    columns = zip(header, *rows, strict=True)
    lengths = [max([round(_BOLD * len(head)), *map(len, cells)]) + 2 for head, *cells in columns]
    width, height = (
        max(4.0, _LETTER * sum(lengths)),
        _LINE * 1.15 * (len(rows) + 1) + (_LINE * 1.6 if caption else 0.05),
    )
    made = Figure(figsize=(width, height), dpi=DPI)
    axes = made.add_axes((0, 0, 1, (height - (_LINE * 1.5 if caption else 0)) / height))
    axes.set(xlim=(0, sum(lengths)), ylim=(len(rows) + 1, 0))
    axes.axis("off")
    for line, cells in enumerate([list(header), *rows]):
        if line % 2 == 0 and line:
            axes.axhspan(line, line + 1, color="0.94")
        for place, cell in zip(np.cumsum([1, *lengths[:-1]]), cells, strict=True):
            axes.text(
                place,
                line + 0.5,
                cell.replace("`", ""),
                fontsize=LETTERS - 1,
                va="center",
                weight="normal" if line else "bold",
                parse_math=False,
            )
    axes.axhline(1, color="0", linewidth=0.6)
    if caption:
        made.text(
            0.01,
            1 - _LINE * 0.75 / height,
            caption.replace("`", ""),
            fontsize=LETTERS,
            va="center",
            parse_math=False,
        )
    return made


def legend(axes: Axes, where: str = "best", columns: int = 1) -> None:
    """Add a legend of the labelled artists.

    Parameters
    ----------
    axes : Axes
        The axes.
    where : str
        Location, as in matplotlib.
    columns : int
        Number of columns.
    """
    axes.legend(fontsize=LETTERS - 1, frameon=False, loc=where, ncols=columns)


def show(
    axes: Axes, image_linear: np.ndarray, title: str = "", mask: np.ndarray | None = None
) -> None:
    """Draw a linear image in sRGB, without ticks.

    Parameters
    ----------
    axes : Axes
        The axes.
    image_linear : (H, W, 3) or (H, W) ndarray
        Linear image; two dimensions are shown as grey.
    title : str
        Title.
    mask : (H, W) ndarray, optional
        Pixels outside are white.
    """
    image = np.asarray(image_linear, float)
    image = np.repeat(image[..., None], 3, -1) if image.ndim == 2 else image
    # Rounded here: matplotlib cuts off, which leaves white a shade darker than the paper around it.
    coded = np.round(255 * linear_to_srgb(np.clip(np.nan_to_num(image), 0, 1))).astype(np.uint8)
    axes.imshow(
        coded if mask is None else np.where(mask[..., None], coded, np.uint8(255)),
        interpolation="antialiased",
    )
    _bare(axes, title)


def show_map(
    axes: Axes,
    values: np.ndarray,
    title: str = "",
    mask: np.ndarray | None = None,
    *,
    limits: tuple[float, float] | None = None,
    colours: str = "viridis",
    label: str = "",
) -> None:
    """Draw a map of numbers in colours.

    Parameters
    ----------
    axes : Axes
        The axes.
    values : (H, W) ndarray
        The map.
    title : str
        Title.
    mask : (H, W) ndarray, optional
        Pixels outside are white.
    limits : (float, float), optional
        Values at the ends of the colour scale.
    colours : str
        "viridis" or "cividis".
    label : str
        Label of a colour bar; empty draws none.
    """
    shown = np.ma.masked_invalid(values if mask is None else np.where(mask, values, np.nan))
    low, high = limits if limits is not None else (None, None)
    picture = axes.imshow(shown, cmap=colours, vmin=low, vmax=high, interpolation="nearest")
    _bare(axes, title)
    if label:
        bar = axes.figure.colorbar(picture, ax=axes, shrink=0.8)
        bar.set_label(label, fontsize=LETTERS - 1)
        bar.ax.tick_params(labelsize=LETTERS - 1)


def normal_colours(normal: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Convert normals to a linear image that `show` draws as (n + 1) / 2.

    Parameters
    ----------
    normal : (H, W, 3) ndarray
        Unit normals, camera frame.
    mask : (H, W) ndarray
        Pixels outside are white.

    Returns
    -------
    (H, W, 3) ndarray
        Linear image.
    """
    coded = np.where(mask[..., None], (np.asarray(normal, float) + 1) / 2, 1.0)
    return np.where(
        coded <= 0.04045, coded / 12.92, ((np.maximum(coded, 0) + 0.055) / 1.055) ** 2.4
    )


def exposure(image_linear: np.ndarray, mask: np.ndarray | None = None) -> float:
    """Compute the gain that keeps all but the brightest 1 % of an image below 0.9.

    Parameters
    ----------
    image_linear : (H, W, 3) or (H, W) ndarray
        Linear image.
    mask : (H, W) ndarray, optional
        Pixels to consider.

    Returns
    -------
    float
        The gain; 1 for a black image.
    """
    inside = (
        image_linear[mask]
        if mask is not None
        else image_linear.reshape(-1, *image_linear.shape[2:])
    )
    peak = (
        float(np.quantile(inside.max(-1) if inside.ndim > 1 else inside, 0.99))
        if inside.size
        else 0.0
    )
    return _BRIGHT / peak if peak > 0 else 1.0


def image_sheet(
    columns: Sequence[str],
    rows: Sequence[tuple[str, Sequence[np.ndarray | None]]],
    *,
    width: float = WIDTH,
    expose: bool | Sequence[bool] = True,
) -> Figure:
    """Draw a labelled contact sheet.

    Parameters
    ----------
    columns : sequence of str
        Column titles.
    rows : sequence of (str, sequence of ndarray or None)
        Row label and linear images, (H, W, 3) or (H, W); None leaves a cell empty.
    width : float
        Inches.
    expose : bool or sequence of bool
        Whether a row's images share the exposure of its first one; one value, or one per column.

    Returns
    -------
    Figure
        The sheet.
    """
    exposed = [expose] * len(columns) if isinstance(expose, bool) else list(expose)
    cell = (width - _LABEL) / len(columns)
    heights = [
        max([image.shape[0] / image.shape[1] for image in images if image is not None] or [1.0])
        * cell
        for _, images in rows
    ]
    made, axes = figure(
        len(rows), len(columns), width=width, height=sum(heights) + _LINE * 1.5 + _GAP * len(rows)
    )
    made.set_layout_engine(
        "constrained",
        w_pad=_GAP / 2,
        h_pad=_GAP / 2,
        wspace=0.0,
        hspace=0.0,
        rect=(0.01, 0, 0.99, 1),
    )
    grid = axes[0, 0].get_gridspec()
    grid.set_height_ratios(heights)
    for line, (name, images) in enumerate(rows):
        first = next(
            (
                image
                for image, brighten in zip(images, exposed, strict=True)
                if image is not None and brighten
            ),
            None,
        )
        gain = 1.0 if first is None else exposure(first)
        for column, image in enumerate(images):
            place = axes[line, column]
            if image is not None:
                show(place, image * gain if exposed[column] else image)
            else:
                place.set_aspect(heights[line] / cell)
            _bare(place, columns[column] if line == 0 else "")
        axes[line, 0].set_ylabel(name, rotation=0, ha="right", va="center", labelpad=4)
    return made


def _bare(axes: Axes, title: str) -> None:
    axes.set_xticks([])
    axes.set_yticks([])
    for side in axes.spines.values():
        side.set_visible(False)
    if title:
        axes.set_title(title, fontsize=LETTERS)
