"""Calls of every kernel, recorded from small programs, to be repeated elsewhere.

Separation by every method, a filled hole, a bending table, a turned mesh, a reduced photo, filters,
a convolution, a minimum cut, and, in both precisions, averages along paths and SIRFS on a ball of a
few pixels call each version of each kernel. The first calls of each are kept, with what the arrays
held before and after. They run on one thread: others would write to these arrays meanwhile.
"""

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from isc_core.baselines.poisson import integrate
from isc_core.filters.components import labelled
from isc_core.filters.distance import nearest_pixels
from isc_core.filters.gaussian import gaussian_average
from isc_core.filters.interpolation import linear_interpolation
from isc_core.filters.splines import spline_coefficients
from isc_core.imaging.area_resize import averaged
from isc_core.inpainting.coherency_sensitive_hashing import CshOptions
from isc_core.inpainting.patch_fill import PatchFillOptions, fill_patches
from isc_core.networks.convolution import convolved
from isc_core.numerics.jit import Kernel
from isc_core.numerics.kernel_check import mix, outcome
from isc_core.numerics.kernel_library import KernelLibrary, flattened
from isc_core.numerics.lbfgs import LbfgsOptions
from isc_core.numerics.maximum_flow import source_side
from isc_core.prior_fitting.roughness import roughness
from isc_core.result_files.turned_view import turned_view
from isc_core.scene.normal_estimate import NormalEstimate
from isc_core.scene.shading_estimate import ShadingEstimate
from isc_core.separation import separate
from isc_core.separation.support.edge_aware import Paths
from isc_core.sirfs.priors.prior_file import shipped_priors
from isc_core.sirfs.recover import RecoverOptions, recover
from isc_core.sirfs.settings import Start, isc_weights
from isc_core.sirfs.solver import SolverOptions

from .portable_code import Version, kernels

_SIDE = 40  # pixels of the photo
_KEPT = 4  # calls of each version
# Method, variant, options that save time.
_METHODS: tuple[tuple[str, str, dict[str, object]], ...] = (
    ("akashi_2016", "improved", {"iterations": 20, "starts": 1, "sample": 256}),
    ("kim_2013", "improved", {}),
    ("mallick_2006", "improved", {}),
    ("sparse_coding", "improved", {}),
    ("tan_2005", "improved", {}),
    ("yang_2010", "improved", {}),
    ("yoon_2006", "improved", {}),
    ("yoon_2006", "sihr", {}),
)


@dataclass(frozen=True)
class Call:
    """One call of a kernel.

    Attributes
    ----------
    version : Version
    before, after : list
        The arguments, with the fields of tuples in place of these; arrays have the strides that the
        kernel met.
    result : float, int or None
    """

    version: Version
    before: list[Any]
    after: list[Any]
    result: Any


def recorded_calls(library: KernelLibrary, versions: list[Version]) -> list[Call]:
    """Run the programs on a library.

    Parameters
    ----------
    library : KernelLibrary
        For this machine.
    versions : list of Version

    Returns
    -------
    list of Call

    Raises
    ------
    LookupError
        If a version was not called.
    """
    with _recording(library, versions) as calls:
        _run_programs()
    missing = {one.symbol for one in versions} - {one.version.symbol for one in calls}
    if missing:
        raise LookupError(f"not called: {', '.join(sorted(missing))}")
    return calls


@contextmanager
def _recording(library: KernelLibrary, versions: list[Version]) -> Iterator[list[Call]]:
    """Have the kernels run on a library, and their calls kept."""
    calls: list[Call] = []
    counts: Counter[str] = Counter()
    try:
        for kernel in kernels():
            own = [one for one in versions if one.kernel is kernel]
            vars(kernel)["compiled"] = _recorder(library, kernel, own, calls, counts)
        yield calls
    finally:
        for kernel in kernels():
            vars(kernel).pop("compiled", None)


def _recorder(
    library: KernelLibrary,
    kernel: Kernel,
    versions: list[Version],
    calls: list[Call],
    counts: Counter[str],
) -> Callable[..., Any]:
    entries = library.entries(kernel.function, kernel.signatures)

    def call(*values: Any) -> Any:
        flat = flattened(values)
        kept = all(counts[one.symbol] >= _KEPT for one in versions)
        before = [] if kept else _copies(flat)
        for version, entry in zip(versions, entries, strict=True):
            fits, result = entry(flat)
            if fits:
                if counts[version.symbol] < _KEPT:
                    calls.append(Call(version, before, _copies(flat), result))
                counts[version.symbol] += 1
                return result
        raise TypeError(f"{kernel.function.__name__} was called with arrays of other types")

    return call


