"""The list of the commands of `isc`.

The module of a command is imported only when the command is chosen, so that `isc --help` and every
other command start without it. The module has `declare(parser)`, which adds the options, and sets
`run(options, monitor)`, which returns the lines to print and raises `InputError` and `Cancelled`.

Packages that build on the core add commands: an entry point of the group `isc.commands` names a
`CommandEntry` in a module that is cheap to import. A command whose module cannot be imported
reports what to install; the others are not affected.
"""

from collections.abc import Iterator
from dataclasses import dataclass

_GROUP = "isc.commands"


@dataclass(frozen=True)
class CommandEntry:
    """A command that can be imported.

    Attributes
    ----------
    name : str
        Name on the command line.
    summary : str
        One line of `isc --help`.
    module : str
        Full name of the module.
    extra : str
        The extra of the package with the command's dependencies.
    """

    name: str
    summary: str
    module: str
    extra: str = ""


def _core(name: str, summary: str, extra: str = "") -> CommandEntry:
    return CommandEntry(name, summary, f"{__package__}.{name.replace('-', '_')}", extra)


CORE = (
    _core("decompose", "recover layers, shape, light, shading, reflectance and mesh"),
    _core("separate", "separate diffuse and specular light only"),
    _core("mask", "find the object in a photo"),
    _core("edit", "change light, gloss or colour of a decomposed photo"),
    _core("batch", "decompose many photos in parallel; resumable", "batch"),
    _core("export", "export a result as textures or a mesh"),
    _core("arrays", "export a result as plain NumPy arrays"),
    _core("evaluate", "measure the accuracy on a data set with ground truth"),
    _core("fit-priors", "fit the priors of shape, reflectance and light"),
    _core("completion", "print a completion script for a shell"),
)


def all_commands() -> Iterator[CommandEntry]:
    """Iterate over the commands of the core, then those of other installed packages.

    Yields
    ------
    CommandEntry
    """
    yield from CORE
    # Takes a tenth of a second: only for commands that are not of the core.
    from importlib.metadata import entry_points

    for entry in entry_points(group=_GROUP):
        try:
            yield entry.load()
        except ImportError as error:
            yield CommandEntry(entry.name, f"not available: {error}", entry.module)


def find_command(name: str) -> CommandEntry | None:
    """Find a command by its name.

    Parameters
    ----------
    name : str

    Returns
    -------
    CommandEntry or None
        None if there is no such command.
    """
    return next((entry for entry in all_commands() if entry.name == name), None)
