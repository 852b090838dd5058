"""The SIRFS objective on compiled kernels and a few threads: the engine that users run.

Rows are split into blocks whose number depends on the image alone, and every sum is taken in a
fixed order: the result is the same, to the byte, on one thread or many.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from ..numerics.thread_pool import Workers
from ..shading.irradiance_basis import C1, C2, C3, C4, C5
from ..shading.surface_stencils import fold_border
from . import kernels, reflectance, surface
from .illumination import light_cost
from .priors.tabulated_potential import TabulatedPotential
from .problem import PAIR_OFFSETS, Evaluation, Problem, Terms

_ROWS_A_BLOCK = 16
_MOST_BLOCKS = 16
_MONOMIAL_SCALES = np.array([C4, 2 * C2, 2 * C2, 2 * C2, 2 * C1, 2 * C1, C3, 2 * C1, C1])


def _fold_light(light: np.ndarray) -> np.ndarray:
    """The light (9, C) as coefficients of 1, n2, n3, n1, n1 n2, n2 n3, n3^2, n1 n3, n1^2 - n2^2."""
    folded = light * _MONOMIAL_SCALES[:, None]
    folded[0] -= C5 * light[6]
    return folded


def _unfold_light_gradient(sums: np.ndarray) -> np.ndarray:
    """The adjoint of `_fold_light`."""
    gradient = sums * _MONOMIAL_SCALES[:, None]
    gradient[6] -= C5 * sums[0]
    return gradient


def _from_zero(table: TabulatedPotential) -> tuple[float, np.ndarray]:
    """The part of `table` that arguments above 0 need: where its first node is, and its costs."""
    first = min(max(int(np.floor(-table.low / table.step)), 0), len(table.values) - 2)
    return table.low + first * table.step, table.values[first:]


class NumbaEngine:
    """Evaluates one `Problem` in `dtype` on `workers`.

    Buffers are reused: an evaluation's arrays are its own only until the next.
    """

    def __init__(
        self,
        problem: Problem,
        dtype: type[np.floating] = np.float32,
        workers: Workers | None = None,
    ) -> None:
        self.problem = problem
        self.dtype = np.dtype(dtype)
        self._workers = workers or Workers(1)
        self._set_up_inputs()
        self._set_up_buffers()

    def _set_up_inputs(self) -> None:
        p, t = self.problem, self.dtype
        self._log_image = np.ascontiguousarray(p.log_image.transpose(0, 2, 1), t)
        self._valid, self._trust = p.valid.astype(t), p.reflectance_weight.astype(t)
        height, width = p.valid.shape
        spans = np.zeros((height, 2), np.int64)
        rows = p.valid.any(axis=1)
        spans[rows, 0] = p.valid[rows].argmax(axis=1)
        spans[rows, 1] = width - p.valid[rows, ::-1].argmax(axis=1)
        self._spans = spans
        self._offsets = np.array(PAIR_OFFSETS, np.int64)
        channels = p.log_image.shape[2]
        whiten = (
            (np.eye(channels), np.eye(channels))
            if p.shading_only
            else (p.priors.smoothness_whiten, p.priors.parsimony_whiten)
        )
        self._whiten_smooth, self._whiten_palette = (np.ascontiguousarray(m, t) for m in whiten)
        # the softened difference is positive: float32 finds its cell more exactly when the table
        # starts at 0
        self._curvature_low, costs = _from_zero(p.priors.curvature)
        # differences are taken before rounding: two large float32 costs would leave nothing of a
        # small slope
        self._smooth_table, self._curvature_table = (
            (v.astype(t), np.diff(v).astype(t)) for v in (p.priors.smoothness.values, costs)
        )
        if p.silhouette is not None:
            strength = np.where(p.valid, p.silhouette.precision, 0) * (
                p.weights.silhouette / max(int(p.valid.sum()), 1)
            )
            field = p.silhouette
            self._expected, self._strength = (
                np.ascontiguousarray([field.down, field.right], t),
                strength.astype(t),
            )
        count = min(_MOST_BLOCKS, max(1, height // _ROWS_A_BLOCK))
        edges = [height * k // count for k in range(count + 1)]
        self._blocks = list(zip(edges[:-1], edges[1:], strict=True))

    def _set_up_buffers(self) -> None:
        t = self.dtype
        height, width = self.problem.valid.shape
        channels, blocks = self.problem.log_image.shape[2], len(self._blocks)
        self._padded = np.empty(
            (height + 2, width + 2)
        )  # float64: in float32 the rounding of heights would drown their curvature
        self._geometry = np.zeros((height, 9, width), t)
        self._whitened, self._palette = np.zeros((2, height, channels, width), t)
        self._g_smooth, self._g_palette = np.zeros((2, height, channels, width), t)
        self._d3, self._g_curvature = np.zeros((2, height, width), t)
        self._contour = np.zeros((2, height, width), t)
        self._slant = np.empty(height)
        self._light_sums = np.empty((height, 9, channels))
        self._derivatives = np.zeros((5, height + 4, width + 4), t)
        self._wide = np.empty((height + 2, width + 2), t)
        self._smooth_spill = np.empty((blocks, 2, channels, width), t)
        self._curvature_spill = np.empty((blocks, 2, width), t)
        self._smooth_cost, self._curvature_cost = np.zeros((2, blocks))
        self._silhouette_cost = np.zeros(height)
        if channels == 3:
            self._cell, self._side = (
                np.zeros((height, width), np.int32),
                np.zeros((height, 3, width), t),
            )
        self._palette_terms: dict[str, float] = {}

    def evaluate(self, height: np.ndarray, light: np.ndarray) -> Evaluation:
        """The objective at `height` (H, W) and `light` (9, C), with its gradients."""
        p = self.problem
        self._pad(height)
        folded = _fold_light(np.asarray(light, float)).astype(self.dtype)
        self._each_block(partial(self._forward, folded))
        if not (np.isfinite(self._slant).all() and np.isfinite(folded).all()):
            # a step too far: kernels that look up tables must not see what is no number
            return Evaluation(
                Terms(slant=float("inf")), np.zeros(height.shape, self.dtype), np.zeros(light.shape)
            )
        pairs: list[Callable[[], None]] = [self._palette_task]
        pairs += [partial(self._pair_block, k) for k in range(len(self._blocks))]
        self._workers.run(pairs)
        self._add_spills()
        if p.silhouette is not None:
            self._each_block(self._silhouette_rows)
        contour = self._contour_term()
        self._each_block(partial(self._backward, folded))
        self._workers.run(
            [
                partial(kernels.adjoint_rows, a, b, self._derivatives, self._wide)
                for a, b in self._shares(len(self._wide))
            ]
        )
        gradient = fold_border(self._wide)
        light_gradient = _unfold_light_gradient(self._light_sums.sum(axis=0))
        cost, pull = light_cost(np.asarray(light, float), p.priors.light, p.weights.light)
        terms = self._palette_terms | {"contour": contour, "light": cost} | self._pair_terms()
        if p.silhouette is not None:
            terms["silhouette"] = float(self._silhouette_cost.sum())
        if p.observation is not None:
            terms["observation"], seen = surface.observation_cost(height, p.observation)
            gradient += seen.astype(self.dtype)
        return Evaluation(Terms(**terms), gradient, light_gradient + pull)

    def _pad(self, height: np.ndarray) -> None:
        z = self._padded
        z[1:-1, 1:-1] = height
        z[0], z[-1] = z[1], z[-2]
        z[:, 0], z[:, -1] = z[:, 1], z[:, -2]

    def _each_block(self, task: Callable[[int, int], None]) -> None:
        self._workers.run([partial(task, a, b) for a, b in self._shares(self._valid.shape[0])])

    def _shares(self, rows: int) -> list[tuple[int, int]]:
        """Rows for kernels whose result does not depend on how rows are split: one share a thread."""
        n = self._workers.threads
        return [(rows * k // n, rows * (k + 1) // n) for k in range(n)]

    def _forward(self, light: np.ndarray, first: int, last: int) -> None:
        kernels.forward_rows(
            first,
            last,
            self._padded,
            self._spans,
            self._log_image,
            light,
            self._whiten_smooth,
            self._whiten_palette,
            self._geometry,
            self._whitened,
            self._palette,
            self._d3,
            self._slant,
        )

    def _silhouette_rows(self, first: int, last: int) -> None:
        kernels.silhouette_rows(
            first,
            last,
            self._geometry,
            self._expected,
            self._strength,
            self._contour,
            self._silhouette_cost,
        )

    def _pair_block(self, k: int) -> None:
        first, last = self._blocks[k]
        p = self.problem
        table = p.priors.curvature
        kernels.curvature_block(
            first,
            last,
            self._geometry,
            self._valid,
            self._spans,
            self._offsets,
            *self._curvature_table,
            self._curvature_low,
            1 / table.step,
            self._g_curvature,
            self._curvature_spill[k],
            self._curvature_cost,
            k,
        )
        if p.shading_only:
            return
        table = p.priors.smoothness
        kernels.smoothness_block(
            first,
            last,
            self._whitened,
            self._trust,
            self._spans,
            self._offsets,
            *self._smooth_table,
            table.low,
            1 / table.step,
            self._g_smooth,
            self._smooth_spill[k],
            self._smooth_cost,
            k,
        )

    def _add_spills(self) -> None:
        for k, (_, last) in enumerate(self._blocks[:-1]):
            self._g_curvature[last : last + 2] += self._curvature_spill[k]
            if not self.problem.shading_only:
                self._g_smooth[last : last + 2] += self._smooth_spill[k]

    def _palette_task(self) -> None:
        p = self.problem
        if p.shading_only or p.priors.channels == 1:
            self._palette_in_numpy()
            return
        w, table = p.weights, p.priors.absolute
        nodes = table.values.shape[0]
        step = (table.high - table.low) / (nodes - 1)
        bounds = np.empty((3, 2), np.int64)
        kernels.palette_range(
            self._palette, self._trust, self._spans, table.low, step, nodes, bounds
        )
        counts = np.zeros(tuple(bounds[:, 1] - bounds[:, 0]))
        kernels.locate_color(
            self._palette, self._spans, table.low, 1 / step, nodes, bounds, self._cell, self._side
        )
        kernels.splat_color(self._trust, self._spans, self._cell, self._side, counts)
        pixels = float(p.reflectance_weight.sum())
        blurred = np.empty_like(counts)
        kernels.blur_color(
            counts,
            reflectance.parzen_taps(w.parsimony_sigma / reflectance.SIGMA_UNIT, step, pixels, 3),
            blurred,
        )
        overlap = float((blurred * counts).sum())
        costs = table.values[tuple(slice(a, b) for a, b in bounds)]
        scale = w.absolute / (reflectance.ABSOLUTE_DIVISOR * pixels)
        node_gradient = (-2 * w.parsimony / overlap) * blurred + scale * costs
        self._palette_terms = {
            "parsimony": -w.parsimony * float(np.log(overlap)),
            "absolute": scale * float((costs * counts).sum()),
        }
        kernels.gather_color(
            self._palette,
            self._trust,
            self._spans,
            table.low,
            table.high,
            1 / step,
            self._cell,
            self._side,
            node_gradient.astype(self.dtype),
            self._g_palette,
        )

    def _palette_in_numpy(self) -> None:
        """Grey photos and shape-from-shading mode, where these terms cost next to nothing."""
        p, w = self.problem, self.problem.weights
        values = self._palette.transpose(0, 2, 1)
        if p.shading_only:
            cost, gradient = reflectance.one_color_cost(
                values, p.reflectance_weight, w.shading_only
            )
            self._palette_terms = {"shading_only": cost}
            self._g_palette[:] = gradient.transpose(0, 2, 1)
            return
        log_reflectance = values @ np.linalg.inv(self._whiten_palette).T
        parsimony, absolute, gradient = reflectance.palette_cost(
            log_reflectance, p.reflectance_weight, p.priors, w
        )
        self._palette_terms = {"parsimony": parsimony, "absolute": absolute}
        self._g_palette[:] = (gradient @ np.linalg.inv(self._whiten_palette)).transpose(0, 2, 1)

    def _contour_term(self) -> float:
        p, w = self.problem, self.problem.weights
        at = (p.contour.rows, p.contour.columns)
        n1, n2 = self._geometry[:, 5], self._geometry[:, 6]
        cost, c1, c2 = surface.contour_cost(
            n1, n2, p.contour, w.contour, w.contour_power, p.valid.size
        )
        if p.silhouette is None:
            self._contour[(0, *at)] = c1
            self._contour[(1, *at)] = c2
        else:
            self._contour[(0, *at)] += c1
            self._contour[(1, *at)] += c2
        return cost

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
            "curvature": w.curvature / (25 * n) * float(self._curvature_cost.sum()),
            "slant": w.slant / n * float(self._slant.sum()),
        }
        if not p.shading_only:
            terms["smoothness"] = (
                w.smoothness * 3 / (25 * n * channels) * float(self._smooth_cost.sum())
            )
        return terms

    def _backward(self, light: np.ndarray, first: int, last: int) -> None:
        kernels.backward_rows(
            first,
            last,
            self._geometry,
            self._spans,
            light,
            self._whiten_smooth,
            self._whiten_palette,
            self._g_smooth,
            self._g_palette,
            self._g_curvature,
            self._scales(),
            self._d3,
            self._contour,
            self._light_sums,
            self._derivatives,
        )
