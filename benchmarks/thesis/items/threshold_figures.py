"""Figures 3.5 to 3.8 and 4.1 to 4.9: mutation rate, chaotic numbers, nine thresholded images.

Citation: those of `isc_core.thresholding.clonal_selection` and
`isc_core.thresholding.logistic_map`.

Limits: the images are scikit-image's, since the thesis' own nine are not freely packaged; their
order is this project's.
"""

from functools import partial

import numpy as np

from isc_core.imaging.srgb import srgb_to_linear
from isc_core.thresholding import exact
from isc_core.thresholding.clonal_selection import mutation_rate
from isc_core.thresholding.logistic_map import (
    ChaoticNumbers,
    bifurcation,
    density,
    orbit,
    uniformised,
)

from ...separation.thresholding import COUNTS, IMAGES, levels
from ..drawing.style import OKABE_ITO, figure, legend, show
from ..measuring.context import Context
from ..measuring.threshold_runs import image_objective, threshold_runs
from ..report.item import Cell, ItemContent, ItemTable, ThesisItem

_DECAYS = (2.0, 3.0, 4.0, 5.0)
_NUMBERS = 100_000
_LEVELS = 256
_LINES = ("-", "--", "-.", ":")


def mutation(context: Context) -> ItemContent:
    """Make figure 3.5.

    Parameters
    ----------
    context : Context
        Ignored.

    Returns
    -------
    ItemContent
        The mutation rate over the affinity.
    """
    del context
    affinity = np.linspace(0, 1, 201)
    made, axes = figure(1, 1, width=4.5, height=3.0)
    for decay, line in zip(_DECAYS, _LINES, strict=True):
        axes[0, 0].plot(
            affinity, mutation_rate(affinity, decay), line, label=rf"$\rho$ = {decay:g}"
        )
    axes[0, 0].set(
        xlabel="affinity f", ylabel=r"mutation rate $e^{-\rho f}$", xlim=(0, 1), ylim=(0, 1)
    )
    legend(axes[0, 0])
    at = np.linspace(0, 1, 5)
    rates = [mutation_rate(at, decay).tolist() for decay in _DECAYS]
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (float(f), *row) for f, row in zip(at, zip(*rates, strict=True), strict=True)
    )
    table = ItemTable(
        ("affinity", *(f"rho = {decay:g}" for decay in _DECAYS)),
        rows,
        "The mutation rate exp(-rho f).",
    )
    return ItemContent(
        (table,),
        (made,),
        "The better an antibody, the smaller the mutations of its clones. The searches "
        "here use rho = 5.",
    )


def branching(context: Context) -> ItemContent:
    """Make figure 3.6.

    Parameters
    ----------
    context : Context
        The run.

    Returns
    -------
    ItemContent
        The bifurcation diagram of the logistic map.
    """
    rates = np.linspace(2.8, 4, 400 if context.quick else 1400)
    ends = bifurcation(rates)
    made, axes = figure(1, 1, height=3.6)
    places = np.broadcast_to(rates, ends.shape).ravel()
    axes[0, 0].plot(places, ends.ravel(), ",", color=OKABE_ITO[0], alpha=0.25, rasterized=True)
    axes[0, 0].set(xlabel="r", ylabel="limit set of the map", xlim=(2.8, 4), ylim=(0, 1))
    known = (
        (2.9, "a fixed point"),
        (3.2, "period 2"),
        (3.5, "period 4"),
        (3.83, "period 3"),
        (4.0, "chaos on [0, 1]"),
    )
    rows = tuple(
        (rate, what, _distinct(bifurcation(np.array([rate]))[:, 0])) for rate, what in known
    )
    table = ItemTable(
        ("r", "what is known", "distinct values of 200"),
        rows,
        "The logistic map x <- r x (1 - x) at some rates.",
    )
    return ItemContent(
        (table,),
        (made,),
        "Only at r = 4 does the orbit fill the whole interval: chaotic numbers are drawn there.",
    )


