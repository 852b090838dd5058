"""Shape and illumination of one masked diffuse image: the SIRFS problem set up, solved, and brought
back to the image's scale.

The priors speak of pixels, so the object is brought to one size first
(`RecoverOptions.solve_size`), and a window of its box with a fixed margin is solved: neither the
photo's scale nor empty space around the object changes the answer.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from ..imaging.framing import continued
from ..imaging.resampling import height_scale, resample_height, resample_inside
from ..progress import Monitor
from ..scene.normal_estimate import NormalEstimate
from ..shading.occluding_contour import Contour, occluding_contour
from .normal_prior import expected_field
from .priors.priors import Priors
from .problem import DepthObservation, Problem, Terms
from .settings import Weights
from .solver import SolverOptions, solve

MARGIN = 20
SOLVE_SIZE = 256


@dataclass(frozen=True)
class RecoverOptions:
    """How the problem is cut out of the image, and how it is solved.

    Attributes
    ----------
    solve_size : int
        Long side of the object's box, in pixels, at which SIRFS is solved; 0 for the size given.
    margin : int
        Pixels of empty space around the box at that size.
    whole_frame : bool
        Solve the frame as given instead of a window around the object. The height then is returned
        as solved, not shifted to a mean of 0.
    drop_near_edge : bool
        Ignore occluding-contour points near the frame, see `occluding_contour`.
    shading_only : bool
        Shape-from-shading mode, one reflectance colour.
    solver : SolverOptions
        How the problem is minimised.
    """

    solve_size: int = SOLVE_SIZE
    margin: int = MARGIN
    whole_frame: bool = False
    drop_near_edge: bool = False
    shading_only: bool = False
    solver: SolverOptions = field(default_factory=SolverOptions)


@dataclass(frozen=True)
class Known:
    """What is known beforehand, each at the image's scale: `height` (H, W) in pixels, `light` (9,
    C) reference convention, `depth` an observation with holes; outside the mask it is not looked
    at.
    """

    height: np.ndarray | None = None
    light: np.ndarray | None = None
    depth: DepthObservation | None = None


@dataclass(frozen=True)
class Recovered:
    """`height`: (H, W) float64 at the image's scale, pixels, 0 mean over the mask unless given;
    valid in the mask and its surroundings.

    `light`: (9, C) reference convention. `solved_shape`: of the window that was solved. `reason`:
    why the solver stopped.
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

    def cut_on(self, array: np.ndarray) -> np.ndarray:
        """The same with the border's values going on beyond the image."""
        rows, columns = (
            np.clip(np.arange(start, start + size), 0, n - 1)
            for start, size, n in zip(
                (self.top, self.left), (self.height, self.width), array.shape, strict=True
            )
        )
        return array[np.ix_(rows, columns)]

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
    trust: np.ndarray | None = None,
    seen: NormalEstimate | None = None,
    outline: np.ndarray | None = None,
    known: Known | None = None,
    monitor: Monitor | None = None,
) -> Recovered:
    """Recovers height and light.

    `image`: (H, W, C) linear diffuse light, C = `priors.channels`; `mask`: (H, W) bool; `floor`:
    zero channels are raised to it, in the logarithm only. `trust`: (H, W) in [0, 1], see `Problem`.
    `seen`: what was seen of the shape, instead of what the outline suggests. `outline` (H, W) bool:
    the object's silhouette where it differs from `mask`, the pixels whose values count. Raises
    `Cancelled`.
    """
    options, known, monitor = options or RecoverOptions(), known or Known(), monitor or Monitor()
    known, base = _levelled(known, mask)
    window, factor = _window(mask, options)
    inside, photo = window.cut(mask, False), window.cut(np.ones_like(mask), False)
    scene = _Scene(
        window.cut(image, 0),
        inside,
        _outline(mask if outline is None else outline, window),
        photo,
        floor,
        priors,
        weights,
        options,
        known,
        window,
        None if trust is None else window.cut(trust, 0),
        None
        if seen is None
        else NormalEstimate(window.cut(seen.normal, 0), window.cut(seen.deviation, 0)),
    )
    problem = scene.problem(factor)
    given = (
        None
        if known.height is None
        else _to_solve(window.cut_on(known.height), scene.inside, factor)
    )
    result = solve(
        problem, options.solver, known_height=given, known_light=known.light, monitor=monitor
    )
    cut = (
        resample_height(result.height, scene.inside.shape) + base
        if known.height is None
        else window.cut_on(known.height)
    )
    if known.height is None and known.depth is None and not options.whole_frame:
        cut = cut - cut[scene.inside].mean()
    return Recovered(
        window.put(cut, mask.shape),
        result.light,
        result.terms,
        result.iterations,
        result.evaluations,
        result.reason,
        result.converged,
        problem.valid.shape,
    )


