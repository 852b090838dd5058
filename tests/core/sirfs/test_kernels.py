"""What the compiled kernels promise whatever they compute."""

import numpy as np
import pytest

from isc_core.decomposition.models import DecompositionTask, Settings, solve
from isc_core.numerics.jit import Kernel
from isc_core.numerics.kernel_library import shipped_library
from isc_core.photo.photo import Photo, PhotoSource
from isc_core.sirfs import kernel_cache, vector_kernels
from isc_core.sirfs.kernels import (
    colour_histogram,
    expected_normals,
    expected_shading,
    height_rows,
    pixel_pairs,
)

_MODULES = (
    colour_histogram,
    expected_normals,
    expected_shading,
    height_rows,
    pixel_pairs,
    vector_kernels,
)


def test_what_kernels_call_is_part_of_them():
    """Else the process that compiles them links another copy than one that reads them from the
    cache, and rounds otherwise.
    """
    for module in _MODULES:
        compiled = {name: one for name, one in vars(module).items() if isinstance(one, Kernel)}
        called = {
            name
            for one in compiled.values()
            for name in one.function.__code__.co_names
            if name in compiled
        }
        assert all(compiled[name].inline for name in called), sorted(called)
        assert module is not height_rows or len(called) >= 2


@pytest.mark.slow
def test_kernels_are_loaded_with_the_types_of_a_solve():
    """Else a photo's solve would load them again, or compile them."""
    pytest.importorskip("numba")
    if shipped_library() is not None:
        pytest.skip("the kernels were compiled ahead of time")
    kernel_cache.load_kernels("photo")
    signatures = {name: _signatures(one) for name, one in _kernels().items()}
    if not kernel_cache.kernels_compiled():
        pytest.skip("nothing was compiled yet")
    size = 40
    y, x = np.mgrid[-1 : 1 : size * 1j, -1 : 1 : size * 1j]
    inside = np.hypot(x, y) < 0.9
    facing = np.where(inside, np.sqrt(np.clip(1 - x**2 - y**2, 0, 1)), 0).astype(np.float32)
    photo = Photo(
        facing[..., None] * np.array([0.8, 0.5, 0.3], np.float32),
        inside,
        1 / 255,
        np.zeros_like(inside),
        PhotoSource("", (size, size), 8, "srgb", "file"),
    )
    solve(DecompositionTask(photo, photo, Settings(model="sirfs", threads=1)))
    assert {name: _signatures(one) for name, one in _kernels().items()} == signatures


def _kernels():
    return {
        f"{module.__name__}.{name}": one
        for module in _MODULES
        for name, one in vars(module).items()
        if isinstance(one, Kernel)
    }


def _signatures(kernel):
    return list(kernel.compiled.signatures)
