"""Tables 4.11 and 4.12: accuracy and speed of the separations MZK06, YCK06, YWA10 and SC09.

Each as published, as in the public toolbox where it contains the method, and improved by this
project: statistics inside the mask, guards for pale objects.

Citation: S. P. Mallick, T. Zickler, D. J. Kriegman, P. N. Belhumeur (2006),
doi:10.1007/11744023_43; K.-J. Yoon, Y. Choi, I. S. Kweon (2006), doi:10.1109/ICIP.2006.312650; Q.
Yang, S. Wang, N. Ahuja (2010), doi:10.1007/978-3-642-15561-1_7; H.-L. Shen, Q.-Y. Cai (2009),
doi:10.1364/AO.48.002711.

Limits: it is not known which images the thesis' own tables use.
"""

from isc_core.separation import variants

from ..measuring.context import Context
from ..measuring.separation_scores import NOTHING, SeparatorSetting
from ..report.comparing import object_of_kind
from ..report.item import ItemContent, ThesisItem
from ..report.layer_tables import (
    DIFFUSE,
    KINDS,
    RunScores,
    accuracy_table,
    mean_or_none,
    mean_scores,
    score_settings,
    speed_table,
    subject_table,
)

METHODS = {"MZK06": "mallick_2006", "YCK06": "yoon_2006", "YWA10": "yang_2010", "SC09": "shen_2009"}
VARIANT_LABELS = {"paper": "as published", "sihr": "as in the toolbox", "improved": "improved"}


def settings() -> tuple[SeparatorSetting, ...]:
    """Return every method in each of its variants."""
    return tuple(
        SeparatorSetting(f"{label}, {words}", method, variant)
        for label, method in METHODS.items()
        for variant, words in VARIANT_LABELS.items()
        if variant in variants(method)
    )


def _accuracy(context: Context) -> ItemContent:
    found = {kind: score_settings(context, kind, settings()) for kind in KINDS}
    overall = [accuracy_table(runs, kind, DIFFUSE, context.seed) for kind, runs in found.items()]
    return ItemContent(
        (*overall, *(subject_table(runs, kind, DIFFUSE) for kind, runs in found.items())),
        text=accuracy_text(found["diffuse"]),
    )


def accuracy_text(without_highlights: RunScores) -> str:
    """Explain the tables of accuracy, with the light that each variant removes by mistake.

    Parameters
    ----------
    without_highlights : RunScores
        Scores on images without highlights.

    Returns
    -------
    str
    """
    text = (
        "Below 1 in the first column of the first two tables, a method helps; above 1, it is "
        "harmful."
    )
    shares = []
    for words in VARIANT_LABELS.values():
        removed = [
            100 * share
            for label, subjects in without_highlights.items()
            if label.endswith(f", {words}")
            and (share := mean_or_none(mean_scores(subjects, "removed").values())) is not None
        ]
        if removed:
            shares.append(f"{min(removed):.1f} to {max(removed):.1f} % {words}")
    if shares:
        text += (
            " Of images without highlights, where pale surfaces are easily confused with light, "
            f"the methods remove {', '.join(shares)} (RMS). A variant that leaves photos "
            "unchanged is cautious, not accurate."
        )
    return text


def _speed(context: Context) -> ItemContent:
    whole: RunScores = {}
    for kind in KINDS:
        for label, found in score_settings(context, kind, settings()).items():
            whole.setdefault(label, {}).update(
                {f"{kind} {name}": runs for name, runs in found.items()}
            )
    table = speed_table(
        whole, _quickest, context.seed, "SC09, as published", object_of=object_of_kind
    )
    return ItemContent((table,), text=_SPEED)


def _quickest(label: str) -> str | None:
    return None if label == NOTHING.label else "SC09, as published"


_SPEED = (
    "All kinds of images; one run per image after a warm-up run. Seconds depend on "
    "the load of the machine."
)

ITEMS: tuple[ThesisItem, ...] = (
    ThesisItem("table", "4.11", "MZK06, YCK06, YWA10 and SC09: accuracy", _accuracy),
    ThesisItem("table", "4.12", "MZK06, YCK06, YWA10 and SC09: speed", _speed),
)
