"""Edits brought back into the photo: outside the mask nothing changes, in any file format; inside
the edit arrives at full size.
"""

from dataclasses import replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy import ndimage

from isc_core.editing.compositing import composite
from isc_core.editing.dichromatic import DichromaticEdit, LayerEdit, edit_layers
from isc_core.editing.edit_folder import Original, Record, Sheet, save_edit
from isc_core.editing.edited import Edited
from isc_core.editing.highlights import add_highlight
from isc_core.editing.recolour import ColourEdit, recolour
from isc_core.errors import InputError
from isc_core.imaging.bounding_box import FramePart
from isc_core.imaging.srgb import linear_to_srgb
from isc_core.io.exr import read_channels, write_channels
from isc_core.photo import Photo, PhotoSource, read_linear, read_photo, read_raster
from isc_core.photo.camera import Camera
from isc_core.scene.decomposition import Decomposition, Provenance
from isc_core.scene.part_of_result import ResultPart, cut_result
from isc_core.shading.lights import DirectionalLight, toward
from tests.core.ball_scene import ball

SCALE = 0.5
DIFFUSE_ONLY = DichromaticEdit(specular=LayerEdit(gain=0))


def photo_of(scene: Decomposition, background: float = 0.3) -> Photo:
    """The scene's picture before a background, as a photo of its own size."""
    image = np.where(scene.mask[..., None], scene.image, background).astype(np.float32)
    height, width = scene.mask.shape
    source = PhotoSource("0" * 64, (width, height), 16, "linear", "file")
    return Photo(image, scene.mask, 1 / 65535, np.zeros_like(scene.mask), source)


