"""A gloss that mirrors more of the sky than the photo shows is not believed."""

from dataclasses import replace

import numpy as np
import pytest

from isc_core.arrays_file import arrays_of
from isc_core.gloss import Gloss, gloss_of
from isc_core.mesh import build_mesh
from isc_core.sheen import most_level
from tests.core.test_arrays_file import glossy


def test_plastic_mirrors_a_25th_of_an_even_sky_in_front() -> None:
    d = glossy()
    facing = replace(d, normal=np.broadcast_to(np.array([0, 0, 1], np.float32), d.normal.shape))
    even = np.broadcast_to(np.array([2.0, 1.0, 0.5]), (16, 32, 3))
    grey = replace(facing, image=np.full_like(d.image, 0.02))
    assert most_level(grey, 0.3, even) == pytest.approx(0.02 / (0.04 * 2.0), rel=0.1), "the brightest channel decides"
    assert most_level(grey, 0.3, 2 * even) == pytest.approx(0.5 * most_level(grey, 0.3, even), rel=1e-5)
    assert most_level(grey, 0.3, 0 * even) == np.inf


def test_a_level_that_the_photo_has_no_room_for_is_lowered_and_others_stay() -> None:
    d = glossy()
    gloss = gloss_of(d)
    assert gloss.specular is not None and gloss.roughness is not None
    for factor, kept in ((1.0, True), (100.0, False)):
        built = build_mesh(d.height, d.normal, d.mask, d.reflectance, None, Gloss(gloss.roughness, factor * gloss.specular))
        arrays = arrays_of(d, built)
        room = most_level(d, gloss.roughness, arrays["sky"])
        assert (built.specular < room) == kept
        assert float(arrays["specular_level"]) == pytest.approx(min(built.specular, room), rel=1e-5)
