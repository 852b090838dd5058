"""Tables 4.13 to 4.18: Sparse Coding with the specular-free images SF1, SF2 and both.

Problem: for each of the three kinds of images, one table of accuracy (diffuse and specular layer)
and one of speed. SF1 keeps the hue, with a largest chromaticity set to a constant; SF2 keeps the
differences of the channels, with a smallest channel set to 0; docs/methods/sparse_coding.md derives
both. Each table includes the methods that the abstract compares Sparse Coding with: Chaotic
Segmentation and the iterative method, as published and improved.

Citation: R. T. Tan, K. Ikeuchi (2005), doi:10.1109/TPAMI.2005.36 (SF1, the iterative method); K.-J.
Yoon, Y. Choi, I. S. Kweon (2006), doi:10.1109/ICIP.2006.312650 (SF2); H. Akbar, thesis (2016).

Limits: only an outline of the thesis' method is public; its equations are this project's.
"""

import functools
import math
from collections.abc import Callable

from ..measuring.context import Context
from ..measuring.separation_scores import NOTHING, SEGMENTATION, SeparatorSetting
from ..report.claims import SPARSE_DIFFUSE, SPARSE_SPECULAR
from ..report.comparing import format_ratio, judge_reduction, paired_ratio
from ..report.item import ClaimVerdict, ItemContent, ThesisItem
from ..report.layer_tables import (
    DIFFUSE,
    KINDS,
    SPECULAR,
    LayerFields,
    RunScores,
    accuracy_table,
    mean_scores,
    score_settings,
    speed_table,
    subject_table,
)

METHOD = "sparse_coding"
IMAGES = {"SF1": "sf1", "SF2": "sf2", "SF1 + SF2": "both"}
OURS = tuple(
    SeparatorSetting(f"SC with {label}", METHOD, "improved", (("specular_free", images),))
    for label, images in IMAGES.items()
)
COMPARED_METHODS = (
    SeparatorSetting("CS, improved", SEGMENTATION),
    SeparatorSetting("iterative, improved", "tan_2005"),
    SeparatorSetting("CS, as published", SEGMENTATION, "paper"),
    SeparatorSetting("iterative, as published", "tan_2005", "paper"),
)
_PUBLISHED = SeparatorSetting("SC, as published", METHOD, "paper")
_BOTH = OURS[-1].label
_TIMED_RUNS = 3
_CLAIMS = {DIFFUSE: (SPARSE_DIFFUSE, 0.076), SPECULAR: (SPARSE_SPECULAR, 0.535)}


def _scores(kind: str, context: Context, runs: int = 1) -> RunScores:
    return score_settings(context, kind, (*OURS, _PUBLISHED, *COMPARED_METHODS), runs)


def _accuracy(kind: str, context: Context) -> ItemContent:
    runs = _scores(kind, context)
    tables = [
        accuracy_table(runs, kind, layer, context.seed, _reference, _BOTH) for layer in _CLAIMS
    ]
    tables += [subject_table(runs, kind, layer) for layer in _CLAIMS]
    judged = () if kind == "diffuse" else tuple(_CLAIMS)
    verdicts = tuple(judge_layer(runs, layer, context.seed) for layer in judged)
    return ItemContent(tuple(tables), text=_ACCURACY_TEXT, verdicts=verdicts)


def _speed(kind: str, context: Context) -> ItemContent:
    runs = _scores(kind, context, _TIMED_RUNS)
    fastest: RunScores = {
        label: {
            name: [min(each, key=lambda run: run.seconds or math.inf)]
            for name, each in subjects.items()
        }
        for label, subjects in runs.items()
    }
    table = speed_table(fastest, _reference, context.seed, _BOTH, search=False)
    return ItemContent((table,), text=_SPEED_TEXT)


def judge_layer(runs: RunScores, layer: LayerFields, seed: int) -> ClaimVerdict:
    """Judge the abstract's claim about one layer.

    Sparse Coding with both images is compared with the two improved methods together: on each
    subject, the geometric mean of their errors.

    Parameters
    ----------
    runs : RunScores
        Scores of all settings on one kind of images.
    layer : LayerFields
        `DIFFUSE` or `SPECULAR`.
    seed : int
        Seed of the bootstrap.

    Returns
    -------
    ClaimVerdict
        The verdict; its reason gives the ratios to the methods as published.
    """
    claim, share = _CLAIMS[layer]
    ours = mean_scores(runs[_BOTH], layer[0])
    compared = [mean_scores(runs[one.label], layer[0]) for one in COMPARED_METHODS[:2]]
    both = {
        name: (compared[0][name] * compared[1][name]) ** 0.5
        for name in compared[0]
        if name in compared[1]
    }
    which = "diffuse" if layer is DIFFUSE else "specular"
    judged = judge_reduction(
        claim,
        share,
        paired_ratio(ours, both, seed),
        f"MSE of the {which} layer, compared with improved CS and iterative,",
    )
    published = [
        format_ratio(paired_ratio(ours, mean_scores(runs[one.label], layer[0]), seed))
        for one in COMPARED_METHODS[2:]
    ]
    why = f"{judged.why}; " if judged.why else ""
    return ClaimVerdict(
        claim,
        judged.here,
        judged.holds,
        f"{why}ratio to CS and iterative as published: {published[0]} and {published[1]}",
    )


def _reference(label: str) -> str | None:
    return None if label == NOTHING.label else _BOTH


_ACCURACY_TEXT = (
    "Photo = diffuse + specular holds both in the ground truth and in the results. Both layers "
    "therefore have nearly the same mean square error, and the abstract's two figures, 7.6 % and "
    "53.5 %, cannot both hold for that measure. For an image without highlights, the specular "
    "layer should be empty: every per cent removed is an error."
)
_SPEED_TEXT = (
    "The fastest of three runs per image. Seconds depend on the load of the machine. SF1 and "
    "SF2 decide which edges separate groups of pixels; the equations solved are the same."
)
_PARTS: tuple[tuple[str, Callable[[str, Context], ItemContent]], ...] = (
    ("accuracy", _accuracy),
    ("speed", _speed),
)

ITEMS: tuple[ThesisItem, ...] = tuple(
    ThesisItem(
        "table",
        f"4.{13 + 2 * row + column}",
        f"Sparse Coding with SF1, SF2 and both, {words}: {what}",
        functools.partial(make, kind),
    )
    for row, (kind, words) in enumerate(KINDS.items())
    for column, (what, make) in enumerate(_PARTS)
)
