"""Checkpoint of a command: an interrupted run is continued by the same command.

Problem: a run that is cancelled or killed after minutes should not begin anew.

Method: the results of its stages are kept in a hidden folder beside the output, `.NAME.checkpoint`,
see `stage_cache`: each under the SHA-256 of all that it depends on, so that the result is the same
with and without the folder, and a stage that is damaged or of another run is computed again. The
folder is removed once the output is complete.

Citation: none; the keys are those of `stage_cache`.

Limits: the stage at which a run was interrupted begins anew. The folder stays until a run with the
same output is complete, or it is removed by hand. Where it cannot be written, or its name is too
long, nothing is kept.
"""

import contextlib
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from ..errors import Cancelled
from .atomic import remove_unfinished_in
from .printable_names import readable
from .stage_cache import SUFFIX, Arrays, StageCache

_STAGE = re.compile(r"[0-9a-f]{64}" + re.escape(SUFFIX))


class Checkpoint:
    """The kept stages of a run, as a `KeptStages`.

    A context: if anything is kept, a cancellation in it has a note that names the folder.

    Attributes
    ----------
    folder : Path
        Created when the first stage is kept.

    Parameters
    ----------
    output : Path
        What the command writes.
    """

    def __init__(self, output: Path) -> None:
        self.folder = _beside(output)
        self._cache = StageCache(self.folder)
        self._found, self._used = len(self._stages()), 0

    def arrays(
        self, stage: str, inputs: Sequence[np.ndarray], compute: Callable[[], Arrays]
    ) -> Arrays:
        """Return the result of a stage, computed unless it is kept.

        Parameters
        ----------
        stage : str
            Name of the stage.
        inputs : sequence of ndarray
            All that the result depends on, besides the program.
        compute : callable
            The stage, see `StageCache.arrays`.

        Returns
        -------
        mapping of str to ndarray
        """
        computed = False

        def made() -> Arrays:
            nonlocal computed
            computed = True
            return compute()

        result = self._cache.arrays(stage, inputs, made)
        self._used += not computed
        return result

    def notes(self) -> list[str]:
        """Return what became of the stages that an earlier run kept, as lines to print."""
        if not self._found:
            return []
        notes = ["continued an interrupted run"] if self._used else []
        if (unused := self._found - self._used) > 0:
            what = "1 kept stage was" if unused == 1 else f"{unused} kept stages were"
            notes.append(
                f"note: {what} not used: damaged, or of another result, other options or another "
                "version"
            )
        return notes

    def remove(self) -> None:
        """Remove the folder, but for foreign files in it."""
        for file in self._stages():
            with contextlib.suppress(OSError):
                file.unlink()
        with contextlib.suppress(OSError):
            remove_unfinished_in(self.folder)
            self.folder.rmdir()

    def _stages(self) -> list[Path]:
        with contextlib.suppress(OSError):  # it may be absent, or somebody else's
            return [path for path in self.folder.iterdir() if _STAGE.fullmatch(path.name)]
        return []

    def __enter__(self) -> "Checkpoint":
        return self

    def __exit__(self, kind: object, value: BaseException | None, trace: object) -> None:
        if isinstance(value, Cancelled | KeyboardInterrupt) and self._stages():
            value.add_note(
                f"finished stages are kept in {readable(str(self.folder))}: repeat the command to "
                "continue, or remove that folder"
            )


def _beside(output: Path) -> Path:
    target = output.expanduser().resolve()
    return target.with_name(f".{target.name}.checkpoint")
