"""Presets of size, model and samples, from fast to detailed.

The overall shape is solved at 256 pixels in all of them: the presets differ in the maps of light,
highlights and fine relief, and in the time; the base color has the photo's resolution. Times are of
photos of 2,400 pixels on two cores.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Preset:
    """Values of one preset.

    Attributes
    ----------
    label : str
        Name in the panel.
    description : str
        Tooltip.
    max_size : int
        Longer side of the object in pixels.
    model : str
        Value of `isc decompose --model`.
    samples : int
        Samples per pixel of Cycles in the scene that is built.
    """

    label: str
    description: str
    max_size: int
    model: str
    samples: int


PRESETS = {
    "DRAFT": Preset("Draft", "Maps of 256 pixels, about 10 s on two cores", 256, "joint", 16),
    "STANDARD": Preset("Standard", "Maps of 512 pixels, about 10 s on two cores", 512, "joint", 64),
    "HIGH": Preset("High", "Maps of 1024 pixels, about 20 s on two cores", 1024, "joint", 128),
    "ULTRA": Preset("Ultra", "Maps of 2048 pixels, about 40 s on two cores", 2048, "joint", 256),
}
CUSTOM = "CUSTOM"


def matching_preset(max_size: int, model: str, samples: int) -> str:
    """Return the name of the preset with these values, or `CUSTOM`.

    Parameters
    ----------
    max_size : int
        Longer side of the object in pixels.
    model : str
        Value of `isc decompose --model`.
    samples : int
        Samples per pixel.

    Returns
    -------
    str
        A key of `PRESETS`, or `CUSTOM`.
    """
    wanted = (max_size, model, samples)
    return next(
        (
            name
            for name, preset in PRESETS.items()
            if (preset.max_size, preset.model, preset.samples) == wanted
        ),
        CUSTOM,
    )
