"""The baselines on scenes of known shape, light and albedo."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from isc_core import baselines
from isc_core.baselines import ikeuchi_horn_1981, naive, retinex, tsai_shah_1994
from isc_core.baselines.box import Box
from isc_core.baselines.light_direction import estimate_light
from isc_core.baselines.light_fit import fit_light
from isc_core.baselines.poisson import integrate
from isc_core.errors import InputError
from isc_core.shading.spherical_harmonics import (
    normal_from_reference,
    normal_to_reference,
    reference_basis,
)
from isc_core.shading.surface_stencils import normals

SIZE = 100


@dataclass(frozen=True)
class Shape:
    """`height` (H, W), `normal` (H, W, 3) in our frame, `mask` (H, W)."""

    height: np.ndarray
    normal: np.ndarray
    mask: np.ndarray

    def lit(self, light: np.ndarray) -> np.ndarray:
        """Brightness (H, W) under one distant light."""
        return np.where(self.mask, np.maximum(self.normal @ light, 0), 0)

    def normal_error(self, height: np.ndarray) -> float:
        """Mean angle in degrees between the true normals and those of `height`, in the mask."""
        found = normal_from_reference(normals(height))
        cosine = np.clip((found * self.normal).sum(axis=2)[self.mask], -1, 1)
        return float(np.rad2deg(np.arccos(cosine)).mean())

    @property
    def flat_error(self) -> float:
        return self.normal_error(np.zeros(self.mask.shape))

    def correlation(self, height: np.ndarray) -> float:
        return float(np.corrcoef(height[self.mask], self.height[self.mask])[0, 1])


def grid() -> tuple[np.ndarray, np.ndarray]:
    """x right, y up, pixels from the centre."""
    rows, columns = np.mgrid[:SIZE, :SIZE].astype(float)
    return columns - SIZE / 2, SIZE / 2 - rows


def hemisphere() -> Shape:
    x, y = grid()
    radius = 0.4 * SIZE
    z = np.sqrt(np.maximum(radius**2 - x**2 - y**2, 0))
    return Shape(z, np.stack([x, y, z], axis=-1) / radius, np.hypot(x, y) < radius)


def bumps() -> Shape:
    """Two hills and a dent that fill the frame, so that there is no contour to learn from."""
    x, y = grid()
    height, p, q = np.zeros_like(x), np.zeros_like(x), np.zeros_like(x)
    for across, up, width, tall in ((-15, 10, 14, 10), (20, -15, 12, 8), (10, 25, 10, -6)):
        hill = tall * np.exp(-((x - across) ** 2 + (y - up) ** 2) / (2 * width**2))
        height, p, q = (
            height + hill,
            p - hill * (x - across) / width**2,
            q - hill * (y - up) / width**2,
        )
    normal = np.stack([-p, -q, np.ones_like(p)], axis=-1)
    return Shape(
        height, normal / np.linalg.norm(normal, axis=-1, keepdims=True), np.ones(x.shape, bool)
    )


def light_from(slant: float, tilt: float, length: float = 0.8) -> np.ndarray:
    s, t = np.deg2rad([slant, tilt])
    return length * np.array([np.sin(s) * np.cos(t), np.sin(s) * np.sin(t), np.cos(s)])


def normals_and_shading(shape: Shape, light: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Log image (H, W, 3) and log shading (H, W) of a shape with coloured stripes."""
    x, _ = grid()
    albedo = np.where((np.floor(x / 9) % 2 == 0)[..., None], [0.8, 0.4, 0.3], [0.1, 0.2, 0.25])
    shading = np.log(np.maximum(shape.lit(light), 0.02)) * shape.mask
    return (np.log(albedo) + shading[..., None]) * shape.mask[..., None], shading


LIGHTS = [(0, 0), (20, 45), (35, 135), (45, -60)]


