"""The priors' statistics: known densities are recovered, tables are densities, symmetries hold, and
the reference's constants are near.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from isc_core.datasets.mit_berkeley import load_natural_lights
from isc_core.errors import Cancelled, InputError
from isc_core.prior_fitting import roughness
from isc_core.prior_fitting.absolute_color import TableFitOptions, fit_absolute_table
from isc_core.prior_fitting.cross_validation import held_out_log_likelihood
from isc_core.prior_fitting.fit import (
    FitOptions,
    LightFitOptions,
    color_histogram,
    fit_photo_priors,
    fit_priors,
    fit_whitening,
)
from isc_core.prior_fitting.pairs import pair_differences
from isc_core.prior_fitting.statistics import (
    ObjectStatistics,
    TrainingObject,
    collect_statistics,
    object_statistics,
)
from isc_core.prior_fitting.training_objects import read_training_objects
from isc_core.prior_fitting.whitening import parsimony_whitening
from isc_core.progress import Monitor
from isc_core.sirfs.priors import absolute_table, lights
from isc_core.sirfs.priors.color_mixture import ColorCells, fit_color_mixture
from isc_core.sirfs.priors.scale_mixture import Magnitudes, ScaleMixture, fit_scale_mixture

FAST = FitOptions(
    iterations=20,
    absolute=TableFitOptions(max_steps=4, runs=1),
    grey_absolute=TableFitOptions(max_steps=20, runs=1),
)


def scale_mixture_samples(seed: int = 0, count: int = 200_000) -> np.ndarray:
    rng = np.random.default_rng(seed)
    sigma = rng.choice([0.02, 0.3], size=count, p=[0.7, 0.3])
    return sigma * rng.normal(size=count)


def painted_ball(seed: int, size: int = 40) -> TrainingObject:
    """A sphere with two albedos and some texture."""
    rng = np.random.default_rng(seed)
    i, j = np.mgrid[:size, :size] - (size - 1) / 2
    inside = i**2 + j**2 < (0.45 * size) ** 2
    height = np.where(inside, np.sqrt(np.maximum((size / 2) ** 2 - i**2 - j**2, 0)), np.nan)
    albedo = np.where((i > j)[..., None], rng.uniform(0.1, 0.9, 3), rng.uniform(0.1, 0.9, 3))
    reflectance = (
        np.clip(albedo * np.exp(0.02 * rng.normal(size=(size, size, 1))), 0, 1) * inside[..., None]
    )
    return TrainingObject(
        f"ball{seed}",
        reflectance,
        inside,
        height,
        inside,
        rng.normal(size=(9, 3)),
        rng.normal(size=(9, 3)),
    )


@pytest.fixture(scope="module")
def balls() -> dict[str, ObjectStatistics]:
    return collect_statistics({f"ball{k}": painted_ball(k) for k in range(8)})


@pytest.fixture(scope="module")
def environments() -> np.ndarray:
    return np.random.default_rng(5).normal(size=(9, 3, 200))


@pytest.fixture(scope="module")
def measured(shared: Path) -> dict[str, ObjectStatistics]:
    """Statistics of the ten training objects."""
    return collect_statistics(read_training_objects(shared / "data" / "mit_berkeley_train"))


@pytest.fixture(scope="module")
def reference(shared: Path) -> dict[str, np.ndarray]:
    with np.load(shared / "anchors" / "sirfs_reference_priors.npz", allow_pickle=False) as file:
        return {name: file[name] for name in file.files}


class TestPairs:
    def test_each_unordered_pair_of_a_window_counts_once(self) -> None:
        values = np.arange(30.0).reshape(5, 6)
        valid = np.ones((5, 6), bool)
        valid[2, 3] = False
        points = [(i, j) for i in range(5) for j in range(6) if valid[i, j]]
        near = [
            (p, q)
            for p in points
            for q in points
            if p < q and abs(p[0] - q[0]) <= 2 and abs(p[1] - q[1]) <= 2
        ]
        wanted = sorted(abs(values[p] - values[q]) for p, q in near)
        assert sorted(np.abs(pair_differences(values, valid))) == wanted

    def test_invalid_values_are_never_used(self) -> None:
        values = np.full((8, 8, 3), np.nan)
        values[2:6, 2:6] = 1.0
        assert np.array_equal(
            np.unique(pair_differences(values, np.isfinite(values[..., 0]))), [0.0]
        )


class TestScaleMixture:
    def test_recovers_a_known_density(self) -> None:
        mixture = fit_scale_mixture(Magnitudes.of(scale_mixture_samples()))
        x = np.array([0.0, 0.01, 0.05, 0.1, 0.3, 0.6])
        truth = sum(
            w * np.exp(-(x**2) / (2 * s * s)) / (s * np.sqrt(2 * np.pi))
            for w, s in ((0.7, 0.02), (0.3, 0.3))
        )
        assert np.abs(mixture.log_density(x) - np.log(truth)).max() < 0.12

    def test_table_is_a_density(self) -> None:
        table = fit_scale_mixture(Magnitudes.of(scale_mixture_samples())).table()
        mixture = fit_scale_mixture(Magnitudes.of(scale_mixture_samples()))
        density = np.exp(mixture.log_density(np.zeros(1))[0] - table.values)
        assert density.sum() * table.step == pytest.approx(1, abs=2e-3)
        assert np.allclose(table.values, table.values[::-1], atol=1e-12)
        assert abs(table.evaluate(np.zeros(1))[0][0]) < 1e-3
        assert table.values.min() >= 0

    def test_the_binned_fit_equals_that_of_the_samples(self) -> None:
        x = scale_mixture_samples(count=3000)
        binned = fit_scale_mixture(Magnitudes.of(x))
        single = Magnitudes(np.ones(len(x)), x**2, float(np.abs(x).sum()), float(np.abs(x).max()))
        exact = fit_scale_mixture(single)
        grid = np.linspace(0, 1, 200)
        assert np.abs(binned.log_density(grid) - exact.log_density(grid)).max() < 1e-3

    def test_merging_is_like_fitting_all_at_once(self) -> None:
        x = scale_mixture_samples(count=3000)
        merged = Magnitudes.merged([Magnitudes.of(x[:1000]), Magnitudes.of(x[1000:])])
        assert np.allclose(
            fit_scale_mixture(merged).weights,
            fit_scale_mixture(Magnitudes.of(x)).weights,
            atol=1e-9,
        )

    def test_density_has_a_floor(self) -> None:
        narrow = ScaleMixture(np.array([1e-3]), np.array([1.0]), 1.0)
        assert narrow.log_density(np.array([1.0]))[0] == pytest.approx(-300)


class TestColorMixture:
    covariance = np.array([[2.0, 1.2, 0.8], [1.2, 1.5, 0.9], [0.8, 0.9, 1.4]])

    def samples(self, count: int = 60_000) -> tuple[np.ndarray, np.ndarray]:
        rng = np.random.default_rng(1)
        variance = rng.choice([1e-4, 1e-2], size=(count, 1), p=[0.6, 0.4])
        unit = self.covariance / np.cbrt(np.linalg.det(self.covariance))
        return np.sqrt(variance) * (rng.normal(size=(count, 3)) @ np.linalg.cholesky(unit).T), unit

    def test_recovers_covariance_and_density(self) -> None:
        x, unit = self.samples()
        mixture = fit_color_mixture(ColorCells.of(x))
        assert np.linalg.det(mixture.covariance) == pytest.approx(1)
        assert np.abs(mixture.covariance - unit).max() < 0.03
        assert np.allclose(mixture.whiten() @ mixture.covariance @ mixture.whiten(), np.eye(3))
        m = np.array([0.0, 1e-4, 1e-3, 1e-2, 3e-2])
        truth = sum(
            w * (2 * np.pi * v) ** -1.5 * np.exp(-m / v) for w, v in ((0.6, 1e-4), (0.4, 1e-2))
        )
        assert np.abs(mixture.log_density(m) - np.log(truth)).max() < 0.15

    def test_a_few_large_differences_do_not_set_the_covariance(self) -> None:
        rng = np.random.default_rng(10)
        _, unit = self.samples(1)
        scale = np.where(np.arange(6000) < 60, 1.0, 0.01)[:, None]
        x = scale * (rng.normal(size=(6000, 3)) @ np.linalg.cholesky(unit).T)
        sample = x.T @ x / len(x)
        assert np.abs(sample / np.cbrt(np.linalg.det(sample)) - unit).max() > 0.15
        assert np.abs(fit_color_mixture(ColorCells.of(x)).covariance - unit).max() < 0.07

    def test_cells_lose_little(self) -> None:
        x, _ = self.samples(4000)
        cells = fit_color_mixture(ColorCells.of(x))
        exact = fit_color_mixture(ColorCells(np.ones(len(x)), x[:, :, None] * x[:, None, :]))
        m = np.linspace(0, 0.05, 100)
        assert np.abs(cells.covariance - exact.covariance).max() < 0.01
        assert np.abs(cells.log_density(m) - exact.log_density(m)).max() < 0.03

    def test_opposite_differences_have_equal_statistics(self) -> None:
        x, _ = self.samples(4000)
        flipped = x * np.random.default_rng(2).choice([-1, 1], (len(x), 1))
        one, other = ColorCells.of(x), ColorCells.of(flipped)
        assert np.array_equal(one.counts, other.counts)
        assert np.allclose(one.moments, other.moments)

    def test_table_starts_at_zero_and_rises(self) -> None:
        x, _ = self.samples(4000)
        table = fit_color_mixture(ColorCells.of(x)).table()
        assert table.low == 0
        assert table.values[0] == 0
        assert (np.diff(table.values) > 0).all()


def test_whitening_whitens() -> None:
    rng = np.random.default_rng(3)
    data = (
        rng.normal(size=(20_000, 3))
        @ np.diag([2.0, 1.0, 0.5])
        @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
        + 1.0
    )
    second = data.T @ data / len(data)
    exact = parsimony_whitening(second, floor=0.0)
    assert np.allclose(exact @ second @ exact, np.eye(3))
    regular = parsimony_whitening(second)
    assert np.allclose(regular, regular.T)
    assert np.mean((data @ regular) ** 2) == pytest.approx(1)


class TestRoughness:
    @pytest.mark.parametrize("shape", [(12,), (6, 7, 8)])
    def test_gradient(self, shape: tuple[int, ...]) -> None:
        rng = np.random.default_rng(4)
        f, direction, step = rng.normal(size=shape), rng.normal(size=shape), 1e-6
        slope = (
            roughness.roughness_numpy(f + step * direction)[0]
            - roughness.roughness_numpy(f - step * direction)[0]
        ) / (2 * step)
        assert (roughness.roughness_numpy(f)[1] * direction).sum() == pytest.approx(slope, rel=1e-6)

    def test_engines_agree(self) -> None:
        pytest.importorskip("numba")
        f = np.random.default_rng(4).normal(size=(7, 9, 11)).astype(np.float32)
        value, gradient = roughness.roughness(f)
        exact, exact_gradient = roughness.roughness_numpy(f.astype(float))
        assert value == pytest.approx(exact, rel=1e-6)
        assert np.abs(gradient - exact_gradient).max() < 1e-5

    def test_planes_do_not_bend(self) -> None:
        i, j, k = np.mgrid[:6, :6, :6].astype(float)
        assert roughness.roughness_numpy(2 * i - j + 3 * k, softening=0.0 + 1e-12)[0] < 1e-3


class TestAbsoluteTable:
    def test_splat_keeps_mass_and_centre(self) -> None:
        rng = np.random.default_rng(6)
        points, weights = rng.uniform(-6, 3, (500, 3)), rng.uniform(size=500)
        histogram = absolute_table.splat(points, 12, weights)
        nodes = np.linspace(absolute_table.LOW, absolute_table.HIGH, 12)
        assert histogram.sum() == pytest.approx(weights.sum())
        assert (histogram.sum(axis=(1, 2)) * nodes).sum() == pytest.approx(
            (weights * points[:, 0]).sum()
        )
        assert (histogram.sum(axis=(0, 1)) * nodes).sum() == pytest.approx(
            (weights * points[:, 2]).sum()
        )

    def test_points_outside_go_to_the_border(self) -> None:
        histogram = absolute_table.splat(np.array([[-99.0], [99.0]]), 12, np.ones(2))
        assert histogram[0] == histogram[-1] == 1

    def test_upsampling_keeps_straight_lines(self) -> None:
        values = np.arange(10.0)
        fine = absolute_table.synthesise(absolute_table.synthesis_matrix(19), values)
        assert np.allclose(fine[2:-2], np.arange(19)[2:-2] / 2)

    def test_half_precision_is_enough(self) -> None:
        i, j, k = np.mgrid[:8, :8, :8] - 3.5
        values = 0.4 * (i**2 + j**2 + k**2) - 10
        half = absolute_table.CoarseTable.of(values, 16).table().values
        full = absolute_table.CoarseTable.of(values, 16, np.float64).table().values
        assert half.min() == 0
        assert np.abs(half - full).max() < 1e-3 * np.ptp(full)

    def test_likelihood_is_largest_for_the_true_distribution(self) -> None:
        p = np.array([0.1, 0.2, 0.3, 0.4])
        best = absolute_table.log_likelihood(-np.log(p), p)
        assert best == pytest.approx((p * np.log(p)).sum())
        assert absolute_table.log_likelihood(np.zeros(4), p) < best
        assert absolute_table.log_likelihood(-np.log(p) + 7, p) == pytest.approx(best)

    def test_fit_finds_a_smooth_density(self) -> None:
        nodes = np.linspace(-7, 4, 256)
        density = np.exp(-0.5 * ((nodes + 1) / 0.8) ** 2)
        density /= density.sum()
        losses: list[float] = []
        table = fit_absolute_table(
            density, TableFitOptions(smoothness=0.5, tolerance=1e-8, max_steps=2000), losses.append
        ).table()
        near = np.abs(nodes + 1) < 1.5
        fitted = np.exp(-table.values) / np.exp(-table.values).sum()
        assert np.abs(fitted - density)[near].max() < 0.05 * density.max()
        assert losses[-1] < losses[0]

    @pytest.mark.slow
    def test_more_smoothness_bends_less(self) -> None:
        histogram = absolute_table.splat(
            np.random.default_rng(7).normal(-1, 0.5, (50, 1)), 256, np.full(50, 0.02)
        )
        bends = [
            roughness.roughness_numpy(
                fit_absolute_table(histogram, TableFitOptions(smoothness=c, tolerance=1e-7))
                .table()
                .values
            )[0]
            for c in (4.0, 64.0)
        ]
        assert bends[1] < 0.5 * bends[0]


class TestLights:
    def test_mirror_is_an_involution_that_turns_the_shading(self) -> None:
        rng = np.random.default_rng(8)
        light = rng.normal(size=(1, 9, 3))
        both = lights.mirrored(light)
        assert np.array_equal(lights.mirrored(both[1:])[1], light[0])
        n1, n2, n3 = (v := rng.normal(size=3)) / np.linalg.norm(v)

        def shading(coefficients: np.ndarray, right: float) -> np.ndarray:
            basis = [1, right, n3, n1, n1 * right, right * n3, n3**2, n1 * n3, n1**2 - right**2]
            return np.asarray(np.array(basis) @ coefficients)

        assert np.allclose(shading(both[0], n2), shading(both[1], -n2))

    def test_mirrored_lights_have_no_favoured_side(self, environments: np.ndarray) -> None:
        fitted = lights.fit_light(lights.mirrored(environments.transpose(2, 0, 1)))
        odd = np.tile(np.isin(np.arange(9), (1, 4, 5)), 3)
        assert np.allclose(fitted.mean[odd], 0, atol=1e-12)
        assert np.allclose(fitted.covariance[np.ix_(odd, ~odd)], 0, atol=1e-12)

    def test_permuted_lights_have_no_favoured_channel(self, environments: np.ndarray) -> None:
        fitted = lights.fit_light(lights.permuted(environments.transpose(2, 0, 1)))
        blocks = fitted.covariance.reshape(3, 9, 3, 9)
        assert np.allclose(blocks[0, :, 0], blocks[2, :, 2])
        assert np.allclose(blocks[0, :, 1], blocks[2, :, 0])

    def test_whitened_lights_have_unit_size(self, environments: np.ndarray) -> None:
        samples = environments.transpose(2, 0, 1)
        light = lights.fit_light(samples).light()
        u = np.linalg.solve(light.unwhiten, (lights.stacked(samples) - light.offset).T)
        assert np.mean(u**2) == pytest.approx(1)
        assert np.allclose(light.unwhiten, light.unwhiten.T)

    def test_grey_is_the_mean_of_the_channels(self, environments: np.ndarray) -> None:
        samples = environments.transpose(2, 0, 1)
        derived, direct = (
            lights.fit_light(samples).grey(),
            lights.fit_light(samples.mean(axis=2, keepdims=True)),
        )
        assert np.allclose(derived.mean, direct.mean)
        assert np.allclose(derived.covariance, direct.covariance)

    def test_ridge_widens_brightness_and_colour_apart(self, environments: np.ndarray) -> None:
        samples = environments.transpose(2, 0, 1)
        gain = (
            lights.fit_light(samples, ridge=(0.3, 0.1)).covariance
            - lights.fit_light(samples).covariance
        )
        bright, blue = (
            np.tile(np.eye(9)[0], 3) / np.sqrt(3),
            np.repeat([-1.0, 0, 1], 9) * np.tile(np.eye(9)[0], 3) / np.sqrt(2),
        )
        assert bright @ gain @ bright == pytest.approx(0.3)
        assert blue @ gain @ blue == pytest.approx(0.1)
        assert bright @ gain @ blue == pytest.approx(0, abs=1e-12)

    @pytest.mark.parametrize(("brightness", "color"), [(2.0, 1.0), (1.5, 1.5)])
    def test_contrast_is_recovered(self, brightness: float, color: float) -> None:
        rng = np.random.default_rng(9)
        base = lights.fit_light(rng.normal(size=(400, 9, 3)))
        truth = lights.scaled(base, lights.Contrast(brightness, color))
        drawn = (
            rng.multivariate_normal(truth.mean, truth.covariance, size=300)
            .reshape(-1, 3, 9)
            .transpose(0, 2, 1)
        )
        found = lights.fit_contrast(base, drawn)
        assert found.brightness == pytest.approx(brightness, rel=0.05)
        assert found.color == pytest.approx(color, rel=0.05)

    def test_likelihood_is_that_of_a_gaussian(self) -> None:
        light = lights.GaussianLight(np.zeros(2), np.diag([1.0, 4.0]))
        assert light.log_likelihood(np.array([[1.0, 2.0]]))[0] == pytest.approx(
            -0.5 * (1 + 1) - np.log(2) - np.log(2 * np.pi)
        )


class TestFit:
    def test_a_sphere_has_one_curvature(self) -> None:
        statistics = object_statistics(painted_ball(0, size=120))
        assert statistics.curvature.absolute_sum / statistics.curvature.counts.sum() < 2e-3

    @pytest.mark.slow
    def test_all_priors_expand(
        self, balls: dict[str, ObjectStatistics], environments: np.ndarray
    ) -> None:
        fitted = fit_priors(balls, environments, FAST)
        for illumination in ("natural", "laboratory"):
            for channels in (3, 1):
                priors = fitted.priors(illumination, channels)
                assert priors.light.mean.shape == (9 * channels,)
                assert priors.absolute.values.ndim == channels
                assert priors.absolute.values.min() == 0
                assert (
                    priors.parsimony_whiten.shape
                    == priors.smoothness_whiten.shape
                    == (channels, channels)
                )
        assert fitted.record.objects == tuple(f"ball{k}" for k in range(8))

    @pytest.mark.slow
    def test_same_objects_give_the_same_priors_in_any_order(
        self, balls: dict[str, ObjectStatistics], environments: np.ndarray
    ) -> None:
        one = fit_priors(balls, environments, FAST)
        other = fit_priors(dict(reversed(balls.items())), environments, FAST)
        assert np.array_equal(one.absolute.coarse, other.absolute.coarse)
        assert np.array_equal(one.color_smoothness.weights, other.color_smoothness.weights)

    @pytest.mark.slow
    def test_contrast_can_be_given(
        self, balls: dict[str, ObjectStatistics], environments: np.ndarray
    ) -> None:
        light = LightFitOptions(natural_contrast=lights.Contrast(2.0, 2.0))
        fitted = fit_priors(
            balls, environments, FitOptions(FAST.components, 5, light=light, absolute=FAST.absolute)
        )
        plain = lights.fit_light(lights.mirrored(environments.transpose(2, 0, 1)))
        natural = fitted.lights.natural
        assert natural is not None and np.allclose(natural.covariance, 4 * plain.covariance)

    def test_held_out_likelihood_has_one_value_an_object(
        self, balls: dict[str, ObjectStatistics]
    ) -> None:
        values = held_out_log_likelihood(
            balls, TableFitOptions(smoothness=24, max_steps=30, runs=1), channels=1
        )
        assert values.shape == (8,)
        assert np.isfinite(values).all()

    def test_cancelling_ends_the_fit(
        self, balls: dict[str, ObjectStatistics], environments: np.ndarray
    ) -> None:
        with pytest.raises(Cancelled):
            fit_priors(balls, environments, FAST, Monitor(cancelled=lambda: True))

    @pytest.mark.slow
    def test_progress_never_goes_back(
        self, balls: dict[str, ObjectStatistics], environments: np.ndarray
    ) -> None:
        seen: list[float] = []
        fit_priors(
            balls,
            environments,
            FAST,
            Monitor(progress=lambda event: seen.append(event.fraction)),
        )
        assert seen == sorted(seen)
        assert seen[-1] == 1

    def test_too_few_objects_is_a_clear_error(
        self, balls: dict[str, ObjectStatistics], environments: np.ndarray
    ) -> None:
        with pytest.raises(InputError, match="at least two"):
            fit_priors({"ball0": balls["ball0"]}, environments, FAST)

    def test_too_few_lights_is_a_clear_error(
        self, balls: dict[str, ObjectStatistics], environments: np.ndarray
    ) -> None:
        plain = replace(FAST, light=replace(FAST.light, laboratory_ridge=(0.0, 0.0)))
        with pytest.raises(InputError, match="too few"):
            fit_priors({name: balls[name] for name in ("ball0", "ball1")}, environments, plain)

    def test_priors_of_photos_need_no_lights_of_objects(
        self, balls: dict[str, ObjectStatistics], environments: np.ndarray
    ) -> None:
        dark = {
            name: replace(one, natural_light=None, laboratory_light=None)
            for name, one in balls.items()
        }
        lights_of_photos = environments.transpose(2, 0, 1)
        fitted = fit_photo_priors(dark, lights_of_photos, FAST)
        assert fitted.lights.photo is not None and fitted.lights.natural is None
        plain = fit_priors(balls, environments, FAST)
        np.testing.assert_array_equal(fitted.curvature.weights, plain.curvature.weights)
        with pytest.raises(InputError, match="unknown"):
            fit_priors(dark, environments, FAST)

    def test_relief_and_texture_widen_the_densities(
        self, balls: dict[str, ObjectStatistics], environments: np.ndarray
    ) -> None:
        seen = environments.transpose(2, 0, 1)
        sharp = fit_photo_priors(balls, seen, FAST)
        wide = fit_photo_priors(balls, seen, replace(FAST, relief=0.1, texture=0.2))
        small = np.array([0.05])
        for name in ("curvature", "grey_smoothness", "color_smoothness"):
            before, after = (
                getattr(one, name).log_density(0 * small) - getattr(one, name).log_density(small)
                for one in (sharp, wide)
            )
            assert 0 <= after[0] < before[0]
        assert np.isclose(wide.curvature.deviations.min(), 0.1, rtol=0.1)

    def test_flat_objects_are_a_clear_error(self) -> None:
        with pytest.raises(InputError, match="flat"):
            fit_scale_mixture(Magnitudes.of(np.zeros(5)))

    def test_an_empty_object_is_a_clear_error(self) -> None:
        ball = painted_ball(0)
        empty = TrainingObject(
            "ball",
            ball.reflectance * 0,
            ball.valid,
            ball.height,
            ball.mask,
            ball.natural_light,
            ball.laboratory_light,
        )
        with pytest.raises(InputError, match="'ball'"):
            object_statistics(empty)


@pytest.mark.slow
class TestAgainstTheReference:
    """The reference's constants came from these ten objects; it drew its samples at random, we take
    all of them.
    """

    @pytest.mark.slow
    def test_curvature(
        self, measured: dict[str, ObjectStatistics], reference: dict[str, np.ndarray]
    ) -> None:
        mixture = fit_scale_mixture(Magnitudes.merged(o.curvature for o in measured.values()))
        x = np.array([0.001, 0.003, 0.01, 0.03, 0.1, 0.3])
        cost = mixture.log_density(np.zeros(1))[0] - mixture.log_density(x)
        nodes = reference["z_curv_lut_low"] + reference["z_curv_lut_step"] * np.arange(20_000)
        # At 0 the table depends on the very smallest differences; costs are compared from 0.001 on,
        # as slopes.
        theirs = np.interp(x, nodes, reference["z_curv_lut_cost"])
        assert np.abs((cost - cost[0]) - (theirs - theirs[0])).max() < 0.25

    @pytest.mark.slow
    def test_color_smoothness(
        self, measured: dict[str, ObjectStatistics], reference: dict[str, np.ndarray]
    ) -> None:
        mixture = fit_color_mixture(
            ColorCells.merged(o.color_smoothness for o in measured.values())
        )
        theirs = reference["a_smooth_whiten"]
        assert np.linalg.norm(mixture.whiten() - theirs) < 0.05 * np.linalg.norm(theirs)
        m = np.array([1e-3, 1e-2, 0.1, 1.0, 3.0])
        nodes = reference["a_smooth_lut_low"] + reference["a_smooth_lut_step"] * np.arange(100_000)
        assert (
            np.abs(
                mixture.log_density(m) - np.interp(m, nodes, reference["a_smooth_lut_loglik"])
            ).max()
            < 0.35
        )

    def test_whitening(
        self, measured: dict[str, ObjectStatistics], reference: dict[str, np.ndarray]
    ) -> None:
        ours, theirs = fit_whitening(list(measured.values())), reference["a_whiten"]
        assert np.linalg.norm(ours - theirs) < 0.01 * np.linalg.norm(theirs)

    @pytest.mark.slow
    def test_absolute_color(
        self, measured: dict[str, ObjectStatistics], reference: dict[str, np.ndarray]
    ) -> None:
        histogram = color_histogram(list(measured.values()), reference["a_whiten"])
        ours, theirs = (
            fit_absolute_table(histogram, TableFitOptions()).table().values,
            reference["a_abs_cost_RETRAINED"],
        )
        assert np.sqrt(np.mean((ours - theirs) ** 2)) < 0.02
        assert np.abs(ours - theirs).max() < 0.1

    def test_light_whitening_formula(self, reference: dict[str, np.ndarray]) -> None:
        for kind in ("color_natural", "color_laboratory", "gray_natural", "gray_laboratory"):
            theirs = lights.GaussianLight(
                reference[f"light_{kind}_mu"], reference[f"light_{kind}_Sigma"]
            )
            assert np.abs(theirs.light().unwhiten - reference[f"light_{kind}_inverse"]).max() < 1e-3

    def test_environments_are_tamer_than_the_objects_light(
        self, measured: dict[str, ObjectStatistics], shared: Path
    ) -> None:
        environments = load_natural_lights(shared / "data" / "mit_berkeley_train").transpose(
            2, 0, 1
        )
        natural = np.array([o.natural_light for o in measured.values()])
        contrast = lights.fit_contrast(lights.fit_light(lights.mirrored(environments)), natural)
        assert contrast.brightness > 1.5 * contrast.color
