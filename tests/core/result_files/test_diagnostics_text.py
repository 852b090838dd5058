"""The diagnostics of a result: as JSON, of both schemas, and as sentences."""

import json
from dataclasses import replace

import pytest

from isc_core.result_files.diagnostics_json import diagnostics_from_json, old_lobe_outcome
from isc_core.result_files.diagnostics_text import (
    COLOURED,
    STOPPED_EARLY,
    STRONG_COLOUR,
    WHITE_ASSUMED,
    joint_text,
    note_lines,
    outcome_text,
    status_lines,
    warning_text,
)
from isc_core.scene.diagnostics import (
    AssumptionWarning,
    Diagnostics,
    ExpectedErrorDiagnostics,
    IlluminantOutcome,
    JointOutcome,
    LightColourDiagnostics,
    LobeDiagnostics,
    LobeFitOutcome,
    LobeStatus,
    PhotoColours,
    StopReason,
    WarningKind,
)

ALL = Diagnostics(
    converged=False,
    reason=StopReason.EVALUATIONS,
    loss=45.5,
    terms={"light": 1.5, "slant": 2.0},
    iterations=10,
    evaluations=12,
    joint=JointOutcome.INPAINTED,
    lobe=LobeDiagnostics(LobeStatus.FITTED, LobeFitOutcome.DETERMINED, (0.2, 0.24, 0.29)),
    light_colour=LightColourDiagnostics(
        "white", (1.1, 1.0, 0.9), 0.8, IlluminantOutcome.DETERMINED, True
    ),
    scene_classes={"ordinary": 0.2, "mirror": 0.8},
    light_counts={"none": 0.0, "one": 1.0, "several": 0.0},
    several_lights=0.1,
    expected_error=ExpectedErrorDiagnostics(14.2, 0.1823),
    warnings=(
        AssumptionWarning(WarningKind.MIRROR_OR_GLASS, 0.8),
        AssumptionWarning(WarningKind.CLIPPED, 0.23),
    ),
)

# What the first schema said, word for word.
OLD = {
    "converged": False,
    "reason": "evaluations",
    "loss": 45.5,
    "terms": {"light": 1.5},
    "iterations": 10,
    "evaluations": 12,
    "help": "the solver ran out of evaluations",
    "gloss": "roughness 0.24, 0.20 to 0.29 with a probability of 68 %",
    "joint": "highlights that colour does not show were taken off, and the paint under them "
    "continued with the help of shape and light",
    "light_colour": {
        "used": "white",
        "estimate": [1.1, 1.0, 0.9],
        "confidence": 0.8,
        "determined": True,
        "reason": "120 changes across highlights agree",
        "help": "the light is coloured: --light-colour estimate takes that into account",
    },
    "kinds": {"ordinary": 0.2, "mirror": 0.8},
    "lamps": {"none": 0.0, "one": 1.0, "several": 0.0},
    "several_lamps": 0.1,
    "doubts": [
        "the object looks like a mirror or like something transparent: what was found would be an "
        "opaque one's, hardly its own",
        "23 % of the object is too bright for the photo: what is there is a guess; expose less",
    ],
}


def test_what_is_written_is_read_back() -> None:
    stored = json.loads(json.dumps(ALL.to_json(), allow_nan=False))
    assert diagnostics_from_json(stored) == ALL
    assert diagnostics_from_json(Diagnostics().to_json()) == Diagnostics()


def test_results_of_the_first_schema_are_still_read() -> None:
    found = diagnostics_from_json(OLD)
    assert (found.joint, found.lobe, found.light_colour) == (
        ALL.joint,
        ALL.lobe,
        ALL.light_colour,
    )
    assert (found.scene_classes, found.light_counts) == (ALL.scene_classes, ALL.light_counts)
    assert (found.converged, found.reason, found.loss) == (False, StopReason.EVALUATIONS, 45.5)
    assert found.warnings == (
        AssumptionWarning(WarningKind.MIRROR_OR_GLASS),
        AssumptionWarning(WarningKind.CLIPPED, 0.23),
    )


