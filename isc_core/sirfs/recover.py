"""Shape and illumination of one masked diffuse image: sets up the SIRFS problem, solves it, and
resamples the result to the image's scale.

Problem: the priors are statistics per pixel, so the result would depend on the photo's scale and on
the empty space around the object. The object is therefore resampled to one size
(`RecoverOptions.solve_size`), and a window around its bounding box with a fixed margin is solved.
If this enlarges it, the average over each pixel is preserved (`imaging.area_enlarge`): a blurring
interpolation would change the differences between neighbours. Where the priors were fitted to
larger objects, too, a larger object is not reduced (`RecoverOptions.reduce_larger`).

Citation: J. T. Barron, J. Malik, "Shape, Illumination, and Reflectance from Shading", TPAMI 37(8),
2015, doi:10.1109/TPAMI.2014.2377712.

Limits: one object; the height lacks detail finer than a pixel of the size that is solved.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from ..imaging.resampling import height_scale, resample_height, resample_inside
from ..imaging.window import Window
from ..progress import Monitor
from ..scene.known_inputs import SceneConstraints
from ..scene.normal_estimate import NormalEstimate
from ..scene.shading_estimate import ShadingEstimate
from ..shading.occluding_contour import Contour, occluding_contour
from .normal_prior import normals_from_prediction
from .priors.priors import Priors
from .problem import Problem, Terms
from .settings import Weights
from .shading_term import expected_shading
from .silhouette import normals_from_silhouette
from .solve_inputs import SolveInputs
from .solver import SirfsResult, SolverOptions, solve

MARGIN = 20
SOLVE_SIZE = 256


@dataclass(frozen=True)
class RecoverOptions:
    """Options of the window, the scale and the solver.

    Attributes
    ----------
    solve_size : int
        Long side of the object's bounding box, in pixels, at which SIRFS is solved; 0 for the
        image's own.
    margin : int
        Pixels of empty space around the box at that size.
    reduce_larger : bool
        Reduce a larger object to `solve_size`; otherwise it is solved at its own size.
    whole_frame : bool
        Solve the frame as given instead of a window around the object. The height is then returned
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
    reduce_larger: bool = True
    whole_frame: bool = False
    drop_near_edge: bool = False
    shading_only: bool = False
    solver: SolverOptions = field(default_factory=SolverOptions)


@dataclass(frozen=True, eq=False)
class Recovered:
    """Shape and light of an image, at the image's scale.

    Attributes
    ----------
    height : (H, W) float64 ndarray
        Pixels toward the viewer, mean 0 over the mask unless it was given; valid in the mask and
        its surroundings.
    light : (9, C) ndarray
        Log-shading SH coefficients, reference convention.
    terms : Terms
        Terms of the objective at the solution.
    iterations, evaluations : int
        Steps of the optimiser, and evaluations of the objective.
    reason : str
        Why the optimiser stopped, see `LbfgsResult`.
    converged : bool
        Whether it stopped because the loss no longer decreased.
    solved_shape : tuple of int
        Shape of the window that was solved.
    """

    height: np.ndarray
    light: np.ndarray
    terms: Terms
    iterations: int
    evaluations: int
    reason: str
    converged: bool
    solved_shape: tuple[int, ...]


