"""Structural similarity against its definition and published figures; sparsification and ranks
against values by hand.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from isc_core.evaluation.image_metrics import (
    highlight_region,
    rank_correlation,
    sparsification,
    ssim,
    ssim_volume,
)
from isc_core.photo import read_linear
from isc_core.separation.published import shen_2013


def pair(shape: tuple[int, ...] = (23, 19, 3), seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    truth = rng.random(shape)
    return truth, np.clip(truth + 0.2 * rng.normal(size=shape), 0, 1)


# --- structural similarity ------------------------------------------------------------------------


def by_the_letter(
    truth: np.ndarray, estimate: np.ndarray, taps: list[np.ndarray], at: tuple[int, ...]
) -> float:
    """The similarity at one pixel: weights, means and biased covariances written out; beyond the
    border the border's value.
    """
    weight = taps[0]
    for axis in taps[1:]:
        weight = weight[..., None] * axis
    sides = zip(taps, at, truth.shape, strict=True)
    around = np.ix_(
        *(np.clip(np.arange(len(w)) - len(w) // 2 + place, 0, size - 1) for w, place, size in sides)
    )
    t, u = truth[around], estimate[around]
    mean_t, mean_u = (weight * t).sum(), (weight * u).sum()
    v_t, v_u = (weight * (t - mean_t) ** 2).sum(), (weight * (u - mean_u) ** 2).sum()
    v_tu = (weight * (t - mean_t) * (u - mean_u)).sum()
    return (
        (2 * mean_t * mean_u + 1e-4)
        * (2 * v_tu + 9e-4)
        / ((mean_t**2 + mean_u**2 + 1e-4) * (v_t + v_u + 9e-4))
    )


@pytest.mark.parametrize("volume", [False, True])
def test_similarity_by_the_letter(volume: bool) -> None:
    truth, estimate = pair((13, 12, 3))
    taps = np.exp(-(np.arange(-5, 6.0) ** 2) / (2 * 1.5**2))
    taps /= taps.sum()
    window = [taps, taps, taps if volume else np.ones(1)]
    expected = np.mean(
        [by_the_letter(truth, estimate, window, at) for at in np.ndindex(truth.shape)]
    )
    assert (ssim_volume if volume else ssim)(truth, estimate) == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize(("name", "printed"), [("animals", 0.979), ("cups", 0.964)])
def test_published_similarity(shared: Path, name: str, printed: float) -> None:
    """The input against the truth, and Shen & Zheng's answer, as measured with the toolbox."""
    anchors = json.loads((shared / "anchors" / "specular_removal.json").read_text())["shen"][name]
    image, truth = (
        read_linear(shared / "data" / "highlight" / file, "linear")
        for file in (f"{name}.bmp", f"{name}_gt.bmp")
    )
    assert ssim_volume(truth, image) == pytest.approx(printed, abs=5e-4)
    assert ssim_volume(truth, image) == pytest.approx(anchors["input_baseline"]["ssim"], abs=1e-7)
    assert 0.005 < ssim_volume(truth, image) - ssim(truth, image) < 0.04
    whole = np.ones(image.shape[:2], bool)
    published = shen_2013.VARIANTS["paper"]
    assert ssim_volume(truth, shen_2013.separate(image, whole, published).diffuse) == pytest.approx(
        anchors["Shen2013_fixed"]["ssim"], abs=5e-4
    )


def test_similarity_is_one_for_equals_and_less_for_others() -> None:
    truth, estimate = pair()
    for measure in (ssim, ssim_volume):
        assert measure(truth, truth) == pytest.approx(1, abs=1e-12)
        assert (
            measure(truth, estimate) == pytest.approx(measure(estimate, truth))
            and measure(truth, estimate) < 0.99
        )
        assert measure(255 * truth, 255 * estimate, peak=255) == pytest.approx(
            measure(truth, estimate)
        )


def test_similarity_counts_inside_the_mask() -> None:
    truth, estimate = pair((40, 40, 3))
    mask = np.zeros((40, 40), bool)
    mask[:10] = True
    estimate[:16] = truth[:16]
    for measure in (ssim, ssim_volume):
        assert measure(truth, estimate, mask) == pytest.approx(1, abs=1e-12)
        assert measure(truth, estimate) < 0.9


