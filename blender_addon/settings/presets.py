"""Three usual choices between waiting and quality, so that nobody has to know a model's name to
begin.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Preset:
    """`label`, `text`: for people. `max_size`: pixels of the object's long side. `model`: of `isc
    decompose`. `samples`: rays a pixel that Cycles spends in the scene that is built.
    """

    label: str
    text: str
    max_size: int
    model: str
    samples: int


PRESETS = {
    "DRAFT": Preset(
        "Draft", "A first look within seconds: a small, coarse shape", 128, "joint", 16
    ),
    "STANDARD": Preset("Standard", "A good balance for most objects", 256, "joint", 64),
    "FULL": Preset("Full", "The finest textures: a minute or more", 512, "joint", 256),
}
CUSTOM = "CUSTOM"


def preset_of(max_size: int, model: str, samples: int) -> str:
    """The name of the preset that has these values, or `CUSTOM`."""
    wanted = (max_size, model, samples)
    return next(
        (
            name
            for name, preset in PRESETS.items()
            if (preset.max_size, preset.model, preset.samples) == wanted
        ),
        CUSTOM,
    )