def distribution(context: Context) -> ItemContent:
    """Make figure 3.7.

    Parameters
    ----------
    context : Context
        The run.

    Returns
    -------
    ItemContent
        The distribution of an orbit of the logistic map.
    """
    values = orbit(_start(context), _NUMBERS)
    edges = np.linspace(0, 1, 51)
    made, axes = figure(1, 1, width=4.5, height=3.0)
    axes[0, 0].stairs(
        np.histogram(values, edges, density=True)[0],
        edges,
        fill=True,
        color=OKABE_ITO[5],
        label=f"orbit of {_NUMBERS:,} values",
    )
    inner = np.linspace(0.002, 0.998, 500)
    axes[0, 0].plot(inner, density(inner), color=OKABE_ITO[1], label=r"$1\,/\,(\pi\sqrt{x(1-x)})$")
    axes[0, 0].set(xlabel="x", ylabel="density", xlim=(0, 1), ylim=(0, 6))
    legend(axes[0, 0], "upper center")
    law = 2 / np.pi * np.arcsin(np.sqrt(edges))
    counted = np.histogram(values, edges)[0] / _NUMBERS
    ends = float(counted[[0, 1, 2, -3, -2, -1]].sum())
    rows = (
        ("mean", float(values.mean()), 0.5),
        ("variance", float(values.var()), 0.125),
        ("within .06 of an end", ends, float(2 * law[3])),
        ("largest error of a bin's share", float(np.abs(counted - np.diff(law)).max()), 0.0),
    )
    table = ItemTable(
        ("of the orbit", "measured", "theory"),
        rows,
        "The orbit at r = 4 and its theoretical distribution.",
    )
    return ItemContent(
        (table,),
        (made,),
        "An orbit stays near the ends of the interval: by itself, it is far from uniform.",
    )


def generators(context: Context) -> ItemContent:
    """Make figure 3.8.

    Parameters
    ----------
    context : Context
        The run.

    Returns
    -------
    ItemContent
        Distribution and consecutive values of random number generators.
    """
    values = uniformised(orbit(_start(context), _NUMBERS))
    sources = (
        ("one orbit, transformed to uniform", values),
        ("many orbits, every eighth value", ChaoticNumbers(context.seed).uniform((_NUMBERS,))),
        ("pseudo-random (PCG64)", np.random.default_rng(context.seed).random(_NUMBERS)),
    )
    edges = np.linspace(0, 1, 51)
    made, axes = figure(2, 3, height=4.4, sharex=True)
    rows = []
    for column, (name, numbers) in enumerate(sources):
        shares = np.histogram(numbers, edges, density=True)[0]
        axes[0, column].stairs(shares, edges, fill=True, color=OKABE_ITO[column])
        axes[0, column].set(title=name, ylim=(0, 1.3))
        axes[1, column].plot(
            numbers[:4000],
            numbers[1:4001],
            ".",
            markersize=1,
            color=OKABE_ITO[column],
            rasterized=True,
        )
        axes[1, column].set(xlabel="u", xlim=(0, 1), ylim=(0, 1))
        expected = _NUMBERS / 50
        chi = float(np.square(np.histogram(numbers, edges)[0] - expected).sum() / expected)
        joint = np.histogram2d(numbers[:-1], numbers[1:], bins=10)[0]
        rows.append(
            (
                name,
                chi,
                float(np.corrcoef(numbers[:-1], numbers[1:])[0, 1]),
                int((joint == 0).sum()),
            )
        )
    axes[0, 0].set_ylabel("density")
    axes[1, 0].set_ylabel("next u")
    header = (
        "numbers",
        "chi square of 50 bins (49 expected)",
        "correlation with the next",
        "empty cells of 10 x 10 pairs",
    )
    text = (
        "All three are close to uniform. Bottom: each number and the next. In one "
        "orbit, each is a function of the previous one, which correlation does not "
        "detect but pairs do. With many orbits and every eighth value, this dependence "
        "vanishes."
    )
    return ItemContent(
        (ItemTable(header, tuple(rows), f"{_NUMBERS:,} numbers of each source."),), (made,), text
    )