@pytest.mark.parametrize(("slant", "tilt"), LIGHTS)
def test_ikeuchi_horn_recovers_a_hemisphere(slant: float, tilt: float) -> None:
    shape = hemisphere()
    for light in (
        light_from(slant, tilt),
        estimate_light(shape.lit(light_from(slant, tilt)), shape.mask),
    ):
        height = ikeuchi_horn_1981.height_from_brightness(
            shape.lit(light_from(slant, tilt)), shape.mask, light
        )
        assert shape.normal_error(height) < 0.3 * shape.flat_error
        assert shape.correlation(height) > 0.95
        assert np.std(height[shape.mask]) == pytest.approx(
            np.std(shape.height[shape.mask]), rel=0.45
        )


@pytest.mark.parametrize(("slant", "tilt"), LIGHTS[1:])
def test_ikeuchi_horn_finds_bumps_without_a_contour(slant: float, tilt: float) -> None:
    shape, light = bumps(), light_from(slant, tilt)
    height = ikeuchi_horn_1981.height_from_brightness(shape.lit(light), shape.mask, light)
    assert shape.normal_error(height) < 0.85 * shape.flat_error
    assert shape.correlation(height) > 0.3


@pytest.mark.parametrize("make", [hemisphere, bumps])
@pytest.mark.parametrize(("slant", "tilt"), LIGHTS[2:])
def test_tsai_shah_beats_flat_under_slanted_light(
    make: Callable[[], Shape], slant: float, tilt: float
) -> None:
    shape, light = make(), light_from(slant, tilt)
    height = tsai_shah_1994.height_from_brightness(shape.lit(light), shape.mask, light)
    assert shape.normal_error(height) < 0.8 * shape.flat_error
    assert shape.correlation(height) > 0.55


@pytest.mark.parametrize(("slant", "tilt"), [*LIGHTS, (60, 100)])
def test_light_of_a_sphere(slant: float, tilt: float) -> None:
    shape, light = hemisphere(), light_from(slant, tilt)
    brightness = np.where(shape.mask, shape.lit(light), 9.0)
    found = estimate_light(brightness, shape.mask)
    assert np.linalg.norm(found - light) < 0.03 * np.linalg.norm(light)


def test_light_of_a_uniform_patch_is_frontal() -> None:
    found = estimate_light(np.full((40, 40), 0.3), np.ones((40, 40), bool))
    assert found[:2] == pytest.approx([0, 0]) and found[2] > 0
    assert np.isfinite(estimate_light(np.zeros((9, 9)), np.ones((9, 9), bool))).all()


def test_integration_is_exact_for_a_surface_and_separate_for_parts() -> None:
    rng = np.random.default_rng(3)
    rows, columns = np.mgrid[:70, :91]
    wanted = rng.normal(size=(70, 91, 2)).cumsum(axis=0).cumsum(axis=1)
    mask = np.hypot(rows - 35, columns - 40) < 30
    mask[30:40, 30:36] = False
    mask[5:12, 80:90] = True
    mask[60, 2] = True
    right, down = np.full_like(wanted, 1e6), np.full_like(wanted, -1e6)
    right[:, :-1][mask[:, 1:] & mask[:, :-1]] = np.diff(wanted, axis=1)[mask[:, 1:] & mask[:, :-1]]
    down[:-1][mask[1:] & mask[:-1]] = np.diff(wanted, axis=0)[mask[1:] & mask[:-1]]
    found = integrate(right, down, mask, tolerance=1e-10)
    assert not found[~mask].any() and found[60, 2] == pytest.approx(0)
    for part in (
        mask & (columns < 75) & (rows != 60) | (mask & (columns > 3) & (columns < 75)),
        mask & (columns >= 75),
    ):
        part_wanted = wanted[part] - wanted[part].mean(axis=0)
        assert np.abs(found[part] - part_wanted).max() < 1e-6 * np.abs(part_wanted).max()
    assert np.allclose(integrate(right[..., 1], down[..., 1], mask, tolerance=1e-10), found[..., 1])


