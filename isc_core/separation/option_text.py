"""Options of a separation method as text, `name=value`, parsed by the method's dataclass."""

import math
import types
import typing
from collections.abc import Iterable

from ..errors import InputError
from . import IMPROVED, method_options

_BOOLEANS = {"true": True, "yes": True, "on": True, "false": False, "no": False, "off": False}
_TYPE_NAMES = {bool: "yes or no", int: "an integer", float: "a number", str: "a text"}


def parse_changes(
    method: str, variant: str = IMPROVED, words: Iterable[str] = ()
) -> dict[str, object]:
    """Parse words like `levels=3`; of two for the same option the last counts.

    Parameters
    ----------
    method, variant : str
    words : iterable of str

    Returns
    -------
    dict
        The `changes` of `separate`.

    Raises
    ------
    InputError
        If the method, variant, option or value is invalid.
    """
    defaults = method_options(method, variant)
    kinds = {} if defaults is None else typing.get_type_hints(type(defaults))
    changes: dict[str, object] = {}
    for word in words:
        name, equals, text = (piece.strip() for piece in word.partition("="))
        if not equals:
            raise InputError(f"--set {word}: expected NAME=VALUE")
        method_options(method, variant, {name: None})  # raises, listing the names, if unknown
        changes[name] = _value(text, kinds[name], f"--set {name} of {method}")
    return changes


def _value(text: str, kind: object, what: str) -> object:
    """Parse `text` as the type `kind`: bool, int, float, str, a `Literal`, a tuple, or a union
    of them, in which `none` is None.
    """
    choices = (
        list(typing.get_args(kind))
        if typing.get_origin(kind) in (typing.Union, types.UnionType)
        else [kind]
    )
    if types.NoneType in choices and text.lower() == "none":
        return None
    for choice in choices:
        value = _parse_one(text, choice)
        if value is not None:
            return value
    raise InputError(
        f"{what}: {text!r} is not {' or '.join(_type_name(choice) for choice in choices)}"
    )


def _parse_one(text: str, kind: object) -> object | None:
    """Parse `text` as one plain type; None if it does not match."""
    if typing.get_origin(kind) is typing.Literal:
        return next((value for value in typing.get_args(kind) if str(value) == text), None)
    if typing.get_origin(kind) is tuple:
        parts = [
            _parse_one(piece.strip(), part)
            for piece, part in zip(text.split(","), typing.get_args(kind), strict=False)
        ]
        return (
            None
            if None in parts
            or len(parts) != len(typing.get_args(kind))
            or text.count(",") >= len(parts)
            else tuple(parts)
        )
    if kind is bool:
        return _BOOLEANS.get(text.lower())
    if kind is str:
        return text
    try:
        if kind is int:
            return int(text)
        value = float(text) if kind is float else math.nan
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _type_name(kind: object) -> str:
    if typing.get_origin(kind) is typing.Literal:
        return "one of " + ", ".join(map(str, typing.get_args(kind)))
    if typing.get_origin(kind) is tuple:
        return f"{len(typing.get_args(kind))} comma-separated numbers"
    if kind is types.NoneType:
        return "none"
    return _TYPE_NAMES.get(kind, "a value that can be set here")  # type: ignore[call-overload]
