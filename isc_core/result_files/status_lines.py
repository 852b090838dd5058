"""What a result's status says to people, in lines; for commands, and for programs that read a
result of another day.
"""

from collections.abc import Mapping
from typing import Any


def status_lines(status: Mapping[str, Any]) -> list[str]:
    """Lines that begin with "note: " or "gloss: ": why the solver stopped early, how gloss was
    determined, what makes the result doubtful.

    `status`: of a decomposition.json, whose file may be anybody's: parts that are not what they
    should be say nothing.
    """
    light, doubts = status.get("light_colour"), status.get("doubts")
    said = [
        ("note", None if status.get("converged", True) else status.get("help")),
        ("gloss", status.get("gloss")),
    ]
    said += [("note", light.get("help") if isinstance(light, Mapping) else None)]
    said += [("note", doubt) for doubt in (doubts if isinstance(doubts, list) else [])]
    return [f"{kind}: {line}" for kind, line in said if isinstance(line, str) and line]
