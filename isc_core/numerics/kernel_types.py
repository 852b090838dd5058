"""The argument types of a compiled kernel, as declared in its decorator.

Compilation ahead of time needs the types of a kernel before any call. A declaration lists them in
the order of the parameters, with NumPy's type codes:

    i8 r[2] Photo(r[3] i8[2:]) (b1 b1) -> f8

An integer; a matrix in row-major order; a named tuple of an array with three axes and a matrix with
any strides; a tuple of two Booleans. The kernel returns a number. Without an arrow it returns
nothing. `r` is f4 in one version of the kernel, and f8 in another.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

_TYPE = re.compile(r"(?P<code>[bif][1248])\b(?:\[(?P<axes>\d)(?P<strided>:?)\])?")
_GROUP = re.compile(r"(?P<name>[\w.]*)\((?P<fields>[^()]*)\)")


@dataclass(frozen=True)
class Scalar:
    """A number: `code` is i8, f4, f8 or b1."""

    code: str


@dataclass(frozen=True)
class Array:
    """An array.

    Attributes
    ----------
    code : str
        Type of its elements in NumPy's notation, for example f4.
    axes : int
    contiguous : bool
        Whether it must be contiguous in row-major order.
    """

    code: str
    axes: int
    contiguous: bool


@dataclass(frozen=True)
class Group:
    """A tuple.

    Attributes
    ----------
    name : str
        Class of a named tuple, as referenced in the kernel's module, for example "arrays.Photo";
        otherwise "".
    fields : tuple of Scalar or Array
    """

    name: str
    fields: tuple[Scalar | Array, ...]


@dataclass(frozen=True)
class Signature:
    """Arguments and result of a kernel.

    Attributes
    ----------
    arguments : tuple of Scalar, Array or Group
    result : Scalar or None
    """

    arguments: tuple[Scalar | Array | Group, ...]
    result: Scalar | None

    @property
    def flat(self) -> tuple[Scalar | Array, ...]:
        """The arguments, with tuples replaced by their fields."""
        return tuple(
            field
            for one in self.arguments
            for field in (one.fields if isinstance(one, Group) else (one,))
        )


def signatures(declaration: str) -> tuple[Signature, ...]:
    """Read a declaration.

    Parameters
    ----------
    declaration : str
        See the module; "" for none.

    Returns
    -------
    tuple of Signature
        One for each version of the kernel.

    Raises
    ------
    ValueError
        If a type is unknown, or a parenthesis unpaired.
    """
    if not re.search(r"\br\b", declaration):
        return (_parsed(declaration),) if declaration else ()
    return tuple(_parsed(re.sub(r"\br\b", real, declaration)) for real in ("f4", "f8"))


def _parsed(text: str) -> Signature:
    arguments, _, result = text.partition("->")
    return Signature(tuple(_types(arguments)), Scalar(result.strip()) if result else None)


def _types(text: str) -> Iterator[Any]:
    rest = text.strip()
    while rest:
        group, plain = _GROUP.match(rest), _TYPE.match(rest)
        if group is not None:
            yield Group(group["name"], tuple(_types(group["fields"])))
        elif plain is None:
            raise ValueError(f"not a declaration of types: {text}")
        elif plain["axes"] is None:
            yield Scalar(plain["code"])
        else:
            yield Array(plain["code"], int(plain["axes"]), not plain["strided"])
        rest = rest[(group or plain).end() :].lstrip()  # type: ignore[union-attr]
