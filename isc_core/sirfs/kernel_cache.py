"""Whether the next solve has to compile its kernels first."""

import sys
from pathlib import Path

from ..numerics.jit import drop_broken, ensure_cache_folder, numba_available
from ..progress import Monitor


def announce_compilation(engine: str, monitor: Monitor) -> None:
    """Reports a stage of its own when the next solve by `engine` ("auto", "numba", "numpy") will
    compile first: 20 s in silence look like a fault. Call before the first solve: where no cache
    folder can be written, it also sees to it that kernels work without.
    """
    if engine == "numpy" or not numba_available():
        return
    ensure_cache_folder()
    drop_broken(_folder())
    if not kernels_compiled():
        monitor.report("preparing the compiled kernels", 0.0, "only once, about 20 s")


def kernels_compiled() -> bool:
    """Whether the kernels, as they are now, were compiled before. Needs Numba."""
    from . import kernels

    kernel = kernels.forward_rows
    code = kernel.py_func.__code__
    source = Path(code.co_filename)
    python = f"py{sys.version_info[0]}{sys.version_info[1]}"
    pattern = f"{source.stem}.{code.co_name}-{code.co_firstlineno}.{python}*.nbi"
    indices = _folder().glob(pattern)
    return any(index.stat().st_mtime >= source.stat().st_mtime for index in indices)


def _folder() -> Path:
    """Where the kernels are kept."""
    from . import kernels

    return Path(str(kernels.forward_rows.stats.cache_path))
