"""Settings of the pipeline from assignments on a command line."""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

from isc_core.decomposition.settings import Settings
from isc_core.errors import InputError


def settings_of(assignments: Sequence[str], default: Settings) -> Settings:
    """Change some settings, each to a value of the type of its default.

    Parameters
    ----------
    assignments : sequence of str
        "NAME=VALUE" each.
    default : Settings

    Returns
    -------
    Settings

    Raises
    ------
    InputError
        If a name is unknown or a value has the wrong type.
    """
    types = {one.name: type(getattr(default, one.name)) for one in fields(default)}
    found = default
    for assignment in assignments:
        name, separator, value = assignment.partition("=")
        if not separator or name not in types:
            raise InputError(f"--set {assignment}: give NAME=VALUE, NAME one of {', '.join(types)}")
        try:
            changed: Any = value == "true" if types[name] is bool else types[name](value)
        except ValueError as error:
            raise InputError(f"--set {assignment}: give a number for {name}") from error
        found = replace(found, **{name: changed})
    return found
