"""Thresholds: the exact optimum against published tables and brute force, the optimisers against
it, budgets, bad input.
"""

from itertools import combinations

import numpy as np
import pytest

from benchmarks.separation.thresholding import levels
from isc_core.errors import InputError
from isc_core.thresholding import (
    OPTIMISERS,
    OtsuObjective,
    chaotic_clonal,
    exact,
    maximise,
    particle_swarm,
    quantise,
)
from isc_core.thresholding.clonal_selection import (
    ClonalOptions,
    PseudoRandomNumbers,
    mutation_rate,
    search,
)
from isc_core.thresholding.particle_swarm import DECREASING_INERTIA, SwarmOptions

# Exact optima for 3, 4 and 5 thresholds, of an independent program.
OPTIMA = {
    "camera": ("69,134,180", 5272.195, "46,100,145,182", 5313.813, "19,55,107,147,182", 5335.594),
    "coins": ("63,107,156", 2609.659, "58,95,134,173", 2669.920, "49,77,108,142,177", 2709.405),
    "moon": ("60,102,142", 134.837, "56,97,114,148", 150.616, "56,97,113,133,182", 156.996),
    "page": ("93,150,199", 3013.843, "71,119,161,203", 3090.682, "68,113,151,185,215", 3135.355),
    "brick": ("112,139,165", 644.883, "100,118,144,168", 655.092, "99,113,134,154,173", 660.510),
    "grass": ("74,113,148", 1339.500, "65,99,128,157", 1389.215, "58,89,114,138,163", 1416.745),
    "gravel": ("77,118,153", 1347.884, "66,103,133,161", 1399.731, "60,93,120,143,167", 1427.630),
    "clock": ("131,148,184", 397.618, "130,143,157,188", 410.071, "130,143,156,177,206", 418.480),
    "astronaut": ("44,105,165", 5368.341, "32,89,145,190", 5475.101, "25,71,116,158,198", 5540.730),
}
SEARCHES = OPTIMISERS[1:]


def between_class_variance(image: np.ndarray, thresholds: tuple[int, ...]) -> float:
    """By its definition, from the pixels."""
    labels = np.searchsorted(thresholds, image.ravel(), side="left")
    classes = [image.ravel()[labels == k] for k in range(len(thresholds) + 1)]
    return float(
        sum(len(c) * (c.mean() - image.mean()) ** 2 for c in classes if len(c)) / image.size
    )


@pytest.mark.parametrize("name", OPTIMA)
def test_exact_optima_of_nine_images(name: str) -> None:
    objective = OtsuObjective.of(levels(name))
    for count in (3, 4, 5):
        thresholds, value = OPTIMA[name][2 * (count - 3) : 2 * (count - 2)]
        found = exact(objective, count)
        # rgb2gray has halves in the grey astronaut, which processors round differently
        assert found.value == pytest.approx(value, abs=1e-2 if name == "astronaut" else 1e-3)
        assert ",".join(map(str, found.thresholds)) == thresholds


def test_objective_is_the_variance_between_classes() -> None:
    rng = np.random.default_rng(1)
    image = np.clip(rng.normal(90, 40, (50, 60)), 0, 255).astype(np.uint8)
    candidates = np.sort(rng.integers(0, 255, (20, 4)), axis=1)
    candidates[0] = (90, 90, 90, 200)  # empty classes add nothing
    objective = OtsuObjective.of(image)
    direct = [between_class_variance(image, tuple(row)) for row in candidates]
    assert objective(candidates) == pytest.approx(direct, rel=1e-10)
    assert objective.evaluations == 20
    # With every level a class of its own, all of the variance lies between classes.
    assert objective(np.arange(255)[None])[0] == pytest.approx(image.var(), rel=1e-10)


def test_exact_beats_every_other_choice() -> None:
    rng = np.random.default_rng(2)
    image = rng.choice(np.arange(0, 256, 13), 400, p=rng.dirichlet(np.ones(20))).astype(np.uint8)
    objective = OtsuObjective.of(image)
    every = np.array(list(combinations(np.arange(0, 256, 13), 3)))
    found = exact(objective, 3)
    assert found.value == pytest.approx(objective(every).max(), rel=1e-12)
    assert found.value == pytest.approx(
        between_class_variance(image, tuple(found.thresholds)), rel=1e-10
    )