def half_size(full: Decomposition) -> Decomposition:
    """The same ball at half its size, as the working maps of the photo `full`."""
    height, width = full.mask.shape
    half = ball((height // 2, width // 2), 40.0, (48.0, 60.0))
    return replace(
        half,
        provenance=Provenance(input={"scale": SCALE, "size": [width, height], "name": "ball.png"}),
    )


def composited(d: Decomposition, edit: Edited, photo: Photo) -> tuple[np.ndarray, np.ndarray]:
    """The photo after an edit, and where it changed."""
    done = composite(ResultPart.of(d), edit, photo)
    image, changed = photo.image.copy(), done.place.placed(done.changed)
    done.place.cut(image)[...] = done.image
    return image, changed


@pytest.fixture(scope="module")
def full() -> Decomposition:
    return ball((192, 240), 80.0, (96.5, 120.5))


def test_at_the_photo_s_own_size_the_edit_is_the_edit() -> None:
    scene = ball()
    edit = recolour(scene, ColourEdit(hue=90))
    image, changed = composited(scene, edit, photo_of(scene))
    assert image[scene.mask] == pytest.approx(edit.image[scene.mask], abs=1e-6)
    assert np.array_equal(image[~scene.mask], photo_of(scene).image[~scene.mask])
    assert not changed[~scene.mask].any()


def test_no_edit_is_the_photo_bit_by_bit_at_any_size(full: Decomposition) -> None:
    half = half_size(full)
    photo = photo_of(full)
    image, changed = composited(half, Edited(half.image, half.diffuse, half.specular), photo)
    assert np.array_equal(image, photo.image) and not changed.any()


@pytest.mark.parametrize("change", [DIFFUSE_ONLY, DichromaticEdit(diffuse=LayerEdit(gain=0.5))])
def test_an_enlarged_edit_is_near_the_edit_made_at_full_size(
    full: Decomposition, change: DichromaticEdit
) -> None:
    half, photo = half_size(full), photo_of(full)
    image, _ = composited(half, edit_layers(half, change), photo)
    wanted = edit_layers(full, change).image
    inner = full.mask & (full.normal[..., 2] > 0.3)
    done = np.abs(image - wanted)[inner].mean()
    nothing = np.abs(photo.image - wanted)[inner].mean()
    assert done < 0.1 * nothing
    assert np.array_equal(image[~full.mask], photo.image[~full.mask])


def test_edges_of_the_paint_stay_as_sharp_as_the_photo_s(full: Decomposition) -> None:
    """A texture finer than the maps survives a change of the light: its contrast follows."""
    generator = np.random.default_rng(2)
    texture = 1 + 0.2 * generator.uniform(-1, 1, full.mask.shape)[..., None].astype(np.float32)
    half, photo = half_size(full), photo_of(full)
    photo = replace(photo, image=photo.image * texture)
    image, _ = composited(
        half, edit_layers(half, DichromaticEdit(LayerEdit(gain=0.5), LayerEdit(gain=0.5))), photo
    )
    inner = full.mask & (full.normal[..., 2] > 0.5)
    fine = [
        np.abs(np.diff(picture[..., 0], axis=1))[inner[:, 1:]].mean()
        for picture in (photo.image, image)
    ]
    assert fine[1] == pytest.approx(0.5 * fine[0], rel=0.15)


@pytest.mark.parametrize("scale", [1.0, SCALE])
def test_the_object_s_part_of_a_result_gives_the_bytes_of_the_whole(scale: float) -> None:
    """Before a camera, and with a mask that lies beside that of the maps, as far as allowed."""
    full = ball((240, 320), 50.0, (80.5, 230.5))
    maps = full if scale == 1 else ball((120, 160), 25.0, (40.0, 115.0))
    given = {"scale": scale, "size": [320, 240], "name": "ball.png"}
    camera = Camera(300.0, (maps.mask.shape[1] / 2, maps.mask.shape[0] / 2))
    maps = replace(maps, provenance=Provenance(input=given), camera=camera)
    photo = photo_of(full)
    shift = -2 if scale == 1 else -5  # with the dilation, three pixels of the maps
    photo = replace(photo, mask=np.roll(ndimage.binary_dilation(photo.mask), shift, axis=1))
    part = FramePart.around(maps.mask, 1)
    near = cut_result(maps, part)
    assert part.share < 0.3
    light = DirectionalLight(toward(-0.5, 0.4, 0.7), np.ones(3))
    for edit in (partial(add_highlight, light=light), partial(recolour, change=ColourEdit(90))):
        whole = composite(ResultPart.of(maps), edit(maps), photo)
        found = composite(ResultPart(near, part), edit(near), photo)
        assert found.changed.any() and found.place == whole.place
        np.testing.assert_array_equal(found.image, whole.image)
        np.testing.assert_array_equal(found.changed, whole.changed)


def test_another_photo_or_mask_is_refused(full: Decomposition) -> None:
    half, photo = half_size(full), photo_of(full)
    edit = edit_layers(half, DIFFUSE_ONLY)
    smaller = replace(photo, image=photo.image[:150], mask=photo.mask[:150])
    shifted = replace(photo, mask=np.roll(photo.mask, 15, axis=1))
    for wrong in (smaller, shifted):
        with pytest.raises(InputError, match="give the same"):
            composite(ResultPart.of(half), edit, wrong)
    part = FramePart(slice(5, 90), slice(15, 105), half.mask.shape)
    near = cut_result(half, part)
    for wrong in (smaller, shifted):
        with pytest.raises(InputError, match="give the same"):
            composite(ResultPart(near, part), edit_layers(near, DIFFUSE_ONLY), wrong)


@pytest.mark.parametrize("size", ["own", "half"])
def test_fur_changes_with_the_object(full: Decomposition, size: str) -> None:
    """Strands that an alpha channel covers by less than half get the new hue, not a fringe of the
    old one; what is transparent stays.
    """
    away, near = ndimage.distance_transform_edt(~full.mask, return_indices=True)
    strands = np.random.default_rng(3).uniform(6, 20, full.mask.shape)
    cover = np.where(full.mask, 0.55, np.clip(0.6 - away / strands, 0, 1)).astype(np.float32)
    cover[ndimage.binary_erosion(full.mask, iterations=9)] = 1
    d = full if size == "own" else half_size(full)
    photo = photo_of(full)
    fur = np.where(cover[..., None] > 0, photo.image[tuple(near)], photo.image)
    photo = replace(photo, image=fur)
    source = replace(photo.original, mask_from="alpha")
    edit = recolour(d, ColourEdit(hue=180))
    opaque, _ = composited(d, edit, photo)
    soft = replace(photo, mask=full.mask, cover=cover, original=source)
    image, changed = composited(d, edit, soft)
    assert np.array_equal(image[full.mask], opaque[full.mask])
    rim = (cover > 0.05) & ~full.mask
    assert rim.sum() > 1000 and changed[rim].mean() > 0.95
    wanted = opaque[tuple(near)][rim]
    done, nothing = (np.abs(one[rim] - wanted).mean() for one in (image, photo.image))
    assert done < (0.02 if size == "own" else 0.2) * nothing
    assert np.array_equal(image[cover == 0], photo.image[cover == 0])


# --- files ----------------------------------------------------------------------------------------


def coded(full: Decomposition, kind: type, transfer: str) -> tuple[np.ndarray, np.ndarray]:
    """RGB codes of the ball before noise, and an alpha with every value, opaque enough on the
    object.
    """
    generator = np.random.default_rng(4)
    image = np.where(full.mask[..., None], full.image, generator.uniform(0, 1, full.image.shape))
    peak = np.iinfo(kind).max
    values = np.rint(
        np.clip(linear_to_srgb(image) if transfer == "srgb" else image, 0, 1) * peak
    ).astype(kind)
    alpha = np.where(
        full.mask,
        generator.integers(peak // 2 + 1, peak, full.mask.shape),
        generator.integers(0, peak // 2, full.mask.shape),
    )
    return values, alpha.astype(kind)


@pytest.mark.slow
def recoloured_png(half: Decomposition, photo: Photo, folder: Path) -> np.ndarray:
    """The edited file of `photo.png` in a folder."""
    original = Original(photo, read_raster(folder / "photo.png"))
    edit = recolour(half, ColourEdit(hue=120))
    stored = ResultPart.of(half)
    save_edit(stored, edit, folder / "out", Record("recolour"), Sheet("t"), original=original)
    return cv2.imread(str(folder / "out" / "edited.png"), cv2.IMREAD_UNCHANGED)


@pytest.mark.parametrize(
    ("kind", "transfer"), [(np.uint8, "srgb"), (np.uint16, "srgb"), (np.uint16, "linear")]
)
def test_png_keeps_depth_coding_alpha_and_all_other_pixels(
    full: Decomposition, tmp_path: Path, kind: type, transfer: str
) -> None:
    values, alpha = coded(full, kind, transfer)
    cv2.imwrite(str(tmp_path / "photo.png"), np.dstack([values[..., ::-1], alpha]))
    photo = read_photo(tmp_path / "photo.png", transfer=transfer)
    half = half_size(full)
    written = recoloured_png(half, photo, tmp_path)
    assert written.dtype == kind
    assert np.array_equal(written[..., 3], alpha)
    assert np.array_equal(written[~full.mask][:, :3], values[~full.mask][:, ::-1])
    assert not np.array_equal(written[full.mask][:, :3], values[full.mask][:, ::-1])
    again = read_linear(tmp_path / "out" / "edited.png", transfer)
    exact, _ = composited(half, recolour(half, ColourEdit(hue=120)), photo)
    step = 1 / np.iinfo(kind).max
    assert np.abs(linear_to_srgb(again) - linear_to_srgb(np.clip(exact, 0, 1)))[full.mask].max() < (
        step if transfer == "srgb" else 13 * step
    )


def test_a_grey_photo_gets_colour_only_where_it_is_painted(
    full: Decomposition, tmp_path: Path
) -> None:
    values = coded(full, np.uint8, "srgb")[0][..., 1]
    cv2.imwrite(str(tmp_path / "photo.png"), values)
    cv2.imwrite(str(tmp_path / "mask.png"), np.uint8(255 * full.mask))
    photo = read_photo(tmp_path / "photo.png", tmp_path / "mask.png")
    half = half_size(full)
    written = recoloured_png(half, photo, tmp_path)
    assert np.array_equal(written[~full.mask], np.repeat(values[~full.mask][:, None], 3, 1))


def test_exr_stays_linear_and_unchanged_outside(full: Decomposition, tmp_path: Path) -> None:
    light = np.where(
        full.mask[..., None],
        3 * full.image,
        np.random.default_rng(1).uniform(0, 9, full.image.shape),
    ).astype(np.float32)
    generator = np.random.default_rng(7)
    alpha = np.where(full.mask, 1, generator.choice([0, 0.1, 0.3, 0.47], full.mask.shape)).astype(
        np.float32
    )
    write_channels(
        tmp_path / "photo.exr", {**{c: light[..., k] for k, c in enumerate("RGB")}, "A": alpha}
    )
    photo = read_photo(tmp_path / "photo.exr")
    half = half_size(full)
    original = Original(photo, read_raster(tmp_path / "photo.exr"), tmp_path / "photo.exr")
    half = replace(
        half,
        image=half.image * 3,
        diffuse=half.diffuse * 3,
        specular=half.specular * 3,
        shading=half.shading * 3,
    )
    save_edit(
        ResultPart.of(half),
        edit_layers(half, DIFFUSE_ONLY),
        tmp_path / "out",
        Record("dichromatic"),
        Sheet("t"),
        original=original,
    )
    written = read_channels(tmp_path / "out" / "edited.exr")
    assert set(written) == {"R", "G", "B", "A"}
    assert np.array_equal(written["A"], alpha)
    for k, name in enumerate("RGB"):
        assert np.array_equal(written[name][~full.mask], light[..., k][~full.mask])
    assert written["R"].max() > 1
    assert not (tmp_path / "out" / "edited.png").exists()
    assert written["R"][full.mask].sum() < light[..., 0][full.mask].sum()


def test_without_a_photo_the_maps_picture_is_written_with_the_mask_as_alpha(tmp_path: Path) -> None:
    scene = ball()
    edit = edit_layers(scene, DIFFUSE_ONLY)
    save_edit(ResultPart.of(scene), edit, tmp_path / "out", Record("dichromatic"), Sheet("t"))
    written = cv2.imread(str(tmp_path / "out" / "edited.png"), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(written[..., 3], 255 * scene.mask.astype(np.uint8))
    channels = read_channels(tmp_path / "out" / "edited.exr")
    assert np.stack([channels[c] for c in "RGB"], -1) == pytest.approx(edit.image, abs=1e-6)
