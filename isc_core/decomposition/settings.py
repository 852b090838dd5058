"""The settings of a decomposition: names of the models, and a user's choices."""

import math
from dataclasses import dataclass
from enum import StrEnum
from numbers import Integral, Real

from .. import baselines
from ..errors import InputError
from ..io.focal_length import LONGEST_35MM, SHORTEST_35MM
from ..separation import BEST, HIGHLIGHT_ODDS, METHODS

SIRFS_MODELS = ("mdr", "mbp", "joint", "sirfs")
SEPARATING_MODELS = ("mdr", "mbp", "joint")
WEIGHTING_MODELS = ("mdr", "joint")
BASELINE_MODELS = tuple(baselines.METHODS)
MODELS = SIRFS_MODELS + BASELINE_MODELS
# One line for the help of the commands.
MODEL_SUMMARIES = {
    "joint": "highlights, shape and light explain the photo together (default)",
    "mdr": "modified dichromatic: highlights removed first, then SIRFS (Akbar 2016)",
    "mbp": "modified Blinn-Phong: SIRFS first, highlights taken from its reflectance (Akbar 2016)",
    "sirfs": "shape, light and reflectance of a photo without highlights (Barron and Malik 2015)",
    "naive": "a flat shape, the image as its own reflectance",
    "retinex": "colour Retinex, then shape from its shading (Grosse et al. 2009)",
    "sfs-tsai-shah": "linear shape from shading (Tsai and Shah 1994)",
    "sfs-ikeuchi-horn": "variational shape from shading (Ikeuchi and Horn 1981)",
}


class CameraChoice(StrEnum):
    """How the camera is found where no focal length is given.

    Attributes
    ----------
    AUTO
        From the photo's EXIF; orthographic where it has no focal length.
    ORTHOGRAPHIC
        Parallel rays.
    """

    AUTO = "auto"
    ORTHOGRAPHIC = "orthographic"


class Illumination(StrEnum):
    """The kind of photo that the priors describe.

    Attributes
    ----------
    PHOTO
        A white-balanced photo in any light: priors of their own, and larger weights of the
        network's predictions.
    NATURAL
        The MIT-Berkeley objects in natural light.
    LABORATORY
        The same in the light of the laboratory.
    """

    PHOTO = "photo"
    NATURAL = "natural"
    LABORATORY = "laboratory"


class LightColour(StrEnum):
    """The assumed colour of the light.

    Attributes
    ----------
    BALANCED
        Nearly white, as a camera's white balance leaves it.
    ESTIMATE
        Estimated from the photo's highlights, where they determine it; else as BALANCED.
    FREE
        Highlights are white, but the light on the diffuse image may have any colour.
    TONED
        The photo is a toned grey one, such as sepia: its colours are not of the scene.
    """

    BALANCED = "balanced"
    ESTIMATE = "estimate"
    FREE = "free"
    TONED = "toned"


class LightPrior(StrEnum):
    """The prior of the light.

    Attributes
    ----------
    PREDICTED
        That of the data set, multiplied by the light predicted from the photo
        (`networks.scene_network`); the predicted shading is expected as well.
    DATASET
        The distribution over all photos of the illumination.
    """

    PREDICTED = "predicted"
    DATASET = "dataset"


class ShapePrior(StrEnum):
    """The prior of the shape.

    Attributes
    ----------
    PREDICTED
        Normals predicted from the photo (`networks.scene_network`), where no depth is known.
    SILHOUETTE
        Normals that the silhouette suggests.
    """

    PREDICTED = "predicted"
    SILHOUETTE = "silhouette"


ILLUMINATIONS = tuple(one.value for one in Illumination)
LIGHT_COLOURS = tuple(one.value for one in LightColour)
LIGHT_PRIORS = tuple(one.value for one in LightPrior)
SHAPE_PRIORS = tuple(one.value for one in ShapePrior)

# Values of earlier versions, accepted for one version.
_RENAMED: dict[str, dict[str, str]] = {
    "light_colour": {"white": LightColour.BALANCED},
    "light_prior": {"seen": LightPrior.PREDICTED, "usual": LightPrior.DATASET},
    "shape_prior": {"seen": ShapePrior.PREDICTED, "outline": ShapePrior.SILHOUETTE},
}


MOST_DETAIL = 4096
_MOST_COLOUR = 100.0  # strongest over weakest channel of a light: candles have less than 10


