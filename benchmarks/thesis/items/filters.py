"""Figure 3.12: histograms of filter outputs on diffuse and specular layers, and their significance.

Equation: with h_s,f and g_s,f the histograms of filter f on the specular and the diffuse layer of
subject s, and h_f, g_f their means over the subjects, the distance is the total variation
1/2 sum |h_f - g_f|, in [0, 1]. If layers did not matter, h_s and g_s could be exchanged in all
subjects that show the same object: p is the share of all exchanges (at most 4096 random ones) with
no smaller distance. Neighbouring pixels are correlated, so that tests that count pixels are far too
optimistic; objects are counted. The nine p values are corrected by Holm's rule.

The area is that under the ROC curve of single pixels of a subject, classified by the histograms of
other objects.

Citation: H. Akbar (2016), section 3.6.5.1; E. J. G. Pitman, "Significance tests which may be
applied to samples from any populations", Supplement to the Journal of the Royal Statistical Society
4(1), 119-130 (1937), doi:10.2307/2984124 (exchanges); S. Holm, "A simple sequentially rejective
multiple test procedure", Scandinavian Journal of Statistics 6(2), 65-70 (1979), which has no DOI.

Limits: n objects cannot give a p below 2 / 2^n, nor below 1 / 4096.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from benchmarks.separation.filter_statistics import Sample, area, fitted, sample_of
from isc_core.datasets.highlight_set import SeparationTruth
from isc_core.separation.support.filter_statistics import (
    BINS,
    FILTERS,
    KINDS,
    WIDTHS,
    bin_edges,
    bins,
)

from ..drawing.style import LETTERS, OKABE_ITO, figure, legend
from ..images.subject import Subject
from ..measuring.context import Context
from ..measuring.specular_free_images import subject_title, subjects_with_highlights
from ..report.item import ItemContent, ItemTable, ThesisItem

_EXCHANGES = 4096
_LEAST = 30  # pixels of either kind, minimum of either layer for a histogram


def layer_samples(subjects: list[Subject]) -> list[Sample]:
    """Filter the layers of each subject with enough pixels of both.

    Parameters
    ----------
    subjects : list of Subject
        Subjects with known layers.

    Returns
    -------
    list of Sample
        Filter outputs.
    """
    found = []
    for one in subjects:
        assert one.diffuse is not None
        assert one.specular is not None
        truth = SeparationTruth(
            subject_title(one),
            one.image,
            one.mask,
            one.diffuse,
            one.specular,
            np.zeros_like(one.mask),
        )
        # `sample_of` shortens names as those of rendered scenes.
        sample = replace(sample_of(truth, "layers"), subject=truth.name)
        if min(len(sample.of_highlight), len(sample.of_without)) >= _LEAST:
            found.append(sample)
    return found


def layer_histograms(sample: Sample, spread: np.ndarray) -> np.ndarray:
    """Compute the histograms of the filter outputs.

    Parameters
    ----------
    sample : Sample
        Filter outputs of a subject.
    spread : (F,) ndarray
        Scale of each filter.

    Returns
    -------
    (2, F, BINS) ndarray
        Histograms of the specular and the diffuse layer, each with sum 1.
    """
    pair = np.zeros((2, len(FILTERS), BINS))
    for kind, outputs in enumerate((sample.of_highlight, sample.of_without)):
        for f in range(len(FILTERS)):
            values = outputs[:, f][np.isfinite(outputs[:, f])]
            counts = np.bincount(bins(values, float(spread[f])), minlength=BINS)
            pair[kind, f] = counts / max(int(counts.sum()), 1)
    return pair


def total_variation(pairs: np.ndarray) -> np.ndarray:
    """Compute the distance of the mean histograms of both layers.

    Parameters
    ----------
    pairs : (S, 2, F, BINS) ndarray
        Histograms by subject and layer.

    Returns
    -------
    (F,) ndarray
        Total variation per filter.
    """
    return np.abs(pairs[:, 0].mean(axis=0) - pairs[:, 1].mean(axis=0)).sum(axis=1) / 2


def exchange_test(pairs: np.ndarray, seed: int, objects: Sequence[str] | None = None) -> np.ndarray:
    """Test the distances by exchanging the layers of objects.

    Parameters
    ----------
    pairs : (S, 2, F, BINS) ndarray
        Histograms by subject and layer.
    seed : int
        Random seed.
    objects : sequence of str, optional
        The object of each subject, whose layers are exchanged together; by default, each shows
        another one.

    Returns
    -------
    (F,) ndarray
        p values.
    """
    places = np.unique(range(len(pairs)) if objects is None else objects, return_inverse=True)[1]
    count = int(places.max()) + 1
    if 2**count <= _EXCHANGES:
        flips = (np.arange(2**count)[:, None] >> np.arange(count)) & 1
    else:
        flips = np.random.default_rng(seed).integers(0, 2, (_EXCHANGES, count))
        flips[0] = 0  # what was seen is one of them
    difference = pairs[:, 0] - pairs[:, 1]
    sign = 1 - 2.0 * flips[:, places]
    seen = total_variation(pairs)
    exchanged = np.abs(np.einsum("es,sfb->efb", sign, difference)).sum(axis=2) / (2 * len(pairs))
    return np.asarray((exchanged >= seen - 1e-12).mean(axis=0))


def holm_correction(p: np.ndarray) -> np.ndarray:
    """Correct p values for their number by Holm's method.

    Parameters
    ----------
    p : (F,) ndarray
        One p value per test.

    Returns
    -------
    (F,) ndarray
        In the same order, at most 1.
    """
    order = np.argsort(p, kind="stable")
    raised = np.maximum.accumulate(p[order] * (len(p) - np.arange(len(p))))
    corrected = np.empty(len(p))
    corrected[order] = np.minimum(raised, 1)
    return corrected


def left_out_area(samples: list[Sample]) -> float:
    """Classify single pixels of each subject by the histograms of other objects.

    Parameters
    ----------
    samples : list of Sample
        Filter outputs by subject.

    Returns
    -------
    float
        Mean area under the ROC curve.
    """
    areas = []
    for one in samples:
        table = fitted([other for other in samples if _object_of(other) != _object_of(one)])
        areas.append(area(table.evidence(one.of_highlight), table.evidence(one.of_without)))
    return float(np.mean(areas))


def _object_of(sample: Sample) -> str:
    """Return the object of a sample, which is named by `subject_title`."""
    return sample.subject.rpartition(" (")[0]


def _filters(context: Context) -> ItemContent:
    samples = layer_samples(
        subjects_with_highlights([*context.subjects("specular"), *context.subjects("synthetic")])
    )
    objects = [_object_of(sample) for sample in samples]
    count = len(set(objects))
    if count < 2:
        return ItemContent(
            text=(
                "Fewer than two objects have enough pixels of both layers: nothing can be compared."
            )
        )
    spread = fitted(samples).spread
    pairs = np.stack([layer_histograms(sample, spread) for sample in samples])

    p = exchange_test(pairs, context.seed, objects)
    columns = zip(FILTERS, total_variation(pairs), p, holm_correction(p), strict=True)
    cells = tuple(
        (kind, 100 * width, float(distance), float(one), float(raised))
        for (kind, width), distance, one, raised in columns
    )
    header = ("filter", "width (% of the diagonal)", "total variation", "p", "p after Holm")
    names = ", ".join(sample.subject for sample in samples)
    nearest, furthest = min(cell[2] for cell in cells), max(cell[2] for cell in cells)
    text = (
        f"{len(samples)} subjects, which show {count} objects: {names}. Of the specular "
        "layers, only pixels with at least a quarter of the light count. Distances are "
        f"{nearest:.2f} to {furthest:.2f} of at most 1; with so many objects, p cannot be below "
        f"{max(2 / 2**count, 1 / _EXCHANGES):.2g}. Single pixels of a subject, classified by the "
        "histograms of other objects, reach an area under the ROC curve of "
        f"{left_out_area(samples):.2f} (.5 is chance, 1 is perfect). A photo contains "
        "only the sum of the layers; docs/methods/filter_statistics.md measures what "
        "remains of the difference. Widths are shares of the object's diagonal."
    )
    return ItemContent((ItemTable(header, cells),), (_picture(pairs, cells),), text)


def _picture(
    pairs: np.ndarray, cells: tuple[tuple[str, float, float, float, float], ...]
) -> Figure:
    made, axes = figure(len(WIDTHS), len(KINDS), height=5.6, sharex=True, sharey=True)
    edges = bin_edges()
    for number, (place, cell) in enumerate(zip(axes.flat, cells, strict=True)):
        for kind, name, colour in ((1, "diffuse", OKABE_ITO[0]), (0, "specular", OKABE_ITO[1])):
            place.stairs(
                pairs[:, kind, number].mean(axis=0), edges, color=colour, linewidth=1.1, label=name
            )
        place.set_title(f"{cell[0]} {cell[1]:g} %: distance {cell[2]:.2f}", fontsize=LETTERS)
    for place in axes[-1]:
        place.set_xlabel("asinh(output / spread)")
    for place in axes[:, 0]:
        place.set_ylabel("share of the pixels")
    legend(axes[0, 0], "upper left")
    return made


ITEMS: tuple[ThesisItem, ...] = (
    partial(ThesisItem, "figure")(
        "3.12", "Histograms of filter outputs on diffuse and specular layers", _filters
    ),
)
