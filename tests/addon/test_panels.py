"""What the panels show: settings without an effect are greyed out and say why, sliders are live."""

from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the extra `blender`")

from blender_addon import panels  # noqa: E402 (after the skip)
from blender_addon.files.image_source import ImageSource  # noqa: E402
from blender_addon.materials.dichromatic import HIGHLIGHTS  # noqa: E402
from blender_addon.materials.edit_nodes import dichromatic_node  # noqa: E402
from blender_addon.runs import request, run_steps  # noqa: E402
from blender_addon.runs.worker_run import WorkerFailed  # noqa: E402
from blender_addon.scene.built_object import BuiltObject, find_built  # noqa: E402
from blender_addon.settings import usage  # noqa: E402
from blender_addon.worker.commands import DecomposeJob, WorkerEnvironment  # noqa: E402
from isc_core.decomposition.settings import (  # noqa: E402
    LIGHT_COLOURS,
    SEPARATING_MODELS,
    SIRFS_MODELS,
    Settings,
)
from isc_core.separation import BEST  # noqa: E402


@dataclass
class Layout:
    """Takes the place of a panel's layout, and keeps what is drawn in it."""

    parent: "Layout | None" = None
    enabled: bool = True
    drawn: dict[str, tuple[Any, "Layout"]] = field(default_factory=dict)
    labels: list[str] = field(default_factory=list)

    def column(self, **_: Any) -> "Layout":
        return Layout(self, True, self.drawn, self.labels)

    row = column

    def prop(self, owner: Any, name: str, text: str | None = None, **_: Any) -> None:
        self.drawn[text or name] = owner, self

    def operator(self, name: str, text: str = "", **_: Any) -> Any:
        self.drawn[text or name] = name, self
        return SimpleNamespace()

    def label(self, text: str = "", **_: Any) -> None:
        self.labels.append(text)

    def separator(self) -> None:
        """Nothing to keep."""

    def greyed(self) -> set[str]:
        """Names of what is drawn in a part that is not enabled."""
        return {name for name, (_, part) in self.drawn.items() if not part.is_live()}

    def is_live(self) -> bool:
        return self.enabled and (self.parent is None or self.parent.is_live())


class Panel(panels._Output, panels._Method, panels._Highlights, panels._Edit):
    """All that are tested, without Blender's own part."""


def drawn(panel: Any) -> Layout:
    shown = Panel()
    shown.layout = Layout()
    panel.draw(shown, bpy.context)
    layout: Layout = shown.layout
    return layout


def test_the_models_of_the_panels_are_those_of_the_core() -> None:
    assert set(usage.SIRFS_MODELS) == set(SIRFS_MODELS)
    assert set(usage.SEPARATING_MODELS) == set(SEPARATING_MODELS)


@pytest.mark.parametrize(
    ("panel", "values", "greyed", "reasons"),
    [
        (panels._Output, {}, set(), []),
        (
            panels._Output,
            {"displacement": True},
            {"back", "triangles"},
            ["Not used with Displacement"],
        ),
        (panels._Method, {}, {"samples"}, ["Used with New Scene only"]),
        (panels._Method, {"own_scene": True}, set(), []),
        (
            panels._Method,
            {"own_scene": True, "model": "naive", "light_color": "custom"},
            {"separator", "illumination", "light_color"},
            ["Naive keeps highlights", "Naive recovers no light"],
        ),
        (panels._Highlights, {}, set(), []),
        (
            panels._Highlights,
            {"each": True},
            {"isc.mark_highlight", "Mark as Print", "highlights", "not_highlights"},
            ["Not used with Each Object"],
        ),
        (
            panels._Highlights,
            {"model": "sirfs"},
            {
                *("highlight_odds", "isc.mark_highlight", "Mark as Print"),
                *("highlights", "not_highlights", "refine"),
            },
            ["Requires the Joint model", "Requires the Joint model", "SIRFS keeps highlights"],
        ),
    ],
)
def test_settings_without_an_effect_are_greyed_out_and_say_why(
    addon: Any, panel: Any, values: dict[str, Any], greyed: set[str], reasons: list[str]
) -> None:
    for name, value in values.items():
        setattr(addon.context.scene.isc, name, value)
    layout = drawn(panel)
    labels = [text for text in layout.labels if text != "Remove Highlights"]
    assert (layout.greyed(), labels) == (greyed, reasons)
    assert all(len(reason) <= panels._LINE_LENGTH for reason in reasons)
    assert "custom_light_color" not in layout.drawn


