"""The stage "gloss": correct where the roughness is determined, undetermined otherwise."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mitsuba", reason="needs the extra `synth`")

from isc_core.progress import Monitor
from synth.capture.truth import GroundTruth, render_truth
from synth.rendering import RenderOptions
from synth.scene import Scene
from synth.scene.camera import Camera
from synth.scene.lights import DirectionalLight, EnvironmentLight, Light
from synth.scene.materials import Material
from synth.validation.stages.lobe import (
    LOBE,
    LobeScores,
    lobe_maps,
    run_lobe,
    score_lobe,
    show_lobe,
)
from synth.validation.stages.types import StageOptions, stage_inputs
from tests.synth.small_scenes import ball

SUN = DirectionalLight(np.array([-0.3, 0.4, np.sqrt(0.75)]), np.full(3, 2.0))
SKY = EnvironmentLight(
    np.broadcast_to(np.linspace(1.2, 0.4, 16)[:, None, None], (16, 32, 3)).copy()
)
RED = np.broadcast_to(np.array([0.5, 0.1, 0.1]), (2, 2, 3))


def rendered(material: Material, light: Light) -> GroundTruth:
    return render_truth(
        Scene(ball(), material, (light,), Camera(96, 96, 42)), RenderOptions(samples=64)
    )


def scores(truth: GroundTruth) -> LobeScores:
    return score_lobe(truth, run_lobe(stage_inputs(truth, LOBE.needs), StageOptions(), Monitor()))


@pytest.mark.slow
@pytest.mark.parametrize(
    "material",
    [Material(RED, "ggx", 0.2, 1.0), Material(RED, "blinn_phong", 50.0, 0.1)],
    ids=["ggx", "blinn_phong"],
)
def test_the_roughness_of_a_ball_in_the_sun_is_found(material: Material) -> None:
    found = scores(rendered(material, SUN))
    assert found.determined == 1 and found.alpha_factor is not None and found.explained is not None
    # A Blinn-Phong lobe is no GGX lobe: its alpha by the usual rule is not the nearest one.
    assert 1 <= found.alpha_factor < (1.1 if material.model == "ggx" else 1.6)
    assert found.explained > 0.8


@pytest.mark.slow
def test_nothing_is_determined_on_a_diffuse_ball_or_under_a_smooth_environment() -> None:
    assert scores(rendered(Material(RED, "lambert"), SUN)) == LobeScores(invented=0.0)
    assert scores(rendered(Material(RED, "ggx", 0.2, 1.0), SKY)) == LobeScores(determined=0.0)


@pytest.mark.slow
def test_what_it_shows_and_keeps() -> None:
    truth = rendered(Material(RED, "ggx", 0.2, 1.0), SUN)
    answer = run_lobe(stage_inputs(truth, LOBE.needs), StageOptions(), Monitor())
    assert [picture.caption for picture in show_lobe(truth, answer)] == [
        "photo",
        "specular, true",
        "specular, fitted",
    ]
    np.testing.assert_allclose(lobe_maps(answer)["specular.R"], truth.specular[..., 0], atol=1e-6)
    with pytest.raises(ValueError, match="known shape"):
        run_lobe(replace(stage_inputs(truth, LOBE.needs), height=None), StageOptions(), Monitor())
