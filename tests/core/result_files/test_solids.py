"""Bodies of the visible sheet: a hemisphere becomes a ball, and every mask a closed body."""

import numpy as np
import pytest
import trimesh
from scipy import ndimage

from isc_core.errors import InputError
from isc_core.result_files.mesh.rim_heights import limit_rim
from isc_core.result_files.solids.back import Back
from isc_core.result_files.solids.outline import outlined, smooth_cover
from isc_core.result_files.solids.rim import Rim
from isc_core.result_files.solids.solid_mesh import SolidMesh, make_solid_mesh
from isc_core.result_files.solids.surface import make_solid, vertex_positions
from isc_core.result_files.turned_view import turned_view
from isc_core.shading.lights import VIEW

CLOSED = (Back.FLAT, Back.ROUNDED, Back.MIRRORED)


def solid(body: SolidMesh) -> trimesh.Trimesh:
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
    mesh = solid(make_solid_mesh(height, height / 40, mask, Rim(mask), back, triangles))
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
    body = make_solid_mesh(height, np.ones(mask.shape), mask, Rim(mask), back, 500)
    mesh = solid(body)
    assert mesh.is_watertight and mesh.is_winding_consistent
    assert mesh.volume > 0 and mesh.area_faces.min() > 0
    assert (np.bincount(mesh.faces_unique_edges.ravel()) == 2).all(), "an edge of four faces"


def test_front_and_back_meet_only_at_the_outline() -> None:
    rng = np.random.default_rng(0)
    _, mask = hemisphere(25, 64)
    height = 60 * ndimage.gaussian_filter(rng.normal(size=mask.shape), 3)
    body = make_solid_mesh(height, np.ones(mask.shape), mask, Rim(mask), Back.MIRRORED, 0)
    inner = int(body.front.sum())
    behind = body.heights[-inner:]
    np.testing.assert_array_equal(body.places[:inner], body.places[-inner:])
    assert (behind < body.heights[:inner]).all()


