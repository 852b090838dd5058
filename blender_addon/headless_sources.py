"""What a command line names: which photos and results, with which masks, and what the files made of
them are called.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from isc_core.errors import InputError

PHOTOS = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".ppm", ".pgm", ".exr", ".hdr")
_MARK = "decomposition.json"
_MASK = "_mask"


@dataclass(frozen=True)
class Source:
    """One object to be built. `path`: a photo, or the folder of a result (`is_result`). `mask`:
    None leaves it to the photo.

    `name`: of the files that come of it; no two sources of a run have the same.
    """

    path: Path
    name: str
    is_result: bool = False
    mask: Path | None = None


def find_sources(paths: Sequence[Path], mask: Path | None) -> list[Source]:
    """Photos, results, and the photos and results in other folders, in order of their names.

    `mask`: a file, for one photo; or a folder, where the mask of `cup.jpg` is `cup.*` or
    `cup_mask.*`. Without it, a file `cup_mask.*` beside `cup.jpg` is its mask. Raises `InputError`
    for what is not there, is not a photo, or has no mask in the folder of masks.
    """
    found = [source for path in paths for source in _in(path)]
    photos = [source for source in found if not source.is_result]
    if mask is not None and not mask.exists():
        raise InputError(f"{mask}: there is no such mask")
    if mask is not None and not mask.is_dir() and len(photos) != 1:
        raise InputError(
            f"--mask {mask} is one file, but there are {len(photos)} photos: give a folder of masks"
        )
    return [
        replace(source, name=name, mask=_mask_of(source, mask))
        for source, name in zip(found, _unlike(found), strict=True)
    ]


def _in(path: Path) -> list[Source]:
    if not path.exists():
        raise InputError(f"{path}: there is no such photo or folder")
    if not path.is_dir():
        return [Source(path, path.stem)]
    if (path / _MARK).is_file():
        return [Source(path, path.resolve().name, is_result=True)]
    entries = sorted(path.iterdir())
    results = [
        Source(entry, entry.name, is_result=True) for entry in entries if (entry / _MARK).is_file()
    ]
    photos = [
        Source(entry, entry.stem) for entry in entries if entry.is_file() and _is_photo(entry)
    ]
    if not results + photos:
        raise InputError(
            f"{path} holds no photo ({' '.join(PHOTOS)}) and no result of isc decompose"
        )
    return sorted(results + photos, key=lambda source: source.path.name)


def _is_photo(path: Path) -> bool:
    return (
        path.suffix.lower() in PHOTOS
        and not path.stem.endswith(_MASK)
        and not path.name.startswith(".")
    )


def _unlike(sources: Sequence[Source]) -> list[str]:
    """The sources' names, with a number behind those that were given before; file systems may not
    tell capitals apart.
    """
    names: list[str] = []
    taken: set[str] = set()
    for source in sources:
        name, number = source.name, 1
        while name.lower() in taken:
            number += 1
            name = f"{source.name}-{number}"
        taken.add(name.lower())
        names.append(name)
    return names


def _mask_of(source: Source, mask: Path | None) -> Path | None:
    if source.is_result:
        return None
    if mask is not None and not mask.is_dir():
        return mask
    stems = (
        (source.path.stem, f"{source.path.stem}{_MASK}")
        if mask
        else (f"{source.path.stem}{_MASK}",)
    )
    folder = mask or source.path.parent
    found = [
        path
        for path in sorted(folder.iterdir())
        if path.stem in stems and path.suffix.lower() in PHOTOS and path != source.path
    ]
    if mask is not None and not found:
        raise InputError(
            f"{mask} holds no mask for {source.path.name}: name it {source.path.stem}.png"
        )
    return found[0] if found else None


def output_files(
    sources: Sequence[Source],
    output: Path | None,
    suffixes: tuple[str, ...],
    option: str,
    together: bool,
) -> list[Path | None]:
    """The file that each source goes to.

    `output`: None for no files; a path that ends in one of `suffixes` is a file; any other is a
    folder, where each source gets a file with its name and the first suffix. `together`: whether
    several sources may share one file. Raises `InputError` where they may not, and for another
    suffix, unless a folder is called so: who writes out.jpg means a file.
    """
    if output is None:
        return [None] * len(sources)
    if output.suffix.lower() in suffixes:
        if len(sources) > 1 and not together:
            raise InputError(
                f"{option} {output} is one file, but there are {len(sources)} objects: give a folder"
            )
        return [output] * len(sources)
    if output.suffix and not output.is_dir():
        raise InputError(
            f"{option} {output}: give a file that ends in {' or '.join(suffixes)}, or a folder (one with a dot has to exist)"
        )
    return [output / f"{source.name}{suffixes[0]}" for source in sources]