@pytest.mark.parametrize("optimiser", OPTIMISERS)
def test_what_every_optimiser_keeps(optimiser: str) -> None:
    objective = OtsuObjective.of(levels("camera"))
    found, again, other = (
        maximise(optimiser, objective, 4, evaluations=3000, seed=seed) for seed in (3, 3, 4)
    )
    assert found.thresholds.shape == (4,) and np.issubdtype(found.thresholds.dtype, np.integer)
    assert (
        (np.diff(found.thresholds) >= 0).all()
        and found.thresholds.min() >= 0
        and found.thresholds.max() <= 255
    )
    assert (
        found.value
        == objective(found.thresholds[None])[0]
        <= exact(objective, 4).value * (1 + 1e-12)
    )
    assert (
        found.evaluations <= 3000
        and found.history[-1, 0] == found.evaluations
        and found.history[-1, 1] == found.value
    )
    assert (np.diff(found.history, axis=0) >= 0).all()
    assert np.array_equal(found.history, again.history) and np.array_equal(
        found.thresholds, again.thresholds
    )
    assert optimiser == "exact" or not np.array_equal(found.history, other.history)


@pytest.mark.parametrize("optimiser", SEARCHES)
def test_evaluations_are_counted_where_they_happen(optimiser: str) -> None:
    objective = OtsuObjective.of(levels("coins"))
    found = maximise(optimiser, objective, 3, evaluations=5000)
    assert objective.evaluations == found.evaluations


@pytest.mark.slow
@pytest.mark.parametrize("optimiser", ["chaotic_clonal", "clonal_selection"])
def test_clonal_selection_finds_the_optimum(optimiser: str) -> None:
    for name in ("camera", "brick", "clock"):  # these have lesser maxima in which a search can end
        objective = OtsuObjective.of(levels(name))
        for count in (3, 4, 5):
            best = exact(objective, count).value
            values = [maximise(optimiser, objective, count, seed=seed).value for seed in range(4)]
            assert values == pytest.approx([best] * 4, rel=1e-12)


@pytest.mark.slow
def test_swarm_finds_easy_optima_and_comes_close_to_others() -> None:
    easy, hard = (OtsuObjective.of(levels(name)) for name in ("coins", "brick"))
    assert all(
        maximise("particle_swarm", easy, 3, seed=s).value
        == pytest.approx(exact(easy, 3).value, rel=1e-12)
        for s in range(4)
    )
    assert (
        min(maximise("particle_swarm", hard, 5, seed=s).value for s in range(4))
        > 0.97 * exact(hard, 5).value
    )


@pytest.mark.slow
def test_swarm_with_falling_inertia_gathers_later() -> None:
    objective = OtsuObjective.of(levels("coins"))
    best = exact(objective, 3).value

    def needed(options: SwarmOptions) -> float:
        found = [
            particle_swarm.maximise(objective, 3, seed=seed, options=options) for seed in range(4)
        ]
        assert [f.value for f in found] == pytest.approx([best] * 4, rel=1e-12)
        return float(
            np.mean([f.history[np.argmax(f.history[:, 1] >= best * (1 - 1e-12)), 0] for f in found])
        )

    assert needed(DECREASING_INERTIA) > 2 * needed(SwarmOptions())


class FirstAntibody:
    """Numbers that place every antibody of the first population at the same thresholds."""

    def __init__(self, thresholds: list[int], seed: int) -> None:
        self.first: list[int] | None = thresholds
        self.others = PseudoRandomNumbers(seed)

    def uniform(self, shape: tuple[int, ...]) -> np.ndarray:
        if self.first is None:
            return self.others.uniform(shape)
        first, self.first = self.first, None
        return np.tile((np.array(first) + 0.5) / 255, (shape[0], 1))


class Recorder(OtsuObjective):
    """An objective that keeps the candidates it evaluates."""

    def __init__(self) -> None:
        super().__init__(np.ones(256))
        self.candidates: list[np.ndarray] = []

    def __call__(self, thresholds: np.ndarray) -> np.ndarray:
        self.candidates.append(thresholds.copy())
        return super().__call__(thresholds)