def texture_scales(body: SolidMesh) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest texture pixels per pixel of surface of each hidden face; face areas."""
    faces = body.faces[~body.front[body.faces].any(1)]
    vertices = np.stack([body.places[:, 1], -body.places[:, 0], body.heights], -1)[faces]
    first, second = vertices[:, 1] - vertices[:, 0], vertices[:, 2] - vertices[:, 0]
    across = np.cross(first, second)
    x = first / np.linalg.norm(first, axis=1, keepdims=True)
    y = np.cross(across / np.linalg.norm(across, axis=1, keepdims=True), x)
    plane = np.stack([np.stack([(e * a).sum(1) for e in (first, second)], -1) for a in (x, y)], 1)
    places = body.texture[faces]
    texture = np.stack([places[:, k] - places[:, 0] for k in (1, 2)], -1)
    scales = np.linalg.svd(texture @ np.linalg.inv(plane), compute_uv=False)
    return scales, np.linalg.norm(across, axis=1)


def test_the_texture_of_a_rounded_back_is_stretched_little() -> None:
    """The pixels in front of the sides would be stretched thirtyfold there."""
    height, mask = hemisphere(80, 180)
    body = make_solid_mesh(height, height / 80, mask, Rim(mask), Back.ROUNDED, 0)
    scales, area = texture_scales(body)
    good = (scales[:, 0] < 1.5) & (scales[:, 1] > 0.3)
    assert area[good].sum() > 0.8 * area.sum()
    straight = scales[:, 1] < 0.1
    assert area[straight].sum() < 0.03 * area.sum()


def leaning_bar(back: Back, flat: float) -> tuple[SolidMesh, np.ndarray]:
    """A round bar whose outline crosses the columns of a hard mask, and its normal in the plane."""
    radius, shape = 40.0, (240, 120)
    row, column = (np.indices(shape).T - np.array(shape) / 2 + 0.3).T
    across = np.array([0.17, 1]) / np.hypot(0.17, 1)
    away = row * across[0] + column * across[1]
    mask = (np.abs(away) < radius) & (np.abs(row) < 115)
    height = limit_rim(flat * np.sqrt(np.maximum(radius**2 - away**2, 0)), mask, 3)
    return make_solid_mesh(height, np.ones(mask.shape), mask, Rim(mask), back, 0), across


@pytest.mark.parametrize("flat", [0.5, 1.0])
def test_the_texture_behind_the_outline_has_no_teeth(flat: float) -> None:
    """What a place takes depends on its depth alone, not on the steps of the mask."""
    body, across = leaning_bar(Back.ROUNDED, flat)
    weights = np.random.default_rng(0).dirichlet(np.ones(3), 8)
    middle = body.places.mean(0)
    place, texture, height = (
        np.einsum("wk,fk...->wf...", weights, values[body.faces]).reshape(-1, *values.shape[1:])
        for values in (body.places - middle, body.texture - middle, body.heights)
    )
    inner = int(body.front.sum())
    behind = body.heights[inner:-inner].mean() - height
    side = (np.abs(place[:, 0]) < 25) & (place @ across > 20) & (behind > 3) & (behind < 30)
    depth, found = behind[side], (texture @ across)[side]
    line = np.polynomial.Polynomial.fit(depth, found, 3)
    assert np.sqrt(np.mean((found - line(depth)) ** 2)) < 0.25


@pytest.mark.parametrize("seed", range(4))
def test_texture_comes_from_inside(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mask = ndimage.gaussian_filter(rng.normal(size=(90, 80)), 4) > 0
    body = make_solid_mesh(
        np.ones(mask.shape), np.ones(mask.shape), mask, Rim(mask), Back.ROUNDED, 0
    )
    np.testing.assert_array_equal(body.texture[body.front], body.places[body.front])
    rows, columns = np.rint(body.texture).astype(int).T + 9
    wide = np.pad(mask, 9)
    assert ndimage.binary_dilation(wide)[rows, columns].mean() > 0.98
    assert ndimage.binary_dilation(wide, iterations=4)[rows, columns].all()


def test_the_rim_of_a_ball_lies_in_a_plane() -> None:
    """Depths of single pixels would be 10 pixels apart, as their distances to the outline are."""
    height, mask = hemisphere(80, 180)
    body = make_solid_mesh(height, height / 80, mask, Rim(mask), Back.ROUNDED, 0)
    inner = int(body.front.sum())
    rim = body.heights[inner : len(body.heights) - inner]
    assert np.ptp(rim) < 3.5


@pytest.mark.parametrize("back", Back)
def test_the_turned_silhouette_has_no_teeth(back: Back) -> None:
    """The last pixels of a front that is too flat at its outline are seen from the side."""
    body, _ = leaning_bar(back, 0.3)
    row, column = body.places.T
    vertices = np.stack([column, -row, body.heights], -1)
    view = turned_view(vertices, body.faces, vertices[:, :1], 30.0, 480, 4.0)
    rows = np.arange(120, 360)
    ends = view.coverage[rows, 240:].sum(1) / 4
    straight = np.polynomial.Polynomial.fit(rows, ends, 1)
    assert np.sqrt(np.mean((ends - straight(rows)) ** 2)) < 0.08


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
        make_solid_mesh(np.zeros((20, 20)), np.ones((20, 20)), mask, Rim(mask), Back.ROUNDED, 0)


def disc(radius: float, centre: np.ndarray) -> np.ndarray:
    """The cover of pixels by a disc, from 16 x 16 points in each."""
    side, points = int(2 * radius + 12), 16
    row, column = (np.indices((side * points,) * 2) + 0.5) / points - 0.5
    inside = np.hypot(row - centre[0], column - centre[1]) < radius
    return inside.reshape(side, points, side, points).mean((1, 3))


@pytest.mark.parametrize("radius", [20.0, 35.0])
def test_the_outline_follows_the_cover_between_the_pixels(radius: float) -> None:
    """A third of the error of a hard mask's outline, and a tenth of that of the pixels' steps."""
    rng, errors = np.random.default_rng(0), []
    for _ in range(4):
        centre = radius + 5 + rng.uniform(0, 1, 2)
        cover = disc(radius, centre)
        mask, flat = cover >= 0.5, np.zeros(cover.shape)
        sheets = [outlined(smooth_cover(one), flat, flat + 1, 0) for one in (cover, mask)]
        places = [sheet.places[sheet.inner :] for sheet in sheets]
        places.append(np.argwhere(mask & ~ndimage.binary_erosion(mask)))
        errors.append([np.square(np.hypot(*(p - centre).T) - radius).mean() for p in places])
    soft, hard, steps = np.sqrt(np.mean(errors, axis=0))
    assert soft < 0.05
    assert soft < hard / 3 and soft < steps / 10


def soft_rim(mask: np.ndarray) -> Rim:
    """The rim of a ball, soft on the right."""
    row, column = np.indices(mask.shape) - 55 + 0.3
    away = np.hypot(row, column) - 40
    soft = (column > 0) & (np.abs(away) < 16)
    return Rim(np.where(soft, np.clip(0.5 - away / 20, 0, 1), np.clip(0.5 - away, 0, 1)), soft)


def fur(back: Back) -> tuple[Rim, SolidMesh]:
    """A ball whose rim is soft on the right."""
    height, mask = hemisphere(40, 110)
    rim = soft_rim(mask)
    return rim, make_solid_mesh(height, height / 40, mask, rim, back, 3000)


def layers(body: SolidMesh, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """How many triangles lie over each place."""
    corners = body.places[body.faces]
    count = np.zeros(len(rows), int)
    for k, place in enumerate(np.stack([rows, columns], -1) + (0.31, 0.17)):
        a, b, c = corners[np.abs(corners - place).max((1, 2)) < 90].transpose(1, 0, 2) - place
        sides = [p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0] for p, q in ((a, b), (b, c), (c, a))]
        count[k] = (np.stack(sides) > 0).all(0).sum() + (np.stack(sides) < 0).all(0).sum()
    return count


@pytest.mark.parametrize("back", Back)
def test_a_soft_rim_is_one_sheet_around_a_closed_core(back: Back) -> None:
    rim, body = fur(back)
    assert rim.soft is not None
    outline = body.places[~body.front & rim.sheet[body.pixels[:, 0], body.pixels[:, 1]]]
    assert len(outline) > 50
    ends = rim.cover[tuple(np.rint(outline).astype(int).T)]
    assert np.median(ends) < 0.06, "it fades to nothing"
    assert len(np.unique(body.faces)) == len(body.places), "no loose vertices"
    rows, columns = (part[::37] for part in np.nonzero(ndimage.binary_erosion(rim.sheet)))
    seen = rim.cover[rows, columns] > 0.1
    assert (layers(body, rows[seen], columns[seen]) == 1).all()
    core = ndimage.binary_erosion((rim.cover > 0.99), iterations=3)
    rows, columns = (part[::101] for part in np.nonzero(core))
    assert (layers(body, rows, columns) == (1 if back is Back.OPEN else 2)).all()


@pytest.mark.parametrize("back", CLOSED)
def test_the_core_of_a_soft_rim_has_no_hole(back: Back) -> None:
    """Edges of one triangle alone are those of the sheet, or where it begins."""
    rim, body = fur(back)
    edges = np.sort(body.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    kinds, count = np.unique(edges, axis=0, return_counts=True)
    near = ndimage.binary_dilation(rim.sheet, np.ones((3, 3)), 2)
    assert near[tuple(body.pixels[kinds[count == 1]].reshape(-1, 2).T)].all()


def test_the_texture_of_the_sheet_is_not_folded() -> None:
    rim, body = fur(Back.ROUNDED)
    thin = rim.sheet[body.pixels[:, 0], body.pixels[:, 1]]
    np.testing.assert_array_equal(body.texture[thin], body.places[thin])


@pytest.mark.parametrize("back", [Back.ROUNDED, Back.MIRRORED])
def test_the_back_behind_a_soft_rim_is_not_shaded_as_the_front(back: Back) -> None:
    height, mask = hemisphere(40, 110)
    row, column = np.indices(mask.shape) - 55 + 0.3
    normal = np.where(mask[..., None], np.dstack([column, -row, height]) / 40, VIEW)
    body = make_solid(height, normal, mask, soft_rim(mask), VIEW, back, 3000)
    vertices = vertex_positions(body.mesh, None)
    normals, faces = body.normals(vertices), body.mesh.faces
    a, b, c = vertices[faces].transpose(1, 0, 2)
    across = np.cross(b - a, c - a)
    behind = across[:, 2] < 0
    cosine = np.einsum("fx,fkx->fk", across[behind], normals[faces[behind]])
    assert np.mean(cosine < 0) < 0.002  # all but a few slivers
