"""Shen & Zheng 2013: published figures, the layers' identities, and what it must leave alone."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from isc_core.errors import InputError
from isc_core.imaging.channels import fade_in
from isc_core.inpainting.pull_push import fill
from isc_core.separation import METHODS, separate
from isc_core.separation.published import shen_2013
from isc_core.separation.published.shen_2013 import VARIANTS, Shen2013Options
from tests.core.separation.scenes import assert_layers_hold, read

RED, GREEN = np.array([0.7, 0.25, 0.15]), np.array([0.2, 0.6, 0.15])


def glossy_scene() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Image, true specular (H, W) and mask: two paints on a shaded disc under white light, with one
    highlight.
    """
    y, x = np.mgrid[-1:1:80j, -1:1:100j]
    mask = x**2 + y**2 < 0.9
    shading = 0.4 + 0.6 * np.sqrt(np.clip(1 - x**2 - y**2, 0, 1))
    specular = 0.5 * np.exp(-((x - 0.4) ** 2 + (y + 0.2) ** 2) / 0.02)
    paint = np.where((x > 0)[..., None], RED, GREEN)
    return (
        (paint * shading[..., None] + specular[..., None]) * mask[..., None],
        specular * mask,
        mask,
    )


FIGURES = {"improved": (37.5, 39.5), "paper": (37.3, 39.2), "sihr": (37.5, 38.3)}


@pytest.mark.parametrize("variant", list(VARIANTS))
def test_published_figures(shared: Path, variant: str) -> None:
    for name, psnr in zip(("animals", "cups"), FIGURES[variant], strict=True):
        image, truth = (
            read(shared / "data/highlight" / file) for file in (f"{name}.bmp", f"{name}_gt.bmp")
        )
        split = shen_2013.separate(image, np.ones(image.shape[:2], bool), VARIANTS[variant])
        got = -10 * np.log10(np.mean((split.diffuse - truth) ** 2))
        assert got == pytest.approx(psnr, abs=0.06)


