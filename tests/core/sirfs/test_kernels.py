"""What the compiled kernels promise whatever they compute."""

import pytest

numba = pytest.importorskip("numba")

from isc_core.sirfs import kernels, vector_kernels  # noqa: E402


def test_what_kernels_call_is_part_of_them():
    """Else the process that compiles them links another copy than one that reads them from the
    cache, and rounds otherwise.
    """
    for module in (kernels, vector_kernels):
        dispatchers = {
            name: one
            for name, one in vars(module).items()
            if isinstance(one, numba.core.registry.CPUDispatcher)
        }
        called = {
            name
            for one in dispatchers.values()
            for name in one.py_func.__code__.co_names
            if name in dispatchers
        }
        assert all(dispatchers[name].targetoptions.get("forceinline") for name in called), sorted(
            called
        )
        assert module is vector_kernels or len(called) >= 2
