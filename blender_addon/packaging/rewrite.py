"""In the source tree the add-on imports `isc_core` by its name; installed, `isc_core` is a part of
it and has to be imported from there.

The text of `from isc_core.errors import InputError` in a module `n` folders deep becomes `from
...isc_core.errors import InputError`, with 1 + n dots. Python's own parser says where such a line
stands, and afterwards that no import is left which an installed extension could not satisfy: other
than of Python itself, Blender, NumPy and the extension.
"""

import ast
import sys

from isc_core.errors import InputError

CORE = "isc_core"
# Of the core, only what needs nothing but Python and NumPy may be loaded into Blender's own
# process.
_LIGHT_NAMES = (
    "atomic",
    "environment",
    "errors",
    "json_files",
    "numpy_files",
    "progress",
    "srgb",
    "status_lines",
    "terminal",
)
LIGHT = {f"{CORE}.{name}" for name in _LIGHT_NAMES}
_BLENDER = {
    "addon_utils",
    "bl_ui",
    "blf",
    "bmesh",
    "bpy",
    "bpy_extras",
    "gpu",
    "gpu_extras",
    "imbuf",
    "mathutils",
    "numpy",
}
_ALLOWED = _BLENDER | set(sys.stdlib_module_names)


def installed_source(source: str, name: str) -> str:
    """The text of a module as it is shipped. `name`: its path within the add-on, with forward
    slashes.

    Raises `InputError` for an import that would not work in an installed extension.
    """
    dots = "." * (1 + name.count("/"))
    lines = source.splitlines(keepends=True)
    for node in ast.walk(ast.parse(source, name)):
        if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module in LIGHT:
            line, before, found = lines[node.lineno - 1], node.col_offset, f"from {CORE}."
            if not line[before:].startswith(found):
                raise InputError(
                    f"{name}:{node.lineno}: write `{found}MODULE import NAME` on one line, so that it can be changed"
                )
            lines[node.lineno - 1] = f"{line[:before]}from {dots}{line[before + len('from ') :]}"
    changed = "".join(lines)
    _check(changed, name)
    return changed


def _check(source: str, name: str) -> None:
    for node in ast.walk(ast.parse(source, name)):
        if isinstance(node, ast.Import):
            modules = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            modules = [node.module or ""]
        else:
            continue
        for module in modules:
            if module.partition(".")[0] not in _ALLOWED:
                raise InputError(
                    f"{name}:{node.lineno} imports {module}, which Blender's Python does not have"
                )
