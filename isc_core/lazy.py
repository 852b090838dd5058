"""Lazy exports: names of a package whose modules are imported at first use.

Problem: a package that re-exports functions imports all of their dependencies, even for a program
that needs one constant. Module-level `__getattr__` (PEP 562) imports the module of a name when the
name is first accessed.

Limits: a submodule must not have the name of an exported function, because its import would replace
the function.
"""

from collections.abc import Callable, Mapping
from importlib import import_module


def exports(package: str, modules: Mapping[str, str]) -> Callable[[str], object]:
    """Make the `__getattr__` of a package.

    Parameters
    ----------
    package : str
        `__name__` of the package.
    modules : mapping of str to str
        For each exported name, its module relative to the package, such as ".reading".

    Returns
    -------
    callable
        Imports the module of a name and returns the name's value; raises `AttributeError` for other
        names.
    """

    def lookup(name: str) -> object:
        home = modules.get(name)
        if home is None:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(home, package), name)

    return lookup
