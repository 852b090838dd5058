"""The stage "refine": ratios of errors, defined where there is something to fit."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mitsuba", reason="needs the extra `synth`")

from isc_core.progress import Monitor
from isc_core.refinement import GlossRefinement
from isc_core.refinement.gloss_note import GlossOutcome
from synth.capture.truth import render_truth
from synth.rendering import RenderOptions
from synth.scene import Scene
from synth.scene.camera import Camera
from synth.scene.lights import DirectionalLight
from synth.scene.materials import Material
from synth.validation.stages.refinement import (
    REFINEMENT,
    Refined,
    refinement_maps,
    run_refinement,
    score_refinement,
    show_refinement,
)
from synth.validation.stages.registry import all_stages, find_stages
from synth.validation.stages.types import StageOptions, stage_inputs
from tests.synth.small_scenes import ball

SUN = DirectionalLight(np.array([-0.3, 0.4, np.sqrt(0.75)]), np.full(3, 2.0))
RED = np.broadcast_to(np.array([0.5, 0.1, 0.1]), (2, 2, 3))


def test_the_stage_is_run_by_name_only() -> None:
    assert REFINEMENT not in all_stages()
    assert find_stages(("refine",)) == (REFINEMENT,)


@pytest.mark.slow
def test_scores_compare_the_lobe_with_that_of_the_start() -> None:
    material = Material(RED, "ggx", 0.2, 1.0)
    truth = render_truth(
        Scene(ball(), material, (SUN,), Camera(96, 96, 42)), RenderOptions(samples=64)
    )
    answer = run_refinement(stage_inputs(truth, REFINEMENT.needs), StageOptions(), Monitor())
    found = score_refinement(truth, answer)
    if not answer.done.kept:
        assert {found.photo, found.gloss, found.normal, found.reflectance} <= {1.0, None}
    start = answer.start
    assert start.brdf is not None
    # A lobe that is the truth itself has no error left; nothing to fit leaves nothing to compare.
    lobe = replace(start.brdf, predicted=truth.specular)
    better = replace(start, brdf=lobe)
    perfect = score_refinement(
        truth, Refined(start, GlossRefinement(better, GlossOutcome.REFINED, 1))
    )
    assert perfect.kept == 1 and perfect.gloss is not None and perfect.gloss < 1e-3
    assert perfect.normal == 1 and perfect.reflectance == 1
    nothing = score_refinement(
        truth, Refined(start, GlossRefinement(start, GlossOutcome.NO_HIGHLIGHT))
    )
    assert nothing.photo is None and nothing.kept is None
    assert len(show_refinement(truth, answer)) == 3
    assert set(refinement_maps(answer)) >= {"specular.R", "start.G", "refined.B"}
