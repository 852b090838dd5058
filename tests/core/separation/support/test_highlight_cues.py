"""The cues that distinguish light from paint, on synthetic examples of both."""

import numpy as np
import pytest
from scipy import ndimage

from isc_core.separation.support.highlight_cues import (
    Steps,
    far_from_borders,
    noise_level,
    ramp,
    reflectance_mixing,
    roughness,
    steps_of,
)


def blob(height: int = 90, width: int = 110, radius: float = 0.35) -> np.ndarray:
    y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    return np.exp(-(x**2 + y**2) / radius**2)


WHOLE = np.ones((90, 110), bool)


# --- ramp -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("ends", [(0.2, 0.6), (0.6, 0.2), (-1.0, 3.0)])
def test_ramps_rise_from_the_first_end_to_the_second(ends: tuple[float, float]) -> None:
    along = ramp(np.linspace(ends[0], ends[1], 101), ends)
    assert (
        along[0] == 0
        and along[-1] == 1
        and along[50] == pytest.approx(0.5)
        and (np.diff(along) > 0).all()
    )
    beyond = 10 * (ends[1] - ends[0])
    assert ramp(ends[0] - beyond, ends) == 0 and ramp(ends[1] + beyond, ends) == 1
    assert along[1] < 0.001 and along[-2] > 0.999, "flat at both ends"


# --- noise ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("deviation", [0.001, 0.02])
def test_noise_is_measured_through_smooth_shading(deviation: float) -> None:
    noise = deviation * np.random.default_rng(0).standard_normal((90, 110, 3))
    image = 0.3 + 0.5 * blob(radius=0.8)[..., None] + noise
    assert noise_level(image, WHOLE) == pytest.approx(deviation, rel=0.05)
    assert noise_level(8 * image, WHOLE) == pytest.approx(8 * noise_level(image, WHOLE))


def test_slopes_and_a_few_edges_are_no_noise() -> None:
    rows, columns = np.indices((90, 110))
    plane = np.repeat((0.01 * rows - 0.02 * columns)[..., None], 3, axis=2)
    assert noise_level(plane, WHOLE) < 1e-12
    assert noise_level(plane + (columns > 50)[..., None], WHOLE) < 1e-12


def test_noise_outside_does_not_count() -> None:
    mask = np.zeros((90, 110), bool)
    mask[20:60, 20:70] = True
    noise = np.random.default_rng(0).standard_normal((90, 110, 3))
    image = np.where(ndimage.binary_dilation(mask)[..., None], 0.1 * noise, noise)
    assert noise_level(image, mask) == pytest.approx(0.1, rel=0.06)


# --- borders --------------------------------------------------------------------------------------


def test_steps_are_counted_in_units_of_a_border() -> None:
    one, shares = np.zeros((6, 8)), np.zeros((6, 8, 3))
    one[:, 5:] = 0.3
    shares[2:] = [0.2, -0.1, 0.1]
    steps = steps_of([(one, 0.1), (shares, 0.2)], np.ones((6, 8), bool), 0.5)
    across, down = np.zeros((6, 8)), np.zeros((6, 8))
    across[:, 5], down[2] = 3 - 0.5, 2 - 0.5
    assert np.allclose(steps.across, across, atol=1e-6) and np.allclose(steps.down, down, atol=1e-6)


def test_steps_into_the_mask_are_none() -> None:
    mask = np.zeros((6, 8), bool)
    mask[1:5, 2:6] = True
    steps = steps_of([(np.where(mask, 1.0, 9.0), 1.0)], mask, 0)
    assert not steps.across.any() and not steps.down.any()


def test_where_noise_is_large_steps_count_less() -> None:
    layer = np.zeros((6, 8))
    layer[:, 4:] = 1
    floor = np.where(np.arange(6)[:, None] < 3, 0.0, 5.0) * np.ones((6, 8))
    across = steps_of([(layer, 1.0)], np.ones((6, 8), bool), floor).across
    assert (across[:3, 4] == 1).all() and not across[3:].any()


def test_both_pixels_of_a_pair_know_of_their_step() -> None:
    across, down = np.zeros((5, 5)), np.zeros((5, 5))
    across[2, 3], down[3, 2] = 2.0, 1.0
    around = Steps(across, down).around()
    expected = np.zeros((5, 5))
    expected[2, 2], expected[2, 3], expected[3, 2] = 2 + 1, 2, 1
    assert np.array_equal(around, expected)


def test_trust_is_low_beside_a_step_of_chroma_only() -> None:
    chroma = np.full((90, 110), 0.5)
    chroma[:, 55:] = 0.2
    mask = blob() > 0.05
    trust = far_from_borders(steps_of([(np.log(chroma), 0.5)], mask, 0), mask, blur=1.5, unit=0.6)
    assert trust[45, 53:57].max() < 0.9 and trust[45, 54:56].max() < 0.7
    assert (
        trust[45, :45][mask[45, :45]].min() > 0.999 and trust[45, 66:][mask[45, 66:]].min() > 0.999
    )
    assert not trust[~mask].any() and trust.min() >= 0 and trust.max() <= 1
    light = far_from_borders(
        steps_of([(np.log(0.5 + 0 * chroma), 0.5)], mask, 0), mask, blur=1.5, unit=0.6
    )
    assert np.array_equal(light, mask)


