"""Yoon, Choi & Kweon 2006: the exact end of its sweeps, its regions and quantiles."""

import numpy as np

from isc_core.separation.published import yoon_2006
from isc_core.separation.published.yoon_2006 import Yoon2006Options
from isc_core.separation.support.colour_groups import group_quantile
from tests.core.separation.scenes import glossy_disc


def noisy_disc() -> tuple[np.ndarray, np.ndarray]:
    image, _, mask = glossy_disc()
    random = np.random.default_rng(5)
    return np.clip(image + random.normal(0, 0.02, image.shape), 0, None), mask & (
        random.random(mask.shape) > 0.3
    )


def test_sweeps_end_at_the_smallest_ratio_of_each_region() -> None:
    image, mask = noisy_disc()
    same = {"quantile": 0.0, "cells": 1, "window": 1, "weigh_evidence": False, "tolerance": 0.0}
    swept = yoon_2006.separate(image, mask, Yoon2006Options(regions=False, **same))
    solved = yoon_2006.separate(image, mask, Yoon2006Options(regions=True, **same))
    assert solved.specular.max() > 0.4
    assert np.array_equal(swept.specular, solved.specular)


def test_quantiles_of_groups() -> None:
    random = np.random.default_rng(1)
    group, values = random.integers(0, 7, 300) * 10**6, random.random(300)
    found = group_quantile(group, values, 0.35)
    for name in np.unique(group):
        assert (
            found[group == name] == np.quantile(values[group == name], 0.35, method="lower")
        ).all()
