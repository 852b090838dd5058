"""The contents of a zip. Its bytes depend on nothing but its files.

Entries are sorted, dated 1980 and stored uncompressed: wheels are compressed already, and the rest
is comparatively small.
"""

import json
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from string import Template

from isc_core import __version__
from isc_core.io.atomic import new_file

from .rewrite import installed_source
from .targets import Target

ROOT = Path(__file__).resolve().parents[2]
_ADDON, _CORE = ROOT / "blender_addon", ROOT / "isc_core"
_MANIFEST = "blender_manifest.toml"
_CORE_FILES = {".py", ".npz", ".typed"}
_DATE = (1980, 1, 1, 0, 0, 0)


def archive_name(target: Target) -> str:
    """Return the file name of a target's zip.

    Parameters
    ----------
    target : Target
        Platform and Python version.

    Returns
    -------
    str
        Name with the version of ISC and the name of the target.
    """
    return f"isc_intrinsic-{__version__}-{target.name}.zip"


def contents(
    target: Target, wheels: Sequence[Path], libraries: Sequence[Path] = ()
) -> dict[str, bytes | Path]:
    """Return the contents of a zip.

    Parameters
    ----------
    target : Target
        Platform and Python version.
    wheels : sequence of Path
        Wheels to include.
    libraries : sequence of Path, optional
        Libraries of compiled kernels.

    Returns
    -------
    dict of str to bytes or Path
        Content, or file to copy, by path inside the zip.

    Raises
    ------
    InputError
        If an import of a module would fail in an installed extension.
    """
    entries: dict[str, bytes | Path] = {
        "LICENSE": ROOT / "LICENSE",
        _MANIFEST: manifest(target, wheels).encode(),
    }
    for path in sorted(_ADDON.rglob("*.py")):
        name = path.relative_to(_ADDON).as_posix()
        if not name.startswith("packaging/"):
            entries[name] = installed_source(path.read_text(encoding="utf-8"), name).encode()
    core = [path for path in sorted(_CORE.rglob("*")) if path.suffix in _CORE_FILES]
    entries |= {f"isc_core/{path.relative_to(_CORE).as_posix()}": path for path in core}
    entries |= {f"isc_core/numerics/compiled/{path.name}": path for path in libraries}
    return entries | {f"wheels/{path.name}": path for path in wheels}


def manifest(target: Target, wheels: Sequence[Path]) -> str:
    """Return the text of blender_manifest.toml.

    Parameters
    ----------
    target : Target
        Platform and Python version.
    wheels : sequence of Path
        Wheels of the zip.

    Returns
    -------
    str
        The text.
    """
    template = Template((_ADDON / _MANIFEST).read_text(encoding="utf-8").partition("\n")[2])
    return template.substitute(
        version=__version__,
        blender_min=target.blender_min,
        # Omitted where there is no maximum: Blender 5.2 rejects an empty one.
        blender_max=f'blender_version_max = "{target.blender_max}"' if target.blender_max else "",
        platforms=json.dumps([target.platform]),
        wheels=json.dumps([f"./wheels/{path.name}" for path in wheels], indent=2),
    )


def write_archive(path: Path, entries: Mapping[str, bytes | Path]) -> None:
    """Write a zip, completely or not at all.

    Parameters
    ----------
    path : Path
        The zip.
    entries : mapping of str to bytes or Path
        Content, or file to copy, by path inside the zip.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    with new_file(path) as partial, zipfile.ZipFile(partial, "w", zipfile.ZIP_STORED) as archive:
        for name, content in sorted(entries.items()):
            entry = zipfile.ZipInfo(name, _DATE)
            entry.create_system, entry.external_attr = 3, 0o100644 << 16
            archive.writestr(entry, content if isinstance(content, bytes) else content.read_bytes())


def listing(path: Path) -> list[str]:
    """Summarise a zip.

    Parameters
    ----------
    path : Path
        The zip.

    Returns
    -------
    list of str
        Lines with its size and that of its parts, the largest first.
    """
    sizes: dict[str, int] = {}
    with zipfile.ZipFile(path) as archive:
        for entry in archive.infolist():
            top = entry.filename.partition("/")[0]
            part = {"wheels": entry.filename, "isc_core": top}.get(top, "the add-on")
            sizes[part] = sizes.get(part, 0) + entry.file_size
    lines = [f"{path.name}: {path.stat().st_size / 1e6:.1f} MB"]
    return lines + [
        f"  {size / 1e6:7.2f} MB  {part}"
        for part, size in sorted(sizes.items(), key=lambda item: -item[1])
    ]
