"""One image of a batch: its inputs, settings and outcomes."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from ..decomposition.settings import Settings
from ..errors import InputError
from ..io.limits import DEFAULT_LIMITS, Limits
from ..photo import TRANSFERS

DONE, SKIPPED, FAILED = "done", "skipped", "failed"

# Options that may be set per line of a manifest; the others apply to the whole run.
_TYPES: dict[str, type] = {
    "model": str,
    "separator": str,
    "illumination": str,
    "camera": str,
    "max_size": int,
    "full_size": bool,
    "detail": int,
    "shading_only": bool,
    "seed": int,
    "transfer": str,
    "each": bool,
}
_BOOLEANS = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}

OPTIONS = tuple(_TYPES)
_EXPECTED = {bool: "true or false", int: "a whole number, 0 or more"}
Options = tuple[tuple[str, str | int | bool], ...]


@dataclass(frozen=True)
class ImageRecipe:
    """Settings of the decomposition of an image.

    Attributes
    ----------
    settings : Settings
    transfer : str
        One of `photo.TRANSFERS`.
    each : bool
        Whether each of several separate objects gets a separate result.
    """

    settings: Settings = field(default_factory=Settings)
    transfer: str = "auto"
    each: bool = False

    def changed(self, options: Options) -> "ImageRecipe":
        """Return the recipe with a manifest line's options.

        Parameters
        ----------
        options : tuple of (str, value)
            Names of settings, "transfer" or "each", and their values. A size replaces the run's
            choice of the full size.

        Returns
        -------
        ImageRecipe

        Raises
        ------
        InputError
            If a value is not valid.
        """
        given = dict(options)
        transfer = str(given.pop("transfer", self.transfer))
        each = bool(given.pop("each", self.each))
        if transfer not in TRANSFERS:
            raise InputError(f'unknown transfer "{transfer}": choose {", ".join(TRANSFERS)}')
        if "max_size" in given:
            given.setdefault("full_size", False)
        settings = replace(self.settings, **given)  # type: ignore[arg-type]
        settings.check()
        return ImageRecipe(settings, transfer, each)


@dataclass(frozen=True)
class BatchItem:
    """One image of the inputs.

    Attributes
    ----------
    image, mask : str
        Paths or URLs; with an empty one, the mask is found in the photo.
    name : str
        Requested name of the result; "" uses the image's.
    options : Options
        Differences from the run's settings.
    label : str
        The image as named in the inputs, independent of the machine.
    """

    image: str
    mask: str = ""
    name: str = ""
    options: Options = ()
    label: str = ""


@dataclass(frozen=True)
class RunPlan:
    """Parameters shared by all tasks of a run.

    Attributes
    ----------
    output : Path
        The absolute output folder.
    run : str
        Random identifier of the run.
    version : str
        Of ISC.
    limits : Limits
    timeout : float
        Seconds per image; 0 for no limit.
    arrays : bool
        Whether to write `arrays.npz`.
    priors : str
        Absolute path of a prior file; "" for the package's.
    priors_sha256 : str
        SHA-256 of that file.
    """

    output: Path
    run: str
    version: str
    limits: Limits = DEFAULT_LIMITS
    timeout: float = 0.0
    arrays: bool = False
    priors: str = ""
    priors_sha256: str = ""


@dataclass(frozen=True)
class ImageJob:
    """One task.

    Attributes
    ----------
    number : int
        Position in the inputs.
    name : str
        Name of its folder in the output.
    image, mask : str
        Absolute paths or URLs.
    recipe : ImageRecipe
    plan : RunPlan
    object_number : int
        Number of the object, from 1, if it is one of several; 0 for the whole photo.
    """

    number: int
    name: str
    image: str
    mask: str
    recipe: ImageRecipe
    plan: RunPlan
    object_number: int = 0

    @property
    def folder(self) -> Path:
        """The result's folder."""
        return self.plan.output / self.name

    def of_object(self, number: int) -> "ImageJob":
        """Return the job of one object of the photo.

        Parameters
        ----------
        number : int
            From 1.

        Returns
        -------
        ImageJob
        """
        return replace(self, name=f"{self.name}/{number}", object_number=number)


@dataclass(frozen=True)
class ImageOutcome:
    """The outcome of one result.

    Attributes
    ----------
    status : str
        "done", "skipped" (the result existed already) or "failed".
    reason : str
        One line, for a failure.
    seconds : float
        In the worker.
    peak_mb : float
        Peak memory of the worker in MB; 0 where the system does not report it.
    """

    status: str
    reason: str = ""
    seconds: float = 0.0
    peak_mb: float = 0.0


# The outcomes of a job by the names of its results: one, or one for each object.
Outcomes = dict[str, ImageOutcome]


def parse_options(given: Mapping[str, object], where: str) -> Options:
    """Parse the options of a manifest line into sorted, typed pairs.

    Parameters
    ----------
    given : mapping
        Text is converted to the option's type.
    where : str
        Prefix of the error message.

    Returns
    -------
    Options

    Raises
    ------
    InputError
        If an option or value is invalid.
    """
    parsed: dict[str, str | int | bool] = {}
    for key, value in sorted(given.items()):
        name = key.replace("-", "_")
        if name not in _TYPES:
            raise InputError(f"{where}: unknown option {key!r}: choose {', '.join(OPTIONS)}")
        parsed[name] = _read(_TYPES[name], value, f"{where}: {key} cannot be {value!r}")
    return tuple(parsed.items())


def _read(kind: type, value: object, message: str) -> str | int | bool:
    if kind is str and isinstance(value, str):
        return value
    if kind is bool and isinstance(value, bool):
        return value
    if kind is bool and isinstance(value, str) and value.lower() in _BOOLEANS:
        return _BOOLEANS[value.lower()]
    if kind is int and isinstance(value, int) and not isinstance(value, bool) and value >= 0:
        return value
    if (
        kind is int
        and isinstance(value, str)
        and value.isascii()
        and value.isdigit()
        and len(value) < 19
    ):
        return int(value)
    raise InputError(f"{message}: expected {_EXPECTED.get(kind, 'text')}")
