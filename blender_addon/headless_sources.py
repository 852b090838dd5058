"""The photos, results and masks that a command line names, and the files made of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from isc_core.errors import InputError
from isc_core.photo.names import PHOTO_SUFFIXES

from .files.result_arrays import DESCRIPTION

_MASK_SUFFIX = "_mask"


@dataclass(frozen=True)
class Source:
    """A photo or a result, from which one object is built.

    Attributes
    ----------
    path : Path
        Photo file, or result folder.
    name : str
        Name of the files made of it, unique within a run.
    is_result : bool
        Whether `path` is a result folder.
    mask : Path or None
        Mask file; None uses the photo's transparency or black background.
    """

    path: Path
    name: str
    is_result: bool = False
    mask: Path | None = None


def find_sources(paths: Sequence[Path], mask: Path | None) -> list[Source]:
    """List photos and results, and those in other folders, sorted by name.

    Parameters
    ----------
    paths : sequence of Path
        Photos, result folders, and folders of either.
    mask : Path or None
        Mask of a single photo; or folder with the mask of `cup.jpg` in `cup.*` or `cup_mask.*`.
        None uses a file `cup_mask.*` beside `cup.jpg`.

    Returns
    -------
    list of Source
        Sources with unique names.

    Raises
    ------
    InputError
        If a path does not exist, is no photo, or has no mask in the folder of masks.
    """
    found = [source for path in paths for source in _list_sources(path)]
    photos = [source for source in found if not source.is_result]
    if mask is not None and not mask.exists():
        raise InputError(f"{mask}: no such mask")
    if mask is not None and not mask.is_dir() and len(photos) != 1:
        raise InputError(
            f"--mask {mask} is one file for {len(photos)} photos: give a folder of masks"
        )
    return [
        replace(source, name=name, mask=_find_mask(source, mask))
        for source, name in zip(found, _unique_names(found), strict=True)
    ]


def _list_sources(path: Path) -> list[Source]:
    if not path.exists():
        raise InputError(f"{path}: no such photo or folder")
    if not path.is_dir():
        return [Source(path, path.stem)]
    if (path / DESCRIPTION).is_file():
        return [Source(path, path.resolve().name, is_result=True)]
    entries = sorted(path.iterdir())
    results = [
        Source(entry, entry.name, is_result=True)
        for entry in entries
        if (entry / DESCRIPTION).is_file()
    ]
    photos = [
        Source(entry, entry.stem) for entry in entries if entry.is_file() and _is_photo(entry)
    ]
    if not results + photos:
        raise InputError(
            f"{path} contains no photo ({' '.join(PHOTO_SUFFIXES)}) and no result of isc decompose"
        )
    return sorted(results + photos, key=lambda source: source.path.name)


def _is_photo(path: Path) -> bool:
    return (
        path.suffix.lower() in PHOTO_SUFFIXES
        and not path.stem.endswith(_MASK_SUFFIX)
        and not path.name.startswith(".")
    )


def _unique_names(sources: Sequence[Source]) -> list[str]:
    """The sources' names, numbered where repeated; file systems may ignore case."""
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


def _find_mask(source: Source, mask: Path | None) -> Path | None:
    if source.is_result:
        return None
    if mask is not None and not mask.is_dir():
        return mask
    stem = source.path.stem
    stems = (stem, f"{stem}{_MASK_SUFFIX}") if mask else (f"{stem}{_MASK_SUFFIX}",)
    folder = mask or source.path.parent
    found = [
        path
        for path in sorted(folder.iterdir())
        if path.stem in stems and path.suffix.lower() in PHOTO_SUFFIXES and path != source.path
    ]
    if mask is not None and not found:
        raise InputError(f"{mask} contains no mask for {source.path.name}: name it {stem}.png")
    return found[0] if found else None


def output_files(
    sources: Sequence[Source],
    output: Path | None,
    suffixes: tuple[str, ...],
    option: str,
    together: bool,
) -> list[Path | None]:
    """Return the file of each source.

    Parameters
    ----------
    sources : sequence of Source
        The sources.
    output : Path or None
        Path with one of `suffixes` for a file; any other for a folder with a file per source; None
        for no files.
    suffixes : tuple of str
        Supported suffixes; files in a folder have the first.
    option : str
        Name of the option, for messages.
    together : bool
        Whether several sources may share one file.

    Returns
    -------
    list of Path or None
        One entry per source.

    Raises
    ------
    InputError
        For a single file that may not be shared, and for any other suffix unless a folder of that
        name exists.
    """
    if output is None:
        return [None] * len(sources)
    if output.suffix.lower() in suffixes:
        if len(sources) > 1 and not together:
            raise InputError(
                f"{option} {output} is one file for {len(sources)} objects: give a folder"
            )
        return [output] * len(sources)
    if output.suffix and not output.is_dir():
        raise InputError(
            f"{option} {output}: give a file that ends in {' or '.join(suffixes)}, or a folder "
            "(one with a dot must exist)"
        )
    return [output / f"{source.name}{suffixes[0]}" for source in sources]
