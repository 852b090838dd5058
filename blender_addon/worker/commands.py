"""The command lines and the environment that workers run with."""

import contextlib
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from isc_core.errors import InputError

from ..files.result_arrays import ARRAYS
from .process import WorkerProcess

Box = tuple[int, int, int, int]
"""Left, top, width and height in pixels, from the photo's upper left corner."""
Points = Sequence[tuple[int, int]]
"""Columns and rows in pixels, from the same corner."""
CERTAIN = "4"
"""The core's default of `--highlight-odds`; its module is not among those that Blender loads."""

_INHERITED = (
    "PATH",
    "HOME",
    "USER",
    "LOGNAME",
    "LANG",
    "LC_ALL",
    "LC_CTYPE",
    "TMPDIR",
    "TEMP",
    "TMP",
    "SYSTEMROOT",
    "SYSTEMDRIVE",
    "WINDIR",
    "COMSPEC",
    "PATHEXT",
    "USERPROFILE",
    "APPDATA",
    "LOCALAPPDATA",
    "PROGRAMDATA",
    "NUMBER_OF_PROCESSORS",
    "PROCESSOR_ARCHITECTURE",
    "PROCESSOR_IDENTIFIER",
)


@dataclass(frozen=True)
class DecomposeJob:
    """Arguments of `isc decompose`.

    Attributes
    ----------
    photo : Path
        Image file, or NumPy array (`.npy`).
    output : Path
        Result folder; an earlier result there is replaced.
    mask : Path or None
        Image file or `.npy`. None uses the photo's transparency or black background.
    model : str
        Value of `--model`.
    separator : str
        Value of `--separator`.
    illumination : str
        Value of `--illumination`.
    max_size : int
        Longer side of the object in pixels; 0 keeps the photo's resolution.
    threads : int
        Number of threads; 0 uses one per core.
    transfer : str
        Value of `--transfer`.
    camera : str
        Value of `--camera`.
    texture_size : str
        Value of `--texture-size`.
    highlight_odds : str
        Value of `--highlight-odds`.
    highlights, not_highlights : tuple of (x, y)
        Values of `--highlight` and `--not-highlight`.
    each : bool
        Whether each object is decomposed, into the folders 1, 2 and so on of `output`.
    refine : bool
        Whether the gloss is refined.
    light_colour : str
        Value of `--light-colour`.
    cache : Path or None
        Value of `--cache`; does not change the result.
    """

    photo: Path
    output: Path
    mask: Path | None
    model: str
    separator: str
    illumination: str
    max_size: int
    threads: int = 0
    transfer: str = "auto"
    camera: str = "auto"
    texture_size: str = "photo"
    highlight_odds: str = CERTAIN
    highlights: tuple[tuple[int, int], ...] = ()
    not_highlights: tuple[tuple[int, int], ...] = ()
    each: bool = False
    refine: bool = False
    light_colour: str = "balanced"
    cache: Path | None = None


@dataclass(frozen=True)
class WorkerEnvironment:
    """Interpreter, search path and cache of a worker.

    Attributes
    ----------
    python : Path
        Interpreter.
    search : tuple of Path
        Folders that contain `isc_core` and the packages it needs.
    cache : Path
        Folder for compiled code, kept between runs; created if missing.
    """

    python: Path
    search: tuple[Path, ...]
    cache: Path

    def variables(self, threads: int = 0) -> dict[str, str]:
        """Return all environment variables of the worker.

        From Blender's environment, only variables that any program needs are inherited.

        Parameters
        ----------
        threads : int, optional
            Number of threads of the linear algebra libraries; 0 sets no limit.

        Returns
        -------
        dict of str to str
            Name and value of each variable.
        """
        own = {
            "PYTHONPATH": os.pathsep.join(map(str, self.search)),
            "PYTHONNOUSERSITE": "1",
            "PYTHONSAFEPATH": "1",
            "PYTHONUTF8": "1",
            "PYTHONPYCACHEPREFIX": str(self.cache / "bytecode"),
            "NUMBA_CACHE_DIR": str(self.cache),
        }
        limits = {
            name: str(threads)
            for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
            if threads > 0
        }
        inherited = {name: os.environ[name] for name in _INHERITED if name in os.environ}
        return inherited | own | limits


