"""Mixtures of colours have the density of what they were fitted to."""

import numpy as np
import pytest

from isc_core.photo.colour_mixture import COMPONENTS, ColourMixture, split_colours


def test_a_component_has_colours_of_one_cluster() -> None:
    rng = np.random.default_rng(0)
    kind = rng.integers(2, size=2000)
    centres = np.array([[30, 60, 90], [200, 140, 40]])
    assignments = split_colours(centres[kind] + rng.normal(0, 3, (2000, 3)))
    assert len(set(assignments)) == COMPONENTS
    assert len(set(zip(assignments, kind, strict=True))) == COMPONENTS


def test_the_density_is_that_of_the_colours() -> None:
    """Differences of costs are those of the true Gaussians."""
    rng = np.random.default_rng(0)
    root = np.array([[9.0, 0, 0], [4, 6, 0], [-3, 2, 7]])
    colours = 100 + rng.normal(size=(200_000, 3)) @ root.T
    mixture = ColourMixture.fitted(colours, np.zeros(len(colours), int))
    seen = mixture.cost(100 + np.array([[0.0, 0, 0], [9, 4, -3], [0, 12, 4]]))
    assert seen - seen[0] == pytest.approx([0, 0.5, 2], abs=0.05)


def test_one_plain_colour_has_a_density() -> None:
    colours = np.full((50, 3), 90.0)
    mixture = ColourMixture.fitted(colours, split_colours(colours))
    near, far = mixture.cost(np.array([[90.0, 90, 90], [120, 90, 90]]))
    assert np.isfinite([near, far]).all() and near < far
