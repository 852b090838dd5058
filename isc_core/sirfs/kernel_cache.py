"""Whether the next solve has to compile its kernels first."""

import sys
from pathlib import Path
from typing import Any

from ..numerics.jit import drop_broken, ensure_cache_folder, numba_available
from ..progress import Monitor


def announce_compilation(engine: str, monitor: Monitor) -> None:
    """Report a stage of its own if the next solve will compile its kernels first.

    Compilation takes about 20 s, during which the solver would seem to hang. Call this before the
    first solve: it also makes sure that the kernels work where no cache folder can be written.

    Parameters
    ----------
    engine : str
        "auto", "numba" or "numpy".
    monitor : Monitor
    """
    if engine == "numpy" or not numba_available():
        return
    ensure_cache_folder()
    drop_broken(_folder())
    if not kernels_compiled():
        monitor.report("preparing the compiled kernels", 0.0, "only once, about 20 s")


def kernels_compiled() -> bool:
    """Return whether the kernels, in their current version, were compiled before. Needs Numba."""
    from . import kernels

    dispatcher: Any = kernels.forward_rows
    code = dispatcher.py_func.__code__
    source = Path(code.co_filename)
    python = f"py{sys.version_info[0]}{sys.version_info[1]}"
    pattern = f"{source.stem}.{code.co_name}-{code.co_firstlineno}.{python}*.nbi"
    indices = _folder().glob(pattern)
    return any(index.stat().st_mtime >= source.stat().st_mtime for index in indices)


def _folder() -> Path:
    """Folder of the compiled kernels."""
    from . import kernels

    dispatcher: Any = kernels.forward_rows
    return Path(str(dispatcher.stats.cache_path))
