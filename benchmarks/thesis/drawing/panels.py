"""Figures of labelled panels: images, maps and lights of a decomposition.

Limits: an image has its own exposure unless a gain is given; a light is shown on a white ball.
"""

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from isc_core.imaging.bounding_box import mask_slices
from isc_core.scene.decomposition import Decomposition

from .image_maps import light_ball
from .style import LETTERS, WIDTH, exposure, figure, normal_colours, show, show_map

_LINE = 0.16  # inches of a line of letters
_LETTERS_AN_INCH = 15  # that fit above a panel
COLOURS = (
    "Height increases toward the viewer. Normals: red to the right, green up, blue "
    "toward the viewer. Light and reflectance share their colour: blue light on a "
    "grey surface and white light on a blue surface give the same photo, and any "
    "model may choose the wrong one."
)


@dataclass(frozen=True, eq=False)
class Panel:
    """One labelled picture.

    Attributes
    ----------
    title : str
        Title.
    values : (H, W, 3) or (H, W) ndarray
        Linear image, or map of numbers.
    mask : (H, W) ndarray or None
        Pixels outside are white.
    limits : (float, float) or None
        Values at the ends of the colour scale of a map.
    gain : float or None
        Exposure of an image; None computes one.
    bar : bool
        Whether a map has a colour bar.
    """

    title: str
    values: np.ndarray
    mask: np.ndarray | None = None
    limits: tuple[float, float] | None = None
    gain: float | None = None
    bar: bool = True


def panel_figure(shown: Sequence[Panel], columns: int, *, width: float = WIDTH) -> Figure:
    """Draw panels row by row, each cropped to its mask.

    Parameters
    ----------
    shown : sequence of Panel
        The panels.
    columns : int
        Panels per row.
    width : float
        Inches.

    Returns
    -------
    Figure
        The figure.
    """
    rows = -(-len(shown) // columns)
    cut = [_cut(panel) for panel in shown]
    cell = width / columns
    titles = [
        "\n".join(textwrap.wrap(panel.title, int(cell * _LETTERS_AN_INCH))) for panel in shown
    ]
    heights = []
    for row in range(rows):
        part = slice(columns * row, columns * (row + 1))
        pictures = max(panel.values.shape[0] / panel.values.shape[1] for panel in cut[part]) * cell
        bars = 2.2 if any(panel.values.ndim == 2 and panel.bar for panel in cut[part]) else 0.4
        heights.append(
            pictures + _LINE * (1 + bars + max(title.count("\n") for title in titles[part]))
        )
    made, axes = figure(rows, columns, width=width, height=sum(heights))
    axes[0, 0].get_gridspec().set_height_ratios(heights)
    for place, panel, title in zip(axes.flat, cut, titles, strict=False):
        _draw(place, panel, title)
    for place in axes.flat[len(cut) :]:
        place.set_axis_off()
    return made


def _draw(place: Axes, panel: Panel, title: str) -> None:
    place.set_anchor("N")
    if panel.values.ndim == 3:
        gain = exposure(panel.values, panel.mask) if panel.gain is None else panel.gain
        show(place, panel.values * gain, title, panel.mask)
        return
    show_map(place, panel.values, title, panel.mask, limits=panel.limits)
    if not panel.bar:
        return
    # Below the picture, where it takes none of the width that the pictures beside it have.
    bar = place.figure.colorbar(
        place.images[-1], cax=place.inset_axes((0.1, -0.1, 0.8, 0.04)), orientation="horizontal"
    )
    bar.ax.tick_params(labelsize=LETTERS - 1, width=0.6, length=2, pad=1)
    bar.ax.locator_params(nbins=3)
    bar.outline.set_linewidth(0.6)


def _cut(panel: Panel) -> Panel:
    if panel.mask is None:
        return panel
    box = mask_slices(panel.mask)
    return Panel(
        panel.title, panel.values[box], panel.mask[box], panel.limits, panel.gain, panel.bar
    )


def normals_panel(title: str, normal: np.ndarray, mask: np.ndarray) -> Panel:
    """Create a panel of normals, coloured as (n + 1) / 2.

    Parameters
    ----------
    title : str
        Text above the panel.
    normal : (H, W, 3) ndarray
        Unit normals in the camera frame.
    mask : (H, W) ndarray
        Pixels outside are white.

    Returns
    -------
    Panel
    """
    return Panel(title, normal_colours(normal, mask), mask, gain=1.0)


def light_panel(title: str, illumination: np.ndarray) -> Panel:
    """Create a panel of a white ball under a light.

    Parameters
    ----------
    title : str
        Text above the panel.
    illumination : (9, 3) ndarray
        SH coefficients of log shading.

    Returns
    -------
    Panel
    """
    return Panel(title, *light_ball(illumination))


def characteristic_panels(d: Decomposition) -> list[Panel]:
    """Create a panel for each map of a decomposition.

    Parameters
    ----------
    d : Decomposition
        The decomposition.

    Returns
    -------
    list of Panel
        Photo and layers share an exposure; every other panel has its own.
    """
    gain = exposure(d.image, d.mask)
    return [
        Panel("photo", d.image, d.mask, gain=gain),
        Panel("diffuse", d.diffuse, d.mask, gain=gain),
        Panel("specular", d.specular, d.mask, gain=gain),
        Panel("reflectance", d.reflectance, d.mask),
        Panel("height (pixels)", d.height, d.mask),
        normals_panel("normals", d.normal, d.mask),
        light_panel("light, on a white ball", d.illumination),
        Panel("shading", d.shading, d.mask),
    ]
