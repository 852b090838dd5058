"""Sparse Coding: what it removes and what it must leave, the closed form, its invariants."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.optimize import nnls

from isc_core.errors import Cancelled, InputError
from isc_core.imaging.smoothing import masked_gaussian
from isc_core.progress import Monitor
from isc_core.scene.decomposition import Separation
from isc_core.separation.sparse_coding import VARIANTS, SparseCodingOptions, separate, stages
from tests.core.separation.scenes import read

RED, GREEN, PALE_GREEN = (
    np.array([0.8, 0.15, 0.1]),
    np.array([0.1, 0.6, 0.15]),
    np.array([0.62, 0.8, 0.64]),
)

# Linear Rec.709 to CIE XYZ, and the length of white light of 1 in every channel there.
XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)
WHITE = np.linalg.norm(XYZ.sum(axis=1))


def laboratory(shared: Path, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    folder = shared / "data/mit_berkeley_train/laboratory" / name
    mask = cv2.imread(str(folder / "mask.png"), cv2.IMREAD_GRAYSCALE) > 0
    return read(folder / "original.png"), read(folder / "diffuse.png"), mask


def left_over(split: Separation, image: np.ndarray, truth: np.ndarray, mask: np.ndarray) -> float:
    """The squared error of the diffuse layer as a share of that of the image itself."""
    return float(
        np.square(split.diffuse - truth)[mask].sum() / np.square(image - truth)[mask].sum()
    )


def glossy_scene(strength: float = 0.4) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Image, true specular (H, W) and mask: two albedos and a pale print on a shaded disc under
    white light, with one highlight.
    """
    y, x = np.mgrid[-1:1:100j, -1:1:120j]
    mask = x**2 + y**2 < 0.9
    shading = 0.4 + 0.6 * np.sqrt(np.clip(1 - x**2 - y**2, 0, 1))
    specular = strength * np.exp(-((x - 0.3) ** 2 + (y + 0.2) ** 2) / 0.03)
    albedo = np.where((x > 0)[..., None], RED, GREEN)
    print_ = (np.abs(y - 0.3) < 0.08) & (np.abs(x + 0.5) < 0.2)
    albedo = np.where(print_[..., None], PALE_GREEN, albedo)
    return (
        (albedo * shading[..., None] + specular[..., None]) * mask[..., None],
        specular * mask,
        mask,
    )


@pytest.mark.parametrize(("name", "most"), [("apple", 0.14), ("teabag2", 0.65), ("paper1", 1.0)])
def test_laboratory_objects(shared: Path, name: str, most: float) -> None:
    image, truth, mask = laboratory(shared, name)
    assert left_over(separate(image, mask), image, truth, mask) <= most + 1e-6


@pytest.mark.parametrize(("name", "most"), [("animals", 0.25), ("cups", 0.3)])
def test_published_images(shared: Path, name: str, most: float) -> None:
    image, truth = (
        read(shared / "data/highlight" / file) for file in (f"{name}.bmp", f"{name}_gt.bmp")
    )
    mask = np.ones(image.shape[:2], bool)
    assert left_over(separate(image, mask), image, truth, mask) <= most


@pytest.mark.parametrize(
    "name", ["box", "cup1", "dinosaur", "frog1", "panther", "phone", "squirrel"]
)
def test_near_grey_and_textured_objects_are_not_harmed(shared: Path, name: str) -> None:
    image, truth, mask = laboratory(shared, name)
    assert left_over(separate(image, mask), image, truth, mask) <= 1.005


@pytest.mark.parametrize(
    ("name", "most"), [("apple", 0.005), ("teabag2", 0.02), ("phone", 0.005), ("panther", 0.005)]
)
def test_photos_without_highlights_are_left_alone(shared: Path, name: str, most: float) -> None:
    _, matte, mask = laboratory(shared, name)
    removed = separate(matte, mask).specular[mask]
    assert np.square(removed).mean() <= most**2 * np.square(matte[mask]).mean()


def test_both_specular_free_images_beat_each(shared: Path) -> None:
    image, truth, mask = laboratory(shared, "teabag2")
    sf1, sf2, both = (
        left_over(
            separate(image, mask, SparseCodingOptions(specular_free=kind)), image, truth, mask
        )
        for kind in ("sf1", "sf2", "both")
    )
    assert both < min(sf1, sf2)


def test_a_highlight_goes_and_a_pale_print_stays() -> None:
    image, specular, mask = glossy_scene()
    split = separate(image, mask)
    assert np.mean((split.specular[..., 0] - specular)[mask] ** 2) < 0.03 * np.mean(
        specular[mask] ** 2
    )
    away = mask & (specular < 1e-3)
    assert split.specular[away].max() < 0.01
    plain = separate(image, mask, VARIANTS["paper"])
    assert plain.specular[away].max() > 0.2
    assert not separate(glossy_scene(0.0)[0], mask).specular.any()


