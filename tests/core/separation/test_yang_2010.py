"""Yang, Wang & Ahuja 2010: its filter, and single precision."""

from pathlib import Path

import numpy as np
import pytest

from isc_core.separation.published import yang_2010
from isc_core.separation.published.yang_2010 import VARIANTS, Yang2010Options
from tests.core.separation.scenes import error_ratio, glossy_disc, laboratory_photo


def test_the_filter_is_a_mean_over_places_and_guide() -> None:
    random = np.random.default_rng(0)
    used = random.random((30, 45)) > 0.3
    options = Yang2010Options()
    guide = np.where(np.arange(used.sum()) % 2, 0.4, 0.9)
    grid = yang_2010.make_grid(used, used, guide, options)
    assert np.allclose(yang_2010.filter_in_grid(np.full(len(guide), 0.37), grid), 0.37)
    assert np.allclose(
        yang_2010.filter_in_grid(guide, grid), guide
    )  # the two guides are too far apart to mix
    smooth = yang_2010.filter_in_grid(random.random(len(guide)), grid)
    assert smooth.std() < 0.05 and abs(smooth.mean() - 0.5) < 0.05


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