def recover(
    image: np.ndarray,
    mask: np.ndarray,
    floor: float,
    priors: Priors,
    weights: Weights,
    options: RecoverOptions | None = None,
    *,
    pixel_weight: np.ndarray | None = None,
    predicted_normals: NormalEstimate | None = None,
    predicted_shading: ShadingEstimate | None = None,
    silhouette: np.ndarray | None = None,
    known: SceneConstraints | None = None,
    monitor: Monitor | None = None,
) -> Recovered:
    """Recover height and light.

    Parameters
    ----------
    image : (H, W, C) ndarray
        Linear diffuse image, C = `priors.channels`.
    mask : (H, W) bool ndarray
        Pixels whose values are used.
    floor : float
        Smallest intensity; lower ones are raised to it, in the logarithm only.
    priors : Priors
        Priors for C channels.
    weights : Weights
        Weights of the objective's terms.
    options : RecoverOptions, optional
        Window, scale and solver.
    pixel_weight : (H, W) ndarray, optional
        In [0, 1], see `Problem`.
    predicted_normals : NormalEstimate, optional
        Predicted normals.
    predicted_shading : ShadingEstimate, optional
        Predicted log shading.
    silhouette : (H, W) bool ndarray, optional
        The object's silhouette, if it differs from `mask`.
    known : SceneConstraints, optional
        Fixed shape or light, and observed depth.
    monitor : Monitor, optional
        Receives the progress.

    Returns
    -------
    Recovered

    Raises
    ------
    Cancelled
        If the monitor cancels.
    """
    options, monitor = options or RecoverOptions(), monitor or Monitor()
    known, base = _with_centred_depth(known or SceneConstraints(), mask)
    window, factor = _window(mask, options)
    inputs = SolveInputs(
        image,
        mask,
        mask if silhouette is None else silhouette,
        np.ones_like(mask),
        pixel_weight,
        predicted_normals,
        known.depth,
        predicted_shading,
    ).cut(window)
    problem = _problem(inputs.scaled(factor), floor, priors, weights, options)
    fixed = None
    if known.height is not None:
        fixed = _scaled_height(window.cut_replicated(known.height), factor)
    result = solve(
        problem, options.solver, known_height=fixed, known_light=known.light, monitor=monitor
    )
    if known.height is not None:
        height = window.cut_replicated(known.height)
    else:
        height = resample_height(result.height, inputs.valid.shape) + base
        if known.depth is None and not options.whole_frame:
            height = height - height[inputs.valid].mean()
    return _recovered(result, window.put(height, mask.shape), problem.valid.shape)


def _recovered(result: SirfsResult, height: np.ndarray, solved_shape: tuple[int, ...]) -> Recovered:
    return Recovered(
        height,
        result.light,
        result.terms,
        result.iterations,
        result.evaluations,
        result.reason,
        result.converged,
        solved_shape,
    )


def _with_centred_depth(
    known: SceneConstraints, mask: np.ndarray
) -> tuple[SceneConstraints, float]:
    """The constraints with depth inside the mask only, minus its median; and the median.

    The distances of a sensor are large compared with the precision of float32.
    """
    if known.depth is None:
        return known, 0.0
    depth = np.where(mask, known.depth.height, np.nan)
    base = float(np.nanmedian(depth)) if np.isfinite(depth).any() else 0.0
    return replace(known, depth=replace(known.depth, height=depth - base)), base


def _window(mask: np.ndarray, options: RecoverOptions) -> tuple[Window, float]:
    """The window that is solved, and the factor from the image's scale to the solver's."""
    if options.whole_frame:
        factor = options.solve_size / max(mask.shape) if options.solve_size else 1.0
        return Window(0, 0, *mask.shape), factor
    rows, columns = np.nonzero(mask.any(axis=1))[0], np.nonzero(mask.any(axis=0))[0]
    height, width = int(rows[-1] - rows[0] + 1), int(columns[-1] - columns[0] + 1)
    factor = options.solve_size / max(height, width) if options.solve_size else 1.0
    if not options.reduce_larger:
        factor = max(factor, 1.0)
    margin = round(options.margin / factor)
    return Window(
        int(rows[0]) - margin, int(columns[0]) - margin, height + 2 * margin, width + 2 * margin
    ), factor


def _problem(
    inputs: SolveInputs, floor: float, priors: Priors, weights: Weights, options: RecoverOptions
) -> Problem:
    contour = occluding_contour(inputs.silhouette, drop_near_edge=options.drop_near_edge)
    profile = priors.silhouette
    return Problem(
        np.where(inputs.valid[..., None], np.log(np.maximum(inputs.image, floor)), 0.0),
        inputs.valid,
        inputs.silhouette,
        _inside_photo(contour, inputs.photo),
        priors,
        weights,
        inputs.depth,
        options.shading_only,
        None if profile is None else normals_from_silhouette(inputs.silhouette, profile),
        inputs.pixel_weight,
        normals_from_prediction(inputs.normals, inputs.silhouette),
        expected_shading(inputs.shading, priors.channels),
    )


def _inside_photo(contour: Contour, photo: np.ndarray) -> Contour:
    """The contour points inside the photo; beyond it, the contour is extrapolated."""
    keep = photo[contour.rows, contour.columns]
    return Contour(
        contour.rows[keep], contour.columns[keep], contour.down[keep], contour.right[keep]
    )


def _scaled_height(height: np.ndarray, factor: float) -> np.ndarray:
    """A fixed height (h, w) at `factor` times the scale."""
    if factor == 1:
        return np.array(height, float)
    coarse = resample_inside(height, np.ones(height.shape, bool), factor)[0]
    return coarse * height_scale(height.shape, coarse.shape)
