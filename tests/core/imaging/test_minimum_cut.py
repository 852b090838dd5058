"""The minimum cut is the best of all labellings, and known labels stay."""

import itertools

import numpy as np

from isc_core.imaging.minimum_cut import SCALE, STEPS, minimum_cut, shifted


def energy(
    labels: np.ndarray, difference: np.ndarray, links: list[np.ndarray], free: np.ndarray
) -> float:
    cost = np.where(labels, np.maximum(-difference, 0), np.maximum(difference, 0))[free].sum()
    for step, link in zip(STEPS, links, strict=True):
        here, there = shifted(labels.shape, step)
        cost += link[labels[here] != labels[there]].sum()
    return float(cost)


def test_no_labelling_costs_less() -> None:
    rng = np.random.default_rng(0)
    cut = 0
    for _ in range(12):
        shape = (3, 4)
        difference = np.rint(SCALE * rng.normal(0, 1, shape)) / SCALE
        sizes = [difference[shifted(shape, step)[0]].shape for step in STEPS]
        links = [np.rint(SCALE * rng.uniform(0, 0.5, size)) / SCALE for size in sizes]
        free, fixed = rng.random(shape) < 0.7, rng.random(shape) < 0.5
        found = minimum_cut(difference, links, free, fixed)
        assert (found == fixed)[~free].all()
        least = np.inf
        for some in itertools.product((False, True), repeat=int(free.sum())):
            labels = fixed.copy()
            labels[free] = some
            least = min(least, energy(labels, difference, links, free))
        assert abs(energy(found, difference, links, free) - least) < 1e-9
        cut += int(found[free].any() and not found[free].all())
    assert cut > 6  # the problems are not trivial


def test_nothing_to_label_changes_nothing() -> None:
    fixed = np.eye(4, dtype=bool)
    links = [np.ones(fixed[shifted(fixed.shape, step)[0]].shape) for step in STEPS]
    assert (minimum_cut(np.zeros((4, 4)), links, np.zeros((4, 4), bool), fixed) == fixed).all()