def _colour_of(text: str) -> tuple[float, float, float] | None:
    """Three positive numbers "r,g,b", scaled to a mean of 1; None for anything else."""
    try:
        red, green, blue = (float(part) for part in text.split(","))
    except ValueError:
        return None
    low, high = min(red, green, blue), max(red, green, blue)
    if not 0 < low <= high <= _MOST_COLOUR * low < math.inf:
        return None
    mean = (red + green + blue) / 3
    return red / mean, green / mean, blue / mean


def renamed_value(setting: str, value: str) -> str | None:
    """Look up the current name of a setting's value of an earlier version.

    Parameters
    ----------
    setting : str
        Name of the field in `Settings`.
    value : str
        The value.

    Returns
    -------
    str or None
        The current name; None where the value was not renamed.
    """
    return _RENAMED.get(setting, {}).get(value)


def _check_separator(settings: "Settings") -> None:
    """Raise `InputError` for a separator that the model would not run."""
    if settings.model not in SEPARATING_MODELS and settings.separator not in (BEST, "none"):
        raise InputError(
            f"--separator does not apply to {settings.model}, which separates no highlights: use "
            f"--model {' or '.join(SEPARATING_MODELS)}, or isc separate"
        )


def _check_numbers(settings: "Settings") -> None:
    """Raise `InputError` for values that Python would take for others: "no" is true."""
    for name in ("max_size", "detail", "threads", "seed"):
        value = getattr(settings, name)
        if not isinstance(value, Integral) or isinstance(value, bool):
            raise InputError(f"{name} must be a whole number, not {value!r}")
    for name in ("full_size", "shading_only", "confidence_weights"):
        value = getattr(settings, name)
        if value not in (True, False):
            raise InputError(f"{name} must be True or False, not {value!r}")
    if not isinstance(settings.highlight_odds, Real):
        raise InputError(f"highlight_odds must be a number, not {settings.highlight_odds!r}")


