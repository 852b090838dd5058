"""The diagnostics of a result as sentences, for commands and for programs that show a result."""

import math
from typing import Any

from ..scene.diagnostics import (
    AssumptionWarning,
    Diagnostics,
    ExpectedErrorDiagnostics,
    JointOutcome,
    LightColourDiagnostics,
    LobeDiagnostics,
    LobeFitOutcome,
    LobeStatus,
    PhotoColours,
    WarningKind,
)
from .diagnostics_json import diagnostics_from_json

_MOST_LOG = 10.0  # larger errors of the logarithm occur only in invalid files
STOPPED_EARLY = "the solver reached its limit of evaluations: try a cleaner mask"
STRONG_COLOUR = "the light or the whole object has a strong colour: photograph it in white light"
CROPPED = (
    "the photo was cropped, so its focal length is not used: use the whole photo, or --camera MM"
)
COLOURED = "the light is coloured: use --light-colour estimate"
WHITE_ASSUMED = (
    "the photo does not show the light's colour, white is assumed: use --light-colour R,G,B"
)

_COLOURS = {
    PhotoColours.GREY: (
        "the photo is grey: the light has no colour, and shape and reflectance are less certain"
    ),
    PhotoColours.TONED: (
        "the photo is grey with a tone, such as sepia: it is solved as grey, and the tone is in "
        "the reflectance"
    ),
}
_JOINT = {
    JointOutcome.UNCHANGED: (
        "no highlights other than those that colour shows: same result as --model mdr"
    ),
    JointOutcome.REMOVED: (
        "highlights that colour does not show were removed; continuing the albedo under them did "
        "not lower the energy"
    ),
    JointOutcome.INPAINTED: (
        "highlights that colour does not show were removed, and the albedo under them continued "
        "with the help of shape and light"
    ),
}
_LOBE = {
    LobeFitOutcome.DETERMINED: "determined",
    LobeFitOutcome.NO_SPECULAR: "undetermined: there is no specular light",
    LobeFitOutcome.SMOOTH_LIGHT: "undetermined: in smooth light, any roughness explains it",
    LobeFitOutcome.NARROW: "the highlight is narrower than a pixel: only an upper bound",
    LobeFitOutcome.CLIPPED: "the highlight is clipped: only an upper bound",
    LobeFitOutcome.UNEXPLAINED: (
        "undetermined: the specular image has no highlight that a lobe explains"
    ),
}
_LOBE_STATUS = {
    LobeStatus.NOT_FITTED: "not fitted: the separator none separates no highlights to fit it to",
    LobeStatus.NO_HIGHLIGHTS: (
        "hardly any highlights: the object is diffuse, or its highlights cannot be distinguished "
        "from its albedo"
    ),
    LobeStatus.HIDDEN: "undetermined: clipping hides the highlights",
}
_WARNINGS = {
    WarningKind.MIRROR_OR_GLASS: (
        "it may be a mirror or transparent (often wrong): if so, dull it with matting spray"
    ),
    WarningKind.SEVERAL_LIGHTS: (
        "several lights, or a shadow of another object: use one light with nothing in front of it"
    ),
    WarningKind.CLIPPED: "{share}of the object is clipped, and guessed: reduce the exposure",
    WarningKind.RAGGED_MASK: (
        "{share}of the mask is too thin or ragged for a mesh, such as hair: fill the mask"
    ),
    WarningKind.DOUBTFUL_HIGHLIGHTS: (
        "{share}of the light stays, but may be highlights: mark them, or require lower odds"
    ),
}


def status_lines(status: Any) -> list[str]:
    """Write the notes on a result, from the entry `status` of its decomposition.json.

    Parameters
    ----------
    status : Any
        The entry, of any schema; the file is not trusted, and invalid parts are ignored.

    Returns
    -------
    list of str
        As for `note_lines`.
    """
    return note_lines(diagnostics_from_json(status))


def note_lines(diagnostics: Diagnostics) -> list[str]:
    """Write the notes on a result.

    Parameters
    ----------
    diagnostics : Diagnostics
        Of the result.

    Returns
    -------
    list of str
        Lines that begin with "note: ", "gloss: " or "expected error: ".
    """
    lines = [f"note: {STOPPED_EARLY}"] if diagnostics.converged is False else []
    if diagnostics.lobe is not None:
        lines.append(f"gloss: {lobe_text(diagnostics.lobe)}")
    if diagnostics.expected_error is not None:
        lines.append(f"expected error: {expected_error_text(diagnostics.expected_error)}")
    colours = diagnostics.photo_colours
    advice = light_colour_advice(diagnostics.light_colour)
    if advice and not (colours in _COLOURS and advice == WHITE_ASSUMED):
        lines.append(f"note: {advice}")
    if colours in _COLOURS:
        lines.append(f"note: {_COLOURS[colours]}")
    return lines + [f"note: {warning_text(warning)}" for warning in diagnostics.warnings]


def joint_text(outcome: JointOutcome) -> str:
    """Return the sentence for an outcome of the model joint.

    Parameters
    ----------
    outcome : JointOutcome

    Returns
    -------
    str
    """
    return _JOINT[outcome]


def outcome_text(outcome: LobeFitOutcome) -> str:
    """Return the sentence for an outcome of a lobe fit.

    Parameters
    ----------
    outcome : LobeFitOutcome

    Returns
    -------
    str
    """
    return _LOBE[outcome]


def lobe_text(lobe: LobeDiagnostics) -> str:
    """Write the roughness with its interval, or the reason why it is not determined.

    Parameters
    ----------
    lobe : LobeDiagnostics
        The fitted lobe.

    Returns
    -------
    str
        One line.
    """
    if lobe.status in _LOBE_STATUS:
        return _LOBE_STATUS[lobe.status]
    outcome = lobe.outcome or LobeFitOutcome.UNEXPLAINED
    if lobe.roughness is None:
        return _LOBE[outcome]
    low, likely, high = lobe.roughness
    if outcome.bounded:
        return f"roughness at most {high:.2f}: {_LOBE[outcome]}"
    return f"roughness {likely:.2f}, {low:.2f} to {high:.2f} with a probability of 68 %"


def expected_error_text(error: ExpectedErrorDiagnostics) -> str:
    """Write the expected error of a result.

    Parameters
    ----------
    error : ExpectedErrorDiagnostics
        Means over the object.

    Returns
    -------
    str
        One line.
    """
    factor = math.exp(min(error.reflectance, _MOST_LOG))
    return f"normals {error.normal:.0f} degrees, reflectance a factor of {factor:.2f}"


def light_colour_advice(light: LightColourDiagnostics | None) -> str:
    """Write the recommended setting for the light's colour.

    Parameters
    ----------
    light : LightColourDiagnostics or None

    Returns
    -------
    str
        "" without a recommendation.
    """
    if light is None:
        return ""
    if light.outcome.too_strong:
        return STRONG_COLOUR
    if light.white_assumed:
        return WHITE_ASSUMED
    return COLOURED if light.coloured and light.used != "estimate" else ""


def warning_text(warning: AssumptionWarning) -> str:
    """Return the sentence for a violated assumption.

    Parameters
    ----------
    warning : AssumptionWarning

    Returns
    -------
    str
    """
    share = "much " if warning.value is None else f"{100 * warning.value:.0f} % "
    return _WARNINGS[warning.kind].format(share=share)
