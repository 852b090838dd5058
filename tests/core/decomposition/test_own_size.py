"""A photo larger than the size at which SIRFS is solved: under the lights of the data set it is
solved at its own size.
"""

from typing import Any

import numpy as np
import pytest

from isc_core.decomposition import shape
from isc_core.decomposition.pipeline import decompose
from isc_core.decomposition.settings import Settings
from isc_core.photo import Photo, PhotoSource
from isc_core.sirfs.recover import Recovered, recover
from tests.core.ball_scene import ball
from tests.core.small_solves import small_solves


@pytest.mark.parametrize(("illumination", "own"), [("natural", True), ("photo", False)])
def test_larger_objects_are_solved_at_their_own_size(
    illumination: str, own: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = ball((50, 54), 20.0, (25.0, 27.0))
    solved: list[Recovered] = []

    def watched(*values: Any, **options: Any) -> Recovered:
        solved.append(recover(*values, **options))
        return solved[-1]

    monkeypatch.setattr(shape, "recover", watched)
    source = PhotoSource("", (54, 50), 16, "linear", "file")
    photo = Photo(scene.image, scene.mask, 1 / 65535, np.zeros_like(scene.mask), source)
    with small_solves(own_size=True):
        result = decompose(photo, Settings("sirfs", illumination=illumination, threads=1))
    size = max(np.ptp(np.nonzero(scene.mask), axis=1)) + 1
    assert (min(solved[-1].solved_shape) > size) == own
    assert result.identity_errors().broken() == ()
