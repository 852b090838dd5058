"""The contact sheet: every panel shows the map that its label names, in comparable tones."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageDraw

from isc_core.imaging.srgb import srgb_to_linear
from isc_core.lobe_fitting import fit_lobe
from isc_core.result_files.contact_sheet import (
    LabelledSeparation,
    comparison_sheet,
    contact_sheet,
    separation_sheet,
)
from isc_core.result_files.error_colors import SCALE, error_colors
from isc_core.scene.decomposition import Decomposition, Provenance, Separation
from isc_core.scene.diagnostics import (
    AssumptionWarning,
    Diagnostics,
    LobeDiagnostics,
    LobeFitOutcome,
    LobeStatus,
    WarningKind,
)
from isc_core.scene.expected_error import ExpectedError
from isc_core.scene.lobe_fit import Interval, LobeFit, LobeLight
from tests.core.ball_scene import ball

LABELS = (
    *("input", "diffuse", "specular", "reflectance", "shading", "normals", "height", "light"),
    *("from the left", "from the right", "relit", "confidence"),
)
SIDE, GAP, EDGE, HEAD, LABEL = 320, 20, 40, 104, 38


def panels(sheet: Image.Image, columns: int = 4) -> dict[str, np.ndarray]:
    """Each panel as linear light, (320, 320, 3)."""
    linear = srgb_to_linear(np.asarray(sheet.convert("RGB")) / 255.0)
    found = {}
    for index, label in enumerate(LABELS[: 12 if columns == 4 else 3]):
        top, left = (
            HEAD + index // columns * (SIDE + LABEL + GAP),
            EDGE + index % columns * (SIDE + GAP),
        )
        found[label] = linear[top : top + SIDE, left : left + SIDE]
    return found


@pytest.fixture(scope="module")
def scene() -> Decomposition:
    return ball((600, 640), 250.0, (300, 320))


@pytest.fixture(scope="module")
def shown(scene: Decomposition) -> dict[str, np.ndarray]:
    return panels(contact_sheet(scene))


def inner() -> np.ndarray:
    """Where the ball surely is in a panel."""
    row, column = np.mgrid[:SIDE, :SIDE] - (SIDE - 1) / 2
    return np.hypot(row, column) < 120


@pytest.mark.slow
def test_one_exposure_holds_for_input_diffuse_and_specular(
    shown: dict[str, np.ndarray], scene: Decomposition
) -> None:
    """Light adds up on the page as it does in the scene."""
    total = shown["diffuse"] + shown["specular"]
    unclipped = inner() & (shown["input"].max(-1) < 0.9)
    assert np.abs(total - shown["input"])[unclipped].max() < 0.02
    gain = 0.95 / np.percentile(scene.image[scene.mask].max(-1), 99.5)
    assert shown["diffuse"][160, 160] == pytest.approx(gain * scene.diffuse[300, 320], abs=0.02)


@pytest.mark.slow
def test_reflectance_and_shading_have_their_own_exposure(shown: dict[str, np.ndarray]) -> None:
    for label in ("reflectance", "shading"):
        assert np.percentile(shown[label][inner()].max(-1), 99.5) == pytest.approx(0.95, abs=0.03)


def test_the_ball_of_light_is_a_ball_in_that_light(shown: dict[str, np.ndarray]) -> None:
    """The scene is itself a ball: its shading is what the light panel shows, a little larger."""
    small = (
        np.asarray(Image.fromarray(np.uint8(255 * shown["light"])).resize((356, 356)))[
            18:338, 18:338
        ]
        / 255
    )
    assert np.abs(small - shown["shading"])[inner()].max() < 0.04


def test_normals_are_drawn_with_right_and_up_positive(shown: dict[str, np.ndarray]) -> None:
    coded = shown["normals"]
    assert coded[160, 270, 0] > 2 * coded[160, 50, 0]  # red grows to the right
    assert coded[50, 160, 1] > 2 * coded[270, 160, 1]  # green grows upward
    assert coded[160, 160, 2] > 0.9


def test_the_relief_is_lit_from_the_upper_left(shown: dict[str, np.ndarray]) -> None:
    grey = shown["height"].mean(-1)
    assert grey[95:115, 95:115].mean() > 3 * grey[205:225, 205:225].mean()


@pytest.mark.slow
def test_contour_lines_show_in_a_dome_and_not_in_a_plain(scene: Decomposition) -> None:
    flat = replace(
        scene,
        height=np.where(scene.mask, 7.0, 0.0),
        normal=np.broadcast_to([0.0, 0.0, 1.0], scene.normal.shape),
    )
    dome = panels(contact_sheet(scene))["height"].mean(-1)[160, 60:260]
    plain = panels(contact_sheet(flat))["height"].mean(-1)[160, 60:260]
    assert np.ptp(plain) < 0.01
    assert np.count_nonzero(np.diff(dome, 2) > 0.1) >= 6


def test_the_turned_ball_is_a_ball(shown: dict[str, np.ndarray]) -> None:
    """With sides and a back a ball looks the same from all sides."""
    card = shown["input"][20, 20]
    covered = {
        label: np.abs(shown[label] - card).max(axis=-1) > 0.01
        for label in ("input", "from the left", "from the right")
    }
    across = np.count_nonzero(covered["input"][SIDE // 2])
    for label in ("from the left", "from the right"):
        assert np.count_nonzero(covered[label][SIDE // 2]) == pytest.approx(across, abs=9)
        assert np.count_nonzero(covered[label][:, SIDE // 2]) == pytest.approx(across, abs=9)


def test_from_the_left_the_left_side_is_seen() -> None:
    """A mark left of the middle moves to the middle of the view from the left."""
    d = ball((300, 300), 140.0, (150, 150))
    mark = np.zeros_like(d.diffuse)
    mark[140:160, 70:90] = 1.0  # 70 of 140 left of the middle: 30 degrees
    shown = panels(contact_sheet(replace(d, image=mark, diffuse=mark, specular=0 * mark)))
    columns = {
        label: np.average(np.arange(SIDE), weights=(shown[label][..., 0] > 0.5).sum(axis=0) + 1e-9)
        for label in ("input", "from the left", "from the right")
    }
    assert columns["from the right"] < columns["input"] < columns["from the left"]


def test_a_rim_of_another_colour_does_not_line_the_sides(scene: Decomposition) -> None:
    """Pixels at the outline mix with the background; a thin part keeps its colour."""
    row, column = np.indices(scene.mask.shape)
    radius = np.hypot(row - 300, column - 320)
    green = scene.shading * np.array([0.2, 0.8, 0.2])
    diffuse = np.where((radius > 247)[..., None], np.array([1.0, 0, 0]), green)
    thin = (np.abs(row - 300) < 7) & (np.abs(column - 320) < 310) & (radius > 250)
    diffuse[thin] = 0, 0, 1
    sheet = contact_sheet(replace(scene, diffuse=diffuse, mask=scene.mask | thin))
    turned = panels(sheet)["from the left"]
    light = turned.sum(axis=2)
    assert not (turned[..., 0] > 0.5 * light)[light > 0.2].any()
    assert (turned[..., 2] > 0.6 * light)[light > 0.2].sum() > 50


def test_the_new_light_comes_from_the_other_side(
    shown: dict[str, np.ndarray], scene: Decomposition
) -> None:
    """The ball's light comes from the left; its new one from the right, of the same colour."""
    white = np.where(scene.mask[..., None], np.full(3, 0.5), 0.0)
    relit = panels(contact_sheet(replace(scene, reflectance=white)))["relit"]
    left, right = (
        relit[100:220, part].mean(axis=(0, 1)) for part in (slice(60, 100), slice(220, 260))
    )
    assert (right > 1.5 * left).all()
    tint = scene.shading[scene.mask].mean(axis=0)
    np.testing.assert_allclose(right / right.sum(), tint / tint.sum(), atol=0.02)