def test_integration_minimises_the_squares() -> None:
    rng = np.random.default_rng(4)
    right, down = rng.normal(size=(2, 30, 32))
    mask = np.ones((30, 32), bool)
    mask[10:14, 5:20] = False

    def misfit(z: np.ndarray) -> float:
        horizontal, vertical = mask[:, 1:] & mask[:, :-1], mask[1:] & mask[:-1]
        return float(
            ((np.diff(z, axis=1) - right[:, :-1])[horizontal] ** 2).sum()
            + ((np.diff(z, axis=0) - down[:-1])[vertical] ** 2).sum()
        )

    best = integrate(right, down, mask, tolerance=1e-10)
    for _ in range(10):
        assert misfit(best + 1e-3 * rng.normal(size=mask.shape)) > misfit(best)


def test_integration_is_the_same_on_any_number_of_threads_and_for_tiny_steps() -> None:
    rng = np.random.default_rng(6)
    right, down = rng.normal(size=(2, 50, 60))
    mask = rng.random((50, 60)) < 0.7
    found = []
    for threads in (1, 3):
        with threadpool_limits(threads):
            found.append(integrate(right, down, mask))
    np.testing.assert_array_equal(*found)
    np.testing.assert_allclose(
        integrate(1e-200 * right, 1e-200 * down, mask) * 1e200, found[0], atol=1e-9
    )


def test_fit_light_returns_the_light_that_was_used() -> None:
    shape = hemisphere()
    light = np.random.default_rng(5).normal(size=(9, 3)) * 0.3
    log_shading = reference_basis(shape.normal) @ light
    reference = normal_to_reference(shape.normal)
    assert np.abs(fit_light(log_shading, reference, shape.mask, ridge=1e-10) - light).max() < 1e-5
    misfit = log_shading - reference_basis(shape.normal) @ fit_light(
        log_shading, reference, shape.mask
    )
    assert np.std(misfit[shape.mask]) < 0.05 * np.std(log_shading[shape.mask])


def test_fit_light_of_a_flat_shape_comes_from_everywhere() -> None:
    flat = np.zeros((20, 20, 3))
    flat[..., 2] = 1
    light = fit_light(np.full((20, 20, 3), -0.7), flat, np.ones((20, 20), bool))
    assert np.abs(light[1:]).max() < 1e-6
    assert reference_basis(np.array([0.0, 0.0, 1.0])) @ light == pytest.approx([-0.7] * 3)


def test_naive_is_flat_and_dark() -> None:
    log_image, _ = normals_and_shading(hemisphere(), light_from(35, 135))
    answer = naive.estimate(log_image, hemisphere().mask)
    assert not answer.height.any() and not answer.light.any() and not answer.log_shading.any()


def test_retinex_takes_paint_off_the_shading() -> None:
    shape = bumps()
    log_image, truth = normals_and_shading(shape, light_from(45, -60))
    found = retinex.log_shading(log_image, shape.mask)
    for channel in range(3):
        # What a best level leaves, for the method and for the photo itself taken as shading.
        error, photo_error = (
            np.std((guess[..., channel] - truth)[shape.mask]) for guess in (found, log_image)
        )
        assert error < 0.2 * min(photo_error, float(truth.std()))


def test_retinex_leaves_the_overall_colour_in_the_reflectance() -> None:
    log_image, _ = normals_and_shading(hemisphere(), light_from(20, 45))
    mask = hemisphere().mask
    tinted = log_image + np.log([3.0, 1.0, 0.2])
    assert np.allclose(
        retinex.log_shading(tinted, mask), retinex.log_shading(log_image, mask), atol=1e-8
    )


def test_retinex_keeps_the_shape_that_paint_hides_from_plain_shading() -> None:
    shape = hemisphere()
    log_image, _ = normals_and_shading(shape, light_from(20, 45))
    answer = retinex.estimate(log_image, shape.mask)
    assert shape.normal_error(answer.height) < 0.6 * shape.flat_error
    assert shape.correlation(answer.height) > 0.8


