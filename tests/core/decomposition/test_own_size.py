"""The size at which SIRFS is solved: under the lights of the data set, that of the object where the
priors were fitted to such objects.
"""

from typing import Any

import numpy as np
import pytest

from isc_core.decomposition import shape
from isc_core.decomposition.pipeline import decompose
from isc_core.decomposition.settings import Settings
from isc_core.photo import Photo, PhotoSource
from isc_core.scene.decomposition import Decomposition
from isc_core.sirfs.recover import SOLVE_SIZE, Recovered, RecoverOptions, recover
from tests.core.ball_scene import ball
from tests.core.small_solves import small_solves


class Asked(Exception):
    """SIRFS is to be solved with these options."""


def ball_photo() -> tuple[Decomposition, Photo]:
    scene = ball((50, 54), 20.0, (25.0, 27.0))
    source = PhotoSource("", (54, 50), 16, "linear", "file")
    return scene, Photo(scene.image, scene.mask, 1 / 65535, np.zeros_like(scene.mask), source)


@pytest.mark.parametrize(
    ("illumination", "size"), [("natural", 224), ("laboratory", 224), ("photo", SOLVE_SIZE)]
)
def test_small_objects_are_enlarged(
    illumination: str, size: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def asked(*values: Any, **_: Any) -> Recovered:
        raise Asked(*(one for one in values if isinstance(one, RecoverOptions)))

    monkeypatch.setattr(shape, "recover", asked)
    monkeypatch.setattr(shape, "RecoverOptions", RecoverOptions)  # not those of small solves
    with pytest.raises(Asked) as caught:
        decompose(ball_photo()[1], Settings("sirfs", illumination=illumination, threads=1))
    (options,) = caught.value.args
    assert options.solve_size == size
    assert options.reduce_larger == (illumination == "photo")


@pytest.mark.parametrize(("illumination", "own"), [("natural", True), ("photo", False)])
def test_larger_objects_are_solved_at_their_own_size(
    illumination: str, own: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, photo = ball_photo()
    solved: list[Recovered] = []

    def watched(*values: Any, **options: Any) -> Recovered:
        solved.append(recover(*values, **options))
        return solved[-1]

    monkeypatch.setattr(shape, "recover", watched)
    with small_solves(own_size=True):
        result = decompose(photo, Settings("sirfs", illumination=illumination, threads=1))
    size = max(np.ptp(np.nonzero(scene.mask), axis=1)) + 1
    assert (min(solved[-1].solved_shape) > size) == own
    assert result.identity_errors().broken() == ()