def test_similarity_refuses_images_of_other_shapes() -> None:
    truth, estimate = pair()
    with pytest.raises(ValueError, match="shapes"):
        ssim(truth, estimate[1:])
    with pytest.raises(ValueError, match="shapes"):
        ssim(truth[..., 0], estimate[..., 0])
    with pytest.raises(ValueError, match="empty"):
        ssim_volume(truth, estimate, np.zeros(truth.shape[:2], bool))


# --- highlights -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["animals", "cups"])
def test_highlights_are_those_of_the_published_figures(shared: Path, name: str) -> None:
    anchors = json.loads((shared / "anchors" / "specular_removal.json").read_text())["shen"][name][
        "input_baseline"
    ]
    image, truth = (
        read_linear(shared / "data" / "highlight" / file, "linear").astype(float)
        for file in (f"{name}.bmp", f"{name}_gt.bmp")
    )
    region = highlight_region(image - truth, np.ones(image.shape[:2], bool))
    assert region.mean() == pytest.approx(anchors["highlight_frac"], abs=1e-6)
    assert np.square(image - truth)[region].mean() == pytest.approx(
        anchors["mse_highlight"], rel=1e-5
    )


def test_no_specular_light_is_no_highlight() -> None:
    mask = np.ones((6, 7), bool)
    assert not highlight_region(np.zeros((6, 7, 3)), mask).any()
    spot = np.zeros((6, 7, 3))
    spot[2, 3] = 1
    assert np.argwhere(highlight_region(spot, mask)).tolist() == [[2, 3]]
    mask[2, 3] = False
    assert not highlight_region(spot, mask).any()
    with pytest.raises(ValueError, match="empty"):
        highlight_region(spot, np.zeros((6, 7), bool))


# --- confidence -----------------------------------------------------------------------------------


def test_sparsification_by_hand() -> None:
    curve = sparsification(np.array([6.0, 3.0, 1.0, 0.0]), np.array([0.1, 0.2, 0.7, 0.9]))
    assert curve.dropped == pytest.approx([0, 0.25, 0.5, 0.75, 1])
    assert curve.left == pytest.approx([1, 0.4, 0.1, 0, 0])
    assert curve.area == pytest.approx(0.25 * (0.7 + 0.25 + 0.05))
    assert curve.removed(0.25) == pytest.approx(0.6) and curve.removed(0.125) == pytest.approx(0.3)
    backwards = sparsification(np.array([6.0, 3.0, 1.0, 0.0]), np.array([0.9, 0.7, 0.2, 0.1]))
    assert backwards.area > 0.5 and backwards.removed(0.25) == 0


def test_equal_confidence_leaves_in_no_order() -> None:
    rng = np.random.default_rng(1)
    error = rng.random(500)
    assert sparsification(error, np.full(500, 0.3)).area == pytest.approx(0.5)
    assert sparsification(np.zeros(5), np.arange(5.0)).area == pytest.approx(0.5)
    confidence = np.round(1 - error, 1)
    shuffled = rng.permutation(500)
    a, b = sparsification(error, confidence), sparsification(error[shuffled], confidence[shuffled])
    assert np.allclose(a.left, b.left) and a.area < 0.4
    assert a.left[-1] == pytest.approx(0) and (np.diff(a.left) <= 0).all()


def test_ranks_like_everybody_elses() -> None:
    rng = np.random.default_rng(2)
    a = rng.integers(0, 9, 300).astype(float)
    b = np.exp(-a) + 0.3 * rng.random(300)
    assert rank_correlation(a, b) == pytest.approx(stats.spearmanr(a, b).statistic, abs=1e-12)
    assert rank_correlation(a, a**3) == pytest.approx(1) and rank_correlation(
        a, -a
    ) == pytest.approx(-1)
    assert rank_correlation(a, np.ones(300)) == 0


@pytest.mark.parametrize("measure", [sparsification, rank_correlation])
def test_rows_must_fit(measure: object) -> None:
    for a, b in (
        (np.ones(3), np.ones(4)),
        (np.ones(0), np.ones(0)),
        (np.ones((2, 2)), np.ones((2, 2))),
    ):
        with pytest.raises(ValueError, match="vectors"):
            measure(a, b)  # type: ignore[operator]
