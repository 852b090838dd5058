"""A lower bound of the highlights that the scene network expects, and whether there are any."""

from dataclasses import replace

import numpy as np

from isc_core.networks.scene_network import predict_scene
from isc_core.separation.support.ratio_bound import highlights_stand_out, ratio_lower_bound


def test_more_deviations_remove_less() -> None:
    line = np.linspace(-1.1, 1.1, 96)
    x, y = np.meshgrid(line, -line)
    mask = x**2 + y**2 < 1
    shading = 0.2 + 0.6 * np.clip(
        0.5 * x + 0.5 * y + 0.7 * np.sqrt(np.clip(1 - x**2 - y**2, 0, 1)), 0, 1
    )
    spot = 0.5 * np.exp(-((x - 0.3) ** 2 + (y - 0.3) ** 2) / 0.02)
    image = ((0.5 * shading + spot)[..., None] * mask[..., None] * np.ones(3)).astype(np.float32)
    seen = predict_scene(image, mask)
    ratios = [ratio_lower_bound(seen, deviations) for deviations in (0, 1, 3)]
    np.testing.assert_array_equal(ratios[0], seen.log_ratio)
    assert ratios[0].sum() > ratios[1].sum() > ratios[2].sum()
    certain = replace(seen, ratio_scale=np.zeros_like(seen.ratio_scale))
    np.testing.assert_array_equal(ratio_lower_bound(certain, 3), seen.log_ratio)


def test_specks_and_even_layers_do_not_stand_out() -> None:
    mask, limit = np.ones((60, 60), bool), 0.3
    flat = np.full((60, 60, 3), 0.8)
    assert not highlights_stand_out(flat, mask, limit)
    speck, spot = np.zeros_like(flat), np.zeros_like(flat)
    speck[30, 30], spot[28:34, 28:34] = 1, 1
    assert not highlights_stand_out(speck, mask, limit)
    assert highlights_stand_out(spot, mask, limit)
    assert not highlights_stand_out(0.2 * spot, mask, limit)
