"""Presets of resolution, model and samples, from fast to detailed."""

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
    "DRAFT": Preset("Draft", "Coarse shape within seconds", 128, "joint", 16),
    "STANDARD": Preset("Standard", "Good balance for most objects", 256, "joint", 64),
    "FULL": Preset("Full", "Most detailed textures, in a minute or more", 512, "joint", 256),
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
