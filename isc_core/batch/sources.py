"""The inputs of a batch: photos, folders, patterns and manifests, local or in an object store.

A file `cup_mask.*` next to `cup.jpg` is its mask; in a folder of masks it is `cup_mask.*` or
`cup.*`. Folders are not searched recursively, but patterns with ** are; what a run has written into
its output is not a photo. Files are sorted by name.
"""

import glob
import os
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path

from ..errors import InputError
from ..photo.names import PHOTO_SUFFIXES
from .fetch import file_system, is_url
from .item import BatchItem, ImageRecipe
from .manifest import SUFFIXES, Manifest
from .run_folder import RunFolder

PHOTOS = (*PHOTO_SUFFIXES, ".npy")
_MASK = "_mask"


class Inputs:
    """The items of all inputs; can be iterated any number of times.

    Folders and patterns are listed once, manifests are streamed each time. `masks` is a folder of
    masks; None for masks next to the photos. Patterns do not match files that runs wrote into
    `output`. Raises `InputError` for an input that does not exist or has no photo.
    """

    def __init__(
        self,
        inputs: Sequence[str],
        masks: str | None,
        recipe: ImageRecipe,
        output: Path | None = None,
    ) -> None:
        self._output = None if output is None else RunFolder(Path(os.path.realpath(output)))
        self._stem_table = lru_cache(maxsize=64)(_by_stem)
        self._masks = None if masks is None else masks.rstrip("/") or masks
        if self._masks is not None and not _files(self._masks):
            raise InputError(f"--masks {masks}: no such folder, or it is empty")
        self._parts: list[Iterable[BatchItem]] = [self._part(text, recipe) for text in inputs]

    def __iter__(self) -> Iterator[BatchItem]:
        for part in self._parts:
            yield from part

    def _part(self, text: str, recipe: ImageRecipe) -> Iterable[BatchItem]:
        if text.lower().endswith(SUFFIXES):
            return Manifest(text, recipe)
        photos = _listed(text, self._output)
        if not photos:
            raise InputError(
                f"{text}: no such photo, folder or manifest, or no photo in it ({' '.join(PHOTOS)})"
            )
        return [BatchItem(location, self._mask_of(location), label=location) for location in photos]

    def _mask_of(self, location: str) -> str:
        """The mask that belongs to a photo, "" for none.

        Raises `InputError` if a folder of masks has none.
        """
        folder, _, name = location.rpartition("/")
        stem = name.rpartition(".")[0]
        place = folder if self._masks is None else self._masks
        stems = self._stem_table(place)
        candidates = (f"{stem}{_MASK}",) if self._masks is None else (f"{stem}{_MASK}", stem)
        for candidate in candidates:
            found = stems.get(candidate)
            if found is not None and not (found == name and _is_same(place, folder)):
                return f"{place}/{found}"
        if self._masks is not None:
            raise InputError(f"--masks {self._masks} has no mask for {name}: name it {stem}.png")
        return ""


def _is_photo(name: str) -> bool:
    stem, dot, suffix = name.rpartition(".")
    return (
        f"{dot}{suffix}".lower() in PHOTOS and not stem.endswith(_MASK) and not name.startswith(".")
    )


def _is_same(folder: str, other: str) -> bool:
    """Whether two locations are the same folder."""
    if is_url(folder) or is_url(other):
        return folder == other
    return os.path.realpath(folder or ".") == os.path.realpath(other or ".")


def _listed(text: str, output: RunFolder | None) -> list[str]:
    """The photos of an input, sorted."""
    if is_url(text):
        return _listed_remote(text)
    if Path(text).is_dir():
        folder = text.rstrip("/") or text
        return [f"{folder}/{name}" for name in _files(folder) if _is_photo(name)]
    if Path(text).exists():
        return [text if "/" in text else f"./{text}"]
    photos = [path for path in glob.iglob(text, recursive=True) if _is_photo(Path(path).name)]
    if output is not None:
        own = {folder: output.wrote(Path(folder)) for folder in set(map(os.path.dirname, photos))}
        photos = [path for path in photos if not own[os.path.dirname(path)]]
    return sorted(f"./{path}" if "/" not in path else path for path in photos)


def _listed_remote(url: str) -> list[str]:
    system, path = file_system(url)
    try:
        if glob.has_magic(path):
            return sorted(
                system.unstrip_protocol(photo)
                for photo in system.glob(path)
                if _is_photo(photo.rpartition("/")[2])
            )
        if system.isdir(path):
            folder = url.rstrip("/")
            return [f"{folder}/{name}" for name in _files(folder) if _is_photo(name)]
        return [url] if system.exists(path) else []
    except OSError as error:
        raise InputError(f"{url} cannot be listed: {error.strerror or error}") from error


def _files(folder: str) -> list[str]:
    """Names of the files in a folder, sorted; empty if the folder does not exist."""
    if is_url(folder):
        system, path = file_system(folder)
        try:
            return sorted(
                entry["name"].rpartition("/")[2]
                for entry in system.ls(path, detail=True)
                if entry["type"] == "file"
            )
        except FileNotFoundError:
            return []
    try:
        with os.scandir(folder or ".") as entries:
            return sorted(entry.name for entry in entries if not _is_folder(entry))
    except (FileNotFoundError, NotADirectoryError):
        return []
    except OSError as error:
        raise InputError(f"{folder} cannot be listed: {error.strerror}") from error


def _is_folder(entry: os.DirEntry[str]) -> bool:
    """Whether an entry is a folder; a broken link is not, and later fails as an image."""
    try:
        return entry.is_dir()
    except OSError:  # a loop of links
        return False


def _by_stem(folder: str) -> dict[str, str]:
    """The photos and masks of a folder by their stems; the first one of equal stems."""
    photos: dict[str, str] = {}
    for name in _files(folder):
        stem, dot, suffix = name.rpartition(".")
        if f"{dot}{suffix}".lower() in PHOTOS:
            photos.setdefault(stem, name)
    return photos
