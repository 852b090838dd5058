"""The mesh of a result as a file for other programs, with its textures.

A `.glb` and a `.usdz` contain all data. Next to an `.obj` (with its `.mtl`) and a `.usd`, `.usda`
or `.usdc` are the textures NAME_basecolor.png, NAME_mesh_normal.png (where the mesh has fewer
vertices than pixels), for the specular level, where it varies, NAME_specular.png (sRGB) or, of USD,
NAME_ior.png, and where the rim is soft NAME_alpha.png or, of USD, NAME_opacity.png. NAME is that of
the file.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

from ...errors import InputError
from ...io.atomic import new_file, require_writable_file
from ..mesh.result import MeshResult
from .obj import encode_obj
from .usd import encode_usd

SUFFIXES: Mapping[str, tuple[str, ...]] = {
    "glb": (".glb",),
    "obj": (".obj",),
    "usd": (".usd", ".usda", ".usdc", ".usdz"),
}


def _encode_glb(built: MeshResult, path: Path) -> dict[str, bytes]:
    return {path.name: built.glb()}


_ENCODERS: Mapping[str, Callable[[MeshResult, Path], dict[str, bytes]]] = {
    "glb": _encode_glb,
    "obj": encode_obj,
    "usd": encode_usd,
}


def check_mesh_path(path: Path, kind: str) -> None:
    """Check, before the work, that a mesh can be written.

    Parameters
    ----------
    path : Path
    kind : str
        One of `SUFFIXES`.

    Raises
    ------
    InputError
        If the format is unknown, the name has another suffix, or the file cannot be written.
    """
    if kind not in SUFFIXES:
        raise InputError(f'unknown format "{kind}": choose {", ".join(SUFFIXES)}')
    if path.suffix.lower() not in SUFFIXES[kind]:
        raise InputError(f"{path}: give a name that ends with {' or '.join(SUFFIXES[kind])}")
    require_writable_file(path)


def write_mesh_file(
    built: MeshResult, path: Path, kind: str, keep: Sequence[Path] = ()
) -> list[Path]:
    """Write a mesh and its textures: all files or none.

    Parameters
    ----------
    built : MeshResult
    path : Path
    kind : str
        One of `SUFFIXES`.
    keep : sequence of Path
        Files that must not be replaced.

    Returns
    -------
    list of Path
        The files; `path` is the first.

    Raises
    ------
    InputError
        If a file cannot be written or would replace one of `keep`, or a package is missing.
    """
    check_mesh_path(path, kind)
    contents = _ENCODERS[kind](built, path)
    targets = [path.with_name(name) for name in contents]
    kept = {one.resolve() for one in keep}
    for target in targets:
        if target.resolve() in kept:
            raise InputError(
                f"{target} would be replaced by a texture: choose another name for {path}"
            )
    with ExitStack() as stack:
        # All are complete before the first is renamed; the mesh is renamed last.
        for target, content in zip(targets, contents.values(), strict=True):
            stack.enter_context(new_file(target)).write_bytes(content)
    return targets
