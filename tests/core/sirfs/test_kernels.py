"""What the compiled kernels promise whatever they compute."""

from isc_core.numerics.jit import Kernel
from isc_core.sirfs import kernels, vector_kernels


def test_what_kernels_call_is_part_of_them():
    """Else the process that compiles them links another copy than one that reads them from the
    cache, and rounds otherwise.
    """
    for module in (kernels, vector_kernels):
        compiled = {name: one for name, one in vars(module).items() if isinstance(one, Kernel)}
        called = {
            name
            for one in compiled.values()
            for name in one.function.__code__.co_names
            if name in compiled
        }
        assert all(compiled[name].inline for name in called), sorted(called)
        assert module is vector_kernels or len(called) >= 2