def test_a_fitted_lobe_moves_with_the_viewer_and_the_light(scene: Decomposition) -> None:
    """The highlight on a black ball: seen from its own side it is nearer to the middle."""
    direction = np.array([0.6, 0.0, 0.8])
    dark = replace(scene, diffuse=0 * scene.diffuse, reflectance=0 * scene.reflectance)
    light = LobeLight(direction, 5.0, np.ones(3), Interval(0.5, 1.5))
    fit = replace(
        LobeFit.without_lobe("ggx", LobeFitOutcome.DETERMINED, scene.image.shape),
        alpha=0.2,
        lights=(light,),
    )
    shown = panels(contact_sheet(replace(dark, brdf=fit)))
    place = {
        label: np.average(np.arange(SIDE), weights=(shown[label][..., 0] > 0.03).sum(axis=0))
        for label in ("from the left", "from the right", "relit")
    }
    assert place["from the left"] > place["from the right"]
    assert place["relit"] < SIDE / 2


def test_expected_errors_have_the_colours_of_the_legend(scene: Decomposition) -> None:
    for degrees, code in SCALE:
        error = ExpectedError(np.full(scene.mask.shape, float(degrees)), 0 * scene.confidence)
        sheet = contact_sheet(replace(scene, expected_error=error))
        shown = panels(sheet)["confidence"]
        np.testing.assert_allclose(shown[160, 160], srgb_to_linear(np.array(code) / 255), atol=0.01)
    top = HEAD + 2 * (SIDE + LABEL + GAP) + SIDE
    legend = np.asarray(sheet)[top : top + LABEL, -EDGE - SIDE : -EDGE].reshape(-1, 3)
    assert all((legend == code).all(axis=1).sum() >= 80 for _, code in SCALE)
    ends = error_colors(np.array([0.0, SCALE[0][0], SCALE[-1][0], 180.0]))
    assert (ends[0] == ends[1]).all() and (ends[2] == ends[3]).all()


