"""Bodies of the visible sheet: a hemisphere becomes a ball, and every mask a closed body."""

import numpy as np
import pytest
import trimesh
from scipy import ndimage

from isc_core.errors import InputError
from isc_core.result_files.solids.body import Back, Body, make_body
from isc_core.result_files.solids.outline import outlined, smooth_cover

CLOSED = (Back.FLAT, Back.ROUNDED, Back.MIRRORED)


def solid(body: Body) -> trimesh.Trimesh:
    vertices = np.stack([body.places[:, 1], -body.places[:, 0], body.heights], -1)
    return trimesh.Trimesh(vertices, body.faces, process=False)


def hemisphere(radius: float, size: int) -> tuple[np.ndarray, np.ndarray]:
    row, column = np.indices((size, size)) - size / 2 + 0.3
    distance = np.hypot(row, column)
    return np.sqrt(np.maximum(radius**2 - distance**2, 0)), distance < radius


@pytest.mark.parametrize("back", [Back.ROUNDED, Back.MIRRORED])
@pytest.mark.parametrize("triangles", [0, 2000])
def test_a_hemisphere_becomes_a_ball(back: Back, triangles: int) -> None:
    height, mask = hemisphere(40, 100)
    mesh = solid(make_body(height, height / 40, mask, mask.astype(float), back, triangles))
    assert mesh.is_watertight and mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 40**3, rel=0.08)
    assert mesh.bounds[0, 2] == pytest.approx(-40, abs=4)


@pytest.mark.parametrize("back", CLOSED)
@pytest.mark.parametrize("seed", range(4))
def test_any_mask_becomes_a_closed_body(back: Back, seed: int) -> None:
    """Masks with holes, with parts that meet at a corner, and at the frame's border."""
    rng = np.random.default_rng(seed)
    mask = ndimage.gaussian_filter(rng.normal(size=(60, 70)), 2) > 0
    height = 200 * ndimage.gaussian_filter(rng.normal(size=mask.shape), 2)
    body = make_body(height, np.ones(mask.shape), mask, mask.astype(float), back, 500)
    mesh = solid(body)
    assert mesh.is_watertight and mesh.is_winding_consistent
    assert mesh.volume > 0 and mesh.area_faces.min() > 0
    assert (np.bincount(mesh.faces_unique_edges.ravel()) == 2).all(), "an edge of four faces"


def test_front_and_back_meet_in_the_outline_alone() -> None:
    rng = np.random.default_rng(0)
    _, mask = hemisphere(25, 64)
    height = 60 * ndimage.gaussian_filter(rng.normal(size=mask.shape), 3)
    body = make_body(height, np.ones(mask.shape), mask, mask.astype(float), Back.MIRRORED, 0)
    inner = int(body.front.sum())
    behind = body.heights[-inner:]
    np.testing.assert_array_equal(body.places[:inner], body.places[-inner:])
    assert (behind < body.heights[:inner]).all()


def test_the_outline_of_a_disc_is_a_circle() -> None:
    """Steps of the pixel grid would be half a pixel off, of a cover a tenth."""
    radius, size = 20.0, 48
    row, column = np.indices((4 * size, 4 * size)) / 4 - (size - 0.25) / 2
    disc = np.hypot(row, column) < radius
    cover = disc.reshape(size, 4, size, 4).mean((1, 3))
    flat = np.zeros_like(cover)
    sheet = outlined(smooth_cover(cover), flat, flat + 1, 0)
    rim = sheet.places[sheet.inner :] - (size - 1) / 2
    assert np.abs(np.hypot(*rim.T) - radius).max() < 0.15


def test_an_object_too_thin_is_refused() -> None:
    mask = np.zeros((20, 20), bool)
    mask[10, 3:15] = True
    with pytest.raises(InputError, match="2 x 2"):
        make_body(np.zeros((20, 20)), np.ones((20, 20)), mask, mask, Back.ROUNDED, 0)