def first_clones(thresholds: list[int], decay: float, seed: int) -> np.ndarray:
    """The clones (100, 40, K) of 100 equal antibodies, whose ranks rise from 0 to 1."""
    objective = Recorder()
    options = ClonalOptions(population=100, clone_share=0.4, decay=decay, replaced_share=0)
    search(objective, len(thresholds), 4100, FirstAntibody(thresholds, seed), options)
    antibodies, clones = objective.candidates
    assert (antibodies == thresholds).all()
    return clones.reshape(100, 40, -1)


def test_clones_of_better_antibodies_move_less() -> None:
    assert mutation_rate(np.array([0.0, 0.5, 1.0]), 4) == pytest.approx([1, np.exp(-2), np.exp(-4)])
    clones = first_clones([60, 120, 180], 6.0, seed=0)
    limits = np.maximum(1, 254 * mutation_rate(np.linspace(0, 1, 100), 6.0))
    small = limits <= 40  # below half the distance of the thresholds nothing is sorted or clipped
    moved = np.abs(clones - [60, 120, 180])[small]
    assert (moved.max(axis=(1, 2)) <= np.ceil(limits[small])).all()
    assert (moved.max(axis=(1, 2)) > 0.7 * limits[small]).all()
    assert (moved.max(axis=2) >= 1).all()
    # One common step for a run of thresholds.
    assert all(len(set(row[row > 0])) == 1 for row in moved.reshape(-1, 3))


def test_thresholds_stay_in_order_at_the_ends() -> None:
    clones = first_clones([0, 1, 254], 1e-9, seed=1)
    assert clones.min() == 0 and clones.max() == 254 and (np.diff(clones, axis=2) >= 0).all()


@pytest.mark.parametrize("optimiser", OPTIMISERS)
@pytest.mark.parametrize(
    "image", [np.full((5, 5), 7), np.array([[0, 255]]), np.array([[3, 4, 4, 200]])]
)
def test_fewer_levels_than_classes(optimiser: str, image: np.ndarray) -> None:
    objective = OtsuObjective.of(image)
    found = maximise(optimiser, objective, 5, evaluations=2000)
    assert (
        np.isfinite(found.value) and found.thresholds.min() >= 0 and found.thresholds.max() <= 254
    )
    assert found.value <= image.var() * (1 + 1e-9) + 1e-9
    if optimiser == "exact":
        assert found.value == pytest.approx(image.var(), abs=1e-9)


def test_quantise_returns_stored_levels() -> None:
    stored = np.arange(256, dtype=np.uint8)
    assert np.array_equal(quantise(stored / 255, 1.0), stored)
    assert np.array_equal(quantise(stored * 40.0, 255 * 40.0), stored)
    assert quantise(np.array([-1.0, 2.0]), 1.0).tolist() == [0, 255]


def test_invalid_input_is_refused() -> None:
    objective = OtsuObjective.of(levels("coins"))
    with pytest.raises(InputError, match="exact, chaotic_clonal"):
        maximise("annealing", objective, 3)
    for count in (0, 255):
        with pytest.raises(InputError, match="number of thresholds"):
            maximise("exact", objective, count)
    with pytest.raises(InputError, match="seed"):
        maximise("clonal_selection", objective, 3, seed=-1)
    with pytest.raises(InputError, match="at least 50 evaluations"):
        maximise("clonal_selection", objective, 3, evaluations=49)
    for bad in (np.zeros(256), np.ones(255), -np.ones(256), np.full(256, np.nan)):
        with pytest.raises(InputError, match="histogram"):
            OtsuObjective(bad)
    for image in (np.array([0.5]), np.array([256]), np.array([-1]), np.array([], int)):
        with pytest.raises(InputError, match="levels must be integers"):
            OtsuObjective.of(image)
    with pytest.raises(InputError, match="finite values"):
        quantise(np.ones(3), 0.0)
    for options in (
        ClonalOptions(population=1),
        ClonalOptions(clone_share=0),
        ClonalOptions(decay=0),
        ClonalOptions(replaced_share=1),
    ):
        with pytest.raises(InputError):
            chaotic_clonal.maximise(objective, 3, options=options)
    for swarm in (
        SwarmOptions(particles=1),
        SwarmOptions(inertia=1),
        SwarmOptions(last_inertia=-1),
        SwarmOptions(attraction=0),
        SwarmOptions(top_speed=0),
    ):
        with pytest.raises(InputError):
            particle_swarm.maximise(objective, 3, options=swarm)
