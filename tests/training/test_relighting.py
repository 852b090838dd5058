"""The pictures that the lamp network learns from: objects of which every lamp's shadow is known,
lit anew.
"""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mitsuba")

from training.data.relighting import NONE, ONE, SEVERAL, Relit, draw_photo
from training.data.traced_objects import (
    GROUP,
    LAMPS,
    SIZE,
    Unlit,
    make_group,
    make_object,
    objects_in,
)


@pytest.fixture(scope="module")
def unlit(tmp_path_factory: pytest.TempPathFactory) -> Unlit:
    folder = tmp_path_factory.mktemp("unlit")
    np.savez_compressed(folder / "000003.npz", **make_object(3))  # type: ignore[arg-type]
    return next(objects_in(folder))


def test_an_object_is_the_same_each_time(unlit: Unlit) -> None:
    again = make_object(3)
    np.testing.assert_array_equal(again["normals"], unlit.normals)
    np.testing.assert_array_equal(
        np.unpackbits(again["reached"], axis=-1).astype(bool), unlit.reached
    )
    assert str(again["shape"]) == unlit.shape


def test_its_parts_fit_together(unlit: Unlit) -> None:
    assert unlit.mask.shape == (SIZE, SIZE) and unlit.reached.shape == (LAMPS, SIZE, SIZE)
    np.testing.assert_allclose(
        np.linalg.norm(unlit.normals[unlit.mask].astype(float), axis=-1), 1, atol=2e-3
    )
    np.testing.assert_allclose(np.linalg.norm(unlit.toward, axis=-1), 1, rtol=1e-5)
    assert not unlit.reached[:, ~unlit.mask].any() and unlit.reached[:, unlit.mask].mean() > 0.3
    assert (unlit.albedos[:, ~unlit.mask] == 0).all() and (unlit.albedos[:, unlit.mask] > 0).all()


@pytest.mark.parametrize("lamps", [NONE, ONE, SEVERAL])
def test_a_photo_says_what_it_was_lit_by(unlit: Unlit, lamps: int) -> None:
    relit = Relit.of(unlit)
    for seed in range(4):
        lit = draw_photo(relit, np.random.default_rng(seed), lamps)
        assert lit.lamps == lamps and np.isfinite(lit.photo).all() and lit.photo.min() >= 0
        assert (
            lit.photo[unlit.mask].mean() == pytest.approx(1, rel=1e-4)
            and not lit.photo[~unlit.mask].any()
        )
        assert len(lit.toward) == len(lit.shares) and (
            len(lit.shares) >= 2 if lamps == SEVERAL else len(lit.shares) == lamps
        )
        assert lamps == NONE or lit.shares.sum() == pytest.approx(1, rel=1e-5)
        assert lit.shading.shape == (int(unlit.mask.sum()),) and lit.shading.min() >= 0


def test_what_faces_the_lamp_is_brighter_than_what_does_not(unlit: Unlit) -> None:
    relit = Relit.of(unlit)
    for seed in range(6):
        lit = draw_photo(relit, np.random.default_rng([1, seed]), ONE)
        facing = relit.normals.astype(float) @ lit.toward[0]
        seen = unlit.reached[int(np.argmax(unlit.toward @ lit.toward[0]))][unlit.mask]
        assert lit.shading[(facing > 0.7) & seen].mean() > 1.5 * lit.shading[facing < 0.1].mean()
        assert np.corrcoef(np.maximum(facing, 0) * seen, lit.shading)[0, 1] > 0.8


def test_an_object_that_is_there_is_read_by_name(tmp_path: Path) -> None:
    for number in (5, 4):
        np.savez_compressed(tmp_path / f"{number:06d}.npz", **make_object(number))  # type: ignore[arg-type]
    assert [one.shape for one in objects_in(tmp_path)] == [
        str(make_object(number)["shape"]) for number in (4, 5)
    ]


def test_a_map_of_space_keeps_what_faces_what_and_the_view(unlit: Unlit) -> None:
    relit = Relit.of(unlit)
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
    ball = np.array(
        [[0.6, 0, 0.8]]
    )  # of x^2 + y^2 + z^2 = 1; twice as deep its normal is along (x, y, z / 4) at (x, y, 2 z)
    deep = (
        Relit(ball, relit.albedos, relit.mirrored, relit.toward, relit.reached, relit.mask, "")
        .mapped(np.diag([1, 1, 2.0]))
        .normals
    )
    np.testing.assert_allclose(deep, np.array([[0.6, 0, 0.4]]) / np.hypot(0.6, 0.4), rtol=1e-5)


def test_a_group_is_the_same_each_time_and_its_normals_face_the_viewer() -> None:
    one, again = make_group(1), make_group(1)
    assert str(one["shape"]) == GROUP
    for name in one:
        np.testing.assert_array_equal(one[name], again[name])
    assert (one["normals"][one["mask"]][:, 2] > -1e-3).all()
    assert 0.1 < one["mask"].mean() < 0.85
