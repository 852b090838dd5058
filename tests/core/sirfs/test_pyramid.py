"""The pyramid is what its definition says, its adjoints are adjoint, and the compiled steps are the
same.
"""

import numpy as np
import pytest

from isc_core.sirfs.pyramid import SMALLEST, TAPS, analyse, down, level_shapes, synthesise, up

SHAPES = [(1, 1), (2, 3), (5, 4), (7, 8), (16, 17), (33, 20)]


def down_as_written(fine: np.ndarray) -> np.ndarray:
    """out[k] = sum over o = -1..2 of f[o + 1] in[clamp(2k + o)], along both axes."""
    rows, columns = ((n + 1) // 2 for n in fine.shape)
    out = np.zeros((rows, columns))
    for i in range(rows):
        for j in range(columns):
            for di in range(-1, 3):
                for dj in range(-1, 3):
                    r, c = (
                        np.clip(2 * i + di, 0, fine.shape[0] - 1),
                        np.clip(2 * j + dj, 0, fine.shape[1] - 1),
                    )
                    out[i, j] += TAPS[di + 1] * TAPS[dj + 1] * fine[r, c]
    return out


@pytest.mark.parametrize("shape", SHAPES)
def test_one_step_down_is_the_definition(shape: tuple[int, int]) -> None:
    fine = np.random.default_rng(0).normal(size=shape)
    np.testing.assert_allclose(down(fine), down_as_written(fine), rtol=0, atol=1e-13)


@pytest.mark.parametrize("shape", SHAPES)
def test_up_is_the_adjoint_of_down(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(1)
    fine = rng.normal(size=shape)
    coarse = rng.normal(size=down(fine).shape)
    assert float((down(fine) * coarse).sum()) == pytest.approx(
        float((fine * up(coarse, shape)).sum()), rel=1e-12, abs=1e-12
    )


def test_a_step_up_doubles_heights() -> None:
    assert up(np.full((12, 10), 3.0), (24, 20))[2:-2, 2:-2] == pytest.approx(6.0)


def test_synthesise_and_analyse_are_adjoint() -> None:
    rng = np.random.default_rng(2)
    levels = [rng.normal(size=s) for s in level_shapes((37, 52))]
    gradient = rng.normal(size=(37, 52))
    out = [np.empty_like(level) for level in levels]
    analyse(gradient, out)
    backward = sum(float((a * b).sum()) for a, b in zip(levels, out, strict=True))
    assert float((synthesise(levels) * gradient).sum()) == pytest.approx(backward)


def test_levels_halve_and_stop_at_the_smallest() -> None:
    shapes = level_shapes((37, 52))
    assert shapes == [(37, 52), (19, 26), (10, 13), (5, 7)]
    assert min(shapes[-1]) >= SMALLEST
    assert level_shapes((37, 52), 2) == [(37, 52), (19, 26)]
    assert level_shapes((1, 90)) == [(1, 90)]


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 1e-13), (np.float32, 1e-5)])
def test_compiled_steps_equal_numpy(
    shape: tuple[int, int], dtype: type[np.floating], tolerance: float
) -> None:
    kernels = pytest.importorskip(
        "isc_core.sirfs.vector_kernels", reason="needs numba", exc_type=ImportError
    )
    rng = np.random.default_rng(3)
    fine = rng.normal(size=shape).astype(dtype)
    want = down(fine)
    have = np.full_like(want, np.nan)
    kernels.down(fine, have)
    np.testing.assert_allclose(have, want, rtol=0, atol=tolerance)
    coarse = rng.normal(size=want.shape).astype(dtype)
    added = np.full_like(fine, np.nan)
    kernels.up_add(coarse, fine, added)
    np.testing.assert_allclose(added, fine + up(coarse, shape), rtol=0, atol=tolerance)
