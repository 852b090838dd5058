"""Triangles of a height map: no cracks, the silhouette as it was, the budget met."""

import numpy as np
import pytest

from isc_core.result_files.mesh.build import build_mesh
from isc_core.result_files.mesh.options import MeshOptions
from isc_core.result_files.triangulation.adaptive_triangles import (
    Triangulation,
    adaptive_triangles,
    covered_pixels,
)
from tests.core.ball_scene import ball

SIDE = 200


def waves(side: int = SIDE) -> tuple[np.ndarray, np.ndarray]:
    """A wavy ball with a hole and a bite, and its cells."""
    row, column = np.mgrid[:side, :side]
    away = np.hypot(row - side / 2, column - side / 2)
    mask = (away < 0.45 * side) & (np.hypot(row - 60, column - 80) > 12)
    mask[: side // 3, column[0] > 0.7 * side] = False
    height = np.sqrt(np.maximum((0.5 * side) ** 2 - away**2, 0)) + np.sin(column / 5)
    return height, mask[:-1, :-1] & mask[1:, :-1] & mask[:-1, 1:] & mask[1:, 1:]


def triangulated(budget: int) -> tuple[np.ndarray, np.ndarray, Triangulation]:
    height, cells = waves()
    mesh = adaptive_triangles(height, cells, np.ones(height.shape), budget)
    assert mesh is not None
    return height, cells, mesh


def areas(mesh: Triangulation) -> np.ndarray:
    """Signed areas, positive for counter-clockwise ones with rows downward."""
    corner, one, other = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    (a, b), (c, d) = (one - corner).T, (other - corner).T
    return (a * d - b * c) / 2


def edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The edges (E, 2), and how many triangles each has."""
    pairs = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    return np.unique(pairs, axis=0, return_counts=True)


def units_of_silhouette(cells: np.ndarray) -> set[tuple[int, ...]]:
    """Every side of a cell that has a cell on one side only, by its two vertices."""
    framed = np.pad(cells, 1)
    flat = np.argwhere(framed[:-1, 1:-1] != framed[1:, 1:-1])
    steep = np.argwhere(framed[1:-1, :-1] != framed[1:-1, 1:])
    return {(r, c, r, c + 1) for r, c in flat.tolist()} | {
        (r, c, r + 1, c) for r, c in steep.tolist()
    }


@pytest.mark.parametrize("budget", [0, 6_000, 15_000, 10**6])
def test_it_has_no_cracks_and_keeps_every_pixel_of_the_silhouette(budget: int) -> None:
    _, cells, mesh = triangulated(budget)
    pairs, count = edges(mesh.faces)
    assert count.max() == 2
    open_ends = mesh.vertices[pairs[count == 1]].reshape(-1, 4)
    assert {tuple(ends) for ends in open_ends.tolist()} == units_of_silhouette(cells)
    area = areas(mesh)
    assert area.min() > 0
    assert area.sum() == cells.sum()
    assert set(np.unique(mesh.faces)) == set(range(len(mesh.vertices)))


def test_the_budget_is_met_and_used() -> None:
    for budget in (6_000, 15_000):
        assert 0.999 * budget < len(triangulated(budget)[2].faces) <= budget
    height, cells = waves()
    assert adaptive_triangles(height, cells, np.ones(height.shape), 100) is None
    assert len(triangulated(10**6)[2].faces) <= 2 * cells.sum()


def test_a_plane_takes_no_more_than_its_outline() -> None:
    row, column = np.mgrid[:129, :129]
    height, cells = 0.5 * row - 0.25 * column, np.ones((128, 128), bool)
    least = adaptive_triangles(height, cells, np.ones(height.shape), 0)
    most = adaptive_triangles(height, cells, np.ones(height.shape), 10**6)
    assert least is not None and most is not None
    assert len(most.faces) == len(least.faces) < 0.1 * 2 * cells.sum()


def missed(height: np.ndarray, mesh: Triangulation) -> np.ndarray:
    """Height above the triangles at each pixel; NaN where there are none."""
    error = np.full(height.shape, np.nan)
    for patch in covered_pixels(mesh):
        row, column = patch.pixels[..., 0], patch.pixels[..., 1]
        level = height[tuple(mesh.vertices[patch.faces].transpose(2, 0, 1))] @ patch.weights.T
        error[row, column] = height[row, column] - level
    return error


def test_more_triangles_come_closer_and_all_of_them_arrive() -> None:
    """The waves need about 3,000 vertices; and each pixel of a cell lies in a triangle."""
    rms = []
    for budget in (0, 6_000, 12_000, 10**6):
        height, cells, mesh = triangulated(budget)
        error = missed(height, mesh)
        used = np.zeros(height.shape, bool)
        used[:-1, :-1] |= cells
        used[1:, 1:] |= cells
        used[1:, :-1] |= cells
        used[:-1, 1:] |= cells
        assert (np.isfinite(error) == used).all()
        rms.append(float(np.sqrt(np.nanmean(error**2))))
    assert rms[0] > 3 * rms[1] > 6 * rms[2]
    assert rms[1] < 0.1
    assert rms[3] < 1e-6


def test_barycentric_coordinates_give_the_pixels_back() -> None:
    _, _, mesh = triangulated(6_000)
    for patch in covered_pixels(mesh, stride=3):
        corners = 3 * mesh.vertices[patch.faces]
        np.testing.assert_allclose(
            np.einsum("pk,tkc->tpc", patch.weights, corners), patch.pixels, atol=1e-9
        )
        assert patch.weights.min() >= 0
        np.testing.assert_allclose(patch.weights.sum(1), 1)


def test_a_mesh_too_thin_for_its_silhouette_takes_every_second_pixel() -> None:
    d = ball((300, 300), 140, (150, 150))
    for budget, stride in ((5_000, 1), (2_000, 2), (1_000, 4)):
        built = build_mesh(d.height, d.normal, d.mask, d.reflectance, MeshOptions(triangles=budget))
        assert built.stride == stride
        assert len(built.mesh.faces) <= budget
        assert (built.vertex_pixel % stride == 0).all()
        assert d.mask[tuple(built.vertex_pixel.T)].all()
    line = d.mask & (abs(np.indices(d.mask.shape)[0] - 150) < 2)  # no cell of twice the size
    built = build_mesh(d.height, d.normal, line, d.reflectance, MeshOptions(triangles=2))
    assert built.stride == 1 and len(built.mesh.faces) > 2