def test_a_higher_step_is_trusted_less() -> None:
    def beside(step: float) -> float:
        layer = np.zeros((30, 40))
        layer[:, 20:] = step
        return float(
            far_from_borders(
                steps_of([(layer, 1.0)], np.ones((30, 40), bool), 0),
                np.ones((30, 40), bool),
                1.5,
                0.2,
            )[15, 20]
        )

    trusts = [beside(step) for step in (0.0, 0.2, 0.5, 1.0, 3.0)]
    assert (
        trusts[0] == 1 and (np.diff(trusts[:4]) < 0).all() and trusts[4] == pytest.approx(trusts[3])
    )
    assert trusts[3] < 0.3


# --- roughness ------------------------------------------------------------------------------------


def test_roughness_orders_light_texture_and_noise() -> None:
    rng = np.random.default_rng(1)
    trust = np.ones((90, 110), np.float32)
    highlight, noise = 0.5 * blob(radius=0.15), rng.random((90, 110))
    dots = ndimage.gaussian_filter((rng.random((90, 110)) > 0.97).astype(float), 0.8)
    examples = (highlight, highlight + 0.05 * dots, highlight + 0.2 * dots, dots, noise)
    rough = [roughness(example, trust, WHOLE, 4.0, 1.5)[0] for example in examples]
    assert rough == sorted(rough) and rough[0] < 0.2 and rough[-1] > 0.8
    assert roughness(0 * highlight, trust, WHOLE, 4.0, 1.5)[0] == 0


def test_roughness_is_known_in_each_place() -> None:
    noise = 0.2 * np.random.default_rng(2).random((90, 110))
    layer = np.where(np.arange(110) < 55, 0.5 * np.roll(blob(radius=0.15), -27, axis=1), noise)
    over_all, here = roughness(layer, np.ones((90, 110), np.float32), WHOLE, 4.0, 1.5)
    assert here.shape == layer.shape and np.isfinite(here).all() and here.min() >= 0
    assert (
        here[35:55, 18:38].max() < 0.4
        and here[:, 75:].min() > 0.7
        and here[45, 28] < over_all < here[45, 80]
    )


def test_roughness_of_a_share_is_the_same_and_borders_do_not_count() -> None:
    layer = 0.5 * blob(radius=0.15)
    trust = np.ones((90, 110), np.float32)
    trust[:, 80:] = 0
    printed = layer.copy()
    printed[:, 84:] += np.random.default_rng(3).random((90, 26))
    plain, bordered = (
        roughness(example, trust, WHOLE, 4.0, 1.5)[0] for example in (layer, printed)
    )
    assert bordered == pytest.approx(plain, abs=0.02)
    assert roughness(3 * layer, trust, WHOLE, 4.0, 1.5)[0] == pytest.approx(plain, rel=1e-4)
    mask = np.arange(110) < 82
    assert roughness(printed, trust, WHOLE & mask, 4.0, 1.5)[0] == pytest.approx(plain, abs=0.02)


# --- paint mixing ---------------------------------------------------------------------------------

PAINT = np.array([0.6, 0.3, 0.15])
RATIO = PAINT.min() / np.ptp(PAINT)


def mixing_of(image: np.ndarray, scale: float = 4.0) -> np.ndarray:
    """Paint mixing (H, W) of an image (H, W, 3) of the one paint and white."""
    chroma = np.ptp(image, axis=2)
    return reflectance_mixing(
        image.min(axis=2) - RATIO * chroma, chroma, np.full(chroma.shape, RATIO), WHOLE, scale
    )


def test_white_paint_is_mixed_and_light_is_not() -> None:
    share = 0.8 * blob()[..., None]
    slope = (share[..., 0] > 0.05) & (share[..., 0] < 0.7)
    slope[:12], slope[-12:], slope[:, :12], slope[:, -12:] = False, False, False, False
    paint = mixing_of((1 - share) * PAINT + share * PAINT.max())
    light = mixing_of(PAINT + 0.5 * share)
    assert slope.sum() > 1000
    assert paint[slope] == pytest.approx(1, abs=0.01) and np.abs(light[slope]).max() < 0.01


def test_half_paint_half_light_lies_between() -> None:
    share = 0.4 * blob()[..., None]
    both = mixing_of((1 - share) * PAINT + share * PAINT.max() + share)
    centre = both[30:60, 30:80]
    assert 0.2 < np.median(centre) < 0.8


def test_where_chroma_rises_with_the_light_no_paint_is_mixed_in() -> None:
    """Shading brightens the paint under a highlight: the mixing is negative."""
    light = blob()[..., None]
    assert np.median(mixing_of((1 + light) * PAINT + 0.5 * light)[30:60, 30:80]) < -0.3


@pytest.mark.parametrize("shape", [(1, 1), (1, 20), (20, 1), (2, 2), (4, 4)])
def test_mixing_of_specks_is_none(shape: tuple[int, int]) -> None:
    layer = np.random.default_rng(4).random(shape)
    assert not reflectance_mixing(layer, 1 - layer, layer, np.ones(shape, bool), 2.5).any()
