"""The digest of a result: all that later work depends on counts, and nothing else."""

from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
import pytest

from isc_core.lobe_fitting import fit_lobe
from isc_core.photo.camera import Camera
from isc_core.scene.decomposition import Decomposition
from isc_core.scene.expected_error import ExpectedError
from isc_core.scene.result_digest import result_digest
from tests.core.ball_scene import ball


def complete() -> Decomposition:
    """A result with all optional parts."""
    d = ball((24, 30), 9.0, (12, 15))
    return replace(
        d,
        brdf=fit_lobe(d.specular, d.normal, d.mask),
        expected_error=ExpectedError(d.confidence, 2 * d.confidence),
        camera=Camera(90.0, (15.0, 12.0)),
        visibility=0 * d.image + 1,
        indirect=0 * d.image,
        environment=np.ones((8, 16, 3), np.float32),
    )


def same(one: Decomposition, other: Decomposition) -> bool:
    return bool((result_digest(one) == result_digest(other)).all())


def test_one_bit_of_any_map_counts() -> None:
    d = complete()
    assert same(d, complete())
    names = [field.name for field in fields(d) if isinstance(getattr(d, field.name), np.ndarray)]
    assert len(names) >= 14
    for name in names:
        values = getattr(d, name).copy()
        last = values.reshape(-1)[-1:]
        last[...] = ~last if values.dtype == bool else np.nextafter(last, values.dtype.type(9))
        assert not same(replace(d, **{name: values}), d), name


@pytest.mark.parametrize(
    "change",
    [
        lambda d: replace(d, camera=Camera(90.0, (15.0, np.nextafter(12.0, 13)))),
        lambda d: replace(d, camera=None),
        lambda d: replace(d, brdf=replace(d.brdf, alpha=0.123)),
        lambda d: replace(d, brdf=replace(d.brdf, predicted=d.brdf.predicted + 1)),
        lambda d: replace(d, brdf=replace(d.brdf, lights=())),
        lambda d: replace(d, expected_error=ExpectedError(d.confidence, d.confidence)),
        lambda d: replace(d, provenance=replace(d.provenance, settings={"illumination": "x"})),
    ],
)
def test_all_else_counts(change: Callable[[Decomposition], Decomposition]) -> None:
    d = complete()
    assert not same(change(d), d)


def test_when_it_was_made_and_of_what_does_not_count() -> None:
    d = complete()
    provenance = replace(d.provenance, timings={"maps": 3.0}, input={"name": "other"})
    assert same(replace(d, provenance=provenance), d)
