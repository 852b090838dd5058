"""The ladder's parts on known shapes: a known light is found, and only what casts shadows blocks
light.
"""

import numpy as np
import pytest

pytest.importorskip("mitsuba", reason="needs the extra `synth`")

from benchmarks.refinement.light_ladder import Step, blocked, nearest, scores
from synth.refine.light_objective import shading_of
from synth.refine.transport import transport_of
from tests.synth.test_refine import dome

ROWS = 16
LIGHT = np.random.default_rng(3).uniform(0.1, 1, (2 * ROWS**2, 1)) * np.array([[1.0, 0.9, 0.8]])


@pytest.fixture(scope="module", params=[False, True])
def step(request: pytest.FixtureRequest) -> Step:
    """A dome, and a floor with a wall, under a known light."""
    d = dome(32, wall=request.param)
    transport = transport_of(d, ROWS)
    shading = shading_of(transport.shadowed, LIGHT, transport.indirect)
    return Step("wall" if request.param else "dome", shading, LIGHT, transport, 0.5 * shading)


@pytest.mark.slow
def test_the_nearest_environment_has_the_given_shading(step: Step) -> None:
    found = nearest(step.transport, step.shading)
    assert found.min() >= 0
    shading = shading_of(step.transport.shadowed, found, step.transport.indirect)
    np.testing.assert_allclose(shading, step.shading, rtol=0.01)


def test_only_a_wall_blocks_light(step: Step) -> None:
    if step.name == "dome":
        assert blocked(step) < 0.02
    else:
        assert blocked(step) > 0.1


def test_the_truth_has_no_error_and_a_turned_light_has(step: Step) -> None:
    mask = dome(32).mask
    picture = np.zeros((*mask.shape, 3))
    picture[mask] = step.shading
    new = np.array([np.argmax(step.transport.unshadowed.sum(axis=0))])
    under = step.transport.shadowed[:, new] * np.pi / step.transport.unshadowed[:, new].max()
    relit = np.zeros_like(picture)[None]
    relit[0][mask] = under
    truth = {
        "shading": picture,
        "reflectance": np.full_like(picture, 0.5),
        "environment": LIGHT.reshape(ROWS, 2 * ROWS, 3),
        "new": new,
        "new_shading": relit,
    }
    found = scores(step, mask, truth)
    assert np.all(found[:4] < 1e-5)
    assert found[4] > 60
    turned = LIGHT.reshape(ROWS, 2 * ROWS, 3)[:, ::-1].reshape(-1, 3)
    shading = shading_of(step.transport.shadowed, turned, step.transport.indirect)
    other = scores(Step("", shading, turned, step.transport, 0.5 * step.shading), mask, truth)
    assert np.all(other[:4] > found[:4])
    assert other[4] < found[4]
