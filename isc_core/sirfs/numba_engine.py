"""The SIRFS objective with compiled kernels on several threads: the production engine.

Determinism: rows are split into blocks whose number depends on the image alone, and every sum is
taken in a fixed order, so the result is the same to the byte on any number of threads.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ..numerics.linear import solve_linear
from ..numerics.thread_pool import ThreadPool
from ..shading.irradiance_basis import C1, C2, C3, C4, C5
from ..shading.surface_stencils import fold_border
from . import reflectance, surface
from .illumination import light_cost
from .kernels import (
    arrays,
    colour_histogram,
    expected_normals,
    expected_shading,
    height_rows,
    pixel_pairs,
)
from .precision import scaled_precision
from .priors.tabulated_potential import TabulatedPotential
from .problem import PAIR_OFFSETS, Evaluation, Problem, Terms
from .shading_term import ExpectedShading, optimal_offsets
from .silhouette import ExpectedNormals

_ROWS_PER_BLOCK = 16
_MAX_BLOCKS = 16
_MONOMIAL_SCALES = np.array([C4, 2 * C2, 2 * C2, 2 * C2, 2 * C1, 2 * C1, C3, 2 * C1, C1])


def _fold_light(light: np.ndarray) -> np.ndarray:
    """Light (9, C) as coefficients of 1, n2, n3, n1, n1 n2, n2 n3, n3^2, n1 n3, n1^2 - n2^2."""
    folded = light * _MONOMIAL_SCALES[:, None]
    folded[0] -= C5 * light[6]
    return folded


def _unfold_light_gradient(sums: np.ndarray) -> np.ndarray:
    """Adjoint of `_fold_light`."""
    gradient = sums * _MONOMIAL_SCALES[:, None]
    gradient[6] -= C5 * sums[0]
    return gradient


def _from_zero(table: TabulatedPotential) -> tuple[float, np.ndarray]:
    """The part of `table` for arguments above 0: its first node, and its costs."""
    first = min(max(int(np.floor(-table.low / table.step)), 0), len(table.values) - 2)
    return table.low + first * table.step, table.values[first:]


def _pairs(low: float, step: float, costs: np.ndarray, dtype: np.dtype[Any]) -> pixel_pairs.Pairs:
    """The pairs with a tabulated potential, in `dtype`."""
    # Differences are taken before rounding: between two large float32 costs, a small slope would
    # be lost.
    return pixel_pairs.Pairs(
        np.array(PAIR_OFFSETS, np.int64),
        costs.astype(dtype),
        np.diff(costs).astype(dtype),
        low,
        1 / step,
    )


def _spans(valid: np.ndarray) -> np.ndarray:
    """First valid column of each row and one past the last, (H, 2)."""
    spans = np.zeros((len(valid), 2), np.int64)
    rows = valid.any(axis=1)
    spans[rows, 0] = valid[rows].argmax(axis=1)
    spans[rows, 1] = valid.shape[1] - valid[rows, ::-1].argmax(axis=1)
    return spans


class _NormalsTerm:
    """A term of expected normals.

    Parameters
    ----------
    valid : (H, W) bool ndarray
    field : ExpectedNormals
    weight : float
    dtype : dtype
    """

    def __init__(
        self, valid: np.ndarray, field: ExpectedNormals, weight: float, dtype: np.dtype[Any]
    ) -> None:
        self._expected = np.ascontiguousarray([field.down, field.right], dtype)
        self._strength = np.ascontiguousarray(
            scaled_precision(field.precision, valid, weight), dtype
        )
        self._sums = np.zeros(len(valid))

    def rows(self, geometry: np.ndarray, gradient: np.ndarray, first: int, last: int) -> None:
        expected_normals.normals_rows(
            first, last, geometry, self._expected, self._strength, gradient, self._sums
        )

    def cost(self) -> float:
        return float(self._sums.sum())


class _ShadingTerm:
    """The term of the expected shading, and its gradient added to that of the palette.

    Parameters
    ----------
    problem : Problem
    expected : ExpectedShading
    dtype : dtype
    """

    def __init__(self, problem: Problem, expected: ExpectedShading, dtype: np.dtype[Any]) -> None:
        valid, weights = problem.valid, problem.weights
        channels = expected.mean.shape[2]
        strength = scaled_precision(expected.precision, valid, weights.predicted_shading, channels)
        self._total, self._strength = float(strength.sum()), strength.astype(dtype, order="C")
        self._balanced = weights.balanced_colour
        self._mean = np.ascontiguousarray(expected.mean.transpose(0, 2, 1), dtype)
        self._spans = _spans(valid)
        whiten = np.eye(channels) if problem.shading_only else problem.priors.parsimony_whiten
        # log reflectance = log image - log shading, hence the sign
        self._back = np.ascontiguousarray(-solve_linear(whiten, np.eye(channels)).T, dtype)
        self._residual, self.joined = np.zeros((2, *self._mean.shape), dtype)
        self._residual_sums, self._sums = np.zeros((len(valid), channels)), np.zeros(len(valid))

    def residuals(self, geometry: np.ndarray, light: np.ndarray, first: int, last: int) -> None:
        expected_shading.residual_rows(
            first,
            last,
            geometry,
            self._spans,
            light,
            self._mean,
            self._strength,
            self._residual,
            self._residual_sums,
        )

    def offsets(self) -> np.ndarray:
        found = optimal_offsets(self._residual_sums.sum(axis=0), self._total, self._balanced)
        return found.astype(self._mean.dtype)

    def gradients(self, offsets: np.ndarray, palette: np.ndarray, first: int, last: int) -> None:
        expected_shading.pull_rows(
            first,
            last,
            self._spans,
            self._residual,
            offsets,
            self._strength,
            self._back,
            palette,
            self.joined,
            self._sums,
        )

    def cost(self) -> float:
        return float(self._sums.sum())


class NumbaEngine:
    """Evaluate the objective of one problem.

    Buffers are reused: the arrays of an evaluation are valid until the next one.

    Parameters
    ----------
    problem : Problem
    dtype : type
        float32 or float64.
    workers : ThreadPool, optional
        By default, one thread.
    """

    def __init__(
        self,
        problem: Problem,
        dtype: type[np.floating] = np.float32,
        workers: ThreadPool | None = None,
    ) -> None:
        self.problem = problem
        self.dtype = np.dtype(dtype)
        self._workers = workers or ThreadPool(1)
        self._set_up_inputs()
        self._set_up_buffers()

    def _set_up_inputs(self) -> None:
        p, t = self.problem, self.dtype
        height, channels = p.valid.shape[0], p.log_image.shape[2]
        weight = p.reflectance_weight
        self._pixels = float(weight.sum())
        self._photo = arrays.Photo(
            np.ascontiguousarray(p.log_image.transpose(0, 2, 1), t),
            weight.astype(t, order="C"),
            p.valid.astype(t, order="C"),
            _spans(p.valid),
        )
        whiten = (
            (np.eye(channels), np.eye(channels))
            if p.shading_only
            else (p.priors.smoothness_whiten, p.priors.parsimony_whiten)
        )
        self._whiten = arrays.Reflectance(*(np.ascontiguousarray(m, t) for m in whiten))
        # The softened difference is positive: in float32, its cell is more exact if the table
        # starts at 0.
        low, costs = _from_zero(p.priors.curvature)
        self._curvature_pairs = _pairs(low, p.priors.curvature.step, costs, t)
        smoothness = p.priors.smoothness
        self._smooth_pairs = _pairs(smoothness.low, smoothness.step, smoothness.values, t)
        count = min(_MAX_BLOCKS, max(1, height // _ROWS_PER_BLOCK))
        edges = [height * k // count for k in range(count + 1)]
        self._blocks = list(zip(edges[:-1], edges[1:], strict=True))

    def _set_up_buffers(self) -> None:
        t = self.dtype
        height, width = self.problem.valid.shape
        channels, blocks = self.problem.log_image.shape[2], len(self._blocks)
        # float64: in float32, rounding of the heights would dominate their curvature
        self._padded = np.empty((height + 2, width + 2))
        self._surface = arrays.Surface(
            np.zeros((height, 9, width), t), np.zeros((height, width), t), np.empty(height)
        )
        self._reflectance = arrays.Reflectance(*np.zeros((2, height, channels, width), t))
        g_smooth, g_palette = np.zeros((2, height, channels, width), t)
        self._pulls = height_rows.Pulls(g_smooth, g_palette, np.zeros((height, width), t))
        self._smooth_sums = pixel_pairs.PairSums(
            g_smooth, np.empty((blocks, 2, channels, width), t), np.zeros(blocks)
        )
        self._curvature_sums = pixel_pairs.PairSums(
            self._pulls.curvature, np.empty((blocks, 2, width), t), np.zeros(blocks)
        )
        self._in_plane = np.zeros((2, height, width), t)
        self._backward_out = height_rows.Backward(
            np.empty((height, 9, channels)), np.zeros((5, height + 4, width + 4), t)
        )
        self._wide = np.empty((height + 2, width + 2), t)
        if channels == 3:
            self._cells = colour_histogram.Cells(
                np.zeros((height, width), np.int32), np.zeros((height, 3, width), t)
            )
        self._palette_terms: dict[str, float] = {}
        self._contour = 0.0
        p, w = self.problem, self.problem.weights
        fields = {
            "silhouette": (p.silhouette, w.silhouette),
            "predicted_normals": (p.predicted_normals, w.predicted_normals),
        }
        self._normals = {
            name: _NormalsTerm(p.valid, field, weight, t)
            for name, (field, weight) in fields.items()
            if field is not None
        }
        expected = p.predicted_shading
        self._shading = None if expected is None else _ShadingTerm(p, expected, t)

    def evaluate(self, height: np.ndarray, light: np.ndarray) -> Evaluation:
        """Compute the objective and its gradients.

        Parameters
        ----------
        height : (H, W) ndarray
            Pixels toward the viewer.
        light : (9, C) ndarray
            Log-shading coefficients, reference convention.

        Returns
        -------
        Evaluation
            With an infinite slant term and zero gradients if the geometry is not finite.
        """
        p = self.problem
        self._pad(height)
        folded = _fold_light(np.asarray(light, float)).astype(self.dtype, order="C")
        self._for_row_ranges(partial(self._forward, folded))
        if not (np.isfinite(self._surface.slant).all() and np.isfinite(folded).all()):
            # The step was too long; NaN or infinity must not reach the table look-ups.
            return Evaluation(
                Terms(slant=float("inf")), np.zeros(height.shape, self.dtype), np.zeros(light.shape)
            )
        tasks: list[Callable[[], None]] = [self._palette_task, self._contour_task]
        tasks += [partial(self._pair_block, k) for k in range(len(self._blocks))]
        self._workers.run(tasks)
        self._add_spills()
        offsets = None if self._shading is None else self._shading.offsets()
        self._for_row_ranges(partial(self._backward, folded, offsets))
        self._workers.run(
            [
                partial(height_rows.adjoint_rows, a, b, self._backward_out.derivatives, self._wide)
                for a, b in self._row_ranges(len(self._wide))
            ]
        )
        gradient = fold_border(self._wide)
        light_gradient = _unfold_light_gradient(self._backward_out.light.sum(axis=0))
        cost, prior_gradient = light_cost(np.asarray(light, float), p.priors.light, p.weights.light)
        terms = self._palette_terms | {"contour": self._contour, "light": cost}
        terms |= self._pair_terms()
        terms |= {name: term.cost() for name, term in self._normals.items()}
        if self._shading is not None:
            terms["predicted_shading"] = self._shading.cost()
        if p.observation is not None:
            terms["observation"], d_height = surface.observation_cost(height, p.observation)
            gradient += d_height.astype(self.dtype)
        return Evaluation(Terms(**terms), gradient, light_gradient + prior_gradient)

    def _pad(self, height: np.ndarray) -> None:
        z = self._padded
        z[1:-1, 1:-1] = height
        z[0], z[-1] = z[1], z[-2]
        z[:, 0], z[:, -1] = z[:, 1], z[:, -2]

    def _for_row_ranges(self, task: Callable[[int, int], None]) -> None:
        self._workers.run(
            [partial(task, a, b) for a, b in self._row_ranges(self.problem.valid.shape[0])]
        )

    def _row_ranges(self, rows: int) -> list[tuple[int, int]]:
        """Rows for kernels whose result does not depend on the split: one range per thread."""
        n = self._workers.threads
        return [(rows * k // n, rows * (k + 1) // n) for k in range(n)]

    def _forward(self, light: np.ndarray, first: int, last: int) -> None:
        """Quantities of a row that depend only on the heights of neighbouring rows."""
        height_rows.forward_rows(
            first,
            last,
            self._padded,
            self._photo,
            light,
            self._whiten,
            self._surface,
            self._reflectance,
        )
        geometry = self._surface.geometry
        self._in_plane[:, first:last] = 0
        for term in self._normals.values():
            term.rows(geometry, self._in_plane, first, last)
        if self._shading is not None:
            self._shading.residuals(geometry, light, first, last)

    def _pair_block(self, k: int) -> None:
        first, last = self._blocks[k]
        pixel_pairs.curvature_block(
            first,
            last,
            k,
            self._surface.geometry,
            self._photo,
            self._curvature_pairs,
            self._curvature_sums,
        )
        if self.problem.shading_only:
            return
        pixel_pairs.smoothness_block(
            first,
            last,
            k,
            self._reflectance.smoothness,
            self._photo,
            self._smooth_pairs,
            self._smooth_sums,
        )

    def _add_spills(self) -> None:
        both = (self._curvature_sums, self._smooth_sums)
        for k, (_, last) in enumerate(self._blocks[:-1]):
            for sums in both[:1] if self.problem.shading_only else both:
                sums.gradient[last : last + 2] += sums.spill[k]

    def _palette_task(self) -> None:
        p = self.problem
        if p.shading_only or p.priors.channels == 1:
            self._palette_in_numpy()
            return
        w, table = p.weights, p.priors.absolute
        nodes = table.values.shape[0]
        step = (table.high - table.low) / (nodes - 1)
        grid = colour_histogram.Grid(table.low, table.high, step, 1 / step, nodes)
        palette, photo, cells = self._reflectance.palette, self._photo, self._cells
        bounds = np.empty((3, 2), np.int64)
        colour_histogram.palette_range(palette, photo, grid, bounds)
        counts = np.zeros(tuple(bounds[:, 1] - bounds[:, 0]))
        colour_histogram.locate_color(palette, photo.spans, grid, bounds, cells)
        colour_histogram.splat_color(photo, cells, counts)
        pixels = self._pixels
        blurred = np.empty_like(counts)
        taps = reflectance.parzen_taps(w.parsimony_sigma / reflectance.SIGMA_UNIT, step, pixels, 3)
        colour_histogram.blur_color(counts, taps, blurred)
        overlap = float((blurred * counts).sum())
        costs = table.values[tuple(slice(a, b) for a, b in bounds)]
        scale = w.absolute / (reflectance.ABSOLUTE_DIVISOR * pixels)
        node_gradient = blurred
        node_gradient *= -2 * w.parsimony / overlap
        node_gradient += scale * costs
        self._palette_terms = {
            "parsimony": -w.parsimony * float(np.log(overlap)),
            "absolute": scale * float((costs * counts).sum()),
        }
        colour_histogram.gather_color(
            palette, photo, grid, cells, node_gradient.astype(self.dtype), self._pulls.palette
        )

    def _palette_in_numpy(self) -> None:
        """Grey photos and shape-from-shading mode, where these terms take hardly any time."""
        p, w = self.problem, self.problem.weights
        values = self._reflectance.palette.transpose(0, 2, 1)
        if p.shading_only:
            cost, gradient = reflectance.one_color_cost(
                values, p.reflectance_weight, w.shading_only
            )
            self._palette_terms = {"shading_only": cost}
            self._pulls.palette[:] = gradient.transpose(0, 2, 1)
            return
        log_reflectance = values @ np.linalg.inv(self._whiten.palette).T
        parsimony, absolute, gradient = reflectance.palette_cost(
            log_reflectance, p.reflectance_weight, p.priors, w
        )
        self._palette_terms = {"parsimony": parsimony, "absolute": absolute}
        self._pulls.palette[:] = (gradient @ np.linalg.inv(self._whiten.palette)).transpose(0, 2, 1)

    def _contour_task(self) -> None:
        p, w = self.problem, self.problem.weights
        at = (p.contour.rows, p.contour.columns)
        n1, n2 = self._surface.geometry[:, 5], self._surface.geometry[:, 6]
        self._contour, c1, c2 = surface.contour_cost(
            n1, n2, p.contour, w.contour, w.contour_power, p.valid.size
        )
        self._in_plane[(0, *at)] += c1
        self._in_plane[(1, *at)] += c2

    def _scales(self) -> tuple[float, float, float, float]:
        p, w = self.problem, self.problem.weights
        n, channels = p.valid.size, p.priors.channels
        smooth = (
            0.0
            if p.shading_only
            else w.smoothness * 3 / (25 * n * channels) / p.priors.smoothness.step
        )
        curvature = w.curvature / (25 * n) / p.priors.curvature.step
        return smooth, 1.0, curvature, w.slant / n

    def _pair_terms(self) -> dict[str, float]:
        p, w = self.problem, self.problem.weights
        n, channels = p.valid.size, p.priors.channels
        terms = {
            "curvature": w.curvature / (25 * n) * float(self._curvature_sums.cost.sum()),
            "slant": w.slant / n * float(self._surface.slant.sum()),
        }
        if not p.shading_only:
            terms["smoothness"] = (
                w.smoothness * 3 / (25 * n * channels) * float(self._smooth_sums.cost.sum())
            )
        return terms

    def _backward(
        self, light: np.ndarray, offsets: np.ndarray | None, first: int, last: int
    ) -> None:
        pulls = self._pulls
        if self._shading is not None and offsets is not None:
            self._shading.gradients(offsets, pulls.palette, first, last)
            pulls = pulls._replace(palette=self._shading.joined)
        height_rows.backward_rows(
            first,
            last,
            self._surface,
            self._photo.spans,
            light,
            self._whiten,
            pulls,
            self._scales(),
            self._in_plane,
            self._backward_out,
        )