def _copies(values: list[Any]) -> list[Any]:
    return [strided_copy(one) if isinstance(one, np.ndarray) else one for one in values]


def strided_copy(array: np.ndarray) -> np.ndarray:
    """Copy an array with its strides.

    Parameters
    ----------
    array : ndarray

    Returns
    -------
    ndarray
        A view of its `base`, the bytes from its first element in memory to its last.
    """
    steps = [(n - 1) * step for n, step in zip(array.shape, array.strides, strict=True)]
    first, last = sum(min(step, 0) for step in steps), sum(max(step, 0) for step in steps)
    memory = np.zeros(last - first + array.itemsize if array.size else 0, np.uint8)
    copy: np.ndarray = np.ndarray(array.shape, array.dtype, memory, -first, array.strides)
    copy[...] = array
    return copy


def _run_programs() -> None:
    outcome(mix)
    rng = np.random.default_rng(3)
    y, x = np.mgrid[-1 : 1 : _SIDE * 1j, -1 : 1 : _SIDE * 1j]
    mask = np.hypot(x, y) < 0.9
    facing = np.where(mask, np.sqrt(np.clip(1 - x**2 - y**2, 0, 1)), 0)
    paint = np.where((x > 0.1 * np.sin(9 * y))[..., None], [0.6, 0.25, 0.12], [0.15, 0.3, 0.5])
    gloss = 0.4 * np.exp(-((x - 0.4) ** 2 + (y + 0.2) ** 2) / 0.02)
    diffuse = paint * (0.3 + 0.6 * facing)[..., None]
    photo = (diffuse + gloss[..., None] + 0.004 * rng.random(diffuse.shape)) * mask[..., None]
    for method, variant, changes in _METHODS:
        separate(method, photo, mask, variant=variant, changes=changes)
    separate("kim_2013", photo.astype(np.float32), mask)
    alone = PatchFillOptions(matching=CshOptions(tables=3, candidates=3, threads=1))
    fill_patches(diffuse, gloss < 0.1, gloss >= 0.1, alone)
    roughness(rng.random((9, 10, 11)).astype(np.float32))
    corners = np.array([(-9, -7, 0), (8, -6, 2), (1, 9, 5), (0, 0, 9.0)])
    faces, places = np.array([(0, 1, 3), (1, 2, 3), (2, 0, 3)]), np.abs(corners[:, :2])
    turned_view(corners, faces, corners, 20.0, _SIDE, 2.0)
    turned_view(corners, faces, places, 20.0, _SIDE, 2.0, texture=rng.random((9, 8, 3)))
    averaged(diffuse.astype(np.float32), mask, 0.6)
    labelled(mask)
    nearest_pixels(mask)
    spline_coefficients(facing)
    integrate(x, y, mask)
    ends = rng.integers(0, 30, 99)
    pull, weight = (rng.integers(low, 9, n).astype(np.int32) for low, n in ((-9, 60), (0, 99)))
    source_side(pull, ends, ends + rng.integers(1, 30, 99), weight)
    convolved(diffuse[None, :7, :9], rng.normal(size=(9, 3, 5)), rng.normal(size=5))
    for single in (True, False):
        _recover_shape(diffuse, mask, single)
        kind = np.float32 if single else np.float64
        gaussian_average(facing.astype(kind), 2.0)
        matrix = linear_interpolation(x[0], _SIDE, kind)
        matrix @ facing, matrix @ x[0], matrix.transposed
        across, down, *layers = (1 + rng.random((4, 9, 11))).astype(kind)
        Paths(across, down, 5.0).average(np.stack(layers))


def _recover_shape(diffuse: np.ndarray, mask: np.ndarray, single: bool) -> None:
    zeros, deviation = np.zeros(diffuse.shape), np.where(mask, 0.5, 0.0)
    solver = SolverOptions("numba", single, threads=1, lbfgs=LbfgsOptions(iterations=5))
    recover(
        diffuse.astype(np.float32),
        mask,
        1 / 255,
        shipped_priors("photo", 3),
        replace(isc_weights("photo", 3), starts=(Start(),)),
        RecoverOptions(_SIDE, 0, solver=solver),
        predicted_normals=NormalEstimate(zeros + (0, 0, 1), deviation),
        predicted_shading=ShadingEstimate(zeros, deviation),
    )
