"""The pictures that the lamp network learns from: objects of which every lamp's shadow is known, lit anew."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mitsuba")

from benchmarks.relit_objects import NONE, ONE, SEVERAL, Relit, draw_photo
from benchmarks.unlit_objects import LAMPS, SIZE, Unlit, make_object, objects_in


@pytest.fixture(scope="module")
def unlit(tmp_path_factory: pytest.TempPathFactory) -> Unlit:
    folder = tmp_path_factory.mktemp("unlit")
    np.savez_compressed(folder / "000003.npz", **make_object(3))  # type: ignore[arg-type]
    return next(objects_in(folder))


def test_an_object_is_the_same_each_time(unlit: Unlit) -> None:
    again = make_object(3)
    np.testing.assert_array_equal(again["normals"], unlit.normals)
    np.testing.assert_array_equal(np.unpackbits(again["reached"], axis=-1).astype(bool), unlit.reached)
    assert str(again["shape"]) == unlit.shape


def test_its_parts_fit_together(unlit: Unlit) -> None:
    assert unlit.mask.shape == (SIZE, SIZE) and unlit.reached.shape == (LAMPS, SIZE, SIZE)
    np.testing.assert_allclose(np.linalg.norm(unlit.normals[unlit.mask].astype(float), axis=-1), 1, atol=2e-3)
    np.testing.assert_allclose(np.linalg.norm(unlit.toward, axis=-1), 1, rtol=1e-5)
    assert not unlit.reached[:, ~unlit.mask].any() and unlit.reached[:, unlit.mask].mean() > 0.3
    assert (unlit.albedos[:, ~unlit.mask] == 0).all() and (unlit.albedos[:, unlit.mask] > 0).all()


@pytest.mark.parametrize("lamps", [NONE, ONE, SEVERAL])
def test_a_photo_says_what_it_was_lit_by(unlit: Unlit, lamps: int) -> None:
    relit = Relit.of(unlit)
    for seed in range(4):
        lit = draw_photo(relit, np.random.default_rng(seed), lamps)
        assert lit.lamps == lamps and np.isfinite(lit.photo).all() and lit.photo.min() >= 0
        assert lit.photo[unlit.mask].mean() == pytest.approx(1, rel=1e-4) and not lit.photo[~unlit.mask].any()
        assert len(lit.toward) == len(lit.shares) and (len(lit.shares) >= 2 if lamps == SEVERAL else len(lit.shares) == lamps)
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
    assert [one.shape for one in objects_in(tmp_path)] == [str(make_object(number)["shape"]) for number in (4, 5)]
