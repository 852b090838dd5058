"""Detects whether the next solve has to compile its kernels, and loads compiled ones in advance.

Problem: Numba takes a quarter of a second to import, and as long again to load two dozen compiled
kernels. None of it depends on the photo.

Method: a ball of a few pixels is solved for two steps, which call every kernel that a colour photo
needs, with arrays of the same types. The ball is enlarged first, as small photos are: resampled
masks are stored in column order.

Limits: other kernels (for grey photos, depth, and photos that need no resampling) are loaded at
their first call.
"""

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..numerics.jit import drop_broken, ensure_cache_folder, numba_available
from ..numerics.kernel_library import shipped_library
from ..numerics.lbfgs import LbfgsOptions
from ..numerics.thread_pool import computed_once
from ..progress import Monitor
from ..scene.normal_estimate import NormalEstimate
from ..scene.shading_estimate import ShadingEstimate
from .priors.prior_file import shipped_priors
from .recover import RecoverOptions, recover
from .settings import Start, isc_weights
from .solver import SolverOptions

_RADIUS = 12  # pixels of the ball
_TWO_STEPS = LbfgsOptions(iterations=2)


def announce_compilation(engine: str, monitor: Monitor) -> None:
    """Report compilation as a separate stage if the next solve has to compile its kernels.

    Compilation takes about 20 s, during which the solver would seem to hang. Call this before the
    first solve: it also makes sure that the kernels work where no cache folder can be written.

    Parameters
    ----------
    engine : str
        "auto", "numba" or "numpy".
    monitor : Monitor
    """
    if engine == "numpy" or shipped_library() is not None or not numba_available():
        return
    ensure_cache_folder()
    drop_broken(_folder())
    if not kernels_compiled():
        monitor.report("preparing the compiled kernels", 0.0, "only once, about 20 s")


def kernels_compiled() -> bool:
    """Return whether the kernels, in their current version, were compiled before. Needs Numba."""
    from .kernels.height_rows import forward_rows

    kernel: Any = forward_rows
    code = kernel.function.__code__
    source = Path(code.co_filename)
    python = f"py{sys.version_info[0]}{sys.version_info[1]}"
    pattern = f"{source.stem}.{code.co_name}-{code.co_firstlineno}.{python}*.nbi"
    indices = _folder().glob(pattern)
    return any(index.stat().st_mtime >= source.stat().st_mtime for index in indices)


@computed_once
def load_kernels(illumination: str) -> None:
    """Load the tables and compiled kernels that a colour photo needs, once per process.

    Parameters
    ----------
    illumination : str
        One of `priors.prior_set.ILLUMINATIONS`, whose tables are built, too.
    """
    priors, weights = shipped_priors(illumination, 3), isc_weights(illumination, 3)
    if shipped_library() is not None or not numba_available() or not kernels_compiled():
        return
    y, x = np.mgrid[-_RADIUS : _RADIUS + 1, -_RADIUS : _RADIUS + 1] / (_RADIUS + 0.5)
    mask = np.hypot(x, y) < 1
    zeros, deviation = np.zeros((*mask.shape, 3)), np.where(mask, 0.5, 0.0)
    recover(
        zeros.astype(np.float32) + np.float32(0.5),
        mask,
        1 / 255,
        priors,
        replace(weights, starts=(Start(),)),
        RecoverOptions(3 * _RADIUS, 0, solver=SolverOptions("numba", threads=1, lbfgs=_TWO_STEPS)),
        predicted_normals=NormalEstimate(zeros + (0, 0, 1), deviation),
        predicted_shading=ShadingEstimate(zeros, deviation),
    )


def _folder() -> Path:
    """Folder of the compiled kernels."""
    from .kernels.height_rows import forward_rows

    kernel: Any = forward_rows
    return Path(str(kernel.compiled.stats.cache_path))
