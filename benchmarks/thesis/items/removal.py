"""Tables 4.11 and 4.12: accuracy and speed of four published separations, MZK06, YCK06, YWA10 and
SC09.

Each as published, as the public toolbox has it where there is one, and improved (ours: statistics
inside the mask, guards for pale objects).

Citation: S. P. Mallick, T. Zickler, D. J. Kriegman, P. N. Belhumeur (2006),
doi:10.1007/11744023_43; K.-J. Yoon, Y. Choi, I. S. Kweon (2006), doi:10.1109/ICIP.2006.312650; Q.
Yang, S. Wang, N. Ahuja (2010), doi:10.1007/978-3-642-15561-1_7; H.-L. Shen, Q.-Y. Cai (2009),
doi:10.1364/AO.48.002711.

Limits: which images the thesis' own tables are made on is not known.
"""

from isc_core.separation import variants

from .context import Context
from .item import Item, Made
from .layer_tables import DIFFUSE, KINDS, Runs, by_subject, run_all, speed, summary
from .separations import NOTHING, Way

METHODS = {"MZK06": "mallick_2006", "YCK06": "yoon_2006", "YWA10": "yang_2010", "SC09": "shen_2009"}
WORDS = {"paper": "as published", "sihr": "as in the toolbox", "improved": "improved"}


def ways() -> tuple[Way, ...]:
    """Every method in every setting that it has."""
    return tuple(
        Way(f"{label}, {words}", method, variant)
        for label, method in METHODS.items()
        for variant, words in WORDS.items()
        if variant in variants(method)
    )


def _accuracy(context: Context) -> Made:
    found = {kind: run_all(context, kind, ways()) for kind in KINDS}
    overall = [summary(runs, kind, DIFFUSE, context.seed) for kind, runs in found.items()]
    return Made(
        (*overall, *(by_subject(runs, kind, DIFFUSE) for kind, runs in found.items())),
        text=_ACCURACY,
    )


def _speed(context: Context) -> Made:
    whole: Runs = {}
    for kind in KINDS:
        for label, found in run_all(context, kind, ways()).items():
            whole.setdefault(label, {}).update(
                {f"{kind} {name}": runs for name, runs in found.items()}
            )
    return Made((speed(whole, _quickest, context.seed, "SC09, as published"),), text=_SPEED)


def _quickest(label: str) -> str | None:
    return None if label == NOTHING.label else "SC09, as published"


_ACCURACY = (
    "Below 1 in the first column a method helps, above it does harm: as published, most "
    "take pale paint for light. The improved settings mostly know when to leave a photo alone, which is caution more than skill."
)
_SPEED = "All kinds of images together; one warm run each, seconds as the machine was."

ITEMS: tuple[Item, ...] = (
    Item("table", "4.11", "MZK06, YCK06, YWA10 and SC09: accuracy", _accuracy),
    Item("table", "4.12", "MZK06, YCK06, YWA10 and SC09: speed", _speed),
)
