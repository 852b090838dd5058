"""What a glossy set is made with, and how its folders are called."""

from dataclasses import asdict, dataclass
from typing import Any

from isc_core.datasets.mit_berkeley import ILLUMINATIONS
from isc_core.errors import InputError

SCHEMA_VERSION = 1
# Each light of the set alone, and with one panel beside it.
LIGHTS = tuple(name + panel for name in ILLUMINATIONS for panel in ("", "-area"))
_HIGHEST_EXPONENT = 2000.0


@dataclass(frozen=True)
class GlossySettings:
    """`levels`: per cent of the light inside the mask that is specular, each within (0, 100).
    `samples`: light paths a pixel of the physical variant, >= 2. `seed`: of the panels and of these
    samples, >= 0. `exponent`: of the normalised Blinn-Phong lobe, 1 to 2000. `physical`: also the
    variant that is rendered with shadows. Raises `InputError` outside these ranges.
    """

    levels: tuple[float, ...] = (10.0, 25.0, 50.0)
    samples: int = 256
    seed: int = 0
    exponent: float = 100.0
    physical: bool = False

    def __post_init__(self) -> None:
        if (
            not self.levels
            or len(set(self.levels)) < len(self.levels)
            or not all(0 < level < 100 for level in self.levels)
        ):
            raise InputError(
                "levels are per cent of the light: different numbers above 0 and below 100, like 10,25,50"
            )
        if self.samples < 2 or self.seed < 0:
            raise InputError("samples have to be 2 or more, and the seed 0 or more")
        if not 1 <= self.exponent <= _HIGHEST_EXPONENT:
            raise InputError(f"the exponent has to be from 1 to {_HIGHEST_EXPONENT:g}")

    def to_json(self) -> dict[str, Any]:
        """What two runs into one folder have to share: all but whether the physical variant is
        wanted too.
        """
        shared = {key: value for key, value in asdict(self).items() if key != "physical"}
        return {"schema_version": SCHEMA_VERSION, **shared, "levels": list(self.levels)}


def root_names(settings: GlossySettings) -> tuple[str, ...]:
    """The data sets that are made, as folders below the output's."""
    names = tuple(root_name(level, light) for level in settings.levels for light in LIGHTS)
    return names + (tuple(f"physical/{name}" for name in names) if settings.physical else ())


def root_name(level: float, light: str) -> str:
    """The folder of one level and light."""
    return f"level-{level:g}_{light}"
