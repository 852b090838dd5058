"""Reading the diagnostics of a result from decomposition.json.

Schema 2 is the format of `Diagnostics.to_json`. Schema 1 had sentences: the entries "gloss" and
"joint", and the list "doubts"; they are recognised by their prefixes. The file is not trusted:
parts of the wrong type or with unknown values are ignored.
"""

import math
import re
from collections.abc import Mapping
from enum import StrEnum
from typing import Any, TypeVar

from ..scene.diagnostics import (
    AssumptionWarning,
    Diagnostics,
    ExpectedErrorDiagnostics,
    IlluminantOutcome,
    JointOutcome,
    LightColourDiagnostics,
    LobeDiagnostics,
    LobeFitOutcome,
    LobeStatus,
    PhotoColours,
    StopReason,
    WarningKind,
)

_Member = TypeVar("_Member", bound=StrEnum)

# Prefixes and substrings of the sentences of schema 1.
_OLD_JOINT = (
    ("no highlights but", JointOutcome.UNCHANGED),
    ("continuing the paint under them did not", JointOutcome.REMOVED),
    ("and the paint under them continued", JointOutcome.INPAINTED),
)
_OLD_WARNINGS = (
    ("looks like a mirror", WarningKind.MIRROR_OR_GLASS),
    ("several lights", WarningKind.SEVERAL_LIGHTS),
    ("too bright for the photo", WarningKind.CLIPPED),
    ("thin or ragged", WarningKind.RAGGED_MASK),
)
_OLD_LIGHTS = (
    ("agree", IlluminantOutcome.DETERMINED),
    ("lie on one paint, or disagree", IlluminantOutcome.UNRELIABLE),
    ("no coloured paint", IlluminantOutcome.NO_FLANKS),
    ("of one strong colour", IlluminantOutcome.STRONG_OBJECT_COLOUR),
    ("too strong a colour for a light", IlluminantOutcome.STRONG_HIGHLIGHT_COLOUR),
)
_OLD_LOBES = (
    ("undetermined: no specular light", LobeFitOutcome.NO_SPECULAR),
    ("undetermined: the light is smooth", LobeFitOutcome.SMOOTH_LIGHT),
    ("narrower than a pixel", LobeFitOutcome.NARROW),
    ("brighter than the photo could show", LobeFitOutcome.CLIPPED),
    ("no highlight that a lobe explains", LobeFitOutcome.UNEXPLAINED),
    ("determined", LobeFitOutcome.DETERMINED),
)
_OLD_HELP = ("light may be strongly coloured", "the light is coloured")
_PERCENT = re.compile(r"(\d{1,3}) %")
_DECIMALS = re.compile(r"\d\.\d\d")


def diagnostics_from_json(status: Any) -> Diagnostics:
    """Read the entry `status` of a decomposition.json of schema 1 or 2.

    Parameters
    ----------
    status : Any
        The entry as JSON values.

    Returns
    -------
    Diagnostics
        Without the parts that are missing or unusable.
    """
    if not isinstance(status, Mapping):
        return Diagnostics()
    converged = status.get("converged")
    old = "doubts" in status or "gloss" in status or "kinds" in status
    return Diagnostics(
        converged=converged if isinstance(converged, bool) else None,
        reason=_member(StopReason, status.get("reason")),
        loss=_number(status.get("loss")),
        terms=_numbers(status.get("terms")),
        iterations=_count(status.get("iterations")),
        evaluations=_count(status.get("evaluations")),
        joint=_member(JointOutcome, status.get("joint"))
        or _old_meaning(_OLD_JOINT, status.get("joint")),
        doubtful_highlights=_number(status.get("doubtful_highlights")),
        lobe=_old_lobe(status.get("gloss")) if old else _lobe(status.get("lobe")),
        light_colour=_light_colour(status.get("light_colour")),
        photo_colours=_member(PhotoColours, status.get("photo_colours")),
        scene_classes=_numbers(status.get("kinds" if old else "scene_classes")),
        light_counts=_numbers(status.get("lamps" if old else "light_counts")),
        several_lights=_number(status.get("several_lamps" if old else "several_lights")),
        expected_error=_expected_error(status.get("expected_error")),
        warnings=_old_warnings(status.get("doubts")) if old else _warnings(status.get("warnings")),
    )


def old_lobe_outcome(reason: str) -> LobeFitOutcome:
    """Translate the sentence `brdf.reason` of schema 1.

    Parameters
    ----------
    reason : str
        The sentence.

    Returns
    -------
    LobeFitOutcome
        The corresponding outcome.

    Raises
    ------
    ValueError
        If the sentence is unknown.
    """
    outcome = _old_meaning(_OLD_LOBES, reason)
    if outcome is None:
        raise ValueError(f"unknown reason {reason[:80]!r}")
    return outcome


