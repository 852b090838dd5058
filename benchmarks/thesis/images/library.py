"""The images that the thesis' tables and figures are made on: three kinds of them, and photos of
real objects.

"specular": significant specularity, the laboratory photos of apple, pear, potato, teabag1 and
teabag2 as far as a copy of MIT-Berkeley has them, and Shen & Zheng's photos with a ground truth.
"synthetic": rendered scenes; `glossy-mit` stands in for the thesis' own MIT-Berkeley-UTeM set,
which is not public. "matt": diffuse images, in which no highlight is. Without data all are rendered
(`rendered`).

Citation: R. Grosse, M. K. Johnson, E. H. Adelson, W. T. Freeman (2009),
doi:10.1109/ICCV.2009.5459428; J. T. Barron, J. Malik (2015), doi:10.1109/TPAMI.2014.2377712; H.-L.
Shen, Z.-H. Zheng (2013), doi:10.1364/AO.52.004483.

Limits: Shen & Zheng's 8-bit codes are made linear here by the sRGB curve, so that figures differ
from those published on the codes.
"""

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from isc_core.box import mask_slices
from isc_core.datasets import MitBerkeleyObject, list_objects, load_object
from isc_core.errors import InputError
from isc_core.highlight_set import list_shen_zheng, load_shen_zheng
from isc_core.photo import read_photo, srgb_to_linear
from isc_core.progress import Monitor

KINDS = ("specular", "synthetic", "matt")
SIGNIFICANT = ("apple", "pear", "potato", "teabag1", "teabag2")
QUICK_SIZE, FULL_PHOTO = 96, 320  # longest sides, pixels
_QUICK_MANY, _MATT_MANY, _GLOSSY_MANY = 2, 4, 3
_SETS = ("", "mit_berkeley_train", "data", "data/mit_berkeley_train")
_LABORATORY = ("laboratory", "MIT-Berkeley-Laboratory")
_PHOTO_SUFFIXES = (".png", ".bmp", ".ppm", ".jpg", ".jpeg", ".tif", ".tiff")


@dataclass(frozen=True)
class Subject:
    """One image with what is known about it.

    `image`: (H, W, 3) float32, linear, >= 0. `mask`: (H, W) bool. `diffuse`, `specular`: (H, W, 3)
    float32, their sum is the image; None where unknown. `truth`: height, light, shading and
    reflectance, on the same pixels; None where unknown.
    """

    name: str
    kind: str
    image: np.ndarray
    mask: np.ndarray
    diffuse: np.ndarray | None = None
    specular: np.ndarray | None = None
    truth: MitBerkeleyObject | None = None


@dataclass(frozen=True)
class Library:
    """Where subjects come from. `cache`: a folder for what is rendered. `data`: a folder of public
    data, or None. `quick`: two small ones of each kind. `seed`: of what is rendered.
    """

    cache: Path
    data: Path | None
    quick: bool
    seed: int

    def subjects(self, kind: str, monitor: Monitor) -> tuple[Subject, ...]:
        """The images of one of `KINDS`.

        Raises `InputError` for damaged data and where nothing can be rendered.
        """
        if kind not in KINDS:
            raise ValueError(f"unknown kind {kind!r}: choose of {', '.join(KINDS)}")
        makers: dict[str, Callable[[Monitor], Iterator[Subject]]] = {
            "specular": self._specular, "synthetic": self._synthetic, "matt": self._matt,
        }  # fmt: skip
        return tuple(self._sized(subject) for subject in self._some(makers[kind](monitor)))

    def photos(self, monitor: Monitor) -> tuple[Subject, ...]:
        """Photos of real objects; rendered stand-ins without data that has any."""
        paths = self.photo_paths
        if not paths:
            rendered = (subject for subject in self._rendered("scene", monitor))
            return tuple(
                self._sized(replace(s, kind="photo", diffuse=None, specular=None, truth=None))
                for s in self._some(rendered)
            )
        return tuple(
            self._sized(_photo(path)) for path in (paths[:_QUICK_MANY] if self.quick else paths)
        )

    @property
    def photo_paths(self) -> list[Path]:
        """The files of photos without a known truth."""
        folders = [
            folder for name in ("photos", "highlight") if (folder := self._beside(name)) is not None
        ]
        paths = [
            p
            for folder in folders
            for p in sorted(folder.iterdir())
            if p.suffix.lower() in _PHOTO_SUFFIXES
        ]
        return [
            path
            for path in paths
            if not path.stem.endswith("_gt") and not path.with_name(f"{path.stem}_gt.bmp").exists()
        ]

    @property
    def fingerprint(self) -> str:
        """Changes with the data: names of what is there, and whether there is any."""
        if self.data is None:
            return "rendered"
        names = [
            *self._objects,
            *(
                folder.name
                for name in ("photos", "highlight")
                if (folder := self._beside(name)) is not None
            ),
        ]
        return hashlib.sha256(" ".join(names).encode()).hexdigest()[:12]

    def check(self) -> None:
        """Raises `InputError` where the data folder holds nothing that is known here."""
        if self.data is None:
            return
        if not self.data.is_dir():
            raise InputError(
                f"{self.data} is not a folder: give the one that holds MIT-Berkeley ({' or '.join(_LABORATORY)})"
            )
        if (
            self._root is None
            and self._beside("photos") is None
            and self._beside("highlight") is None
        ):
            raise InputError(
                f"{self.data} holds nothing known here: MIT-Berkeley (a folder {' or '.join(_LABORATORY)}), highlight/ or photos/"
            )

    @property
    def _root(self) -> Path | None:
        """The folder of the MIT-Berkeley set."""
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
        """A folder of photos in or beside the data."""
        if self.data is None:
            return None
        # A folder beside the data counts where the data is the set itself.
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
            yield _laboratory(self._root_given(), name, "original", "specular")
        for name in pairs:
            assert highlight is not None
            yield _shen_zheng(highlight, name)

    def _synthetic(self, monitor: Monitor) -> Iterator[Subject]:
        yield from self._rendered("glossy", monitor)
        yield from list(self._rendered("synth", monitor))

    def _matt(self, monitor: Monitor) -> Iterator[Subject]:
        names = [
            *(name for name in SIGNIFICANT if name in self._objects),
            *(name for name in self._objects if name not in SIGNIFICANT),
        ]
        for name in names[:_MATT_MANY]:
            yield _laboratory(self._root_given(), name, "diffuse", "matt")
        if not names:
            for subject in self._rendered("scene", monitor):
                yield _matt(subject)

    def _rendered(self, family: str, monitor: Monitor) -> Iterator[Subject]:
        from .rendered import rendered

        names = [
            *(n for n in SIGNIFICANT if n in self._objects),
            *(n for n in self._objects if n not in SIGNIFICANT),
        ][:_GLOSSY_MANY]
        return rendered(
            family,
            self.cache,
            self._root,
            names,
            QUICK_SIZE if self.quick else 256,
            self.seed,
            monitor,
        )

    def _root_given(self) -> Path:
        assert self._root is not None
        return self._root

    def _some(self, subjects: Iterator[Subject]) -> Iterator[Subject]:
        for number, subject in enumerate(subjects):
            yield subject
            if self.quick and number + 1 >= _QUICK_MANY:
                return

    def _sized(self, subject: Subject) -> Subject:
        longest = QUICK_SIZE if self.quick else FULL_PHOTO if subject.truth is None else 10**6
        return shrunk(subject, longest)


