"""Mitsuba 3, in the fastest variant that this machine can run.

The LLVM variants compile their kernels with the system's libLLVM. An old one does not make them fail, it aborts the whole process, and
Dr.Jit lists the backend all the same; its version is therefore asked before the first kernel.

Reference: W. Jakob et al., Dr.Jit: a just-in-time compiler for differentiable rendering, 2022, doi:10.1145/3528223.3530099.
"""

from types import ModuleType

from isc_core.errors import InputError

OLDEST_LLVM = 19


def llvm_is_usable(major: int) -> bool:
    """Whether a libLLVM of this major version (-1: none found) compiles Dr.Jit's kernels."""
    return major >= OLDEST_LLVM


def load_mitsuba() -> ModuleType:
    """The `mitsuba` module, with the variant chosen: `llvm_ad_rgb`, or `scalar_rgb` where there is no libLLVM of version 19 or later.

    Raises `InputError` where Mitsuba is not installed.
    """
    try:
        import drjit
        import mitsuba
    except ImportError as error:
        raise InputError("rendering needs Mitsuba: install it with `pip install 'isc3d[synth]'`") from error
    if mitsuba.variant() is None:
        fast = "llvm_ad_rgb" in mitsuba.variants() and llvm_is_usable(drjit.detail.llvm_version()[0])
        mitsuba.set_variant("llvm_ad_rgb" if fast else "scalar_rgb")
    mitsuba.set_log_level(mitsuba.LogLevel.Error)
    return mitsuba


def has_llvm() -> bool:
    """Whether Mitsuba runs in an LLVM variant. Raises `InputError` where it is not installed."""
    return str(load_mitsuba().variant()).startswith("llvm")