def _expected_error(record: Any) -> ExpectedErrorDiagnostics | None:
    if not isinstance(record, Mapping):
        return None
    normal, reflectance = (_number(record.get(k)) for k in ("normal_degrees", "log_reflectance"))
    if normal is None or reflectance is None:
        return None
    return ExpectedErrorDiagnostics(normal, reflectance)


def _lobe(record: Any) -> LobeDiagnostics | None:
    if not isinstance(record, Mapping):
        return None
    status = _member(LobeStatus, record.get("status"))
    if status is None:
        return None
    roughness = _triple(record.get("roughness_68"))
    return LobeDiagnostics(status, _member(LobeFitOutcome, record.get("outcome")), roughness)


def _old_lobe(sentence: Any) -> LobeDiagnostics | None:
    """Parse "roughness 0.24, 0.20 to 0.29 with ...", "roughness at most 0.24: why", or a reason."""
    if not isinstance(sentence, str):
        return None
    if sentence.startswith("not fitted"):
        return LobeDiagnostics(LobeStatus.NOT_FITTED)
    if sentence.startswith("next to no highlights"):
        return LobeDiagnostics(LobeStatus.NO_HIGHLIGHTS, LobeFitOutcome.NO_SPECULAR)
    if "too bright to show" in sentence:
        return LobeDiagnostics(LobeStatus.HIDDEN, LobeFitOutcome.NO_SPECULAR)
    values = [float(number) for number in _DECIMALS.findall(sentence)]
    if sentence.startswith("roughness at most") and values:
        outcome = _old_meaning(_OLD_LOBES, sentence)
        return LobeDiagnostics(LobeStatus.FITTED, outcome, (0.0, values[0], values[0]))
    if sentence.startswith("roughness") and len(values) >= 3:
        likely, low, high = values[:3]
        return LobeDiagnostics(LobeStatus.FITTED, LobeFitOutcome.DETERMINED, (low, likely, high))
    outcome = _old_meaning(_OLD_LOBES, sentence)
    return None if outcome is None else LobeDiagnostics(LobeStatus.FITTED, outcome)


def _light_colour(record: Any) -> LightColourDiagnostics | None:
    if not isinstance(record, Mapping):
        return None
    estimate, confidence = _triple(record.get("estimate")), _number(record.get("confidence"))
    outcome = _member(IlluminantOutcome, record.get("outcome")) or _old_meaning(
        _OLD_LIGHTS, record.get("reason")
    )
    if estimate is None or confidence is None or outcome is None:
        return None
    used = record.get("used")
    advice = record.get("help")
    coloured = record.get("coloured") is True or (
        isinstance(advice, str) and advice.startswith(_OLD_HELP[1])
    )
    return LightColourDiagnostics(
        used if isinstance(used, str) else "white",
        estimate,
        confidence,
        outcome,
        coloured,
        record.get("white_assumed") is True,
    )


def _warnings(records: Any) -> tuple[AssumptionWarning, ...]:
    given = (
        [record for record in records if isinstance(record, Mapping)]
        if isinstance(records, list)
        else []
    )
    found = [
        (_member(WarningKind, record.get("kind")), _number(record.get("value"))) for record in given
    ]
    return tuple(AssumptionWarning(kind, value) for kind, value in found if kind is not None)


def _old_warnings(lines: Any) -> tuple[AssumptionWarning, ...]:
    found = []
    for line in lines if isinstance(lines, list) else []:
        kind = _old_meaning(_OLD_WARNINGS, line)
        if kind is not None:
            share = _PERCENT.search(line)
            found.append(AssumptionWarning(kind, share and int(share[1]) / 100))
    return tuple(found)


def _old_meaning(table: tuple[tuple[str, _Member], ...], sentence: Any) -> _Member | None:
    text = sentence if isinstance(sentence, str) else ""
    return next((meaning for part, meaning in table if part in text), None)


def _member(kind: type[_Member], value: Any) -> _Member | None:
    return kind(value) if isinstance(value, str) and value in kind.__members__.values() else None


def _number(value: Any) -> float | None:
    usable = isinstance(value, int | float) and not isinstance(value, bool)
    try:
        return float(value) if usable and math.isfinite(value) else None
    except OverflowError:
        return None


def _count(value: Any) -> int | None:
    return value if isinstance(value, int) and not isinstance(value, bool) and value >= 0 else None


def _numbers(values: Any) -> dict[str, float]:
    given = values if isinstance(values, Mapping) else {}
    found = {str(name): _number(value) for name, value in given.items()}
    return {name: value for name, value in found.items() if value is not None}


def _triple(values: Any) -> tuple[float, float, float] | None:
    found = [_number(value) for value in values] if isinstance(values, list) else []
    if len(found) != 3 or any(value is None for value in found):
        return None
    first, second, third = (value for value in found if value is not None)
    return first, second, third
