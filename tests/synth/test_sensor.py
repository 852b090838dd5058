"""The sensor: identities, the stated noise, clipping and quantisation, and a photo that can be read
back.
"""

from pathlib import Path

import numpy as np
import pytest

from isc_core.errors import InputError
from isc_core.imaging.srgb import linear_to_srgb, srgb_to_linear
from isc_core.photo import read_photo
from synth.capture.sensor import READ, Sensor, noise_deviation, observe, write_photo
from synth.capture.truth import GroundTruth


def truth_of(diffuse: np.ndarray, specular: np.ndarray, mask: np.ndarray) -> GroundTruth:
    """A ground truth with the given layers, (H, W, 3) each; its other maps are irrelevant here."""
    diffuse, specular = (
        np.where(mask[..., None], layer, 0).astype(np.float32) for layer in (diffuse, specular)
    )
    nothing, plane = np.zeros_like(diffuse), np.zeros(mask.shape, np.float32)
    return GroundTruth(
        image=diffuse + specular,
        diffuse=diffuse,
        specular=specular,
        residual=nothing,
        reflectance=diffuse,
        shading=np.ones_like(diffuse),
        normal=nothing,
        height=plane,
        mask=mask,
        strength=plane,
        gloss=plane,
        shading_variance=nothing,
        specular_variance=nothing,
        illumination=np.zeros((9, 3)),
        light_fit_residual=0.0,
        environment=np.zeros((4, 8, 3)),
    )


def glossy(size: int = 64) -> GroundTruth:
    """A disc with a highlight far above 1."""
    rng = np.random.default_rng(5)
    y, x = np.mgrid[:size, :size] / size - 0.5
    glow = 40 * np.exp(-((x - 0.1) ** 2 + y**2) / 0.01)[..., None]
    return truth_of(rng.uniform(0, 0.9, (size, size, 3)), glow * np.ones(3), np.hypot(x, y) < 0.45)


def flat(value: float, size: int = 256) -> GroundTruth:
    return truth_of(
        np.full((size, size, 3), value), np.zeros((size, size, 3)), np.ones((size, size), bool)
    )


@pytest.mark.parametrize(
    "sensor",
    [
        Sensor(),
        Sensor(noise=0.05),
        Sensor(bits=8),
        Sensor(noise=0.01, bits=16),
        Sensor(clip=False, noise=0.1),
    ],
)
def test_the_layers_add_up_and_nothing_else_is_touched(sensor: Sensor) -> None:
    truth = glossy()
    seen = observe(truth, sensor, np.random.default_rng(1))
    assert np.abs(seen.diffuse + seen.specular + seen.residual - seen.image).max() <= 1e-6 * max(
        1, seen.image.max() / 4
    )
    assert {seen.image.dtype, seen.residual.dtype} == {np.dtype(np.float32)}
    assert seen.image.min() >= 0
    assert not seen.image[~truth.mask].any()
    assert not seen.residual[~truth.mask].any()
    for name, values in truth.arrays().items():
        if name not in ("image", "residual"):
            assert getattr(seen, name) is values


def test_the_same_seed_gives_the_same_noise() -> None:
    first, again, other = (
        observe(glossy(), Sensor(noise=0.02), np.random.default_rng(seed)).image
        for seed in (3, 3, 4)
    )
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


def test_a_perfect_sensor_changes_nothing() -> None:
    truth = glossy()
    seen = observe(truth, Sensor(clip=False), np.random.default_rng(0))
    np.testing.assert_array_equal(seen.image, truth.image)
    assert not seen.residual.any()


def test_only_light_above_full_scale_is_clipped() -> None:
    truth = glossy()
    seen = observe(truth, Sensor(), np.random.default_rng(0))
    above = truth.image > 1
    assert above.any()
    assert (seen.image[above] == 1).all()
    np.testing.assert_array_equal(seen.image[~above], truth.image[~above])
    np.testing.assert_array_equal(seen.residual != 0, above)


def test_the_layers_of_clipped_light_add_up_exactly_however_bright_it_was() -> None:
    rng = np.random.default_rng(4)
    truth = truth_of(
        rng.uniform(0, 0.9, (64, 64, 3)),
        np.exp(rng.uniform(0, 12, (64, 64, 3))),
        np.ones((64, 64), bool),
    )
    seen = observe(truth, Sensor(), rng)
    assert (seen.image == 1).all()
    np.testing.assert_array_equal(seen.diffuse + seen.specular + seen.residual, seen.image)