@pytest.mark.parametrize("name", ["animals", "cups"])
def test_trusted_pixels_err_less(shared: Path, name: str) -> None:
    image, truth = (
        read(shared / "data/highlight" / file) for file in (f"{name}.bmp", f"{name}_gt.bmp")
    )
    split = shen_2013.separate(image, np.ones(image.shape[:2], bool))
    error = ((split.diffuse - truth) ** 2).mean(axis=2).ravel()
    ascending = error[np.argsort(split.confidence.ravel(), kind="stable")]
    assert ascending[len(error) // 4 :].mean() < 0.4 * error.mean()


def test_mask_statistics_on_apple(shared: Path) -> None:
    folder = shared / "data/mit_berkeley_train/laboratory/apple"
    image, truth = read(folder / "original.png"), read(folder / "diffuse.png")
    mask = cv2.imread(str(folder / "mask.png"), cv2.IMREAD_GRAYSCALE) > 0
    split = shen_2013.separate(image, mask)
    assert_layers_hold(split, image, mask)
    assert np.mean((split.diffuse - truth)[mask] ** 2) <= 0.2 * np.mean((image - truth)[mask] ** 2)


@pytest.mark.parametrize("name", ["box", "dinosaur", "squirrel", "teabag2"])
def test_pale_objects_are_not_taken_for_highlights(shared: Path, name: str) -> None:
    folder = shared / "data/mit_berkeley_train/laboratory" / name
    image, truth = read(folder / "original.png"), read(folder / "diffuse.png")
    mask = cv2.imread(str(folder / "mask.png"), cv2.IMREAD_GRAYSCALE) > 0
    split = shen_2013.separate(image, mask)
    assert np.mean((split.diffuse - truth)[mask] ** 2) <= 1.01 * np.mean((image - truth)[mask] ** 2)


def test_recovers_a_rendered_highlight() -> None:
    image, specular, mask = glossy_scene()
    split = shen_2013.separate(image, mask)
    assert_layers_hold(split, image, mask)
    error = np.mean((split.specular[..., 0] - specular)[mask] ** 2)
    assert error < 0.05 * np.mean(specular[mask] ** 2)
    assert not split.residual.any()


def test_scale_and_surroundings_do_not_matter() -> None:
    image, _, mask = glossy_scene()
    split = shen_2013.separate(image, mask)
    padded_mask = np.pad(mask, 17)
    padded = np.pad(image, [(17, 17), (17, 17), (0, 0)], constant_values=0.8)
    wide = shen_2013.separate(1000 * padded, padded_mask)
    assert np.allclose(wide.specular[17:-17, 17:-17], 1000 * split.specular, atol=1e-3)
    assert np.allclose(wide.confidence[17:-17, 17:-17], split.confidence, atol=1e-4)


def test_the_whole_frame_counts_for_the_toolbox_alone() -> None:
    image, _, mask = glossy_scene()
    lit = np.where(mask[..., None], image, 0.9)
    for name, differs in (("improved", False), ("paper", False), ("sihr", True)):
        dark, bright = (shen_2013.separate(scene, mask, VARIANTS[name]) for scene in (image, lit))
        assert differs == (np.abs(dark.diffuse - bright.diffuse).max() > 1e-3)
        assert_layers_hold(bright, lit, mask)
        for unknown in (np.nan, np.inf):
            blind = shen_2013.separate(
                np.where(mask[..., None], image, unknown), mask, VARIANTS[name]
            )
            assert np.allclose(blind.diffuse, dark.diffuse, atol=1e-6)


def test_the_specular_layer_fades_in_without_a_jump() -> None:
    image, _, mask = glossy_scene()
    low = image.min(axis=2)
    rim = mask & (low > low[mask].mean()) & (low < 1.02 * low[mask].mean())
    paper, improved = (
        shen_2013.separate(image, mask, VARIANTS[name]).specular[rim].max()
        for name in ("paper", "improved")
    )
    assert improved <= 0.04 * paper + 1e-6


@pytest.mark.parametrize("value", [0.0, 0.5])
def test_achromatic_photo_is_refused(value: float) -> None:
    ramp = np.linspace(value, 2 * value, 40)
    image = np.broadcast_to(ramp[None, :, None], (30, 40, 3))
    with pytest.raises(InputError, match="no colour"):
        shen_2013.separate(image, np.ones((30, 40), bool))


def test_clipped_highlight_is_filled_from_around() -> None:
    scene, specular, mask = glossy_scene()
    image = np.minimum(scene, 0.85)
    clipped = (scene >= 0.85).any(axis=2) & mask
    assert clipped.sum() > 20
    split = shen_2013.separate(image, mask, clipped=clipped)
    assert_layers_hold(split, image, mask)
    assert (
        not split.residual[~clipped].any()
        and not split.confidence[clipped].any()
        and split.residual.max() <= 1e-7
    )
    truth = scene - specular[..., None]
    blind = shen_2013.separate(image, mask)
    error, blind_error = (np.mean((s.diffuse - truth)[clipped] ** 2) for s in (split, blind))
    assert error < 0.1 * blind_error
    assert np.mean((split.specular[..., 0] - specular)[clipped] ** 2) < 0.05 * np.mean(
        specular[clipped] ** 2
    )


def test_fill_carries_a_plane_across_a_hole() -> None:
    y, x = np.mgrid[:61, :47].astype(float)
    plane = (0.3 + 0.004 * x + 0.002 * y)[..., None]
    known = np.hypot(x - 20, y - 30) > 6
    filled = fill(np.where(known[..., None], plane, 9.0), known)
    assert np.array_equal(filled[known], plane.astype(np.float32)[known])
    assert np.abs(filled - plane).max() < 0.01


def test_names() -> None:
    image, _, mask = glossy_scene()
    nothing = separate("none", image, mask)
    assert np.allclose(nothing.diffuse[mask], image[mask]) and not nothing.specular.any()
    for method in METHODS:
        assert_layers_hold(separate(method, image, mask), image, mask, tinted=method == "network")
    with pytest.raises(InputError, match="choose one of none, .*shen_2013"):
        separate("magic", image, mask)


def test_refuses_what_it_cannot_use() -> None:
    image, _, mask = glossy_scene()
    with pytest.raises(InputError, match="mask is empty"):
        shen_2013.separate(image, np.zeros_like(mask))
    with pytest.raises(InputError, match="like the image"):
        shen_2013.separate(image, mask[1:])
    with pytest.raises(InputError, match="colour image"):
        shen_2013.separate(image[..., 0], mask)
    with pytest.raises(InputError, match="non-finite"):
        shen_2013.separate(np.where(mask[..., None], np.nan, image), mask)
    with pytest.raises(InputError, match="bright_saturation"):
        shen_2013.separate(image, mask, Shen2013Options(bright_saturation=1.1))
    with pytest.raises(InputError, match="cluster_radius"):
        shen_2013.separate(image, mask, Shen2013Options(cluster_radius=0))


def test_bright_pixels_above_a_black_base_count_in_full() -> None:
    with np.errstate(all="raise"):
        np.testing.assert_array_equal(
            fade_in(np.array([0, 1e-3, 1e12], np.float32), 0.0, 0.2), [0, 1, 1]
        )
        np.testing.assert_allclose(
            fade_in(np.array([0.4, 0.55, 0.7], np.float32), 0.5, 0.2), [0, 0.5, 1], atol=1e-6
        )
