"""Mitsuba 3 in the fastest variant that this machine supports.

The LLVM variants compile their kernels with the system's libLLVM. An old one does not raise an
error, it aborts the whole process, although Dr.Jit lists the backend; its version is therefore
checked before the first kernel.

Reference: W. Jakob et al., Dr.Jit: a just-in-time compiler for differentiable rendering, 2022,
doi:10.1145/3528223.3530099.
"""

from types import ModuleType

from isc_core.errors import InputError
from isc_core.extras import install_command

OLDEST_LLVM = 19


def llvm_is_usable(major: int) -> bool:
    """Return whether a version of libLLVM compiles Dr.Jit's kernels.

    Parameters
    ----------
    major : int
        Major version; -1 means none.

    Returns
    -------
    bool
        True from `OLDEST_LLVM` on.
    """
    return major >= OLDEST_LLVM


def newest_llvm() -> int:
    """Return the major version of the libLLVM that Dr.Jit loads, -1 for none; loads no kernel.

    Raises
    ------
    InputError
        If Dr.Jit is not installed.
    """
    try:
        import drjit
    except ImportError as error:
        raise _missing() from error
    return int(drjit.detail.llvm_version()[0])


def load_mitsuba() -> ModuleType:
    """Return the `mitsuba` module with a variant selected.

    Returns
    -------
    module
        In the variant `llvm_ad_rgb`, or `scalar_rgb` without libLLVM 19 or later.

    Raises
    ------
    InputError
        If Mitsuba is not installed.
    """
    try:
        import mitsuba
    except ImportError as error:
        raise _missing() from error
    if mitsuba.variant() is None:
        fast = "llvm_ad_rgb" in mitsuba.variants() and llvm_is_usable(newest_llvm())
        mitsuba.set_variant("llvm_ad_rgb" if fast else "scalar_rgb")
    mitsuba.set_log_level(mitsuba.LogLevel.Error)
    return mitsuba


def has_llvm() -> bool:
    """Return whether Mitsuba runs in an LLVM variant.

    Raises
    ------
    InputError
        If Mitsuba is not installed.
    """
    return str(load_mitsuba().variant()).startswith("llvm")


def slower_without() -> str:
    """Return advice that would make rendering faster on this machine; empty if there is none.

    Raises
    ------
    InputError
        If Mitsuba is not installed.
    """
    if has_llvm():
        return ""
    found = newest_llvm()
    what = "libLLVM was not found" if found < 0 else f"libLLVM {found} is too old"
    return (
        f"{what}, so rendering is slower (scalar_rgb): install libLLVM {OLDEST_LLVM} or later "
        "(Debian: apt-get install libllvm19)"
    )


def _missing() -> InputError:
    return InputError(f"rendering needs Mitsuba: install it with `{install_command('synth')}`")