def start_decompose(job: DecomposeJob, environment: WorkerEnvironment) -> WorkerProcess:
    """Start decomposing a photo into a result folder with arrays.

    Parameters
    ----------
    job : DecomposeJob
        What to decompose, and how.
    environment : WorkerEnvironment
        What the worker runs with.

    Returns
    -------
    WorkerProcess
        The running worker.

    Raises
    ------
    InputError
        If the worker cannot be started.
    """
    words = ["decompose", _absolute(job.photo), "--arrays", "-o", _absolute(job.output)]
    names = ("model", "separator", "illumination", "max_size", "threads", "transfer", "camera")
    for name in (*names, "texture_size", "highlight_odds", "light_colour"):
        words += [f"--{name.replace('_', '-')}", str(getattr(job, name))]
    if job.mask is not None:
        words += ["--mask", _absolute(job.mask)]
    if job.cache is not None:
        words += ["--cache", _absolute(job.cache)]
    words += ["--each"] * job.each + ["--refine"] * job.refine
    words += [f"--highlight={x},{y}" for x, y in job.highlights]
    words += [f"--not-highlight={x},{y}" for x, y in job.not_highlights]
    return _start(words, job.output, environment, job.threads)


def start_arrays(result: Path, environment: WorkerEnvironment) -> WorkerProcess:
    """Start adding `arrays.npz` to a result folder without it.

    Parameters
    ----------
    result : Path
        Result folder.
    environment : WorkerEnvironment
        What the worker runs with.

    Returns
    -------
    WorkerProcess
        The running worker.

    Raises
    ------
    InputError
        If the worker cannot be started.
    """
    return _start(["arrays", _absolute(result)], result / ARRAYS, environment)


def start_box_mask(
    photo: Path, box: Box, output: Path, environment: WorkerEnvironment, transfer: str = "auto"
) -> WorkerProcess:
    """Start segmenting the object inside a box.

    Parameters
    ----------
    photo : Path
        Image file or `.npy`.
    box : tuple of int
        Left, top, width and height in pixels.
    output : Path
        PNG file of the mask.
    environment : WorkerEnvironment
        What the worker runs with.
    transfer : str, optional
        Value of `--transfer`.

    Returns
    -------
    WorkerProcess
        The running worker.

    Raises
    ------
    InputError
        If the worker cannot be started.
    """
    numbers = ",".join(map(str, box))
    # The equals sign keeps a negative number from being parsed as an option.
    words = ["mask", _absolute(photo), f"--box={numbers}", "--transfer", transfer]
    words += ["--overlay", _absolute(overlay_of(output))]
    return _start([*words, "-o", _absolute(output)], output, environment)


def start_auto_mask(
    photo: Path,
    points: Points,
    others: Points,
    output: Path,
    environment: WorkerEnvironment,
    transfer: str = "auto",
) -> WorkerProcess:
    """Start finding the object by its appearance.

    Parameters
    ----------
    photo : Path
        Image file or `.npy`.
    points, others : sequence of (x, y)
        Pixels of the object and of the background; may be empty.
    output : Path
        PNG file of the mask.
    environment : WorkerEnvironment
        What the worker runs with.
    transfer : str, optional
        Value of `--transfer`.

    Returns
    -------
    WorkerProcess
        The running worker.

    Raises
    ------
    InputError
        If the worker cannot be started.
    """
    words = ["mask", _absolute(photo), "--auto", "--transfer", transfer]
    words += ["--overlay", _absolute(overlay_of(output))]
    words += [f"--point={x},{y}" for x, y in points] + [f"--not={x},{y}" for x, y in others]
    return _start([*words, "-o", _absolute(output)], output, environment)


def overlay_of(mask: Path) -> Path:
    """Return the file of the small picture that shows a mask on its photo.

    Parameters
    ----------
    mask : Path
        PNG file of the mask.

    Returns
    -------
    Path
        A PNG file beside it.
    """
    return mask.with_name(f"{mask.stem}_overlay.png")


def _start(
    words: Sequence[str], output: Path, environment: WorkerEnvironment, threads: int = 0
) -> WorkerProcess:
    with contextlib.suppress(OSError):  # without a cache the worker compiles every time
        environment.cache.mkdir(parents=True, exist_ok=True)
    command = [str(environment.python), "-m", "isc_core", *words, "--progress", "json"]
    command.append("--cancel-at-eof")  # the worker ends with Blender
    try:
        return WorkerProcess(command, Path(_absolute(output)), environment.variables(threads))
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(
            f"cannot start the worker with {environment.python} ({reason}): "
            "install the extension again"
        ) from error


def _absolute(path: Path) -> str:
    """The worker runs in another folder than Blender."""
    return os.path.abspath(path)
