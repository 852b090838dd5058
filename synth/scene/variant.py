"""Mitsuba 3 in the fastest variant that this machine supports.

In order of preference: `cuda_ad_rgb` on a graphics card, `llvm_ad_rgb` on the processor, and
`scalar_rgb`, which traces one ray at a time. The environment variable `ISC_MITSUBA_VARIANT` names
another one. The same seed gives the same bytes in one variant; variants differ by rounding, and
where a ray grazes an edge. Files that depend on it therefore record it.

The LLVM variants compile their kernels with the system's libLLVM. An old one does not raise an
error, it aborts the whole process, although Dr.Jit lists the backend; its version is therefore
checked before the first kernel. The CUDA variants trace rays with OptiX, a library of NVIDIA's
driver that may be missing where CUDA itself works, as in containers; it is therefore looked for
before the variant is chosen.

Citation: W. Jakob et al., Dr.Jit: a just-in-time compiler for differentiable rendering, 2022,
doi:10.1145/3528223.3530099; S. G. Parker et al., OptiX: a general purpose ray tracing engine, 2010,
doi:10.1145/1778765.1778803.

Limits: one card, the one that Dr.Jit takes first. Only the RGB variants are used.
"""

import ctypes
import os
from types import ModuleType

from isc_core.errors import InputError
from isc_core.extras import install_command

OLDEST_LLVM = 19
SCALAR, LLVM, CUDA = "scalar_rgb", "llvm_ad_rgb", "cuda_ad_rgb"
CHOICE = "ISC_MITSUBA_VARIANT"  # environment variable
OPTIX = "libnvoptix.so.1"


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


def cuda_is_usable() -> bool:
    """Return whether there is a card on which Mitsuba can trace rays; loads no kernel.

    Raises
    ------
    InputError
        If Dr.Jit is not installed.
    """
    try:
        import drjit
    except ImportError as error:
        raise _missing() from error
    if not drjit.has_backend(drjit.JitBackend.CUDA):
        return False
    try:
        ctypes.CDLL(os.environ.get("DRJIT_LIBOPTIX_PATH") or OPTIX)
    except OSError:
        return False
    return True


def usable_variants() -> tuple[str, ...]:
    """Return the variants that run on this machine, the fastest first.

    Returns
    -------
    tuple of str
        Of `CUDA`, `LLVM` and `SCALAR`; the last is always there.

    Raises
    ------
    InputError
        If Mitsuba is not installed.
    """
    try:
        import mitsuba
    except ImportError as error:
        raise _missing() from error
    usable = {CUDA: cuda_is_usable(), LLVM: llvm_is_usable(newest_llvm()), SCALAR: True}
    return tuple(name for name in usable if usable[name] and name in mitsuba.variants())


def chosen_variant() -> str:
    """Return the variant that the environment variable names, or else the fastest one.

    Returns
    -------
    str
        One of `usable_variants`.

    Raises
    ------
    InputError
        If Mitsuba is not installed, or the named variant does not run on this machine.
    """
    usable = usable_variants()
    named = os.environ.get(CHOICE, "")
    if named and named not in usable:
        raise InputError(
            f"{CHOICE}={named}: this machine runs {', '.join(usable)}; name one of these or unset "
            "the variable"
        )
    return named or usable[0]


def load_mitsuba() -> ModuleType:
    """Return the `mitsuba` module with a variant selected.

    Returns
    -------
    module
        In the variant that was selected before in this process, or else in `chosen_variant`.

    Raises
    ------
    InputError
        If Mitsuba is not installed, or the named variant does not run on this machine.
    """
    try:
        import mitsuba
    except ImportError as error:
        raise _missing() from error
    if mitsuba.variant() is None:
        mitsuba.set_variant(chosen_variant())
    mitsuba.set_log_level(mitsuba.LogLevel.Error)
    return mitsuba


def is_vectorised() -> bool:
    """Return whether Mitsuba runs in a variant that traces whole arrays of rays, with kernels.

    Raises
    ------
    InputError
        As `load_mitsuba`.
    """
    return not str(load_mitsuba().variant()).startswith("scalar")


def slower_without() -> str:
    """Return advice that would make rendering faster on this machine; empty if there is none, or if
    the slow variant was chosen by name.

    Raises
    ------
    InputError
        As `load_mitsuba`.
    """
    if is_vectorised() or os.environ.get(CHOICE):
        return ""
    found = newest_llvm()
    what = "libLLVM was not found" if found < 0 else f"libLLVM {found} is too old"
    return (
        f"{what}, so rendering is slower ({SCALAR}): install libLLVM {OLDEST_LLVM} or later "
        "(Debian: apt-get install libllvm19)"
    )


def _missing() -> InputError:
    return InputError(f"rendering needs Mitsuba: install it with `{install_command('synth')}`")
