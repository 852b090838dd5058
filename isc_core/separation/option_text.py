"""Options of a separation method as text, `name=value`, parsed by the method's dataclass."""

import math
import types
import typing
from collections.abc import Iterable

from ..errors import InputError
from . import IMPROVED, method_options

_WORDS = {"true": True, "yes": True, "on": True, "false": False, "no": False, "off": False}
_KINDS = {bool: "yes or no", int: "a whole number", float: "a number", str: "a word"}


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
    usual = method_options(method, variant)
    kinds = {} if usual is None else typing.get_type_hints(type(usual))
    changes: dict[str, object] = {}
    for word in words:
        name, equals, text = (piece.strip() for piece in word.partition("="))
        if not equals:
            raise InputError(f"--set {word}: write it as name=value")
        method_options(method, variant, {name: None})  # the name is known, or this says which are
        changes[name] = _value(text, kinds[name], f"--set {name} of {method}")
    return changes


def _value(text: str, kind: object, what: str) -> object:
    """`text` as the type `kind`: bool, int, float, str, a `Literal`, or a union of them, in which
    `none` is None.
    """
    choices = (
        list(typing.get_args(kind))
        if typing.get_origin(kind) in (typing.Union, types.UnionType)
        else [kind]
    )
    if types.NoneType in choices and text.lower() == "none":
        return None
    for choice in choices:
        found = _one(text, choice)
        if found is not None:
            return found
    raise InputError(f"{what}: {text!r} is not {' or '.join(_named(choice) for choice in choices)}")


def _one(text: str, kind: object) -> object | None:
    """`text` as one plain type, or None where it is not of it."""
    if typing.get_origin(kind) is typing.Literal:
        return next((value for value in typing.get_args(kind) if str(value) == text), None)
    if typing.get_origin(kind) is tuple:
        parts = [
            _one(piece.strip(), part)
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
        return _WORDS.get(text.lower())
    if kind is str:
        return text
    try:
        if kind is int:
            return int(text)
        value = float(text) if kind is float else math.nan
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _named(kind: object) -> str:
    if typing.get_origin(kind) is typing.Literal:
        return "one of " + ", ".join(map(str, typing.get_args(kind)))
    if typing.get_origin(kind) is tuple:
        return f"{len(typing.get_args(kind))} numbers with commas between them"
    return "none" if kind is types.NoneType else _KINDS.get(kind, "something that can be set here")  # type: ignore[call-overload]
