"""Warm seconds and peak memory of the separation methods at one megapixel, one process each."""

import multiprocessing
import resource
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy import ndimage

from isc_core.datasets.highlight_set import load_shen_zheng
from isc_core.separation import separate

_PIXELS = 1_000_000
_REPEATS = 3
# Target in seconds per megapixel, on two cores.
_TARGETS = {
    **dict.fromkeys(("yang_2010", "shen_2009", "shen_2013", "mallick_2006", "yoon_2006"), 0.5),
    "isc": 1.5,
    "sparse_coding": 3.0,
    "chaotic_segmentation": 6.0,
    "tan_2005": 10.0,
}


def megapixel(folder: Path) -> np.ndarray:
    """Return Shen & Zheng's cups, enlarged to a million pixels.

    Parameters
    ----------
    folder : Path
        Shen & Zheng's photos.

    Returns
    -------
    (H, W, 3) ndarray
        Linear, float32.
    """
    image = load_shen_zheng(folder, "cups").image
    factor = float(np.sqrt(_PIXELS / (image.shape[0] * image.shape[1])))
    return np.clip(ndimage.zoom(image, (factor, factor, 1), order=1), 0, None)


def speed_table(folder: Path, methods: Sequence[str]) -> str:
    """Measure all methods.

    Parameters
    ----------
    folder : Path
        Shen & Zheng's photos.
    methods : sequence of str
        Names.

    Returns
    -------
    str
        Markdown: the best of three warm runs, its ratio to the target, peak memory.
    """
    lines = [
        "| method | first run s | warm s | target s | ratio | peak memory MB |",
        "|---|---|---|---|---|---|",
    ]
    image = megapixel(folder)
    context = multiprocessing.get_context("spawn")
    for method in methods:
        with context.Pool(1) as pool:
            first, warm, memory = pool.apply(timed, (method, image))
        target = _TARGETS.get(method)
        against = ("-", "-") if target is None else (f"{target:g}", f"{warm / target:.2f}")
        lines.append(
            f"| {method} | {first:.2f} | {warm:.3f} | {against[0]} | {against[1]} | {memory:.0f} |"
        )
        print(lines[-1], flush=True)
    return "\n".join(lines) + "\n"


def timed(method: str, image: np.ndarray) -> tuple[float, float, float]:
    """Time one method.

    Parameters
    ----------
    method : str
        Name.
    image : (H, W, 3) ndarray
        Linear.

    Returns
    -------
    first : float
        Seconds of the first run, with compilation or reading the cache.
    warm : float
        Seconds of the best warm run.
    memory : float
        Peak memory of the process, MB.
    """
    mask = np.ones(image.shape[:2], bool)
    seconds = []
    for _ in range(1 + _REPEATS):
        start = time.perf_counter()
        separate(method, image, mask)
        seconds.append(time.perf_counter() - start)
        if sum(seconds) > 60:
            break
    return (
        seconds[0],
        min(seconds[1:] or seconds),
        resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    )