@pytest.fixture
def built(addon: Any, bump_folder: Path) -> BuiltObject:
    addon.ops.isc.import_result(directory=str(bump_folder))
    found = find_built(addon.context.object)
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("level", "shows", "greyed", "reason"),
    [
        (1.0, False, set(), []),
        (
            0.0,
            False,
            {"Roughness", "Gloss Gain", "Specular Gain"},
            ["No gloss at specular level 0"],
        ),
        (
            1.0,
            True,
            {"Specular Level", "Roughness", "Gloss Gain"},
            ["Showing the photo's highlights"],
        ),
    ],
)
def test_sliders_of_gloss_are_live_where_they_show_something(
    addon: Any, built: BuiltObject, level: float, shows: bool, greyed: set[str], reason: list[str]
) -> None:
    node = dichromatic_node(built.material)
    assert node is not None
    node.inputs["Specular Level"].default_value = level
    if shows:
        addon.ops.isc.photo_highlights(show=True)
    layout = drawn(panels._Edit)
    assert layout.greyed() == {*greyed, "Remove Sun"}, "there is no sun"
    assert [text for text in layout.labels if text not in ("Diffuse", "Specular", "Light")] == (
        reason
    )
    socket, _ = layout.drawn["Specular Gain"]
    assert socket == node.inputs["Specular Gain"], "a slider, not a button"


def test_a_sun_can_be_removed_where_one_shines(addon: Any, built: BuiltObject) -> None:
    addon.ops.isc.relight(light="OPTIMAL")
    assert "Remove Sun" not in drawn(panels._Edit).greyed()
    addon.ops.isc.relight(light="RECOVERED")
    assert "Remove Sun" in drawn(panels._Edit).greyed()


def test_the_slider_of_the_gain_moves_the_photos_highlights_too(
    addon: Any, built: BuiltObject
) -> None:
    addon.ops.isc.photo_highlights(show=True)
    node = dichromatic_node(built.material)
    assert node is not None
    node.inputs["Specular Gain"].default_value = 0.25
    addon.context.view_layer.update()
    layer = built.material.node_tree.nodes[HIGHLIGHTS]
    assert layer.inputs["Specular Gain"].default_value == 0.25


@pytest.mark.parametrize("model", ["joint", "naive"])
def test_light_color_and_separator_reach_the_worker(
    addon: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, model: str
) -> None:
    """As `isc decompose` takes it; models without a light would refuse it, and those that separate
    no highlights another separator.
    """
    settings = addon.context.scene.isc
    settings.image, settings.model = addon.data.images.new("cup", 8, 8), model
    settings.separator = "shen_2013"
    choices = {item.identifier for item in settings.bl_rna.properties["light_color"].enum_items}
    assert choices == {*LIGHT_COLOURS, "custom"}
    jobs: list[DecomposeJob] = []

    def start(job: DecomposeJob, environment: Any) -> Any:
        jobs.append(job)
        raise WorkerFailed("seen")

    monkeypatch.setattr(run_steps, "start_decompose", start)
    (tmp_path / "cup.png").write_text("never read")
    photo = ImageSource("cup", path=tmp_path / "cup.png")
    for choice in ("estimate", "custom"):
        settings.light_color, settings.custom_light_color = choice, (1, 0.5, 0.25)
        method = request.request_from_settings(addon.context.scene).method
        steps = run_steps.decompose_steps(
            photo,
            None,
            None,
            method,
            run_steps.ResultDestination(tmp_path),
            0,
            WorkerEnvironment(Path("python"), (tmp_path,), tmp_path),
        )
        with pytest.raises(WorkerFailed, match="seen"):
            list(steps)
    separator = "shen_2013" if model in SEPARATING_MODELS else BEST
    assert [job.separator for job in jobs] == [separator] * 2
    for job in jobs:
        Settings(model, job.separator, light_colour=job.light_colour).check()
    sent = [job.light_colour for job in jobs]
    if model == "naive":
        assert sent == ["balanced", "balanced"]
        return
    assert sent[0] == "estimate"
    given = Settings(model=model, light_colour=sent[1]).given_light_colour
    np.testing.assert_allclose(given, np.array([4, 2, 1]) * 3 / 7, rtol=1e-3)
