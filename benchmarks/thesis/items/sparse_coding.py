"""Tables 4.13 to 4.18: Sparse Coding with the specular-free images SF1 and SF2, and with both, on
the three kinds of images.

A table for the diffuse and one for the specular layer of each kind. SF1 leaves the hue, by a
largest chromaticity that is made a fixed number; SF2 leaves the magnitude as well, by a smallest
channel that is made 0; docs/methods/sparse_coding.md derives both. Beside them the methods that the
abstract compares Sparse Coding with: Chaotic Segmentation and the iterative method, as published
and improved.

Citation: R. T. Tan, K. Ikeuchi (2005), doi:10.1109/TPAMI.2005.36 (SF1, the iterative method); K.-J.
Yoon, Y. Choi, I. S. Kweon (2006), doi:10.1109/ICIP.2006.312650 (SF2); H. Akbar, thesis (2016).

Limits: only an outline of the thesis' method is public; the equations behind it are ours.
"""

import functools

from .claims import SPARSE_DIFFUSE, SPARSE_SPECULAR
from .comparing import gain, in_words, ratio
from .context import Context
from .item import Item, Made, Verdict
from .layer_tables import DIFFUSE, KINDS, SPECULAR, Layer, Runs, by_subject, means, run_all, summary
from .separations import NOTHING, SEGMENTATION, Way

METHOD = "sparse_coding"
IMAGES = {"SF1": "sf1", "SF2": "sf2", "SF1 + SF2": "both"}
OURS = tuple(
    Way(f"SC with {label}", METHOD, "improved", (("specular_free", images),))
    for label, images in IMAGES.items()
)
RIVALS = (
    Way("CS, improved", SEGMENTATION),
    Way("iterative, improved", "tan_2005"),
    Way("CS, as published", SEGMENTATION, "paper"),
    Way("iterative, as published", "tan_2005", "paper"),
)
_PUBLISHED = Way("SC, as published", METHOD, "paper")
_BOTH = OURS[-1].label
_CLAIMS = {DIFFUSE: (SPARSE_DIFFUSE, 0.076), SPECULAR: (SPARSE_SPECULAR, 0.535)}


def _make(kind: str, layer: Layer, context: Context) -> Made:
    runs = run_all(context, kind, (*OURS, _PUBLISHED, *RIVALS))
    tables = summary(runs, kind, layer, context.seed, _both, _BOTH), by_subject(runs, kind, layer)
    return Made(
        tables, text=_TEXT, verdicts=() if kind == "matt" else (verdict(runs, layer, context.seed),)
    )


def verdict(runs: Runs, layer: Layer, seed: int) -> Verdict:
    """The claim of the layer, judged against the improved rivals together: the mean of both, in
    logarithms, on each subject.
    """
    claim, share = _CLAIMS[layer]
    ours = means(runs[_BOTH], layer[0])
    rivals = [means(runs[way.label], layer[0]) for way in RIVALS[:2]]
    both = {
        name: (rivals[0][name] * rivals[1][name]) ** 0.5 for name in rivals[0] if name in rivals[1]
    }
    judged = gain(
        claim,
        share,
        ratio(ours, both, seed),
        "MSE, against CS and the iterative method, both improved,",
    )
    published = [
        in_words(ratio(ours, means(runs[way.label], layer[0]), seed)) for way in RIVALS[2:]
    ]
    why = f"{judged.why}; " if judged.why else ""
    return Verdict(
        claim,
        judged.here,
        judged.holds,
        f"{why}over CS and the iterative method as published: {published[0]} and {published[1]}",
    )


def _both(label: str) -> str | None:
    return None if label == NOTHING.label else _BOTH


_TEXT = (
    "As photo = diffuse + specular holds in the truth and in the answers, both layers have nearly the same mean square error: the "
    "abstract's two figures, 7.6 % and 53.5 %, cannot hold at once for that measure. Without any highlight the specular layer should be "
    "empty, and every per cent taken off is an error."
)

ITEMS: tuple[Item, ...] = tuple(
    Item(
        "table",
        f"4.{13 + 2 * row + column}",
        f"Sparse Coding with SF1, SF2 and both, {words}: the {which} layer",
        functools.partial(_make, kind, layer),
    )
    for row, (kind, words) in enumerate(KINDS.items())
    for column, (which, layer) in enumerate((("diffuse", DIFFUSE), ("specular", SPECULAR)))
)