def shrunk(subject: Subject, longest: int) -> Subject:
    """The subject with its longest side at most `longest` pixels: means over blocks of the object's
    own pixels; heights scaled along.
    """
    side = max(subject.mask.shape)
    factor = -(-side // longest)
    if factor <= 1:
        return subject
    mask = _blocks(subject.mask.astype(float), None, factor) >= 0.5

    def less(values: np.ndarray | None) -> np.ndarray | None:
        return (
            None if values is None else _blocks(values, subject.mask, factor).astype(values.dtype)
        )

    image, diffuse, specular = (
        less(values) for values in (subject.image, subject.diffuse, subject.specular)
    )
    assert image is not None
    truth = (
        None if subject.truth is None else _shrunk_truth(subject.truth, subject.mask, mask, factor)
    )
    return Subject(subject.name, subject.kind, image, mask, diffuse, specular, truth)


def _shrunk_truth(
    truth: MitBerkeleyObject, mask: np.ndarray, less: np.ndarray, factor: int
) -> MitBerkeleyObject:
    image, shading, reflectance = (
        _blocks(values, mask, factor) for values in (truth.image, truth.shading, truth.reflectance)
    )
    known = np.isfinite(truth.height)
    height = _blocks(np.where(known, truth.height, 0), known, factor) / factor
    height[~less | (_blocks(known.astype(float), None, factor) < 0.5)] = np.nan
    return replace(
        truth,
        image=image,
        shading=shading,
        reflectance=reflectance,
        height=height,
        mask=less,
        valid=less & (image > 0).all(-1),
    )


def _blocks(values: np.ndarray, weight: np.ndarray | None, factor: int) -> np.ndarray:
    """Means over blocks of factor x factor pixels, of the pixels that `weight` marks (all without
    it); incomplete blocks are cut off.
    """
    rows, columns = (size // factor for size in values.shape[:2])
    marked = np.ones(values.shape[:2]) if weight is None else weight.astype(float)
    marked = marked.reshape(marked.shape + (1,) * (values.ndim - 2))

    def total(image: np.ndarray) -> np.ndarray:
        cut = image[: rows * factor, : columns * factor]
        return cut.reshape(rows, factor, columns, factor, *image.shape[2:]).sum((1, 3))

    return total(values * marked) / np.maximum(total(marked), 1e-12)


def _laboratory(root: Path, name: str, input: str, kind: str) -> Subject:
    """An object of the set on its evaluation crop."""
    truth, matt = (load_object(root, name, "laboratory", layer) for layer in (input, "diffuse"))
    inside = truth.mask[..., None]
    image, diffuse = (
        np.where(inside, layer.image, 0).astype(np.float32) for layer in (truth, matt)
    )
    return Subject(name, kind, image, truth.mask, diffuse, np.maximum(image - diffuse, 0), truth)


def _shen_zheng(folder: Path, name: str) -> Subject:
    found = load_shen_zheng(folder, name)
    image, diffuse = (
        srgb_to_linear(layer).astype(np.float32) for layer in (found.image, found.diffuse)
    )
    return Subject(name, "specular", image, found.mask, diffuse, np.maximum(image - diffuse, 0))


def _matt(subject: Subject) -> Subject:
    """A subject without its highlights."""
    assert subject.diffuse is not None and subject.truth is not None
    image = subject.diffuse
    truth = replace(
        subject.truth, image=image.astype(float), valid=subject.mask & (image > 0).all(-1)
    )
    return Subject(subject.name, "matt", image, subject.mask, image, np.zeros_like(image), truth)


def _photo(path: Path) -> Subject:
    photo = read_photo(path, None, "auto", whole_frame=path.parent.name == "highlight")
    rows, columns = mask_slices(photo.mask)
    part = (
        slice(max(rows.start - 4, 0), rows.stop + 4),
        slice(max(columns.start - 4, 0), columns.stop + 4),
    )
    return Subject(path.stem, "photo", photo.image[part], photo.mask[part])
