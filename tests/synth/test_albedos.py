"""Albedos: in range, reproducible, without a seam, and each family with its own properties."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from isc_core.errors import InputError
from synth.albedos import ALBEDOS, BRIGHTEST, DARKEST, image_albedo, make_albedo
from synth.albedos.fields import ASPECT, fractal_noise, smooth_noise
from synth.albedos.near_grey import LARGEST_CHROMA
from synth.albedos.plate import FACES, Plate

SEEDS = range(12)


def made(name: str, seed: int, size: int = 128) -> np.ndarray:
    return make_albedo(name, np.random.default_rng(seed), size)


def chroma(albedo: np.ndarray) -> np.ndarray:
    return (albedo.max(-1) - albedo.min(-1)) / albedo.max(-1)


@pytest.mark.parametrize("name", ALBEDOS)
def test_every_texture_is_in_range_and_follows_from_its_seed(name: str) -> None:
    seen = [made(name, seed) for seed in SEEDS]
    for albedo in seen:
        assert albedo.shape == (128, 128, 3)
        assert albedo.dtype == np.float32
        assert albedo.min() >= np.float32(DARKEST)
        assert albedo.max() <= np.float32(BRIGHTEST)
    np.testing.assert_array_equal(seen[3], made(name, 3))
    assert all((seen[0] != other).any() for other in seen[1:])


@pytest.mark.parametrize("name", ALBEDOS)
def test_textures_close_around_u(name: str) -> None:
    """Differences across the seam are no larger than between other neighbours."""
    seam = inside = 0.0
    for seed in SEEDS:
        albedo = made(name, seed).astype(float)
        seam += np.abs(albedo[:, 0] - albedo[:, -1]).mean()
        inside += np.abs(np.diff(albedo, axis=1)).mean()
    assert seam <= 1.5 * inside


@pytest.mark.parametrize("name", ["patches", "print", "noise", "near_grey"])
def test_textured_families_have_texture(name: str) -> None:
    spread = [made(name, seed).std(axis=(0, 1)).max() / made(name, seed).mean() for seed in SEEDS]
    assert min(spread) > 0.01
    assert np.median(spread) > 0.05


def test_uniform_is_one_colour() -> None:
    for seed in SEEDS:
        assert np.ptp(made("uniform", seed), axis=(0, 1)).max() == 0


@pytest.mark.slow
def test_patches_are_two_to_six_colours_with_soft_edges() -> None:
    for seed in SEEDS:
        albedo = made("patches", seed, 256).reshape(-1, 3)
        colours, counts = np.unique(np.round(albedo, 4), axis=0, return_counts=True)
        flat = counts > 0.02 * len(albedo)
        assert 2 <= flat.sum() <= 6
        assert len(colours) > flat.sum()
        assert counts[flat].sum() > 0.4 * len(albedo)


def test_grey_is_exactly_grey_and_near_grey_nearly() -> None:
    for seed in SEEDS:
        grey, near = made("grey", seed), made("near_grey", seed)
        np.testing.assert_array_equal(grey[..., 0], grey[..., 1])
        np.testing.assert_array_equal(grey[..., 0], grey[..., 2])
        assert chroma(near).max() <= LARGEST_CHROMA + 1e-6
    assert max(chroma(made("near_grey", seed)).max() for seed in SEEDS) > 0.03


def test_most_coloured_albedos_are_coloured() -> None:
    for name in ("uniform", "patches", "noise"):
        assert np.median([np.median(chroma(made(name, seed))) for seed in SEEDS]) > 0.2


def test_noise_has_the_stated_moments_and_slope() -> None:
    rng = np.random.default_rng(0)
    for field in (smooth_noise(rng, 256, 6), fractal_noise(rng, 256, 2)):
        np.testing.assert_allclose((field.mean(), field.std()), (0, 1), atol=1e-9)
    spectra = [
        np.square(
            np.abs(np.fft.fft(fractal_noise(np.random.default_rng(seed), 256, 2), axis=0))
        ).mean(1)
        for seed in range(4)
    ]
    power = np.mean(spectra, axis=0)
    lines = np.arange(2, 60)
    slope = np.polyfit(np.log(lines), np.log(power[lines]), 1)[0]
    assert abs(slope + 2) < 0.2


def test_stretch_is_along_u() -> None:
    field = smooth_noise(np.random.default_rng(1), 256, 12, 5)
    along, down = (np.square(np.diff(field, axis=axis)).mean() for axis in (1, 0))
    assert (
        abs(np.sqrt(down / along) / (5 / ASPECT) - 1) < 0.1
    )  # in texels, which are ASPECT times as wide as high


def test_a_plate_prints_at_the_given_place_also_across_the_seam() -> None:
    plate = Plate(128)
    plate.box(ASPECT - 0.2, 0.25, 0.4, 0.5)
    cover = plate.cover()
    assert abs(cover.mean() - 0.4 / ASPECT * 0.5) < 0.01
    assert cover[64, 0] == 1
    assert cover[64, -1] == 1
    assert cover[64, 64] == 0
    assert cover[10].max() == 0


def test_letters_have_the_requested_height_and_width() -> None:
    for face in FACES:
        plate = Plate(256)
        plate.centred("HEL", 0.8, 0.6, 0.2, face, 2.0)
        rows, columns = np.nonzero(plate.cover() > 0.5)
        assert abs(np.ptp(rows) / 256 - 0.2) < 0.06
        assert abs((columns.min() + columns.max()) / 2 / 256 * ASPECT - 0.8) < 0.05
        assert abs(np.ptp(columns) / 256 * ASPECT - plate.text_width("HEL", 0.2, face)) < 0.06


def test_unknown_names_and_sizes_are_refused() -> None:
    with pytest.raises(InputError, match=r"unknown albedo 'plaid': choose uniform, patches"):
        make_albedo("plaid", np.random.default_rng(0))
    for size in (0, 15, 4097):
        with pytest.raises(InputError, match="texels cannot be made"):
            make_albedo("grey", np.random.default_rng(0), size)


def test_an_image_becomes_an_albedo(tmp_path: Path) -> None:
    codes = np.zeros((20, 30, 4), np.uint8)
    codes[..., 2], codes[..., 3] = 188, 50  # red in OpenCV's order, hardly opaque
    codes[:10] = 255
    cv2.imwrite(str(tmp_path / "a.png"), codes)
    albedo = image_albedo(tmp_path / "a.png")
    assert albedo.dtype == np.float32
    np.testing.assert_allclose(
        albedo[15, 7], (((188 / 255 + 0.055) / 1.055) ** 2.4, 0, 0), rtol=1e-6
    )
    np.testing.assert_array_equal(albedo[3, 3], np.float32(0.95))
    np.testing.assert_allclose(
        image_albedo(tmp_path / "a.png", "linear")[15, 7, 0], 188 / 255, rtol=1e-6
    )


def test_a_large_image_is_reduced_by_means(tmp_path: Path) -> None:
    codes = np.zeros((16, 8192, 3), np.uint8)
    codes[:, ::2] = 255
    cv2.imwrite(str(tmp_path / "long.png"), codes)
    with pytest.raises(InputError, match="100 times"):
        image_albedo(tmp_path / "long.png")
    cv2.imwrite(str(tmp_path / "wide.png"), np.repeat(codes, 8, axis=0))
    albedo = image_albedo(tmp_path / "wide.png")
    assert albedo.shape == (64, 4096, 3)
    np.testing.assert_allclose(albedo, 0.95 / 2, rtol=1e-5)


def test_files_that_are_no_images_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"not a picture")
    with pytest.raises(InputError, match="not an image of a known format"):
        image_albedo(tmp_path / "a.png")
    with pytest.raises(InputError, match="no such file"):
        image_albedo(tmp_path / "b.png")