def thresholded(context: Context, name: str) -> ItemContent:
    """Make one of figures 4.1 to 4.9.

    Parameters
    ----------
    context : Context
        The run.
    name : str
        Name of the image.

    Returns
    -------
    ItemContent
        The image, its histogram and its thresholds.
    """
    image, of = levels(name), image_objective(name)
    made, axes = figure(2, 1 + len(COUNTS), height=4.1)
    show(axes[0, 0], srgb_to_linear(image / 255), name)
    shares = 100 * of.counts / of.counts.sum()
    top = 1.25 * float(np.quantile(shares, 0.99))
    axes[1, 0].set(title="histogram", ylabel="pixels, %")
    rows = []
    for column, count in enumerate(COUNTS, 1):
        found = exact(of, count).thresholds
        searched = threshold_runs(context, "CS", name, count).thresholds[0]
        show(axes[0, column], srgb_to_linear(_classes(image, found) / 255), f"{count} thresholds")
        for number, level in enumerate(found):
            axes[1, column].axvline(
                level, color=OKABE_ITO[1], linewidth=0.9, label="exact" if number == 0 else None
            )
        axes[1, column].plot(
            searched,
            np.full(count, top * 0.94),
            "v",
            color=OKABE_ITO[0],
            markersize=4,
            label="CS, one run",
        )
        rows.append(
            (
                count,
                " ".join(map(str, found)),
                " ".join(map(str, searched)),
                float(exact(of, count).value),
            )
        )
    for place in axes[1]:
        # Not snapped to pixels: bars narrower than one would come and go from panel to panel.
        place.stairs(shares, np.arange(_LEVELS + 1) - 0.5, fill=True, color="0.6", snap=False)
        place.set(xlim=(0, 255), ylim=(0, top), xlabel="level", xticks=(0, 128, 255))
    made.legend(
        *axes[1, 1].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=2,
        frameon=False,
        fontsize=7,
    )
    header = ("K", "exact thresholds", "CS, first run", "objective")
    high = [f"{level} ({share:.1f} %)" for level, share in enumerate(shares) if share > top]
    cut = f" Clipped bars of the histogram: level {', '.join(high)}." if high else ""
    text = f"Each class is shown at its mean level.{cut}"
    return ItemContent((ItemTable(header, tuple(rows), f"Thresholds of {name}."),), (made,), text)


def _classes(image: np.ndarray, thresholds: np.ndarray) -> np.ndarray:
    """Set every pixel (H, W) to the mean level of its class."""
    labels = np.searchsorted(thresholds, image, side="left")
    sums, counts = (
        np.bincount(labels.ravel(), weights, len(thresholds) + 1)
        for weights in (image.ravel().astype(float), None)
    )
    return (sums / np.maximum(counts, 1))[labels]


def _distinct(values: np.ndarray) -> int:
    return len(np.unique(np.round(values, 6)))


def _start(context: Context) -> float:
    """Return the first value of the orbit: varies with the seed, never degenerate."""
    return 0.1 + 0.8 * ((0.0293 + context.seed * 0.6180339887) % 1)


ITEMS: tuple[ThesisItem, ...] = (
    ThesisItem("figure", "3.5", "The mutation rate by affinity", mutation),
    ThesisItem("figure", "3.6", "Bifurcation of the logistic map", branching),
    ThesisItem("figure", "3.7", "Distribution of the logistic map's values", distribution),
    ThesisItem(
        "figure",
        "3.8",
        "Histogram of chaotic numbers compared with a pseudo-random generator",
        generators,
    ),
    *(
        ThesisItem(
            "figure",
            f"4.{number}",
            f"Histogram, thresholds and thresholded images of {name}",
            partial(thresholded, name=name),
        )
        for number, name in enumerate(IMAGES, 1)
    ),
)
