"""Names that a package offers without importing their modules before they are used.

Problem: a package that re-exports functions imports everything that these need, also for a program
that wants one constant. Module-level `__getattr__` (PEP 562) imports the module of a name when the
name is first asked for.

Limits: a submodule must not have the name of an exported function, which it would replace when it
is imported.
"""

from collections.abc import Callable, Mapping
from importlib import import_module


def exports(package: str, homes: Mapping[str, str]) -> Callable[[str], object]:
    """Make the `__getattr__` of a package.

    Parameters
    ----------
    package : str
        `__name__` of the package.
    homes : mapping of str to str
        For each exported name, its module relative to the package, such as ".reading".

    Returns
    -------
    callable
        Imports the module of a name and returns the name's value; raises `AttributeError` for other
        names.
    """

    def lookup(name: str) -> object:
        home = homes.get(name)
        if home is None:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(home, package), name)

    return lookup