@dataclass(frozen=True)
class Settings:
    """A user's choices for a decomposition.

    Attributes
    ----------
    model : str
        One of `MODELS`.
    separator : str
        For `SEPARATING_MODELS`: one of `separation.METHODS`.
    illumination : Illumination or str
        The kind of photo.
    max_size : int
        Long side of the object, pixels, at which the maps are made; 0 for the photo's. The overall
        shape and the light do not depend on it, see `recover.SOLVE_SIZE`.
    full_size : bool
        The maps have the photo's resolution, as with a `max_size` of 0.
    detail : int
        For `SIRFS_MODELS` in the illumination `photo`: long side of the object, pixels, at which
        the finest relief is recovered, see `decomposition.detail`; 0 for only the overall shape.
    engine : str
        "auto", "numba" or "numpy", see `SolverOptions`.
    threads : int
        See `SolverOptions`; 0 for all cores.
    seed : int
        Written into the result; no step of these models draws random numbers.
    shading_only : bool
        Shape-from-shading mode: an object of one colour.
    confidence_weights : bool
        For `WEIGHTING_MODELS`: pixels with an uncertain separation have less weight in SIRFS'
        reflectance terms.
    light_colour : LightColour or str
        For `SIRFS_MODELS`: the assumed colour of the light, or three numbers "r,g,b", linear.
    light_prior : LightPrior or str
        For `SIRFS_MODELS`: the prior of the light.
    shape_prior : ShapePrior or str
        For `SIRFS_MODELS`: the prior of the shape.
    camera : CameraChoice or str
        The camera, or its focal length: millimetres, 35-mm equivalent by the diagonal.
    highlight_odds : float
        For the model joint: light is removed where its odds of being a highlight, and not print,
        exceed this number; 0 removes all candidates.
    """

    model: str = "joint"
    separator: str = BEST
    illumination: str = Illumination.PHOTO
    max_size: int = 1024
    full_size: bool = False
    detail: int = 1024
    engine: str = "auto"
    threads: int = 0
    seed: int = 0
    shading_only: bool = False
    confidence_weights: bool = False
    light_colour: str = LightColour.BALANCED
    light_prior: str = LightPrior.PREDICTED
    shape_prior: str = ShapePrior.PREDICTED
    camera: str = CameraChoice.AUTO
    highlight_odds: float = HIGHLIGHT_ODDS

    def __post_init__(self) -> None:
        for setting in _RENAMED:
            value = getattr(self, setting)
            current = renamed_value(setting, value) if isinstance(value, str) else None
            if current is not None:
                object.__setattr__(self, setting, current)

    @property
    def maps_size(self) -> int:
        """Long side of the object in the maps; 0 for the photo's."""
        return 0 if self.full_size else self.max_size

    @property
    def takes_priors(self) -> bool:
        """Whether the model uses SIRFS priors."""
        return self.model in SIRFS_MODELS

    @property
    def uses_predicted_normals(self) -> bool:
        """Whether SIRFS expects the predicted normals."""
        return self.shape_prior == ShapePrior.PREDICTED

    @property
    def uses_predicted_light(self) -> bool:
        """Whether SIRFS expects the predicted light and shading."""
        return self.light_prior == LightPrior.PREDICTED

    @property
    def separates_by_colour(self) -> bool:
        """Whether the separator decides by colour alone: the model joint tests form itself."""
        return self.model == "joint"

    @property
    def given_light_colour(self) -> tuple[float, float, float] | None:
        """Linear RGB of mean 1 where the light's colour is given as numbers."""
        return _colour_of(self.light_colour)

    @property
    def focal_length_35mm(self) -> float | None:
        """The 35-mm equivalent focal length in millimetres where it is given as a number."""
        try:
            millimetres = float(self.camera)
        except ValueError:
            return None
        return millimetres if SHORTEST_35MM <= millimetres <= LONGEST_35MM else None

    @property
    def expects_white_light(self) -> bool:
        """Whether SIRFS expects nearly white light, the light's known colour being divided out."""
        return self.illumination == Illumination.PHOTO and self.light_colour != LightColour.FREE

    @property
    def desaturates(self) -> bool:
        """Whether SIRFS solves a less saturated photo, because dark channels are noisy."""
        return self.illumination == Illumination.PHOTO

    def check(self) -> None:
        """Validate the settings.

        Raises
        ------
        InputError
            If a value is unknown, of another type, or does not apply to the model.
        """
        _check_numbers(self)
        for name, value, known in (
            ("model", self.model, MODELS),
            ("separator", self.separator, METHODS),
            ("illumination", self.illumination, ILLUMINATIONS),
            ("light prior", self.light_prior, LIGHT_PRIORS),
            ("shape prior", self.shape_prior, SHAPE_PRIORS),
            ("engine", self.engine, ("auto", "numba", "numpy")),
        ):
            if value not in known:
                raise InputError(f'unknown {name} "{value}": choose {", ".join(known)}')
        _check_separator(self)
        if self.confidence_weights and self.model not in WEIGHTING_MODELS:
            raise InputError(
                f"--confidence-weights does not apply to {self.model}: "
                f"use --model {' or '.join(WEIGHTING_MODELS)}"
            )
        for name, value, example in (
            ("light colour", self.light_colour, "1,1,0.9"),
            ("camera", self.camera, "35"),
        ):
            if not isinstance(value, str):
                raise InputError(f"the {name} must be a text such as {example!r}, not {value!r}")
        if self.light_colour not in LIGHT_COLOURS and self.given_light_colour is None:
            raise InputError(
                f'unknown light colour "{self.light_colour}": choose {", ".join(LIGHT_COLOURS)}, '
                f"or three numbers r,g,b, the largest at most {_MOST_COLOUR:g} times the smallest"
            )
        if self.light_colour != LightColour.BALANCED and self.model not in SIRFS_MODELS:
            raise InputError(
                f"--light-colour does not apply to {self.model}: "
                f"use --model {' or '.join(SIRFS_MODELS)}"
            )
        if self.highlight_odds != HIGHLIGHT_ODDS and self.model != "joint":
            raise InputError(f"--highlight-odds does not apply to {self.model}: use --model joint")
        if not 0 <= self.highlight_odds < math.inf:
            raise InputError(
                f"--highlight-odds {self.highlight_odds:g}: give odds of 0 or more, such as 1 for "
                "what is more likely a highlight than not"
            )
        if self.camera not in list(CameraChoice) and self.focal_length_35mm is None:
            raise InputError(
                f'unknown camera "{self.camera}": choose {", ".join(CameraChoice)}, or a focal '
                f"length of {SHORTEST_35MM:g} to {LONGEST_35MM:g} (mm, 35-mm equivalent)"
            )
        if not 0 <= self.detail <= MOST_DETAIL:
            raise InputError(
                f"--detail {self.detail}: give the long side of the object in pixels, at most "
                f"{MOST_DETAIL}, or 0 for the overall shape alone"
            )
        if self.max_size < 0 or self.threads < 0:
            raise InputError(
                "--max-size and --threads cannot be negative: 0 means no limit and all cores"
            )
