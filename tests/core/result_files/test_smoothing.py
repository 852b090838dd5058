"""Smoothing of maps and numbering of vertices, against plain ways to do the same."""

import numpy as np

from isc_core.result_files.solids.smoothing import binomial, smoothed_within
from isc_core.result_files.triangulation.renumbering import renumbered


def test_each_map_is_smoothed_as_if_it_were_alone() -> None:
    rng = np.random.default_rng(1)
    maps, counts = rng.normal(size=(3, 30, 40)), rng.random((30, 40)) > 0.5
    together = smoothed_within(maps, counts, 3)
    for one, values in zip(together, maps, strict=True):
        assert np.array_equal(one, smoothed_within((values,), counts, 3)[0])
        assert np.array_equal(smoothed_within((np.ones_like(values),), counts, 3)[0], one * 0 + 1)


def test_the_binomial_filter_of_a_point_is_binomial() -> None:
    point = np.zeros((15, 15))
    point[7, 7] = 1
    row = np.array([1, 4, 6, 4, 1]) / 16
    wanted = np.zeros_like(point)
    wanted[5:10, 5:10] = np.outer(row, row)
    assert np.array_equal(binomial(point, 2), wanted)


def test_vertices_are_renumbered_as_by_sorting() -> None:
    corners = np.random.default_rng(2).integers(0, 500, (80, 3))
    used, faces = np.unique(corners, return_inverse=True)
    found = renumbered(corners)
    assert np.array_equal(found[0], used)
    assert np.array_equal(found[1], faces.reshape(corners.shape))
    assert all(part.size == 0 for part in renumbered(np.zeros((0, 3), np.int64)))
