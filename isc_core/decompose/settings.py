"""What a decomposition is asked for: the names of the models, and what they can be told."""

from dataclasses import dataclass

from .. import baselines
from ..errors import InputError
from ..separation import BEST, METHODS

SIRFS_MODELS = ("mdr", "mbp", "joint", "sirfs")
SEPARATING_MODELS = ("mdr", "mbp", "joint")
WEIGHING_MODELS = ("mdr", "joint")
BASELINE_MODELS = tuple(baselines.METHODS)
MODELS = SIRFS_MODELS + BASELINE_MODELS
NATURAL, LABORATORY = ILLUMINATIONS = ("natural", "laboratory")
LIGHT_COLOURS = ("white", "estimate")
SEEN, USUAL, OUTLINE = "seen", "usual", "outline"
LIGHT_PRIORS = (SEEN, USUAL)
SHAPE_PRIORS = (SEEN, OUTLINE)


@dataclass(frozen=True)
class Settings:
    """What a decomposition is asked for.

    `model`: one of `MODELS`. `separator`: one of `separation.METHODS`, used by `SEPARATING_MODELS`.
    `illumination`: "natural" or "laboratory", which lights to expect. `max_size`: the object's long
    side in pixels at which the maps are made, 0 for the photo's; SIRFS is solved at a size of its
    own, `recover.SOLVE_SIZE`. `full_size`: the maps are then brought to the photo's resolution.
    `engine`, `threads`: see `SolverOptions`. `seed`: written into the result; no step of these
    models draws random numbers. `shading_only`: shape-from-shading mode, an object of one colour.
    `confidence_weights`: of "mdr" and "joint", whether pixels whose separation is in doubt weigh
    less in SIRFS' terms of reflectance. `light_colour`: of `SEPARATING_MODELS`, "white", or
    "estimate" for the colour that the photo's highlights tell, where they do. `light_prior`: of
    `SIRFS_MODELS`, which lights SIRFS expects: those that the photo's looks like ("seen", see
    `lamp_network`; in natural illumination), or those of all photos of this `illumination`
    ("usual"). `shape_prior`: of `SIRFS_MODELS`, what SIRFS expects of the shape: what the photo
    looks like ("seen", see `shape_network`; in natural illumination, where no depth is known and
    the frame does not cut the object), or what its outline alone suggests ("outline").
    """

    model: str = "joint"
    separator: str = BEST
    illumination: str = "natural"
    max_size: int = 512
    full_size: bool = False
    engine: str = "auto"
    threads: int = 0
    seed: int = 0
    shading_only: bool = False
    confidence_weights: bool = False
    light_colour: str = "white"
    light_prior: str = SEEN
    shape_prior: str = SEEN

    @property
    def takes_priors(self) -> bool:
        """Whether the model uses SIRFS priors."""
        return self.model in SIRFS_MODELS

    @property
    def uses_predicted_normals(self) -> bool:
        """Whether SIRFS expects the predicted normals."""
        return self.shape_prior == SEEN and self.illumination != LABORATORY

    @property
    def uses_predicted_light(self) -> bool:
        """Whether SIRFS expects the predicted light."""
        return self.light_prior == SEEN and self.illumination != LABORATORY

    def check(self) -> None:
        """Raises `InputError` for values that mean nothing."""
        for name, value, known in (
            ("model", self.model, MODELS),
            ("separator", self.separator, METHODS),
            ("illumination", self.illumination, ILLUMINATIONS),
            ("light colour", self.light_colour, LIGHT_COLOURS),
            ("light prior", self.light_prior, LIGHT_PRIORS),
            ("shape prior", self.shape_prior, SHAPE_PRIORS),
            ("engine", self.engine, ("auto", "numba", "numpy")),
        ):
            if value not in known:
                raise InputError(f'unknown {name} "{value}": choose {", ".join(known)}')
        if self.confidence_weights and self.model not in WEIGHING_MODELS:
            raise InputError(
                f"--confidence-weights means nothing to {self.model}: use --model {' or '.join(WEIGHING_MODELS)}"
            )
        if self.light_colour != "white" and self.model not in SEPARATING_MODELS:
            raise InputError(
                f"--light-colour means nothing to {self.model}: use --model {' or '.join(SEPARATING_MODELS)}"
            )
        if self.max_size < 0 or self.threads < 0:
            raise InputError(
                "--max-size and --threads cannot be negative: 0 means no limit and all cores"
            )