@pytest.mark.parametrize("method", baselines.METHODS)
def test_empty_background_changes_nothing(method: str) -> None:
    log_image, _ = normals_and_shading(hemisphere(), light_from(35, 135))
    mask = hemisphere().mask
    plain = baselines.estimate(method, log_image, mask)
    pads = [(11, 30), (0, 7)]
    wide = baselines.estimate(
        method, np.pad(log_image, [*pads, (0, 0)], constant_values=-3.0), np.pad(mask, pads)
    )
    inner = (slice(11, 11 + SIZE), slice(0, SIZE))
    assert np.allclose(wide.height[inner][mask], plain.height[mask], atol=1e-9)
    assert np.allclose(wide.log_shading[inner], plain.log_shading, atol=1e-9)
    assert np.allclose(wide.light, plain.light, atol=1e-9)


@pytest.mark.parametrize("method", baselines.METHODS)
def test_light_and_height_explain_the_shading(method: str) -> None:
    shape = hemisphere()
    brightness = np.maximum(shape.lit(light_from(35, 135)), 0.02)
    log_image = (np.log(brightness)[..., None] + np.log([0.6, 0.5, 0.4])) * shape.mask[..., None]
    answer = baselines.estimate(method, log_image, shape.mask)
    shading = reference_basis(normal_from_reference(normals(answer.height))) @ answer.light
    left = (answer.log_shading - shading)[shape.mask]
    spread = answer.log_shading[shape.mask].std()
    assert left.std() <= 0.75 * spread
    assert not answer.log_shading[~shape.mask].any()


def odd_masks() -> list[np.ndarray]:
    masks = [np.zeros((23, 31), bool) for _ in range(5)]
    masks[0][7, 9] = True
    masks[1][4, :] = True
    masks[2][5:7, 3:5] = masks[2][15:20, 20:29] = True
    masks[3][:] = True
    masks[4][::2, ::2] = True
    return [*masks, np.ones((1, 1), bool), np.ones((40, 1), bool)]


@pytest.mark.parametrize("method", baselines.METHODS)
@pytest.mark.parametrize("mask", odd_masks())
@pytest.mark.parametrize("spread", [0.0, 3.0])
def test_irregular_masks_give_finite_results(method: str, mask: np.ndarray, spread: float) -> None:
    log_image = np.where(
        mask[..., None], -9 + spread * np.random.default_rng(1).random((*mask.shape, 3)), np.nan
    )
    answer = baselines.estimate(method, log_image, mask)
    assert (
        answer.height.shape == mask.shape
        and answer.log_shading.shape == (*mask.shape, 3)
        and answer.light.shape == (9, 3)
    )
    assert (
        np.isfinite(answer.height).all()
        and np.isfinite(answer.log_shading).all()
        and np.isfinite(answer.light).all()
    )


def test_box_goes_there_and_back() -> None:
    mask = np.zeros((20, 30), bool)
    mask[0:7, 9:25] = True
    box = Box.of(mask)
    assert box.crop(mask).shape == (7 + 3, 16 + 6)
    values = np.random.default_rng(2).normal(size=mask.shape)
    back = box.place(box.crop(values * mask))
    assert back.shape == mask.shape and np.array_equal(back[mask], values[mask])


def test_invalid_input_is_refused() -> None:
    log_image, mask = np.zeros((8, 9, 3)), np.ones((8, 9), bool)
    with pytest.raises(InputError, match="naive, retinex, sfs-tsai-shah, sfs-ikeuchi-horn"):
        baselines.estimate("magic", log_image, mask)
    for method in baselines.METHODS:
        with pytest.raises(InputError, match="mask is empty"):
            baselines.estimate(method, log_image, ~mask)
        with pytest.raises(InputError, match="like the image"):
            baselines.estimate(method, log_image, mask[1:])
        with pytest.raises(InputError, match="colour image"):
            baselines.estimate(method, log_image[..., 0], mask)
        with pytest.raises(InputError, match="not finite"):
            baselines.estimate(method, log_image - np.inf, mask)
