"""Rewrite imports of `isc_core` for the installed extension.

In the source tree the add-on imports `isc_core` by its name. In the extension, `isc_core` is a
sub-package: in a module `n` folders deep, `from isc_core.errors import InputError` becomes `from
...isc_core.errors import InputError` with 1 + n dots. Python's own parser locates these lines. It
then checks that all other imports are available to an installed extension: from Python itself,
Blender, NumPy and the extension.
"""

import ast
import sys

from isc_core.errors import InputError

CORE = "isc_core"
# The modules of the core that need only Python and NumPy, and may therefore be imported into
# Blender's own process.
LIGHT_MODULES = frozenset(
    {
        "isc_core.cli.interface.interrupts",
        "isc_core.cli.interface.terminal",
        "isc_core.cli.interface.values",
        "isc_core.errors",
        "isc_core.extras",
        "isc_core.imaging.bounding_box",
        "isc_core.imaging.row_blocks",
        "isc_core.imaging.srgb",
        "isc_core.imaging.upsampling",
        "isc_core.inpainting.pull_push",
        "isc_core.io.atomic",
        "isc_core.io.json_files",
        "isc_core.io.npy",
        "isc_core.io.png",
        "isc_core.io.reading_notes",
        "isc_core.io.source_stamp",
        "isc_core.io.stage_cache",
        "isc_core.lobe_fitting.specular_layer",
        "isc_core.photo.camera",
        "isc_core.photo.names",
        "isc_core.progress",
        "isc_core.refinement.gloss_note",
        "isc_core.result_files.diagnostics_json",
        "isc_core.result_files.diagnostics_text",
        "isc_core.result_files.exports.targets",
        "isc_core.result_files.mesh.options",
        "isc_core.result_files.mesh.rim_heights",
        "isc_core.result_files.object_folders",
        "isc_core.result_files.reading_notes_text",
        "isc_core.result_files.solids.back",
        "isc_core.result_files.solids.solid_mesh",
        "isc_core.result_files.solids.rim",
        "isc_core.result_files.solids.surface",
        "isc_core.scene.diagnostics",
        "isc_core.shading.ambient_occlusion",
        "isc_core.shading.brdf.energy",
        "isc_core.shading.brdf.ggx",
        "isc_core.shading.environment_map",
        "isc_core.shading.lights",
        "isc_core.shading.mirrored_environment",
        "isc_core.shading.perspective",
        "isc_core.shading.spherical_harmonics",
    }
)
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
    """Return the text of a module as it is shipped.

    Parameters
    ----------
    source : str
        Text in the source tree.
    name : str
        Path within the add-on, with forward slashes.

    Returns
    -------
    str
        The text with relative imports of `isc_core`.

    Raises
    ------
    InputError
        If an import would fail in an installed extension.
    """
    dots = "." * (1 + name.count("/"))
    lines = source.splitlines(keepends=True)
    for node in ast.walk(ast.parse(source, name)):
        if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module in LIGHT_MODULES:
            line, start, statement = lines[node.lineno - 1], node.col_offset, f"from {CORE}."
            if not line[start:].startswith(statement):
                raise InputError(
                    f"{name}:{node.lineno}: cannot rewrite the import: "
                    f"write `{statement}MODULE import NAME` on one line"
                )
            lines[node.lineno - 1] = f"{line[:start]}from {dots}{line[start + len('from ') :]}"
    rewritten = "".join(lines)
    _check_imports(rewritten, name)
    return rewritten


def _check_imports(source: str, name: str) -> None:
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
