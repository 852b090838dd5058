"""Yang, Wang & Ahuja 2010: published figures, what the filter leaves invariant, and what it must
leave alone.
"""

from pathlib import Path

import numpy as np
import pytest

from isc_core.errors import Cancelled, InputError
from isc_core.progress import Monitor
from isc_core.separation.published import yang_2010
from isc_core.separation.published.yang_2010 import VARIANTS, Yang2010Options
from tests.core.separation.scenes import (
    assert_any_mask_and_noise_keep_the_layers_sound,
    assert_clipped_cores_are_filled_and_inform_nobody,
    assert_layers_hold,
    assert_scale_and_surroundings_do_not_matter,
    error_ratio,
    glossy_disc,
    highlight_photo,
    laboratory_photo,
    psnr,
)


@pytest.mark.parametrize(
    ("name", "published", "improved"), [("animals", 36.46, 37.3), ("cups", 37.50, 38.4)]
)
def test_figures(shared: Path, name: str, published: float, improved: float) -> None:
    image, truth, mask = highlight_photo(shared, name)
    assert psnr(yang_2010.separate(image, mask, VARIANTS["sihr"]), truth) == pytest.approx(
        published, abs=0.05
    )
    assert psnr(yang_2010.separate(image, mask), truth) > improved


def test_mask_statistics_on_apple(shared: Path) -> None:
    image, truth, mask = laboratory_photo(shared, "apple")
    split = yang_2010.separate(image, mask)
    assert_layers_hold(split, image, mask)
    assert error_ratio(split, image, truth, mask) < 0.18


@pytest.mark.parametrize("name", ["box", "phone", "squirrel", "teabag2"])
def test_pale_objects_are_left_alone(shared: Path, name: str) -> None:
    image, truth, mask = laboratory_photo(shared, name)
    assert error_ratio(yang_2010.separate(image, mask), image, truth, mask) <= 1 + 1e-3
    assert error_ratio(yang_2010.separate(image, mask, VARIANTS["paper"]), image, truth, mask) > 20


@pytest.mark.parametrize("variant", list(VARIANTS))
def test_highlights_on_three_paints(variant: str) -> None:
    image, diffuse, mask = glossy_disc()
    split = yang_2010.separate(image, mask, VARIANTS[variant])
    assert_layers_hold(split, image, mask)
    assert error_ratio(split, image, diffuse, mask) < 0.03


@pytest.mark.parametrize("variant", ["improved", "paper"])
def test_matte_paint_is_left_alone(variant: str) -> None:
    _, diffuse, mask = glossy_disc()
    split = yang_2010.separate(diffuse, mask, VARIANTS[variant])
    assert np.sqrt(np.mean(split.specular[mask] ** 2)) < 0.005 * np.sqrt(
        np.mean(diffuse[mask] ** 2)
    )


@pytest.mark.parametrize(
    ("variant", "scale"), [("improved", 1000.0), ("improved", 1e-5), ("paper", 1.0)]
)
def test_scale_and_surroundings_do_not_matter(variant: str, scale: float) -> None:
    assert_scale_and_surroundings_do_not_matter(
        yang_2010.separate, VARIANTS[variant], scale, least=0.4
    )


@pytest.mark.parametrize("variant", list(VARIANTS))
def test_any_mask_and_noise_keep_the_layers_sound(variant: str) -> None:
    assert_any_mask_and_noise_keep_the_layers_sound(yang_2010.separate, VARIANTS[variant])


def test_the_filter_is_a_mean_over_places_and_guide() -> None:
    random = np.random.default_rng(0)
    used = random.random((30, 45)) > 0.3
    options = Yang2010Options()
    guide = np.where(np.arange(used.sum()) % 2, 0.4, 0.9)
    grid = yang_2010._grid(used, used, guide, options)
    assert np.allclose(yang_2010._filtered(np.full(len(guide), 0.37), grid), 0.37)
    assert np.allclose(
        yang_2010._filtered(guide, grid), guide
    )  # the two guides are too far apart to mix
    smooth = yang_2010._filtered(random.random(len(guide)), grid)
    assert smooth.std() < 0.05 and abs(smooth.mean() - 0.5) < 0.05


def test_clipped_cores_are_filled_from_around_and_inform_nobody() -> None:
    assert_clipped_cores_are_filled_and_inform_nobody(yang_2010.separate, at_most=0.05)


def test_refuses_what_it_cannot_use() -> None:
    image, _, mask = glossy_disc()
    with pytest.raises(InputError, match="no colour"):
        yang_2010.separate(np.repeat(image[..., :1], 3, axis=2), mask)
    with pytest.raises(InputError, match="mask is empty"):
        yang_2010.separate(image, np.zeros_like(mask))
    wrongs = [
        {"spatial_sigma": 0},
        {"range_sigma": 0},
        {"tolerance": 0},
        {"rounds": 0},
        {"dark": -1},
        {"spatial_sigma": np.inf},
    ]
    for wrong in wrongs:
        with pytest.raises(InputError, match="range_sigma"):
            yang_2010.separate(image, mask, Yang2010Options(**wrong))
    with pytest.raises(Cancelled):
        yang_2010.separate(image, mask, monitor=Monitor(cancelled=lambda: True))


@pytest.mark.parametrize("variant", list(VARIANTS))
def test_black_pixels_have_no_chromaticity_in_single_precision_either(variant: str) -> None:
    image, _, mask = glossy_disc()
    image[40:50, 50:60] = 0
    double, single = (
        yang_2010.separate(image.astype(kind), mask, VARIANTS[variant])
        for kind in (np.float64, np.float32)
    )
    assert double.specular.max() > 0.4 and np.abs(single.specular - double.specular).max() < 1e-4


def test_single_precision_on_apple(shared: Path) -> None:
    image, truth, mask = laboratory_photo(shared, "apple")
    image = np.where(mask[..., None], image, 0).astype(np.float32)
    assert error_ratio(yang_2010.separate(image, mask, VARIANTS["sihr"]), image, truth, mask) < 0.35
