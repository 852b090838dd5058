"""What is asked for one image of a batch, and what became of it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from ..decompose.settings import Settings
from ..errors import InputError
from ..io.limits import USUAL, Limits
from ..photo import TRANSFERS

DONE, SKIPPED, FAILED = "done", "skipped", "failed"

# What a line of a manifest may change; all else holds for the whole run.
_TYPES: dict[str, type] = {
    "model": str,
    "separator": str,
    "illumination": str,
    "max_size": int,
    "full_size": bool,
    "shading_only": bool,
    "seed": int,
    "transfer": str,
}
_WORDS = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}

OPTIONS = tuple(_TYPES)
Options = tuple[tuple[str, str | int | bool], ...]


@dataclass(frozen=True)
class Recipe:
    """How an image is decomposed.

    `settings`: see `decompose.pipeline.Settings`; `transfer`: one of `photo.photo.TRANSFERS`.
    """

    settings: Settings = field(default_factory=Settings)
    transfer: str = "auto"

    def changed(self, options: Options) -> "Recipe":
        """The recipe with a line's own options.

        Raises `InputError` for values that mean nothing.
        """
        given = dict(options)
        transfer = str(given.pop("transfer", self.transfer))
        if transfer not in TRANSFERS:
            raise InputError(f'unknown transfer "{transfer}": choose {", ".join(TRANSFERS)}')
        settings = replace(self.settings, **given)  # type: ignore[arg-type]
        settings.check()
        return Recipe(settings, transfer)


@dataclass(frozen=True)
class Item:
    """One image of the inputs.

    `image`, `mask`: paths or URLs; an empty mask leaves it to the photo. `name`: wanted for the
    result, "" takes the image's. `options`: what this image is to have otherwise than the run.
    `label`: the image as the inputs call it, the same wherever they lie.
    """

    image: str
    mask: str = ""
    name: str = ""
    options: Options = ()
    label: str = ""


@dataclass(frozen=True)
class Plan:
    """What all tasks of a run share.

    `output`: the absolute folder. `run`: the run's own random name. `version`: of ISC. `timeout`:
    seconds an image, 0 for none. `arrays`: also write `arrays.npz`. `priors`: an absolute file, ""
    for the package's; `priors_sha256` of it.
    """

    output: Path
    run: str
    version: str
    limits: Limits = USUAL
    timeout: float = 0.0
    arrays: bool = False
    priors: str = ""
    priors_sha256: str = ""


@dataclass(frozen=True)
class Job:
    """One task.

    `number`: its place in the inputs; `name`: of its folder in the output. `image`, `mask`:
    absolute paths or URLs.
    """

    number: int
    name: str
    image: str
    mask: str
    recipe: Recipe
    plan: Plan

    @property
    def folder(self) -> Path:
        """Where the result goes."""
        return self.plan.output / self.name


@dataclass(frozen=True)
class Outcome:
    """What became of a job.

    `status`: done, skipped (it was there already) or failed; `reason`: of a failure, one line.
    `seconds` it took in the worker; `peak_mb`: the largest memory of the worker meanwhile, 0 where
    the system does not tell.
    """

    status: str
    reason: str = ""
    seconds: float = 0.0
    peak_mb: float = 0.0


def parse_options(given: Mapping[str, object], where: str) -> Options:
    """The options of a line, sorted and of their types; text is read as what it has to be.

    Raises `InputError`, opened by `where`.
    """
    found: dict[str, str | int | bool] = {}
    for key, value in sorted(given.items()):
        name = key.replace("-", "_")
        if name not in _TYPES:
            raise InputError(f"{where}: unknown option {key!r}: choose {', '.join(OPTIONS)}")
        found[name] = _read(_TYPES[name], value, f"{where}: {key} cannot be {value!r}")
    return tuple(found.items())


def _read(kind: type, value: object, complaint: str) -> str | int | bool:
    if kind is str and isinstance(value, str):
        return value
    if kind is bool and isinstance(value, bool):
        return value
    if kind is bool and isinstance(value, str) and value.lower() in _WORDS:
        return _WORDS[value.lower()]
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
    raise InputError(
        f"{complaint}: give {'true or false' if kind is bool else 'a whole number from 0 on' if kind is int else 'text'}"
    )
