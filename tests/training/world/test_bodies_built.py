"""Bodies that are built: every kind gives sound bodies, and the same ones again."""

import importlib.util

import numpy as np
import pytest

from isc_core.errors import InputError
from training.world.bodies.body import finished
from training.world.bodies.built import KINDS, build
from training.world.bodies.screening import MOST, fault

WITH_BLENDER = {"assembly", "boolean", "lettering", "metaball", "skin"}


def skip_without_blender(kind: str) -> None:
    if kind in WITH_BLENDER and importlib.util.find_spec("bpy") is None:
        pytest.skip("bpy is not installed")


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_kind_gives_sound_bodies(kind: str) -> None:
    skip_without_blender(kind)
    for number in range(4):
        surface = build(kind, number)
        assert fault(surface) is None
        mesh = finished(surface)
        assert len(mesh.faces) <= MOST
        assert np.ptp(mesh.vertices, axis=0).max() == pytest.approx(2)
        assert np.isfinite(mesh.normals).all()


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_number_gives_the_same_body_and_another_number_another(kind: str) -> None:
    skip_without_blender(kind)
    first, again, other = build(kind, 5), build(kind, 5), build(kind, 6)
    assert np.array_equal(first.vertices, again.vertices)
    assert np.array_equal(first.faces, again.faces)
    assert first.vertices.shape != other.vertices.shape or not np.allclose(
        first.vertices, other.vertices
    )


def test_an_unknown_kind_is_one_line() -> None:
    with pytest.raises(InputError, match="unknown kind of body 'tree': choose assembly"):
        build("tree", 0)
