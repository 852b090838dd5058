"""How a decomposition ended: the solver's convergence, the fits, and violated assumptions.

Values only: the sentences for users are in `result_files.diagnostics_text`.
"""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any


class StopReason(StrEnum):
    """Why the solver stopped.

    Attributes
    ----------
    LOSS, GRADIENT, STEP
        It converged: the loss, the gradient or the step became small.
    ITERATIONS, EVALUATIONS
        It reached a limit.
    DIRECT
        The method is not iterative.
    """

    LOSS = "loss"
    GRADIENT = "gradient"
    STEP = "step"
    ITERATIONS = "iterations"
    EVALUATIONS = "evaluations"
    DIRECT = "direct method"


class Abstention(StrEnum):
    """Why a separation left a photo unchanged.

    Attributes
    ----------
    NO_COLOUR
        All channels are equal.
    NO_CANDIDATE
        No pixel is paler than pixels of its hue.
    NEAR_GREY
        The bright pixels are too pale to tell a highlight from their colours.
    NOT_PROVEN
        There are pale pixels, but they look like reflectance: they have its edges, or run with its
        colours.
    PRINT
        The pale pixels are likelier print than highlights.
    """

    NO_COLOUR = "no colour"
    NO_CANDIDATE = "no candidate"
    NEAR_GREY = "near grey"
    NOT_PROVEN = "not proven"
    PRINT = "print"


class JointOutcome(StrEnum):
    """What the model joint did beyond MDR.

    Attributes
    ----------
    UNCHANGED
        No highlights stand out that colour does not show: the result is MDR's.
    REMOVED
        Such highlights were removed; inpainting the albedo under them did not lower the energy.
    INPAINTED
        Such highlights were removed, and the albedo under them was inpainted.
    """

    UNCHANGED = "unchanged"
    REMOVED = "highlights removed"
    INPAINTED = "albedo continued"


class LobeFitOutcome(StrEnum):
    """How far a lobe fit determines the roughness.

    Attributes
    ----------
    DETERMINED
        The roughness is determined.
    NO_SPECULAR
        There is no specular light.
    SMOOTH_LIGHT
        The light is smooth, so that any roughness explains the highlights.
    NARROW
        The highlight is narrower than a pixel: only an upper bound of the roughness.
    CLIPPED
        The highlight is brighter than the photo can record: only an upper bound.
    UNEXPLAINED
        The specular image has no highlight that a lobe explains.
    """

    DETERMINED = "determined"
    NO_SPECULAR = "no specular light"
    SMOOTH_LIGHT = "smooth light"
    NARROW = "narrower than a pixel"
    CLIPPED = "clipped"
    UNEXPLAINED = "unexplained"

    @property
    def bounded(self) -> bool:
        """Whether there is an upper bound of the roughness, but no value."""
        return self in (LobeFitOutcome.NARROW, LobeFitOutcome.CLIPPED)


class LobeStatus(StrEnum):
    """What became of the lobe.

    Attributes
    ----------
    NOT_FITTED
        No separator was run.
    NO_HIGHLIGHTS
        There are next to no highlights.
    HIDDEN
        Clipping hides the highlights.
    FITTED
        A lobe was fitted, see `LobeDiagnostics.outcome`.
    """

    NOT_FITTED = "not fitted"
    NO_HIGHLIGHTS = "no highlights"
    HIDDEN = "hidden by clipping"
    FITTED = "fitted"


class IlluminantOutcome(StrEnum):
    """How far a photo determines the colour of its light.

    Attributes
    ----------
    DETERMINED
        Changes across highlights agree on it.
    UNRELIABLE
        The highlights lie on one albedo, or disagree.
    NO_FLANKS
        No coloured albedo carries a highlight with a visible flank.
    STRONG_OBJECT_COLOUR
        All of the object has one strong colour, its brightest places too.
    STRONG_HIGHLIGHT_COLOUR
        Apparent highlights have too strong a colour for a light.
    """

    DETERMINED = "determined"
    UNRELIABLE = "unreliable"
    NO_FLANKS = "no flanks"
    STRONG_OBJECT_COLOUR = "strong object colour"
    STRONG_HIGHLIGHT_COLOUR = "strong highlight colour"

    @property
    def too_strong(self) -> bool:
        """Whether the light may have a colour that no lamp has."""
        kind = IlluminantOutcome
        return self in (kind.STRONG_OBJECT_COLOUR, kind.STRONG_HIGHLIGHT_COLOUR)


class PhotoColours(StrEnum):
    """Whether a photo has colours of its own.

    Attributes
    ----------
    COLOURED
        It has.
    GREY
        Its channels are equal.
    TONED
        It is a grey photo that was toned, such as sepia.
    """

    COLOURED = "coloured"
    GREY = "grey"
    TONED = "toned"


class WarningKind(StrEnum):
    """An assumption that a photo violates.

    Attributes
    ----------
    MIRROR_OR_GLASS
        The object may be a mirror or transparent; the value is the probability.
    SEVERAL_LIGHTS
        There seem to be several lights; the value is the probability.
    CLIPPED
        Much of the object is clipped; the value is its share.
    RAGGED_MASK
        The mask is thin or ragged; the value is the share that no mesh can cover.
    DOUBTFUL_HIGHLIGHTS
        Much light may be highlights, but not certainly, and stays; the value is its share.
    """

    MIRROR_OR_GLASS = "mirror or glass"
    SEVERAL_LIGHTS = "several lights"
    CLIPPED = "clipped"
    RAGGED_MASK = "ragged mask"
    DOUBTFUL_HIGHLIGHTS = "doubtful highlights"