@pytest.mark.parametrize(
    ("said", "status", "outcome"),
    [
        (
            "not fitted: the separator none leaves no highlights to fit it to",
            LobeStatus.NOT_FITTED,
            None,
        ),
        (
            "next to no highlights were found: the object is matt, or they cannot be told",
            LobeStatus.NO_HIGHLIGHTS,
            LobeFitOutcome.NO_SPECULAR,
        ),
        (
            "undetermined: where highlights may be, the photo is too bright to show them",
            LobeStatus.HIDDEN,
            LobeFitOutcome.NO_SPECULAR,
        ),
        (
            "undetermined: the light is smooth, any roughness explains it",
            LobeStatus.FITTED,
            LobeFitOutcome.SMOOTH_LIGHT,
        ),
        (
            "roughness at most 0.31: the highlight is narrower than a pixel: only an upper bound",
            LobeStatus.FITTED,
            LobeFitOutcome.NARROW,
        ),
    ],
)
def test_each_old_sentence_about_the_lobe_has_its_outcome(
    said: str, status: LobeStatus, outcome: LobeFitOutcome | None
) -> None:
    lobe = diagnostics_from_json({"gloss": said}).lobe
    assert lobe is not None and (lobe.status, lobe.outcome) == (status, outcome)


def test_an_unknown_old_reason_is_refused() -> None:
    assert old_lobe_outcome("determined") == LobeFitOutcome.DETERMINED
    with pytest.raises(ValueError, match="unknown reason"):
        old_lobe_outcome("nobody knows")


def test_each_entry_has_its_line() -> None:
    assert note_lines(ALL) == [
        f"note: {STOPPED_EARLY}",
        "gloss: roughness 0.24, 0.20 to 0.29 with a probability of 68 %",
        "expected error: normals 14 degrees, reflectance a factor of 1.20",
        f"note: {COLOURED}",
        *(f"note: {warning_text(warning)}" for warning in ALL.warnings),
    ]
    assert any("23 % of the object" in line for line in note_lines(ALL))
    assert note_lines(Diagnostics(converged=True)) == note_lines(Diagnostics()) == []
    strong = LightColourDiagnostics(
        "white", (1.0, 1.0, 1.0), 0.0, IlluminantOutcome.STRONG_OBJECT_COLOUR
    )
    assert note_lines(Diagnostics(light_colour=strong)) == [f"note: {STRONG_COLOUR}"]
    unknown = LightColourDiagnostics(
        "balanced", (1.0, 1.0, 1.0), 0.0, IlluminantOutcome.UNRELIABLE, white_assumed=True
    )
    assert note_lines(Diagnostics(light_colour=unknown)) == [f"note: {WHITE_ASSUMED}"]
    grey = note_lines(Diagnostics(light_colour=unknown, photo_colours=PhotoColours.GREY))
    assert len(grey) == 1 and "the photo is grey" in grey[0]
    stored = Diagnostics(light_colour=unknown).to_json()
    assert diagnostics_from_json(stored).light_colour == unknown
    bound = LobeDiagnostics(LobeStatus.FITTED, LobeFitOutcome.CLIPPED, (0.0, 0.3, 0.3))
    assert note_lines(Diagnostics(lobe=bound))[0].startswith("gloss: roughness at most 0.30: ")


def test_every_value_has_a_sentence() -> None:
    lines = [
        *map(joint_text, JointOutcome),
        *map(outcome_text, LobeFitOutcome),
        *(warning_text(AssumptionWarning(kind)) for kind in WarningKind),
    ]
    assert len(set(lines)) == len(lines) and all(lines)


def test_a_note_is_one_short_line_with_a_remedy() -> None:
    """A note fits a terminal's line, and no two notes are equal."""
    notes = [
        STOPPED_EARLY,
        STRONG_COLOUR,
        COLOURED,
        WHITE_ASSUMED,
        *(warning_text(AssumptionWarning(kind, 0.23)) for kind in WarningKind),
    ]
    assert all(len(note) <= 100 and "\n" not in note for note in notes)
    doing = ("try", "photograph", "use", "dull", "reduce", "fill", "mark")
    assert all(any(f" {verb} " in note for verb in doing) for note in notes)
    every = replace(ALL, warnings=tuple(AssumptionWarning(kind, 0.5) for kind in WarningKind))
    lines = note_lines(every)
    assert len(lines) == len(set(lines)) == 4 + len(WarningKind)


def test_foreign_files_are_harmless() -> None:
    odd = {"converged": "no", "gloss": 3, "light_colour": "red", "doubts": {"a": 1}}
    assert status_lines(odd) == status_lines({}) == status_lines([1]) == []
    assert status_lines({"doubts": [1, None, "there seem to be several lights"]}) == [
        f"note: {warning_text(AssumptionWarning(WarningKind.SEVERAL_LIGHTS))}"
    ]
    assert status_lines({"warnings": [1, {"kind": "ghost"}, {"kind": ["clipped"]}]}) == []
    huge = {"loss": 10**400, "terms": [1], "iterations": -1, "lobe": {"status": 1}}
    assert diagnostics_from_json(huge) == Diagnostics()
