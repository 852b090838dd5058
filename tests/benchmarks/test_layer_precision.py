"""What is taken off in place of the true specular layer."""

import numpy as np
import pytest

from benchmarks.decomposition.layer_precision import APPROXIMATIONS, mirrored
from isc_core.evaluation.evaluate import Estimate
from isc_core.shading.environment_map import environment_from_shading
from synth.glossy_mit.gloss import environment_gloss
from synth.glossy_mit.settings import GlossySettings
from tests.core.lit_balls import ball


def answer() -> tuple[Estimate, np.ndarray]:
    """A ball under a light from above, as it would be recovered, and its mask."""
    normal, mask = ball()
    light = np.zeros((9, 3))
    light[0], light[1] = -1.0, [0.8, 0.7, 0.6]
    still = np.zeros((*mask.shape, 3))
    return Estimate(
        np.zeros(mask.shape), np.where(mask[..., None], normal, (0, 0, 1)), still, still, light
    ), mask


@pytest.mark.slow
def test_mirrored_light_keeps_a_layer_of_environment_gloss() -> None:
    plain, mask = answer()
    layer = np.zeros((*mask.shape, 3))
    layer[mask] = environment_gloss(
        environment_from_shading(plain.light), plain.normal[mask], GlossySettings().exponent
    )
    facing = plain.normal[mask][:, 2] > 0.3  # a table of a disc is coarse at its edge
    np.testing.assert_allclose(
        mirrored(layer, mask, plain)[mask][facing], layer[mask][facing], rtol=0.05
    )


@pytest.mark.parametrize(
    ("name", "share"), [("80 %", 0.8), ("50 %", 0.5), ("mean", 1.0), ("mirrored light", 1.0)]
)
def test_the_stated_share_of_light_is_removed(name: str, share: float) -> None:
    plain, mask = answer()
    layer = np.where(mask[..., None], np.random.default_rng(0).random((*mask.shape, 3)), 0)
    approximate = APPROXIMATIONS[name](layer, mask, plain)
    assert approximate[mask].sum() == pytest.approx(share * layer.sum())


@pytest.mark.parametrize("name", ["blurred 2 %", "blurred 5 %"])
def test_blurring_keeps_a_uniform_layer(name: str) -> None:
    plain, mask = answer()
    even = np.where(mask[..., None], 0.3, 0) * np.ones(3)
    np.testing.assert_allclose(APPROXIMATIONS[name](even, mask, plain)[mask], 0.3, rtol=1e-5)
