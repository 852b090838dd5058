"""Filter statistics as a prior: the filters' responses, the table, and its use in the separator."""

import numpy as np
import pytest
from scipy import ndimage

from benchmarks.separation.filter_statistics import (
    AblationRow,
    Sample,
    calibrated,
    figure,
    fitted,
    markdown,
    scenes,
)
from isc_core.errors import InputError
from isc_core.separation import separate
from isc_core.separation.support.filter_statistics import (
    BINS,
    FILTERS,
    FilterTable,
    bins,
    filter_outputs,
    highlight_prior,
    read_table,
    shipped_table,
)

DISC = np.hypot(*(np.mgrid[:90, :90] - 44.5)) < 42


def photo(seed: int, glossy: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Intensity, specular light and mask: a shaded disc with soft albedo; if glossy, with sharp
    highlights.
    """
    random = np.random.default_rng(seed)
    y, x = (np.mgrid[:90, :90] - 44.5) / 45
    albedo = 0.5 + 0.8 * ndimage.gaussian_filter(random.standard_normal(DISC.shape), 6)
    diffuse = np.maximum(albedo, 0.05) * (1 - 0.5 * (x**2 + y**2))
    specular = np.zeros_like(diffuse)
    for row, column in random.uniform(25, 65, (5, 2)) if glossy else ():
        specular += 0.9 * np.exp(
            -np.square(np.hypot(*(np.mgrid[:90, :90].T - (row, column)).T) / 4)
        )
    return diffuse + specular, specular, DISC


def samples(seeds: range) -> list[Sample]:
    found = []
    for seed in seeds:
        intensity, specular, mask = photo(seed, seed % 3 > 0)
        high, none = mask & (specular > 0.25 * intensity), mask & (specular < 0.05 * intensity)
        outputs = filter_outputs(intensity, mask)
        found.append(
            Sample(
                f"subject{seed}",
                intensity,
                mask,
                high,
                none,
                outputs[high[mask]],
                outputs[none[mask]],
            )
        )
    return found


@pytest.fixture(scope="module")
def table() -> FilterTable:
    return calibrated(samples(range(15)))[0]


def coloured(intensity: np.ndarray) -> np.ndarray:
    return np.repeat(intensity[..., None], 3, axis=2)


def test_flat_light_gives_no_output_and_ramps_only_slope():
    flat = filter_outputs(np.full(DISC.shape, 0.7), DISC)
    assert np.nanmax(np.abs(flat)) < 1e-9
    growth = np.exp(0.02 * np.mgrid[:90, :90][1])
    ramp = (
        growth - 0.05 / 1.05 * growth[DISC].mean()
    )  # whose logarithm, with its dark floor, is linear
    middle = (np.hypot(*(np.mgrid[:90, :90] - 44.5)) < 12)[DISC]
    outputs = filter_outputs(ramp, DISC)[middle]
    for number, (kind, width) in enumerate(FILTERS):
        if kind == "slope":
            sigma = max(width * np.hypot(84, 84), 0.5)
            np.testing.assert_allclose(
                outputs[:, number], [[0, 0.02 * sigma]] * middle.sum(), atol=2e-4
            )
        else:
            assert np.nanmax(np.abs(outputs[:, number])) < 2e-3


def test_nothing_outside_the_mask_counts():
    intensity, _, mask = photo(4, True)
    image = coloured(intensity)
    around = np.where(mask[..., None], image, 50.0)
    np.testing.assert_array_equal(highlight_prior(around, mask), highlight_prior(image, mask))
    assert (highlight_prior(image, mask)[~mask] == 0.5).all()


@pytest.mark.slow
def test_exposure_turns_and_mirrors_change_nothing(table):
    intensity, _, mask = photo(4, True)
    image = coloured(intensity)
    prior = highlight_prior(image, mask, table)
    np.testing.assert_allclose(highlight_prior(1000 * image, mask, table), prior, atol=1e-3)
    np.testing.assert_allclose(
        highlight_prior(np.rot90(image), np.rot90(mask), table), np.rot90(prior), atol=1e-3
    )
    np.testing.assert_allclose(
        highlight_prior(image[:, ::-1], mask[:, ::-1], table), prior[:, ::-1], atol=1e-3
    )


@pytest.mark.slow
def test_the_fitted_prior_knows_highlights_it_has_not_seen(table):
    yes, no = [], []
    for seed in range(100, 106):
        intensity, specular, mask = photo(seed, True)
        prior = highlight_prior(coloured(intensity), mask, table)
        assert prior.min() >= 0.0199 and prior.max() <= 0.9801 and prior.dtype == np.float32
        yes.append(prior[mask & (specular > 0.25 * intensity)])
        no.append(prior[mask & (specular < 0.05 * intensity)])
    assert np.concatenate(yes).mean() > 0.7
    assert np.concatenate(no).mean() < 0.4


@pytest.mark.slow
def test_where_both_kinds_look_alike_the_temperature_says_nothing():
    made = samples(range(10))
    random = np.random.default_rng(1)
    blind = []
    for one in made:
        heads = random.random(one.mask.shape) < 0.5
        outputs = filter_outputs(one.intensity, one.mask)
        high, none = one.mask & heads, one.mask & ~heads
        blind.append(
            Sample(
                one.subject,
                one.intensity,
                one.mask,
                high,
                none,
                outputs[high[one.mask]],
                outputs[none[one.mask]],
            )
        )
    _, bits, hits = calibrated(blind)
    assert abs(bits) < 0.01 and abs(hits - 0.5) < 0.03
    assert calibrated(made)[1] > 0.3


def test_histograms_are_probabilities_and_symmetric_where_the_filter_is_odd(table):
    for histograms in (table.without, table.highlight):
        assert histograms.shape == (len(FILTERS), BINS) and histograms.min() > 0
        np.testing.assert_allclose(histograms.sum(axis=1), 1)
        for number, (kind, _) in enumerate(FILTERS):
            if kind == "slope":
                np.testing.assert_allclose(histograms[number], histograms[number][::-1])
    assert bins(np.array([-1e9, 0, 1e9]), 0.1).tolist() == [0, BINS // 2, BINS - 1]
    assert fitted(samples(range(3))).temperature == 1


def test_large_photos_are_judged_on_blocks(table):
    intensity, _, mask = photo(4, True)
    small = highlight_prior(coloured(intensity), mask, table)
    large = highlight_prior(
        coloured(np.kron(intensity, np.ones((4, 4)))), np.kron(mask, np.ones((4, 4))) > 0, table
    )
    assert large.shape == (360, 360)
    inner = ndimage.binary_erosion(mask, iterations=6)
    assert np.corrcoef(large[2::4, 2::4][inner], small[inner])[0, 1] > 0.8


def test_the_separator_takes_it_as_one_more_voice():
    y, x = (np.mgrid[:90, :90] - 44.5) / 45
    shading = 1 - 0.5 * (x**2 + y**2)
    highlight = 0.15 * np.exp(-np.square(np.hypot(x - 0.1, y + 0.1) / 0.15))
    image = (np.array([0.7, 0.2, 0.1]) * shading[..., None] + highlight[..., None]).astype(
        np.float32
    )
    image *= 1 + 0.05 * np.random.default_rng(0).standard_normal(image.shape).astype(
        np.float32
    ).clip(-3, 3)
    found = separate("isc", image, DISC, changes={"filters": True}).specular
    same = separate("isc", image, DISC, prior=highlight_prior(image, DISC)).specular
    np.testing.assert_allclose(found, same, atol=1e-5)
    assert np.abs(found - separate("isc", image, DISC).specular).max() > 1e-3
    never = np.where(x < 0, 0, 0.5)
    assert (
        separate("isc", image, DISC, changes={"filters": True}, prior=never).specular[x < 0].max()
        == 0
    )


def test_the_ablation_counts_what_got_better_and_worse(tmp_path):
    rows = [
        AblationRow("rendered", "a", (0.5, 0.4)),
        AblationRow("rendered", "b", (0.5, 0.625)),
        AblationRow("clean", "c", (0.2, 0.4)),
    ]
    text = markdown(rows, ["without", "with"])
    assert (
        "| rendered | 2 | 0.500 (at most 0.500) | 0.500 (at most 0.625; 1 better, 1 worse) |"
        in text
    )
    assert (
        "| clean | 1 | 0.200 % (at most 0.200) | 0.400 % (at most 0.400; 0 better, 1 worse) |"
        in text
    )
    with pytest.raises(InputError, match="make some with isc synth"):
        scenes(tmp_path, ("train",))
    with pytest.raises(InputError, match="make some with isc synth"):
        figure(tmp_path, tmp_path / "figure")


def test_the_shipped_table_is_whole_and_others_are_refused(tmp_path):
    assert shipped_table().temperature > 0
    with pytest.raises(InputError, match="cannot be read"):
        read_table(tmp_path / "none.npz")
    (tmp_path / "text.npz").write_text("no table")
    with pytest.raises(InputError, match="is not a table"):
        read_table(tmp_path / "text.npz")
    np.savez(
        tmp_path / "other.npz",
        spread=np.ones(2),
        without=np.ones((2, BINS)),
        highlight=np.ones((2, BINS)),
        temperature=1.0,
    )
    with pytest.raises(InputError, match="does not match the filters"):
        read_table(tmp_path / "other.npz")
    with pytest.raises(InputError, match="mask is empty"):
        highlight_prior(np.ones((4, 4, 3)), np.zeros((4, 4), bool))
