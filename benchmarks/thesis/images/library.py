"""Test images of the thesis' tables and figures: three kinds, and photos of real objects.

Problem: `specular` has significant specularity: the laboratory photos apple, pear, potato, teabag1
and teabag2, as far as a copy of MIT-Berkeley is given, and Shen & Zheng's photos with ground truth.
`synthetic` has rendered scenes; `glossy-mit` replaces the thesis' own set MIT-Berkeley-UTeM, which
is not public. `diffuse` has images without highlights. Without data, all images are rendered (see
`rendered`).

Citation: R. Grosse, M. K. Johnson, E. H. Adelson, W. T. Freeman (2009),
doi:10.1109/ICCV.2009.5459428; J. T. Barron, J. Malik (2015), doi:10.1109/TPAMI.2014.2377712; H.-L.
Shen, Z.-H. Zheng (2013), doi:10.1364/AO.52.004483.

Limits: Shen & Zheng's 8-bit codes are linearised by the sRGB curve. Errors therefore differ from
those published on the codes.
"""

import hashlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from isc_core.batch.fetch import sha256
from isc_core.datasets.highlight_set import list_shen_zheng, load_shen_zheng
from isc_core.datasets.mit_berkeley import list_objects, load_object
from isc_core.errors import InputError
from isc_core.imaging.bounding_box import mask_slices
from isc_core.imaging.srgb import srgb_to_linear
from isc_core.masking.finder import MaskSearch
from isc_core.photo import WholeFrame, read_photo
from isc_core.progress import Monitor

from .subject import QUICK_SIZE, Subject, downsample_subject

KINDS = ("specular", "synthetic", "diffuse")
SIGNIFICANT = ("apple", "pear", "potato", "teabag1", "teabag2")
FULL_PHOTO = 320  # longest side of a photo, pixels
_QUICK_COUNT, _DIFFUSE_COUNT, _GLOSSY_COUNT = 2, 4, 3
_BESIDE = ("photos", "highlight")
_SETS = ("", "mit_berkeley_train", "data", "data/mit_berkeley_train")
_LABORATORY = ("laboratory", "MIT-Berkeley-Laboratory")
_NATURAL = ("natural", "MIT-Berkeley-Natural")
_PHOTO_SUFFIXES = (".png", ".bmp", ".ppm", ".jpg", ".jpeg", ".tif", ".tiff")


