"""The settings of a glossy set, and the names of its folders."""

from dataclasses import asdict, dataclass
from typing import Any

from isc_core.datasets.mit_berkeley import ILLUMINATIONS
from isc_core.errors import InputError

SCHEMA_VERSION = 1
# Each light of the set alone, and with an additional panel.
LIGHTS = tuple(name + panel for name in ILLUMINATIONS for panel in ("", "-area"))
_HIGHEST_EXPONENT = 2000.0


@dataclass(frozen=True)
class GlossySettings:
    """Settings of a glossy set.

    Attributes
    ----------
    levels : tuple of float
        Specular share of the light inside the mask, per cent, in (0, 100).
    samples : int
        Light paths per pixel of the physical variant, >= 2.
    seed : int
        Of the panels and of these samples, >= 0.
    exponent : float
        Of the normalised Blinn-Phong lobe, 1 to 2000.
    physical : bool
        Whether to make the variant with shadows, too.

    Raises
    ------
    InputError
        Outside these ranges.
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
                "levels are percentages of the light: give different numbers above 0 and below "
                "100, such as 10,25,50"
            )
        if self.samples < 2 or self.seed < 0:
            raise InputError("use at least 2 samples, and a seed of at least 0")
        if not 1 <= self.exponent <= _HIGHEST_EXPONENT:
            raise InputError(f"the exponent must be from 1 to {_HIGHEST_EXPONENT:g}")

    def to_json(self) -> dict[str, Any]:
        """Return the settings that two runs in one folder must share: all except `physical`."""
        shared = {key: value for key, value in asdict(self).items() if key != "physical"}
        return {"schema_version": SCHEMA_VERSION, **shared, "levels": list(self.levels)}


def root_names(settings: GlossySettings) -> tuple[str, ...]:
    """Return the folders of the data sets, relative to the output.

    Parameters
    ----------
    settings : GlossySettings
        Settings of the set.

    Returns
    -------
    tuple of str
        One per level and light, then those of the physical variant.
    """
    names = tuple(root_name(level, light) for level in settings.levels for light in LIGHTS)
    return names + (tuple(f"physical/{name}" for name in names) if settings.physical else ())


def root_name(level: float, light: str) -> str:
    """Return the folder of one level and light.

    Parameters
    ----------
    level : float
        Specular share of the light in per cent.
    light : str
        One of `LIGHTS`.

    Returns
    -------
    str
        For example "level-10_natural-area".
    """
    return f"level-{level:g}_{light}"
