"""The texture at the photo's resolution: the maps' base colour on average, the photo's detail, no
seam, and the frame of the maps.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from isc_core.imaging.area_resize import AreaFilter, resize_separately
from isc_core.imaging.srgb import srgb_to_linear
from isc_core.imaging.upsampling import enlarged
from isc_core.photo import Photo
from isc_core.photo.photo import PhotoSource
from isc_core.result_files.exports.full_texture import full_texture
from isc_core.result_files.mesh.base_color import base_color
from isc_core.result_files.mesh.options import MeshOptions
from isc_core.scene.decomposition import COLOR_MAPS, Decomposition
from tests.core.ball_scene import ball

Scene = tuple[Photo, Decomposition, Decomposition]


def scene(center: tuple[float, float] = (150.0, 221.0), long_side: int = 75) -> Scene:
    """A photo of a ball with fine print, its maps, and its layers at the photo's resolution."""
    truth = ball((331, 403), 130.0, center)
    row, column = np.indices(truth.mask.shape)
    print_ = np.where((row // 3 + column // 5) % 2, 1.0, 0.35).astype(np.float32)[..., None]
    diffuse = truth.diffuse * print_
    truth = replace(
        truth,
        image=diffuse + truth.specular,
        diffuse=diffuse,
        reflectance=truth.reflectance * print_,
    )
    size = (truth.mask.shape[1], truth.mask.shape[0])
    source = PhotoSource("", size, 32, "linear", "file")
    # The background is bright, so that it shows where it leaks in.
    image = np.where(truth.mask[..., None], truth.image, 5.0).astype(np.float32)
    photo = Photo(image, truth.mask, 1e-4, np.zeros(truth.mask.shape, bool), source)
    small = photo.resized_to_object(long_side)
    area = AreaFilter.of(truth.mask.shape, small.scale)
    layers = {
        name: resize_separately(getattr(truth, name), truth.mask, small.mask, area)
        * small.mask[..., None]
        for name in COLOR_MAPS
    }
    about = replace(truth.provenance, input={"size": list(size), "scale": small.scale})
    return photo, replace(truth, **layers, mask=small.mask, provenance=about), truth


def maps_color(d: Decomposition) -> tuple[np.ndarray, float]:
    return base_color(d.reflectance, d.mask, MeshOptions().bleed)


def texture_of(photo: Photo, d: Decomposition, longest: int = 0) -> np.ndarray:
    """Linear, cut to the frame of the photo."""
    codes = full_texture(photo, d, longest)
    assert codes is not None and codes.dtype == np.uint8
    return np.asarray(srgb_to_linear(codes / 255.0))


@pytest.mark.parametrize("center", [(150.0, 221.0), (60.0, 330.0)], ids=["whole", "cut by frame"])
def test_its_averages_are_the_base_colour_of_the_maps(center: tuple[float, float]) -> None:
    photo, d, _ = scene(center)
    height, width = photo.mask.shape
    texture = texture_of(photo, d)
    area = AreaFilter.of(photo.mask.shape, d.provenance.input["scale"])
    averages = resize_separately(texture[:height, :width], photo.mask, d.mask, area)[d.mask]
    wanted = np.clip(maps_color(d)[0], 0, 1)[d.mask]
    error = np.abs(averages - wanted) / wanted.mean()
    assert error.mean() < 0.01 and np.percentile(error, 95) < 0.03
    np.testing.assert_allclose(averages.mean(0), wanted.mean(0), rtol=0.01)


def test_it_shows_the_print_of_the_photo() -> None:
    photo, d, truth = scene()
    height, width = photo.mask.shape
    color, k = maps_color(d)
    texture = texture_of(photo, d)[:height, :width]
    coarse = enlarged(color.astype(np.float32), photo.mask.shape, 1 / d.provenance.input["scale"])
    inside = ndimage.binary_erosion(photo.mask, iterations=4)
    wanted = np.clip(k * truth.reflectance, 0, 1)[inside]
    before, after = (np.abs(one[inside] - wanted).mean() for one in (coarse, texture))
    assert after < 0.2 * before


@pytest.mark.parametrize("longest", [0, 250])
def test_it_covers_the_frame_of_the_maps(longest: int) -> None:
    """The mean of the texture over the UV square of a map pixel is that pixel's colour."""
    photo, d, _ = scene()
    texture = texture_of(photo, d, longest)
    rows, columns = (
        np.minimum((np.arange(size) + 0.5) * of / size, of - 1).astype(int)
        for size, of in zip(texture.shape, d.mask.shape, strict=False)
    )
    squares = rows[:, None] * d.mask.shape[1] + columns
    count = np.bincount(squares.ravel(), minlength=d.mask.size)
    means = np.stack(
        [np.bincount(squares.ravel(), texture[..., c].ravel(), d.mask.size) for c in range(3)], -1
    )
    means = (means / count[:, None]).reshape(*d.mask.shape, 3)
    inside = ndimage.binary_erosion(d.mask)
    wanted = np.clip(maps_color(d)[0], 0, 1)[inside]
    correlation = np.corrcoef(means[inside].ravel(), wanted.ravel())[0, 1]
    assert correlation > 0.97
    assert max(texture.shape) <= (longest or max(photo.mask.shape) + 4)


def test_no_seam_along_the_rim() -> None:
    """Beyond the mask the texture continues; neither black nor the bright background shows."""
    photo, d, _ = scene()
    height, width = photo.mask.shape
    texture = texture_of(photo, d)[:height, :width]
    ring = ndimage.binary_dilation(photo.mask, iterations=4) & ~photo.mask
    edge = photo.mask & ~ndimage.binary_erosion(photo.mask, iterations=6)
    low, high = texture[edge].min(0), texture[edge].max(0)
    assert (texture[ring] >= 0.9 * low).all() and (texture[ring] <= 1.1 * high).all()
    assert texture.min() > 0


def test_none_where_the_maps_are_as_fine() -> None:
    photo, d, _ = scene(long_side=0)
    assert full_texture(photo, d) is None
    photo, d, _ = scene()
    assert full_texture(photo, d, longest=50) is None
