"""Settings of a data set of rendered scenes."""

from dataclasses import dataclass, field

from isc_core.errors import InputError

from ..capture.recipe import PictureSettings, Sources
from .splits import Choices

MOST_SCENES = 100_000  # seeds have five digits in folder names


@dataclass(frozen=True)
class DatasetSettings:
    """Settings of a data set.

    Attributes
    ----------
    count, seed : int
        Number of scenes and seed of the first one; the others follow it.
    choices : Choices
        Families that scenes are drawn from.
    picture : PictureSettings
        Camera, renderer and sensor.
    sources : Sources
        The user's files.

    Raises
    ------
    InputError
        For an impossible count or seed.
    """

    count: int
    seed: int = 0
    choices: Choices = field(default_factory=Choices)
    picture: PictureSettings = field(default_factory=PictureSettings)
    sources: Sources = field(default_factory=Sources)

    def __post_init__(self) -> None:
        if not (self.count >= 1 and self.seed >= 0 and self.seed + self.count <= MOST_SCENES):
            raise InputError(
                f"{self.count} scenes from seed {self.seed} are not possible: seeds are from 0 to "
                f"{MOST_SCENES - 1}"
            )
