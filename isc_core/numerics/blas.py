"""The kernels that OpenBLAS, NumPy's library of matrix products, uses on this processor.

Problem: OpenBLAS chooses its kernels by the processor's model number. A processor that is newer
than the library gets those for SSE3: with the OpenBLAS 0.3.23 of NumPy 1.26, an Intel processor of
2023 multiplies matrices in float64 at 16 GFLOP/s instead of 67.

Method: choose by the instructions that the processor has, as OpenBLAS does for the models that it
knows.

Limits: Linux on x86-64. OpenBLAS chooses when it is loaded, so the environment must be set before
NumPy is imported.
"""

from pathlib import Path

_CPU_INFO = Path("/proc/cpuinfo")
_KINDS = {
    "SkylakeX": {"avx512f", "avx512cd", "avx512dq", "avx512bw", "avx512vl"},
    "Haswell": {"avx2", "fma"},
}


def openblas_core_type(cpu_info: Path = _CPU_INFO) -> str | None:
    """Return the value of OPENBLAS_CORETYPE for this processor.

    Parameters
    ----------
    cpu_info : Path
        Linux' description of the processors.

    Returns
    -------
    str or None
        None if OpenBLAS should choose.
    """
    try:
        with cpu_info.open(encoding="ascii", errors="replace") as lines:
            flags = next((line for line in lines if line.startswith("flags")), "")
    except OSError:
        return None
    present = set(flags.partition(":")[2].split())
    return next((kind for kind, needed in _KINDS.items() if needed <= present), None)