@dataclass(frozen=True)
class SubjectLibrary:
    """Source of the test images.

    Attributes
    ----------
    cache : Path
        Folder for rendered images.
    data : Path or None
        Folder of public data sets; None renders everything.
    quick : bool
        Two small images of each kind.
    seed : int
        Seed of the rendered images.
    """

    cache: Path
    data: Path | None
    quick: bool
    seed: int

    def subjects(self, kind: str, monitor: Monitor) -> tuple[Subject, ...]:
        """Load or render the images of one kind.

        Parameters
        ----------
        kind : str
            One of `KINDS`.
        monitor : Monitor
            Progress and cancellation.

        Returns
        -------
        tuple of Subject
            The images, at most two in a quick run.

        Raises
        ------
        InputError
            If data are damaged, or an image must be rendered and no renderer is installed.
        """
        if kind not in KINDS:
            raise ValueError(f"unknown kind {kind!r}; expected one of {', '.join(KINDS)}")
        loaders: dict[str, Callable[[Monitor], Iterator[Subject]]] = {
            "specular": self._specular, "synthetic": self._synthetic, "diffuse": self._diffuse,
        }  # fmt: skip
        return tuple(self._sized(subject) for subject in self._first(loaders[kind](monitor)))

    def photos(self, monitor: Monitor) -> tuple[Subject, ...]:
        """Load photos without ground truth; render objects instead if there are none.

        Parameters
        ----------
        monitor : Monitor
            Progress and cancellation.

        Returns
        -------
        tuple of Subject
            Subjects of kind "photo", without layers and truth.
        """
        paths = self.photo_paths
        if not paths:
            rendered_subjects = (subject for subject in self._rendered("scene", monitor))
            return tuple(
                self._sized(replace(s, kind="photo", diffuse=None, specular=None, truth=None))
                for s in self._first(rendered_subjects)
            )
        stems = Counter(path.stem for path in paths)
        return tuple(
            self._sized(
                # Results are kept by name.
                _photo(
                    path,
                    path.stem if stems[path.stem] == 1 else f"{path.parent.name}-{path.name}",
                )
            )
            for path in (paths[:_QUICK_COUNT] if self.quick else paths)
        )

    @property
    def photo_paths(self) -> list[Path]:
        """Photo files without ground truth."""
        folders = [folder for name in _BESIDE if (folder := self._beside(name)) is not None]
        paths = [path for folder in folders for path in _pictures(folder)]
        return [
            path
            for path in paths
            if not path.stem.endswith("_gt") and not path.with_name(f"{path.stem}_gt.bmp").exists()
        ]

    @property
    def fingerprint(self) -> str:
        """Digest of the contents of the available data, wherever the folder is."""
        if self.data is None:
            return "rendered"
        beside = [folder for name in _BESIDE if (folder := self._beside(name)) is not None]
        return _digest(
            [
                self._objects_fingerprint,
                *(f"{each.name} {_files_digest(each, _pictures(each))}" for each in beside),
            ]
        )

    @property
    def _objects_fingerprint(self) -> str:
        """Digest of MIT-Berkeley's files; empty without a copy."""
        if self._root is None:
            return ""
        folders = [self._root / name for name in (*_LABORATORY, *_NATURAL)]
        return _digest(_files_digest(folder, folder.rglob("*")) for folder in folders)

    def check(self) -> None:
        """Check that the data folder holds a known data set.

        Raises
        ------
        InputError
            If it is no folder, or holds no known data set.
        """
        if self.data is None:
            return
        if not self.data.is_dir():
            raise InputError(
                f"{self.data} is not a folder; pass the folder that holds MIT-Berkeley "
                f"({' or '.join(_LABORATORY)})"
            )
        if self._root is None and all(self._beside(name) is None for name in _BESIDE):
            raise InputError(
                f"{self.data} holds no known data set; expected MIT-Berkeley "
                f"({' or '.join(_LABORATORY)}), highlight/ or photos/"
            )

    @property
    def _root(self) -> Path | None:
        """Folder of the MIT-Berkeley set."""
        if self.data is None:
            return None
        candidates = (self.data / name for name in _SETS)
        return next(
            (root for root in candidates if any((root / name).is_dir() for name in _LABORATORY)),
            None,
        )

    @property
    def _objects(self) -> tuple[str, ...]:
        return () if self._root is None else list_objects(self._root, "laboratory")

    def _beside(self, name: str) -> Path | None:
        """Folder of photos in the data folder or next to it."""
        if self.data is None:
            return None
        # If the data folder is the set itself, its siblings count too.
        outer = (self.data.parent / name,) if self._root == self.data else ()
        return next(
            (
                folder
                for folder in (self.data / name, self.data / "data" / name, *outer)
                if folder.is_dir()
            ),
            None,
        )

    def _specular(self, monitor: Monitor) -> Iterator[Subject]:
        names = [name for name in SIGNIFICANT if name in self._objects]
        highlight = self._beside("highlight")
        pairs = () if highlight is None else list_shen_zheng(highlight)
        if not names and not pairs:
            yield from self._rendered("scene", monitor)
        for name in names:
            yield _laboratory(self._required_root(), name, "original", "specular")
        for name in pairs:
            assert highlight is not None
            yield _shen_zheng(highlight, name, f"highlight-{name}" if name in names else name)

    def _synthetic(self, monitor: Monitor) -> Iterator[Subject]:
        yield from self._rendered("glossy", monitor)
        yield from list(self._rendered("synth", monitor))

    def _diffuse(self, monitor: Monitor) -> Iterator[Subject]:
        names = [
            *(name for name in SIGNIFICANT if name in self._objects),
            *(name for name in self._objects if name not in SIGNIFICANT),
        ]
        for name in names[:_DIFFUSE_COUNT]:
            yield _laboratory(self._required_root(), name, "diffuse", "diffuse")
        if not names:
            for subject in self._rendered("scene", monitor):
                yield _without_highlights(subject)

    def _rendered(self, family: str, monitor: Monitor) -> Iterator[Subject]:
        from .rendered import rendered_subjects

        names = [
            *(n for n in SIGNIFICANT if n in self._objects),
            *(n for n in self._objects if n not in SIGNIFICANT),
        ][:_GLOSSY_COUNT]
        return rendered_subjects(
            family,
            self.cache,
            self._root,
            self._objects_fingerprint,
            names,
            QUICK_SIZE if self.quick else 256,
            self.seed,
            monitor,
        )

    def _required_root(self) -> Path:
        assert self._root is not None
        return self._root

    def _first(self, subjects: Iterator[Subject]) -> Iterator[Subject]:
        for number, subject in enumerate(subjects):
            yield subject
            if self.quick and number + 1 >= _QUICK_COUNT:
                return

    def _sized(self, subject: Subject) -> Subject:
        longest = QUICK_SIZE if self.quick else FULL_PHOTO if subject.truth is None else 10**6
        return downsample_subject(subject, longest)