def _levelled(known: Known, mask: np.ndarray) -> tuple[Known, float]:
    """What is known with the depth inside the mask alone and its median taken off: a sensor's
    distances are large, float32 is short.
    """
    if known.depth is None:
        return known, 0.0
    seen = np.where(mask, known.depth.height, np.nan)
    base = float(np.nanmedian(seen)) if np.isfinite(seen).any() else 0.0
    return replace(known, depth=replace(known.depth, height=seen - base)), base


def _window(mask: np.ndarray, options: RecoverOptions) -> tuple[_Window, float]:
    if options.whole_frame:
        factor = options.solve_size / max(mask.shape) if options.solve_size else 1.0
        return _Window(0, 0, *mask.shape), factor
    rows, columns = np.nonzero(mask.any(axis=1))[0], np.nonzero(mask.any(axis=0))[0]
    height, width = int(rows[-1] - rows[0] + 1), int(columns[-1] - columns[0] + 1)
    factor = options.solve_size / max(height, width) if options.solve_size else 1.0
    margin = round(options.margin / factor)
    return _Window(
        int(rows[0]) - margin, int(columns[0]) - margin, height + 2 * margin, width + 2 * margin
    ), factor


def _outline(mask: np.ndarray, window: _Window) -> np.ndarray:
    """The object in the window, going on beyond the photo where the photo's frame cuts it."""
    below, beyond = (
        window.top + window.height - mask.shape[0],
        window.left + window.width - mask.shape[1],
    )
    grown = continued(
        mask, max(-window.top, 0), max(below, 0), max(-window.left, 0), max(beyond, 0)
    )
    top, left = max(window.top, 0), max(window.left, 0)
    return grown[top : top + window.height, left : left + window.width]


@dataclass(frozen=True)
class _Scene:
    """What a problem is made of, in the window and at the image's scale."""

    image: np.ndarray
    inside: np.ndarray
    outline: np.ndarray
    photo: np.ndarray
    floor: float
    priors: Priors
    weights: Weights
    options: RecoverOptions
    known: Known
    window: _Window
    trust: np.ndarray | None
    seen: NormalEstimate | None

    def problem(self, factor: float) -> Problem:
        """The problem at `factor` times the image's scale."""
        image, valid, outline, photo, depth = (
            self.image,
            self.inside,
            self.outline,
            self.photo,
            self.known.depth,
        )
        trust, seen = self.trust, self.seen
        if depth is not None:
            depth = DepthObservation(
                self.window.cut(depth.height, np.nan), depth.sigma, depth.weight
            )
        if factor != 1:
            image, share = resample_inside(image, self.inside, factor)
            valid = share >= 0.5 * share.max()  # an object thinner than a pixel fills none by half
            outline, photo = (
                resample_inside(m.astype(float), np.ones_like(m), factor)[0] >= 0.5
                for m in (outline, photo)
            )
            depth = None if depth is None else _scaled_depth(depth, factor)
            trust = None if trust is None else resample_inside(trust, self.inside, factor)[0]
            seen = (
                None
                if seen is None
                else NormalEstimate(
                    *(
                        resample_inside(m, self.inside, factor)[0]
                        for m in (seen.normal, seen.deviation)
                    )
                )
            )
        log_image = np.where(valid[..., None], np.log(np.maximum(image, self.floor)), 0.0)
        return Problem(
            log_image,
            valid,
            outline,
            _seen(occluding_contour(outline, drop_near_edge=self.options.drop_near_edge), photo),
            self.priors,
            self.weights,
            depth,
            self.options.shading_only,
            expected_field(outline, self.priors.silhouette, seen),
            trust,
        )


def _seen(contour: Contour, photo: np.ndarray) -> Contour:
    """The contour points that lie in the photo: where an object was continued beyond it, its sides
    are made up.
    """
    keep = photo[contour.rows, contour.columns]
    return Contour(
        contour.rows[keep], contour.columns[keep], contour.down[keep], contour.right[keep]
    )


def _scaled_depth(depth: DepthObservation, factor: float) -> DepthObservation:
    seen, share = resample_inside(np.nan_to_num(depth.height), np.isfinite(depth.height), factor)
    scale = height_scale(depth.height.shape, seen.shape)
    return DepthObservation(
        np.where(share >= 0.5, seen * scale, np.nan), depth.sigma * scale, depth.weight
    )


def _to_solve(height: np.ndarray, inside: np.ndarray, factor: float) -> np.ndarray:
    if factor == 1:
        return np.array(height, float)
    coarse = resample_inside(height, np.ones_like(inside), factor)[0]
    return coarse * height_scale(inside.shape, coarse.shape)
