"""Shen & Zheng 2013: confidence, the whole frame, fading in, clipped highlights."""

from pathlib import Path

import numpy as np
import pytest

from isc_core.errors import InputError
from isc_core.imaging.channels import fade_in
from isc_core.inpainting.pull_push import fill
from isc_core.separation import METHODS, separate
from isc_core.separation.published import shen_2013
from isc_core.separation.published.shen_2013 import VARIANTS
from tests.core.separation.scenes import assert_layers_hold, disc_of_two, highlight_photo


@pytest.mark.parametrize("name", ["animals", "cups"])
def test_pixels_of_high_confidence_have_a_smaller_error(shared: Path, name: str) -> None:
    image, truth, mask = highlight_photo(shared, name)
    split = shen_2013.separate(image, mask)
    error = ((split.diffuse - truth) ** 2).mean(axis=2).ravel()
    ascending = error[np.argsort(split.confidence.ravel(), kind="stable")]
    assert ascending[len(error) // 4 :].mean() < 0.4 * error.mean()


def test_the_whole_frame_counts_for_the_toolbox_alone() -> None:
    image, _, mask = disc_of_two()
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
    image, _, mask = disc_of_two()
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
    scene, truth, mask = disc_of_two()
    specular = (scene - truth)[..., 0]
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


@pytest.mark.slow
def test_every_method_has_sound_layers() -> None:
    image, _, mask = disc_of_two()
    nothing = separate("none", image, mask)
    assert np.allclose(nothing.diffuse[mask], image[mask]) and not nothing.specular.any()
    for method in METHODS:
        assert_layers_hold(separate(method, image, mask), image, mask, tinted=method == "network")
    with pytest.raises(InputError, match="choose one of none, .*shen_2013"):
        separate("magic", image, mask)


def test_bright_pixels_above_a_black_base_count_in_full() -> None:
    with np.errstate(all="raise"):
        np.testing.assert_array_equal(
            fade_in(np.array([0, 1e-3, 1e12], np.float32), 0.0, 0.2), [0, 1, 1]
        )
        np.testing.assert_allclose(
            fade_in(np.array([0.4, 0.55, 0.7], np.float32), 0.5, 0.2), [0, 0.5, 1], atol=1e-6
        )
