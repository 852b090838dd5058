"""What every item works with: where results go, which data there is, how much is wanted; and rows
that are computed once.

Rows are JSON objects. Those of a key are kept below `output/.work/rows`, so that an interrupted run
goes on where it stopped and items share what is expensive. They are taken up again only under the
same seed, size of run, data and version of the program.

Limits: a row that was kept does not know that the code behind it changed within one version:
`--again` computes it anew.
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
    """One run. `output`: the folder of the results. `data`: a folder of public data, or None.
    `quick`: small images, few repetitions. `seed`: of all random numbers. `monitor`: progress and
    cancel. `fresh_since`: rows kept before this time (seconds, as of files) are computed anew.
    """

    output: Path
    data: Path | None = None
    quick: bool = False
    seed: int = 0
    monitor: Monitor = field(default_factory=Monitor)
    fresh_since: float = 0.0

    def subjects(self, kind: str) -> tuple[Subject, ...]:
        """The images of a kind: "specular" (significant specularity), "synthetic" (rendered
        scenes), "diffuse" (without highlights).

        Raises `InputError` where data are damaged or nothing can be rendered here.
        """
        return self._library.subjects(kind, self.monitor)

    def photos(self) -> tuple[Subject, ...]:
        """Photos of real objects without a known truth; without data, rendered stand-ins."""
        return self._library.photos(self.monitor)

    @property
    def has_photos(self) -> bool:
        """Whether `photos` are photos, not rendered stand-ins."""
        return bool(self._library.photo_paths)

    def rows(self, key: str, compute: Callable[[], Sequence[JsonRow]]) -> list[JsonRow]:
        """The rows of `key`, computed only if they are not kept.

        Raises `Cancelled` before it computes, where the user asked to stop.
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
        """Raises `InputError` where the data folder holds nothing that is known here."""
        self._library.check()

    @property
    def fingerprint(self) -> str:
        """Changes with whatever decides the results: seed, size of run, data, version."""
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
    """The rows of a file; None where it is damaged."""
    try:
        return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    except ValueError:
        return None
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error