@pytest.mark.parametrize("level", [0.1, 0.5, 0.8])
def test_noise_has_mean_zero_and_the_stated_variance(level: float) -> None:
    noise = 0.02
    error = observe(flat(level), Sensor(noise=noise), np.random.default_rng(7)).residual.astype(
        float
    )
    count, variance = error.size, noise**2 * (level + READ**2)
    assert abs(error.mean()) < 5 * np.sqrt(variance / count)
    assert abs(error.var() / variance - 1) < 5 * np.sqrt(2 / count)
    np.testing.assert_allclose(noise_deviation(np.array(level), noise) ** 2, variance)
    neighbours = np.corrcoef(error[:, :-1].ravel(), error[:, 1:].ravel())[0, 1]
    channels = np.corrcoef(error[..., 0].ravel(), error[..., 1].ravel())[0, 1]
    assert max(abs(neighbours), abs(channels)) < 5 / np.sqrt(count / 3)


def test_noise_at_black_is_cut_off_at_zero() -> None:
    seen = observe(flat(0.0), Sensor(noise=0.02), np.random.default_rng(2)).image
    assert abs((seen == 0).mean() - 0.5) < 0.01
    assert seen.max() < 6 * 0.02 * READ


@pytest.mark.parametrize("bits", [8, 16])
def test_codes_are_the_nearest_ones(bits: int) -> None:
    truth, peak = glossy(), 2**bits - 1
    seen = observe(truth, Sensor(bits=bits), np.random.default_rng(0)).image
    coded = linear_to_srgb(seen.astype(float)) * peak
    assert np.abs(coded - np.rint(coded)).max() < 0.01
    assert (
        np.abs(coded - linear_to_srgb(np.minimum(truth.image.astype(float), 1)) * peak).max() < 0.51
    )
    steps = np.unique(seen[seen < 1])
    assert (len(steps) <= peak) if bits == 8 else (len(steps) > 256)


@pytest.mark.parametrize("bits", [8, 16])
def test_a_photo_reads_back_within_half_a_code(bits: int, tmp_path: Path) -> None:
    truth = glossy()
    write_photo(tmp_path / "photo.png", truth, bits)
    photo = read_photo(tmp_path / "photo.png")
    np.testing.assert_array_equal(photo.mask, truth.mask)
    assert (photo.original.bit_depth, photo.original.mask_from) == (bits, "alpha")
    error = linear_to_srgb(photo.image.astype(float)) - linear_to_srgb(
        np.minimum(truth.image.astype(float), 1)
    )
    assert np.abs(error).max() < 0.501 / (2**bits - 1)
    np.testing.assert_array_equal(
        photo.clipped, (linear_to_srgb(truth.image) > 1 - 0.5 / (2**bits - 1)).any(-1)
    )


@pytest.mark.parametrize("bits", [8, 16])
def test_a_photo_of_the_same_codes_reads_back_to_the_last_bit(bits: int, tmp_path: Path) -> None:
    seen = observe(glossy(), Sensor(noise=0.02, bits=bits), np.random.default_rng(0))
    write_photo(tmp_path / "photo.png", seen, bits)
    np.testing.assert_array_equal(read_photo(tmp_path / "photo.png").image, seen.image)


def test_codes_of_the_darkest_light_follow_the_linear_part_of_the_curve() -> None:
    seen = observe(flat(0.0013, 16), Sensor(bits=8), np.random.default_rng(0)).image
    np.testing.assert_allclose(seen, srgb_to_linear(4 / 255), rtol=1e-6)


def test_impossible_sensors_and_photos_are_refused(tmp_path: Path) -> None:
    for bits in (1, 12, -8):
        with pytest.raises(InputError, match="choose 8 or 16"):
            Sensor(bits=bits)
    for noise in (-0.1, 1.0, float("nan")):
        with pytest.raises(InputError, match="noise"):
            Sensor(noise=noise)
    for level in (0.0, -1.0, float("inf"), float("nan")):
        with pytest.raises(InputError, match="exposure"):
            Sensor(exposure_level=level)
    with pytest.raises(InputError, match="codes end at full scale"):
        Sensor(clip=False, bits=8)
    with pytest.raises(InputError, match="choose 8 or 16"):
        write_photo(tmp_path / "photo.png", glossy(), 0)
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="choose another place"):
        write_photo(tmp_path / "file" / "photo.png", glossy())
