"""SciPy imported without the notes that it writes into its own documentation.

Problem: since 1.17, SciPy adds a note on other array libraries to the docstring of each function,
at each import. To parse the docstrings takes half of what `scipy.ndimage` takes to import, a
thirtieth of the processor time of a decomposition, and nobody reads them in a command.

Limits: a private name of SciPy; where there is none, SciPy is imported as it is. The functions
themselves are the same.
"""

from collections.abc import Callable
from typing import TypeVar

Function = TypeVar("Function")


def skip_docstring_notes() -> None:
    """Let SciPy leave the docstrings of this process as they are; call it before its import."""
    try:
        from scipy._lib import _array_api
    except ImportError:
        return
    if hasattr(_array_api, "xp_capabilities"):
        setattr(_array_api, "xp_capabilities", _plain)  # noqa: B010 (private, so not declared)


def _plain(*_: object, **__: object) -> Callable[[Function], Function]:
    """A decorator that changes nothing."""
    return lambda function: function