def test_no_dark_seam_runs_around_the_object(scene: Decomposition) -> None:
    """A white object on its card: from the inside out the tone falls once and never below the
    card's.
    """
    white = np.where(scene.mask[..., None], np.full(3, 0.8), 0.0)
    row = panels(contact_sheet(replace(scene, reflectance=white)))["reflectance"][160, 160:, 1]
    assert (np.diff(row) < 1e-6).all()
    assert row[0] == pytest.approx(0.95, abs=0.01)


@pytest.mark.slow
def test_the_object_fills_its_panel_wherever_it_is_in_the_frame() -> None:
    near_corner = panels(contact_sheet(ball((300, 500), 60, (62, 430))))["shading"]
    central = panels(contact_sheet(ball((200, 200), 60, (100, 100))))["shading"]
    assert np.abs(near_corner - central).mean() < 0.01


@pytest.mark.parametrize("shape", [(300, 3), (3, 20_000), (2, 2), (1, 1)])
def test_odd_shapes_can_be_shown(shape: tuple[int, int]) -> None:
    d = ball()
    grown = np.ones((*shape, 3))
    flat = np.zeros(shape)
    odd = Decomposition(
        grown,
        grown,
        0 * grown,
        0 * grown,
        grown,
        grown,
        grown / np.sqrt(3),
        flat,
        flat == 0,
        flat,
        d.illumination,
        Provenance(),
    )
    assert contact_sheet(odd).size == contact_sheet(d).size


@pytest.mark.slow
def test_a_black_result_and_a_long_name_can_be_shown() -> None:
    d = ball()
    named = replace(
        d.provenance,
        input={"name": "a long name " * 40 + ".png"},
        diagnostics=Diagnostics(loss=float("nan"), converged=False),
    )
    black = replace(
        d,
        image=0 * d.image,
        diffuse=0 * d.diffuse,
        specular=0 * d.specular,
        shading=0 * d.shading,
        provenance=named,
    )
    sheet = np.asarray(contact_sheet(black))
    assert sheet.shape == np.asarray(contact_sheet(d)).shape
    assert (sheet[:HEAD, -EDGE:] == sheet[0, 0]).all()  # the title ends before the edge


def test_the_title_depends_on_the_provenance() -> None:
    d = ball()
    nameless = replace(d, provenance=Provenance())
    with_title, without = (np.asarray(contact_sheet(x))[:HEAD].astype(int) for x in (d, nameless))
    assert np.abs(with_title - without).max() > 100


def test_the_sheet_of_a_separation_adds_up(scene: Decomposition) -> None:
    separation = Separation(scene.diffuse, scene.specular, scene.residual, scene.confidence)
    sheet = separation_sheet(separation, scene.image, scene.mask, "ball.png")
    found = panels(sheet, columns=3)
    unclipped = inner() & (found["input"].max(-1) < 0.9)
    assert np.abs(found["diffuse"] + found["specular"] - found["input"])[unclipped].max() < 0.02


def comparison_panel(sheet: Image.Image, index: int) -> np.ndarray:
    top, left = HEAD + index // 6 * (SIDE + LABEL + GAP), EDGE + index % 6 * (SIDE + GAP)
    return srgb_to_linear(np.asarray(sheet)[top : top + SIDE, left : left + SIDE] / 255.0)


