"""The note about a refinement in the settings of its result, and its one-line summary.

Programs that display results read it, too; it therefore needs no numerical library.
"""

import math
from collections.abc import Mapping
from enum import StrEnum
from typing import Any

NOTE = "refine_gloss"


class GlossOutcome(StrEnum):
    """Outcome of the refinement of a gloss."""

    REFINED = "refined"
    NO_HIGHLIGHT = "no_highlight"
    NOT_BETTER = "not_better"
    UNLIKELY_REFLECTANCE = "unlikely_reflectance"


_REASONS = {
    GlossOutcome.NO_HIGHLIGHT: "no highlight of known roughness was separated",
    GlossOutcome.NOT_BETTER: "held-out pixels are not explained better",
    GlossOutcome.UNLIKELY_REFLECTANCE: "the reflectance would become less likely",
}


def was_refined(settings: Mapping[str, Any]) -> bool:
    """Return whether the gloss of a result was refined.

    Parameters
    ----------
    settings : mapping
        Of the result; not validated.

    Returns
    -------
    bool
    """
    return _outcome(settings) is GlossOutcome.REFINED


def gloss_line(settings: Mapping[str, Any]) -> str:
    """Summarise the refinement of the gloss of a result.

    Parameters
    ----------
    settings : mapping
        Of the result; not validated.

    Returns
    -------
    str
        One line; "" if no refinement was attempted.
    """
    outcome = _outcome(settings)
    if outcome is None:
        return ""
    if outcome is not GlossOutcome.REFINED:
        return f"gloss not refined: {_REASONS[outcome]}"
    note = settings[NOTE]
    lamps, share = note.get("lamps"), note.get("held_out_after")
    if not (isinstance(lamps, int) and isinstance(share, float) and math.isfinite(share)):
        return "gloss refined"
    what = "1 lamp explains" if lamps == 1 else f"{lamps} lamps explain"
    return f"gloss refined: {what} {100 * share:.0f} % of held-out highlights"


def _outcome(settings: Mapping[str, Any]) -> GlossOutcome | None:
    note = settings.get(NOTE)
    stored = note.get("outcome") if isinstance(note, Mapping) else None
    return GlossOutcome(stored) if stored in tuple(GlossOutcome) else None
