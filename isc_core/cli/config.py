"""Defaults of options from a TOML file.

`isc.toml` in the current folder, or the file of `--config`, has a table for each command, with the
long names of its options:

    [decompose]
    model = "sirfs"
    max-size = 384
    full-size = true

    [edit.gloss]
    look = "metallic"

Options on the command line take precedence, also over those that they exclude, and a repeated one
replaces the list of the file. A file that was not given explicitly must not make
`isc` connect to other machines: `scheduler` requires `--config`. Paths are relative to the file.
Values are checked as on the command line; `--no-config` ignores the file.
"""

import argparse
import difflib
from collections.abc import Sequence
from pathlib import Path

from ..errors import InputError
from ..io.regular_files import read_regular
from .commands.registry import all_commands, find_command
from .interface.parser import GENERAL, actions_of
from .interface.values import Location

DEFAULT_FILE = Path("isc.toml")
_ONLY_IF_NAMED = frozenset({"scheduler"})
# Options that have no effect beside others, and are ignored if those are on the command line.
_REPLACED_BY = {"--full-size": "--max-size"}
_MAX_BYTES = 1 << 20


def apply_config(parser: argparse.ArgumentParser, arguments: Sequence[str]) -> Path | None:
    """Make the values of a configuration file the defaults of a parser.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        That of `isc`; changed in place.
    arguments : sequence of str
        The arguments to parse.

    Returns
    -------
    Path or None
        The file, if there is one.

    Raises
    ------
    InputError
        If the file cannot be read, or has an unknown table, option or value, or one that is
        accepted only with `--config`.
    """
    path, named = _find(arguments)
    if path is None:
        return None
    inner = dict(actions_of(parser))
    given = {word.partition("=")[0] for word in arguments if word.startswith("--")}
    for name, table in _read(path).items():
        if not isinstance(table, dict):
            raise InputError(f"{path}: {name!r} is outside any table: move it below [decompose]")
        if name in inner and inner[name].get_default("run") is not None:
            if not named and (barred := _ONLY_IF_NAMED & table.keys()):
                raise InputError(
                    f"{path}: {min(barred)} of [{name}] is accepted only from a file given with "
                    f"--config: use --config {path} if you trust it"
                )
            _apply(inner[name], table, path, name, given)
        elif find_command(name) is None:
            known = [entry.name for entry in all_commands()]
            raise InputError(f"{path}: unknown command {name!r}: {_advice(name, known)}")
    return path


def _find(arguments: Sequence[str]) -> tuple[Path | None, bool]:
    """The file, and whether the command line names it."""
    finder = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    finder.add_argument("--config", nargs="?", type=Path)
    finder.add_argument("--no-config", action="store_true")
    known, _ = finder.parse_known_args(arguments)
    if known.config is not None:
        return Path(known.config), True
    return (None if known.no_config or not DEFAULT_FILE.is_file() else DEFAULT_FILE), False


def _read(path: Path) -> dict[str, object]:
    import tomllib

    remedy = "give a TOML file with --config"
    if not path.exists():
        raise InputError(f"{path}: no such file: {remedy}")
    if path.stat().st_size > _MAX_BYTES:
        raise InputError(f"{path} is larger than {_MAX_BYTES} bytes: is it a configuration file?")
    try:
        # Editors on Windows write a byte order mark.
        return tomllib.loads(read_regular(path, None, remedy).decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not UTF-8: save it as UTF-8") from error
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path} is not valid TOML: {error}") from error


def _apply(
    parser: argparse.ArgumentParser,
    table: dict[str, object],
    path: Path,
    where: str,
    given: set[str],
) -> None:
    """Set defaults from a table, except those that the options `given` on the command line
    replace.
    """
    inner, options = dict(actions_of(parser)), _options(parser)
    for key, value in table.items():
        if key in inner and isinstance(value, dict):
            _apply(inner[key], value, path, f"{where}.{key}", given)
        elif key in options:
            action = options[key]
            excluded = _excluded_by(parser, action)
            if clash := [name for name in table if options.get(name) in excluded]:
                raise InputError(
                    f"{path}: {key} and {clash[0]} of [{where}] exclude each other: leave one out"
                )
            converted = _value(action, value, path, where)
            if not given & _replacing(action, excluded):
                parser.set_defaults(**{action.dest: converted})
            action.required = False
            for group in parser._mutually_exclusive_groups:
                group.required = group.required and action not in group._group_actions
        else:
            known = [*options, *inner]
            raise InputError(f"{path}: [{where}] has no option {key!r}: {_advice(key, known)}")


def _excluded_by(parser: argparse.ArgumentParser, action: argparse.Action) -> list[argparse.Action]:
    """The options that cannot be given together with one."""
    groups = (group._group_actions for group in parser._mutually_exclusive_groups)
    return [other for group in groups if action in group for other in group if other is not action]


def _replacing(action: argparse.Action, excluded: list[argparse.Action]) -> set[str]:
    """The options that, on the command line, replace the value that a file gives to one.

    An option that is not repeated replaces the default without further ado.
    """
    names = {_REPLACED_BY[name] for name in action.option_strings if name in _REPLACED_BY}
    names.update(*(other.option_strings for other in excluded))
    return names.union(action.option_strings) if _is_repeated(action) else names


def _is_repeated(action: argparse.Action) -> bool:
    return isinstance(action, argparse._AppendAction)


def _options(parser: argparse.ArgumentParser) -> dict[str, argparse.Action]:
    """The options that a file may set, by their long names."""
    return {
        option.removeprefix("--"): action
        for action in parser._actions
        for option in action.option_strings
        if option.startswith("--") and action.dest not in (*GENERAL, "help", "output")
    }


def _advice(name: str, known: list[str]) -> str:
    close = difflib.get_close_matches(name, known, 1)
    return f"did you mean {close[0]}?" if close else f"choose one of {', '.join(sorted(known))}"


def _value(action: argparse.Action, value: object, path: Path, where: str) -> object:
    """The value in the type of the option."""
    name = f"{path}: {action.option_strings[-1].removeprefix('--')} of [{where}]"
    if action.nargs == 0:
        if not isinstance(value, bool):
            raise InputError(f"{name} must be true or false, not {value!r}")
        return value if isinstance(action.const, bool) else action.default
    repeated = action.nargs is not None or _is_repeated(action)
    if repeated != isinstance(value, list):
        raise InputError(f"{name} must be {'a list' if repeated else 'one value'}, not {value!r}")
    if isinstance(value, list):
        if isinstance(action.nargs, int) and len(value) != action.nargs:
            raise InputError(f"{name} must be a list of {action.nargs} values, not {value!r}")
        return [_converted(action, one, path, name) for one in value]
    return _converted(action, value, path, name)


def _converted(action: argparse.Action, value: object, path: Path, name: str) -> object:
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise InputError(f"{name} must be a text or a number, not {value!r}")
    kind = action.type
    try:
        converted = kind(str(value)) if callable(kind) else str(value)
    except (argparse.ArgumentTypeError, ValueError) as error:
        raise InputError(f"{name}: {error}") from error
    if action.choices is not None and converted not in action.choices:
        raise InputError(f"{name}: unknown {value!r}: choose {', '.join(map(str, action.choices))}")
    if isinstance(converted, Location):
        return str(path.parent / converted)
    return path.parent / converted if isinstance(converted, Path) else converted