def test_a_comparison_shows_where_light_was_left_and_where_too_much_was_taken(
    scene: Decomposition,
) -> None:
    nothing = Separation(scene.image, 0 * scene.image, scene.residual, scene.confidence)
    exact = Separation(scene.diffuse, scene.specular, scene.residual, scene.confidence)
    black = Separation(0 * scene.image, scene.image, scene.residual, scene.confidence)
    answers = [
        LabelledSeparation(name, "remark", split)
        for name, split in (("none", nothing), ("exact", exact), ("black", black))
    ]
    sheet = comparison_sheet(
        "ball", scene.image, scene.mask, answers, (scene.diffuse, scene.specular)
    )
    assert (
        sheet.width == 2 * EDGE + 6 * SIDE + 5 * GAP
        and sheet.height == HEAD + 2 * (SIDE + LABEL) + GAP + EDGE
    )
    photo, diffuse, specular, _, _, left, found, taken, fine, dark, _, over = (
        comparison_panel(sheet, k) for k in range(12)
    )
    unclipped = inner() & (photo.max(-1) < 0.9)
    assert np.abs(diffuse + specular - photo)[unclipped].max() < 0.02
    assert (
        np.abs(found - diffuse).max() < 0.01
        and np.abs(taken - specular).max() < 0.01
        and dark[inner()].max() < 0.01
    )
    highlight = inner() & (specular.mean(-1) > 0.3)
    assert highlight.sum() > 100 and (left[highlight][:, 0] > left[highlight][:, 2] + 0.5).all()
    assert (
        np.ptp(fine[inner()], axis=0).max() < 0.02
        and (over[inner()][:, 2] > over[inner()][:, 0] + 0.3).mean() > 0.8
    )


def test_a_comparison_without_truth_shows_the_confidence(scene: Decomposition) -> None:
    exact = Separation(scene.diffuse, scene.specular, scene.residual, scene.confidence)
    sheet = comparison_sheet(
        "ball", scene.image, scene.mask, [LabelledSeparation("exact", "", exact)]
    )
    colour, confidence = comparison_panel(sheet, 2), comparison_panel(sheet, 5)
    assert np.abs(colour.sum(-1) - 1)[inner()].max() < 0.05
    assert (
        np.ptp(confidence[inner()], axis=1).max() < 0.01
        and confidence[160, 160, 0] > 0.9 > confidence[160, 30, 0]
    )


def drawn_text(d: Decomposition) -> list[str]:
    """The lines of text that the contact sheet draws: title, subtitle, and so on."""
    drawn: list[str] = []
    text = ImageDraw.ImageDraw.text

    def recorded(self: ImageDraw.ImageDraw, place: Any, line: str, **options: Any) -> None:
        drawn.append(line)
        text(self, place, line, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ImageDraw.ImageDraw, "text", recorded)
        contact_sheet(d)
    return drawn


def drawn_subtitle(d: Decomposition) -> str:
    return drawn_text(d)[1]


@pytest.mark.slow
def test_the_title_has_the_fitted_lobe() -> None:
    d = ball()
    fit = fit_lobe(d.specular, d.normal, d.mask)
    assert fit.blender_roughness is not None
    assert drawn_subtitle(replace(d, brdf=fit)).endswith(f"roughness {fit.blender_roughness:.2f}")
    uncertain = replace(
        d.provenance,
        diagnostics=Diagnostics(warnings=(AssumptionWarning(WarningKind.MIRROR_OR_GLASS, 0.8),)),
    )
    assert "note: mirror or glass" in drawn_subtitle(replace(d, provenance=uncertain))
    assert "note" not in drawn_subtitle(d)
    assert drawn_subtitle(replace(d, brdf=replace(fit, outcome=LobeFitOutcome.NARROW))).endswith(
        f"roughness at most {fit.blender_roughness:.2f}"
    )
    assert drawn_subtitle(replace(d, brdf=replace(fit, alpha=None))).endswith("gloss undetermined")
    assert drawn_subtitle(replace(d, brdf=fit_lobe(0 * d.specular, d.normal, d.mask))).endswith(
        "no highlights"
    )


def test_the_title_says_that_clipping_hides_the_highlights() -> None:
    """As the command line does: a matt object and a clipped one are told apart."""
    d = ball()
    nothing = LobeFit.without_lobe("ggx", LobeFitOutcome.NO_SPECULAR, d.specular.shape)
    for status, said in (
        (LobeStatus.NO_HIGHLIGHTS, "no highlights"),
        (LobeStatus.HIDDEN, "highlights hidden by clipping"),
    ):
        lobe = LobeDiagnostics(status, LobeFitOutcome.NO_SPECULAR)
        provenance = replace(d.provenance, diagnostics=Diagnostics(lobe=lobe))
        assert drawn_subtitle(replace(d, brdf=nothing, provenance=provenance)).endswith(said)


def test_the_title_has_the_number_of_one_of_several_objects() -> None:
    d = ball()
    named = d.provenance.input | {"name": "shelf.png"}
    for numbered, title in ((named, "shelf.png"), (named | {"object": 2}, "shelf.png, object 2")):
        about = replace(d, provenance=replace(d.provenance, input=numbered))
        assert drawn_text(about)[0] == title
