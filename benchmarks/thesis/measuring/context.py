"""Input of every item: output folder, data, size of the run; and rows that are computed once.

Rows are JSON objects. The rows of a key are kept below `output/.work/rows`, so that an interrupted
run resumes and items share expensive results. They are reused only for the same seed, size of the
run, contents of the data and program version.

Limits: a kept row does not depend on the code that made it: after a change within one version,
`--again` recomputes it.
"""

import hashlib
import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from isc_core import __version__
from isc_core.errors import InputError
from isc_core.io.atomic import new_file
from isc_core.progress import Monitor

from ..images.library import SubjectLibrary
from ..images.subject import Subject

JsonRow = dict[str, str | int | float | bool | None]
WORK = ".work"


@dataclass(frozen=True)
class Context:
    """One run.

    Attributes
    ----------
    output : Path
        Output folder.
    data : Path or None
        Folder of public data sets.
    quick : bool
        Small images, few repetitions.
    seed : int
        Seed of all random numbers.
    monitor : Monitor
        Progress and cancellation.
    fresh_since : float
        Rows kept before this time (file time, seconds) are recomputed.
    """

    output: Path
    data: Path | None = None
    quick: bool = False
    seed: int = 0
    monitor: Monitor = field(default_factory=Monitor)
    fresh_since: float = 0.0

    def subjects(self, kind: str) -> tuple[Subject, ...]:
        """Load the images of a kind.

        Parameters
        ----------
        kind : str
            "specular" (significant specularity), "synthetic" (rendered scenes) or "diffuse"
            (without highlights).

        Returns
        -------
        tuple of Subject
            The images.

        Raises
        ------
        InputError
            If data are damaged, or rendering is not possible.
        """
        return self._library.subjects(kind, self.monitor)

    def photos(self) -> tuple[Subject, ...]:
        """Load photos of real objects without ground truth; rendered objects if there are none."""
        return self._library.photos(self.monitor)

    @property
    def has_photos(self) -> bool:
        """Whether `photos` returns photos, not rendered objects."""
        return bool(self._library.photo_paths)

    def rows(self, key: str, compute: Callable[[], Sequence[JsonRow]]) -> list[JsonRow]:
        """Return the rows of a key; compute them if they are not kept.

        Parameters
        ----------
        key : str
            Name of the rows, unique within a run.
        compute : callable
            Computes the rows.

        Returns
        -------
        list of dict
            One JSON object per row.

        Raises
        ------
        Cancelled
            If the user cancelled before the computation.
        """
        path = self._path(key)
        if (
            path.is_file()
            and path.stat().st_mtime >= self.fresh_since
            and (kept := _read(path)) is not None
        ):
            return kept
        if self.monitor.cancelled():
            self.monitor.report(key, 0.0)
        found = [dict(row) for row in compute()]
        with new_file(path) as partial:
            partial.write_text("".join(json.dumps(row) + "\n" for row in found), encoding="utf-8")
        return found

    def check(self) -> None:
        """Check the data folder.

        Raises
        ------
        InputError
            If it holds no known data set.
        """
        self._library.check()

    @property
    def fingerprint(self) -> str:
        """Digest of all that determines results: seed, size of the run, data, version."""
        parts = (__version__, self.seed, self.quick, self._library.fingerprint)
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:12]

    @cached_property
    def _library(self) -> SubjectLibrary:
        return SubjectLibrary(self.output / WORK / "rendered", self.data, self.quick, self.seed)

    def _path(self, key: str) -> Path:
        digest = hashlib.sha256(f"{self.fingerprint} {key}".encode()).hexdigest()[:12]
        readable = re.sub(r"[^A-Za-z0-9.]+", "-", key).strip("-")[:80]
        return self.output / WORK / "rows" / f"{readable}-{digest}.jsonl"


def _read(path: Path) -> list[JsonRow] | None:
    """Read the rows of a file; None if it is damaged."""
    try:
        return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    except ValueError:
        return None
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error
