"""The list of all bodies, and how one is loaded.

A reference is a file, or the number of a body that is made: everything that one reference gives is
related, so whoever splits bodies into sets splits references.

Limits: the names of made bodies stay with their shapes only as long as the code that draws them.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from isc_core.errors import InputError
from synth.shapes import SHAPES

from .body import Body, Source, finished
from .built import CREDIT as BUILT_CREDIT
from .built import KINDS, build
from .families import CREDIT as FAMILY_CREDIT
from .families import family_body
from .furniture import items_of, models_in
from .geometry.surface import Surface
from .scans import read_scan, scans_in
from .screening import fault
from .urdfs import CREDIT as URDF_CREDIT
from .urdfs import read_urdf, urdfs_in


@dataclass(frozen=True)
class BodyFolders:
    """Where downloaded bodies lie; None leaves a source out.

    Attributes
    ----------
    furniture : Path or None
        Folder of the catalogues, `.sh3f` files.
    urdfs : Path or None
        The folder `pybullet_data/random_urdfs`.
    scans : Path or None
        Folder of PLY files.
    """

    furniture: Path | None
    urdfs: Path | None
    scans: Path | None


@dataclass(frozen=True)
class BodyReference:
    """What can be loaded as one body or a few related ones.

    Attributes
    ----------
    name : str
        Name of the body, or the beginning of the names of several.
    source : Source
        Where it comes from.
    credit : str
        Author and licence, as far as the source gives them.
    path : Path or None
        The file; None for bodies that are made.
    part : str
        Member of an archive, or kind or family of a body that is made.
    number : int
        Number of a body that is made, its seed.
    """

    name: str
    source: Source
    credit: str
    path: Path | None = None
    part: str = ""
    number: int = 0

    def load(self) -> list[Body]:
        """Read or make the bodies.

        Returns
        -------
        list of Body
            At most six, the largest first; empty if none passes the screening.

        Raises
        ------
        InputError
            If the file cannot be read or has no surface.
        """
        if self.source is Source.FAMILY:
            return [Body(self.name, self.source, family_body(self.part, self.number))]
        if self.source is Source.FURNITURE:
            items = items_of(self._file(), self.part, self.name)
            return [
                Body(f"{self.name}-{k}", self.source, finished(item))
                for k, item in enumerate(items)
            ]
        surface = self._surface()
        return [Body(self.name, self.source, finished(surface))] if fault(surface) is None else []

    def _surface(self) -> Surface:
        if self.source is Source.URDF:
            return read_urdf(self._file())
        if self.source is Source.SCAN:
            return read_scan(self._file())
        return build(self.part, self.number)

    def _file(self) -> Path:
        if self.path is None:
            raise InputError(f"{self.name} has no file: list the bodies with their folders")
        return self.path


def body_names(folders: BodyFolders, seed: int, built: int, families: int) -> list[BodyReference]:
    """List everything that can be loaded.

    Parameters
    ----------
    folders : BodyFolders
        Where the downloaded bodies lie.
    seed : int
        Fixes the order, and nothing else.
    built, families : int
        Number of bodies built from a seed, over all kinds, and of bodies of the shape families.

    Returns
    -------
    list of BodyReference
        In random order.

    Raises
    ------
    InputError
        If a folder holds none of its source's files, or a number is negative.
    """
    if min(built, families) < 0:
        raise InputError(f"{built} built and {families} family bodies: give numbers from 0")
    listed = [*_from_files(folders), *_made(built, families)]
    order = np.random.default_rng(seed).permutation(len(listed))
    return [listed[k] for k in order]


def _from_files(folders: BodyFolders) -> Iterator[BodyReference]:
    if folders.furniture is not None:
        for model in models_in(folders.furniture):
            name = f"{Source.FURNITURE}/{model.name}"
            yield BodyReference(name, Source.FURNITURE, model.credit, model.archive, model.member)
    if folders.urdfs is not None:
        for path in urdfs_in(folders.urdfs):
            name = f"{Source.URDF}/{path.stem.zfill(4)}"
            yield BodyReference(name, Source.URDF, URDF_CREDIT, path)
    if folders.scans is not None:
        for path, credit in scans_in(folders.scans):
            yield BodyReference(f"{Source.SCAN}/{path.stem}", Source.SCAN, credit, path)


def _made(built: int, families: int) -> Iterator[BodyReference]:
    for source, credit, kinds, count in (
        (Source.BUILT, BUILT_CREDIT, KINDS, built),
        (Source.FAMILY, FAMILY_CREDIT, SHAPES, families),
    ):
        for k in range(count):
            kind, number = kinds[k % len(kinds)], k // len(kinds)
            name = f"{source}/{kind}/{number:04d}"
            yield BodyReference(name, source, credit, part=kind, number=number)