def _laboratory(root: Path, name: str, used: str, kind: str) -> Subject:
    """Load a laboratory object on its evaluation crop."""
    truth, bare = (load_object(root, name, "laboratory", layer) for layer in (used, "diffuse"))
    inside = truth.mask[..., None]
    image, diffuse = (
        np.where(inside, layer.image, 0).astype(np.float32) for layer in (truth, bare)
    )
    return Subject(name, kind, image, truth.mask, diffuse, np.maximum(image - diffuse, 0), truth)


def _shen_zheng(folder: Path, file: str, name: str) -> Subject:
    pair = load_shen_zheng(folder, file)
    image, diffuse = (
        srgb_to_linear(layer).astype(np.float32) for layer in (pair.image, pair.diffuse)
    )
    return Subject(name, "specular", image, pair.mask, diffuse, np.maximum(image - diffuse, 0))


def _without_highlights(subject: Subject) -> Subject:
    """Replace a subject's image by its diffuse layer."""
    assert subject.diffuse is not None and subject.truth is not None
    image = subject.diffuse
    truth = replace(
        subject.truth, image=image.astype(float), valid=subject.mask & (image > 0).all(-1)
    )
    return Subject(subject.name, "diffuse", image, subject.mask, image, np.zeros_like(image), truth)


def _photo(path: Path, name: str) -> Subject:
    """Read a photo: of the highlight set whole, others with a mask as in `isc decompose`."""
    if path.parent.name == "highlight":
        photo = read_photo(path, whole_frame=WholeFrame.WITHOUT_MASK)
    else:
        photo = read_photo(path, finder=MaskSearch())
    rows, columns = mask_slices(photo.mask)
    part = (
        slice(max(rows.start - 4, 0), rows.stop + 4),
        slice(max(columns.start - 4, 0), columns.stop + 4),
    )
    return Subject(name, "photo", photo.image[part], photo.mask[part])


def _pictures(folder: Path) -> list[Path]:
    """List the image files of a folder by name."""
    return [path for path in sorted(folder.iterdir()) if path.suffix.lower() in _PHOTO_SUFFIXES]


def _files_digest(folder: Path, files: Iterable[Path]) -> str:
    """Digest of the names and contents of some files of a folder; empty if there are none."""
    return _digest(
        f"{path.relative_to(folder).as_posix()} {_content(path, size, changed)}"
        for path in sorted(files)
        if path.is_file()
        for size, changed in [(path.stat().st_size, path.stat().st_mtime_ns)]
    )


@cache
def _content(path: Path, size: int, changed: int) -> str:
    """Digest of a file, read again only after its size or time changed."""
    del size, changed
    return sha256(path)


def _digest(parts: Iterable[str]) -> str:
    """Digest of several texts; empty if there are none."""
    each = list(parts)
    return hashlib.sha256("\n".join(each).encode()).hexdigest()[:12] if each else ""
