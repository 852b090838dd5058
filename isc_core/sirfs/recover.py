"""Shape and illumination of one masked diffuse image: the SIRFS problem set up, solved, and brought back to the image's scale.

The priors speak of pixels, so the object is brought to one size first (`RecoverOptions.solve_size`), and a window of its box with
a fixed margin is solved: neither the photo's scale nor empty space around the object changes the answer.
"""

from dataclasses import dataclass, field

import numpy as np

from ..progress import Monitor
from .contour import occluding_contour
from .priors import Priors
from .problem import DepthObservation, Problem, Terms
from .resampling import resample_height, resample_inside
from .settings import Weights
from .silhouette import silhouette_field
from .solver import SolverOptions, solve

MARGIN = 20


@dataclass(frozen=True)
class RecoverOptions:
    """`solve_size`: long side of the object's box, in pixels, at which SIRFS is solved; 0 for the size given.

    `margin`: pixels of empty space around the box there. `shading_only`: shape-from-shading mode, one reflectance colour.
    """

    solve_size: int = 0
    margin: int = MARGIN
    shading_only: bool = False
    solver: SolverOptions = field(default_factory=SolverOptions)


@dataclass(frozen=True)
class Known:
    """What is known beforehand, each at the image's scale: `height` (H, W) in pixels, `light` (9, C) reference convention,
    `depth` an observation with holes."""

    height: np.ndarray | None = None
    light: np.ndarray | None = None
    depth: DepthObservation | None = None


@dataclass(frozen=True)
class Recovered:
    """`height`: (H, W) float64 at the image's scale, pixels, 0 mean over the mask unless given; valid in the mask and its surroundings.

    `light`: (9, C) reference convention. `solved_shape`: of the window that was solved. `reason`: why the solver stopped.
    """

    height: np.ndarray
    light: np.ndarray
    terms: Terms
    iterations: int
    evaluations: int
    reason: str
    converged: bool
    solved_shape: tuple[int, ...]


@dataclass(frozen=True)
class _Window:
    """A rectangle around the object that may reach beyond the image."""

    top: int
    left: int
    height: int
    width: int

    def cut(self, array: np.ndarray, fill: float | bool) -> np.ndarray:
        rows, columns = array.shape[:2]
        out = np.full((self.height, self.width, *array.shape[2:]), fill, array.dtype)
        a, b = max(self.top, 0), min(self.top + self.height, rows)
        c, d = max(self.left, 0), min(self.left + self.width, columns)
        out[a - self.top : b - self.top, c - self.left : d - self.left] = array[a:b, c:d]
        return out

    def put(self, window: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
        out = np.zeros(shape, window.dtype)
        a, b = max(self.top, 0), min(self.top + self.height, shape[0])
        c, d = max(self.left, 0), min(self.left + self.width, shape[1])
        out[a:b, c:d] = window[a - self.top : b - self.top, c - self.left : d - self.left]
        return out


def recover(
    image: np.ndarray,
    mask: np.ndarray,
    floor: float,
    priors: Priors,
    weights: Weights,
    options: RecoverOptions | None = None,
    *,
    known: Known | None = None,
    monitor: Monitor | None = None,
) -> Recovered:
    """Recovers height and light.

    `image`: (H, W, C) linear diffuse light, C = `priors.channels`; `mask`: (H, W) bool; `floor`: zero channels are raised to it, in
    the logarithm only. Raises `Cancelled`.
    """
    options, known = options or RecoverOptions(), known or Known()
    window, factor = _window(mask, options)
    inside = window.cut(mask, False)
    problem = _problem(window.cut(image, 0), inside, _contour_mask(mask, window), factor, floor, priors, weights, options, known, window)
    shape = problem.valid.shape
    height = None if known.height is None else _to_solve(window.cut(known.height, 0.0), inside, factor)
    result = solve(problem, options.solver, known_height=height, known_light=known.light, monitor=monitor)
    cut = resample_height(result.height, inside.shape) if known.height is None else window.cut(known.height, 0.0)
    if known.height is None and known.depth is None:
        cut = cut - cut[inside].mean()
    return Recovered(
        window.put(cut, mask.shape), result.light, result.terms, result.iterations, result.total_evaluations,
        result.reason, result.converged, shape,
    )  # fmt: skip


def _window(mask: np.ndarray, options: RecoverOptions) -> tuple[_Window, float]:
    rows, columns = np.nonzero(mask.any(axis=1))[0], np.nonzero(mask.any(axis=0))[0]
    height, width = int(rows[-1] - rows[0] + 1), int(columns[-1] - columns[0] + 1)
    factor = options.solve_size / max(height, width) if options.solve_size else 1.0
    margin = round(options.margin / factor)
    return _Window(int(rows[0]) - margin, int(columns[0]) - margin, height + 2 * margin, width + 2 * margin), factor


def _contour_mask(mask: np.ndarray, window: _Window) -> np.ndarray:
    """The mask in the window, going on beyond the photo where the photo's frame cuts the object: there is no contour there."""
    grown = np.pad(mask, [(max(-window.top, 0), max(window.top + window.height - mask.shape[0], 0)),
                          (max(-window.left, 0), max(window.left + window.width - mask.shape[1], 0))], mode="edge")  # fmt: skip
    top, left = max(window.top, 0), max(window.left, 0)
    return grown[top : top + window.height, left : left + window.width]


def _problem(
    image: np.ndarray, inside: np.ndarray, contour_mask: np.ndarray, factor: float, floor: float, priors: Priors, weights: Weights,
    options: RecoverOptions, known: Known, window: _Window,
) -> Problem:  # fmt: skip
    valid, contour_inside, depth = inside, contour_mask, known.depth
    if depth is not None:
        depth = DepthObservation(window.cut(depth.height, np.nan), depth.sigma, depth.weight)
    if factor != 1:
        image, share = resample_inside(image, inside, factor)
        valid = share >= 0.5
        contour_inside = resample_inside(contour_mask.astype(float), np.ones_like(inside), factor)[0] >= 0.5
        if depth is not None:
            seen, seen_share = resample_inside(np.nan_to_num(depth.height), np.isfinite(depth.height), factor)
            depth = DepthObservation(np.where(seen_share >= 0.5, seen * factor, np.nan), depth.sigma * factor, depth.weight)
    log_image = np.where(valid[..., None], np.log(np.maximum(image, floor)), 0.0)
    contour = occluding_contour(contour_inside)
    field = None if priors.silhouette is None else silhouette_field(contour_inside, priors.silhouette)
    return Problem(log_image, valid, contour_inside, contour, priors, weights, depth, options.shading_only, silhouette=field)


def _to_solve(height: np.ndarray, inside: np.ndarray, factor: float) -> np.ndarray:
    if factor == 1:
        return np.array(height, float)
    return resample_inside(height, np.ones_like(inside), factor)[0] * factor