@dataclass(frozen=True)
class AssumptionWarning:
    """A violated assumption.

    Attributes
    ----------
    kind : WarningKind
        The assumption.
    value : float or None
        See `WarningKind`, in [0, 1]; None where unknown.
    """

    kind: WarningKind
    value: float | None = None


@dataclass(frozen=True)
class LobeDiagnostics:
    """The fitted lobe in short.

    Attributes
    ----------
    status : LobeStatus
        What became of it.
    outcome : LobeFitOutcome or None
        Of the fit, where there is one.
    roughness : tuple of float or None
        Lower end, value and upper end of the 68 % interval, Blender's roughness in [0, 1]; None
        where it is unknown.
    """

    status: LobeStatus
    outcome: LobeFitOutcome | None = None
    roughness: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class LightColourDiagnostics:
    """The colour of the light.

    Attributes
    ----------
    used : str
        "balanced", "estimate" or "free".
    estimate : tuple of float
        Linear RGB of mean 1.
    confidence : float
        In [0, 1].
    outcome : IlluminantOutcome
        How far the photo determines it.
    coloured : bool
        The estimate differs clearly from white.
    white_assumed : bool
        The estimate was asked for, but the photo does not determine it.
    """

    used: str
    estimate: tuple[float, float, float]
    confidence: float
    outcome: IlluminantOutcome
    coloured: bool = False
    white_assumed: bool = False

    @property
    def determined(self) -> bool:
        """Whether the photo determines the colour."""
        return self.outcome == IlluminantOutcome.DETERMINED


@dataclass(frozen=True)
class ExpectedErrorDiagnostics:
    """Means over the object of the expected errors, see `scene.expected_error`.

    Attributes
    ----------
    normal : float
        Degrees.
    reflectance : float
        Of the natural logarithm.
    """

    normal: float
    reflectance: float


@dataclass(frozen=True)
class Diagnostics:
    """How a decomposition ended. None, or empty, where a step was not run.

    Attributes
    ----------
    converged : bool or None
        Whether the solver converged.
    reason : StopReason or None
        Why it stopped.
    loss : float or None
        The objective at its end.
    terms : dict of str to float
        The objective's terms there.
    iterations, evaluations : int or None
        The solver's work.
    joint : JointOutcome or None
        What the model joint did beyond MDR.
    doubtful_highlights : float or None
        Share of the light that is likelier a highlight than print, but not certainly: it stays.
    lobe : LobeDiagnostics or None
        The fitted lobe.
    light_colour : LightColourDiagnostics or None
        The colour of the light.
    photo_colours : PhotoColours or None
        Whether the photo has colours.
    scene_classes : dict of str to float
        Probabilities of what the object is made of: "opaque", "mirror" and "glass".
    light_counts : dict of str to float
        Probabilities of "none", "one" and "several" lights.
    several_lights : float or None
        Probability of several lights.
    expected_error : ExpectedErrorDiagnostics or None
        How wrong normals and reflectance probably are.
    warnings : tuple of AssumptionWarning
        Violated assumptions.
    """

    converged: bool | None = None
    reason: StopReason | None = None
    loss: float | None = None
    terms: dict[str, float] = field(default_factory=dict)
    iterations: int | None = None
    evaluations: int | None = None
    joint: JointOutcome | None = None
    doubtful_highlights: float | None = None
    lobe: LobeDiagnostics | None = None
    light_colour: LightColourDiagnostics | None = None
    photo_colours: PhotoColours | None = None
    scene_classes: dict[str, float] = field(default_factory=dict)
    light_counts: dict[str, float] = field(default_factory=dict)
    several_lights: float | None = None
    expected_error: ExpectedErrorDiagnostics | None = None
    warnings: tuple[AssumptionWarning, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return the entry `status` of decomposition.json, without the steps that were not run."""
        lobe, light, error = self.lobe, self.light_colour, self.expected_error
        entries: dict[str, Any] = {
            "converged": self.converged,
            "reason": self.reason and self.reason.value,
            "loss": self.loss,
            "terms": self.terms,
            "iterations": self.iterations,
            "evaluations": self.evaluations,
            "joint": self.joint and self.joint.value,
            "doubtful_highlights": self.doubtful_highlights,
            "lobe": lobe
            and {
                "status": lobe.status.value,
                "outcome": lobe.outcome and lobe.outcome.value,
                "roughness_68": lobe.roughness and list(lobe.roughness),
            },
            "light_colour": light
            and {
                "used": light.used,
                "estimate": list(light.estimate),
                "confidence": light.confidence,
                "determined": light.determined,
                "outcome": light.outcome.value,
                "coloured": light.coloured,
                "white_assumed": light.white_assumed,
            },
            "photo_colours": self.photo_colours and self.photo_colours.value,
            "scene_classes": self.scene_classes,
            "light_counts": self.light_counts,
            "several_lights": self.several_lights,
            "expected_error": error
            and {"normal_degrees": error.normal, "log_reflectance": error.reflectance},
        }
        kept = {name: value for name, value in entries.items() if value is not None and value != {}}
        return kept | {
            "warnings": [{"kind": one.kind.value, "value": one.value} for one in self.warnings]
        }
