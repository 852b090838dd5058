"""Relit photos agree with the lights that they were drawn with."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mitsuba")

from training.data.relighting import (
    LightCount,
    RelightableObject,
    draw_photo,
    relightable_objects,
)
from training.data.traced_objects import (
    GROUP,
    LIGHTS,
    SIZE,
    TracedObject,
    make_group,
    make_object,
    objects_in,
)


@pytest.fixture(scope="module")
def traced(tmp_path_factory: pytest.TempPathFactory) -> TracedObject:
    folder = tmp_path_factory.mktemp("traced")
    np.savez_compressed(folder / "000003.npz", **make_object(3))  # type: ignore[arg-type]
    return next(objects_in(folder))


@pytest.mark.slow
def test_an_object_is_reproducible(traced: TracedObject) -> None:
    again = make_object(3)
    np.testing.assert_array_equal(again["normals"], traced.normals)
    np.testing.assert_array_equal(
        np.unpackbits(again["reached"], axis=-1).astype(bool), traced.reached
    )
    assert str(again["shape"]) == traced.shape


@pytest.mark.slow
def test_the_arrays_of_an_object_are_consistent(traced: TracedObject) -> None:
    assert traced.mask.shape == (SIZE, SIZE) and traced.reached.shape == (LIGHTS, SIZE, SIZE)
    np.testing.assert_allclose(
        np.linalg.norm(traced.normals[traced.mask].astype(float), axis=-1), 1, atol=2e-3
    )
    np.testing.assert_allclose(np.linalg.norm(traced.toward, axis=-1), 1, rtol=1e-5)
    assert not traced.reached[:, ~traced.mask].any() and traced.reached[:, traced.mask].mean() > 0.3
    assert (traced.albedos[:, ~traced.mask] == 0).all() and (
        traced.albedos[:, traced.mask] > 0
    ).all()


@pytest.mark.parametrize("count", LightCount)
def test_a_photo_comes_with_its_lights(traced: TracedObject, count: LightCount) -> None:
    relit = RelightableObject.of(traced)
    for seed in range(4):
        lit = draw_photo(relit, np.random.default_rng(seed), count)
        assert lit.count == count and np.isfinite(lit.photo).all() and lit.photo.min() >= 0
        assert (
            lit.photo[traced.mask].mean() == pytest.approx(1, rel=1e-4)
            and not lit.photo[~traced.mask].any()
        )
        assert len(lit.toward) == len(lit.shares) and (
            len(lit.shares) >= 2 if count == LightCount.SEVERAL else len(lit.shares) == count
        )
        assert count == LightCount.NONE or lit.shares.sum() == pytest.approx(1, rel=1e-5)
        assert lit.shading.shape == (int(traced.mask.sum()),) and lit.shading.min() >= 0


def test_pixels_facing_the_light_are_brighter(traced: TracedObject) -> None:
    relit = RelightableObject.of(traced)
    for seed in range(6):
        lit = draw_photo(relit, np.random.default_rng([1, seed]), LightCount.ONE)
        facing = relit.normals.astype(float) @ lit.toward[0]
        seen = traced.reached[int(np.argmax(traced.toward @ lit.toward[0]))][traced.mask]
        assert lit.shading[(facing > 0.7) & seen].mean() > 1.5 * lit.shading[facing < 0.1].mean()
        assert np.corrcoef(np.maximum(facing, 0) * seen, lit.shading)[0, 1] > 0.8


@pytest.mark.slow
def test_objects_are_read_by_name(tmp_path: Path) -> None:
    for number in (5, 4):
        np.savez_compressed(tmp_path / f"{number:06d}.npz", **make_object(number))  # type: ignore[arg-type]
    assert [one.shape for one in objects_in(tmp_path)] == [
        str(make_object(number)["shape"]) for number in (4, 5)
    ]


@pytest.mark.slow
def test_excluded_shapes_are_left_out(tmp_path: Path, traced: TracedObject) -> None:
    np.savez_compressed(tmp_path / "000003.npz", **make_object(3))  # type: ignore[arg-type]
    assert [one.shape for one in relightable_objects([tmp_path], [])] == [traced.shape]
    assert not list(relightable_objects([tmp_path], [traced.shape]))


def test_a_linear_map_keeps_the_signs_of_cosines(traced: TracedObject) -> None:
    relit = RelightableObject.of(traced)
    space = np.array([[0.7, 0, 0], [0, 1, 0], [0.2, -0.3, 1.4]])
    mapped = relit.mapped(space)
    np.testing.assert_allclose(np.linalg.norm(mapped.normals, axis=1), 1, rtol=1e-5)
    facing, before = (
        mapped.normals @ mapped.toward.T,
        relit.normals.astype(np.float32) @ relit.toward.T,
    )
    clear = np.abs(before) > 1e-2
    np.testing.assert_array_equal(np.sign(facing[clear]), np.sign(before[clear]))
    np.testing.assert_array_equal(mapped.normals[:, 2] > 0, relit.normals[:, 2] > 0)
    # Of x^2 + y^2 + z^2 = 1; twice as deep, its normal at (x, y, 2 z) is along (x, y, z / 4).
    ball = replace(relit, normals=np.array([[0.6, 0, 0.8]]))
    deep = ball.mapped(np.diag([1, 1, 2.0])).normals
    np.testing.assert_allclose(deep, np.array([[0.6, 0, 0.4]]) / np.hypot(0.6, 0.4), rtol=1e-5)


@pytest.mark.slow
def test_a_group_is_reproducible_and_its_normals_face_the_viewer() -> None:
    one, again = make_group(1), make_group(1)
    assert str(one["shape"]) == GROUP
    for name in one:
        np.testing.assert_array_equal(one[name], again[name])
    assert (one["normals"][one["mask"]][:, 2] > -1e-3).all()
    assert 0.1 < one["mask"].mean() < 0.85
