"""Pictures of what a model finds, each with its name, as figures of labelled panels.

Limits: an image is shown in an exposure of its own unless a gain is given; the light is shown as a
white ball in it.
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
    "Height grows toward the viewer; normals are red to the right, green up, blue toward the viewer. Light and reflectance share their "
    "colour: blue light on grey paint and white light on blue paint give one photo, and any model may choose the wrong one."
)


@dataclass(frozen=True)
class Panel:
    """One picture. `values`: (H, W, 3) an image of linear light, or (H, W) numbers; `mask` (H, W)
    bool or None; `limits`: the ends of the numbers' colours; `gain`: of an image, None for one of
    its own; `bar`: whether the numbers have a bar of colours.
    """

    title: str
    values: np.ndarray
    mask: np.ndarray | None = None
    limits: tuple[float, float] | None = None
    gain: float | None = None
    bar: bool = True


def panel_figure(shown: Sequence[Panel], columns: int, *, width: float = WIDTH) -> Figure:
    """The panels, row by row, each cut to its mask's box."""
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
    """Normals (H, W, 3) in the usual colours."""
    return Panel(title, normal_colours(normal, mask), mask, gain=1.0)


def light_panel(title: str, illumination: np.ndarray) -> Panel:
    """A white ball under the light of coefficients (9, 3)."""
    return Panel(title, *light_ball(illumination))


def characteristic_panels(d: Decomposition) -> list[Panel]:
    """Everything that a decomposition holds: photo and layers in one exposure, the rest each in its
    own.
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