@pytest.mark.parametrize("variant", VARIANTS)
def test_layers_hold(variant: str) -> None:
    image, _, mask = glossy_scene()
    split = separate(image, mask, VARIANTS[variant])
    assert np.abs(split.diffuse + split.specular + split.residual - image)[mask].max() < 1e-6
    assert (
        (split.diffuse >= 0).all()
        and (split.diffuse <= image + 1e-6).all()
        and split.specular.min() >= 0
    )
    assert all(
        np.isfinite(layer).all() and not layer[~mask].any()
        for layer in (split.diffuse, split.specular, split.confidence)
    )


@pytest.mark.slow
@pytest.mark.parametrize("variant", VARIANTS)
def test_scale_surroundings_and_transposition_do_not_matter(variant: str) -> None:
    image, _, mask = glossy_scene()
    split = separate(image, mask, VARIANTS[variant])
    padded = np.pad(image, [(9, 9), (9, 9), (0, 0)], constant_values=np.nan)
    wide = separate(64 * padded, np.pad(mask, 9), VARIANTS[variant])
    assert np.allclose(wide.diffuse[9:-9, 9:-9], 64 * split.diffuse, atol=1e-3)
    turned = separate(image.transpose(1, 0, 2), mask.T, VARIANTS[variant])
    assert np.allclose(turned.diffuse.transpose(1, 0, 2), split.diffuse, atol=1e-6)


def test_plain_code_is_the_optimum() -> None:
    """The code equals non-negative least squares, min |A x - y|, x >= 0, without the L1 penalty.

    The diffuse layer of a pixel that lies below the image in every channel is a multiple of its
    atom, and so gives the atom's direction.
    """
    image, _, mask = glossy_scene()
    options = replace(VARIANTS["paper"], sparsity=0.0)
    diffuse = separate(image, mask, options).diffuse.astype(np.float64)
    free = mask & ((diffuse > 1e-4) & (diffuse < image - 1e-6)).all(axis=2)
    assert free.sum() > 0.5 * mask.sum()
    for y, x in np.argwhere(free)[::50]:
        atom = XYZ @ diffuse[y, x] / np.linalg.norm(XYZ @ diffuse[y, x])
        code, _ = nnls(np.stack([atom, XYZ.sum(axis=1) / WHITE], axis=1), XYZ @ image[y, x])
        assert XYZ @ diffuse[y, x] == pytest.approx(code[0] * atom, abs=1e-6)


def test_specular_light_does_not_move_the_specular_free_part() -> None:
    image, specular, mask = glossy_scene()
    with_light, without = (
        stages(picture, mask, mask) for picture in (image, image - specular[..., None])
    )
    assert np.allclose(with_light.alpha, without.alpha, atol=1e-6)
    assert np.allclose(
        np.exp(2j * np.pi * with_light.hue)[mask], np.exp(2j * np.pi * without.hue)[mask], atol=1e-5
    )
    smoothed = masked_gaussian(specular, mask, VARIANTS["improved"].blur)
    assert (with_light.brightness - without.brightness)[mask] == pytest.approx(
        smoothed[mask] * WHITE, abs=1e-9
    )


def test_small_and_odd_masks() -> None:
    image, _, mask = glossy_scene()
    single = np.zeros_like(mask)
    single[50, 50] = True
    assert np.isfinite(separate(image, single).diffuse).all()
    holes = mask & (np.random.default_rng(0).random(mask.shape) < 0.5)
    assert np.isfinite(separate(image, holes).diffuse).all()
    noisy = np.maximum(
        np.round(image * 20) / 255 + np.random.default_rng(1).normal(0, 0.01, image.shape), 0
    )
    for options in VARIANTS.values():
        assert np.isfinite(separate(noisy, mask, options).diffuse).all()


def test_clipped_highlight_is_filled_from_around() -> None:
    scene, specular, mask = glossy_scene(0.8)
    clipped = mask & (scene >= 1.0).any(axis=2)
    assert clipped.sum() > 20
    split = separate(np.minimum(scene, 1.0), mask, clipped=clipped)
    error = np.square(split.diffuse - (scene - specular[..., None]))[clipped].mean()
    assert error < 0.1 * np.square(specular[clipped]).mean() and not split.confidence[clipped].any()


def test_invalid_input_is_refused() -> None:
    image, _, mask = glossy_scene()
    with pytest.raises(InputError, match="no colour"):
        separate(np.repeat(image[..., :1], 3, axis=2), mask)
    with pytest.raises(InputError, match="specular_free"):
        separate(image, mask, SparseCodingOptions(specular_free="sf3"))
    with pytest.raises(InputError, match="hues"):
        separate(image, mask, SparseCodingOptions(hues=2))
    with pytest.raises(InputError, match="sparsity"):
        separate(image, mask, SparseCodingOptions(sparsity=1.0))
    with pytest.raises(Cancelled):
        separate(image, mask, monitor=Monitor(cancelled=lambda: True))
