"""Shape and light of a diffuse image by SIRFS, as the models use it.

Problem: the priors expect albedo and light as bright as in photos, but a float file may have any
exposure.

Equation: such an image is multiplied by a gain that brings it to the brightness of photos, and the
recovered light is divided by the gain, so that neither shape nor roughness depend on the exposure.

In the darkest channel of a saturated colour, noise, compression and interreflections are large
relative to the object's own light, and become relief in the log shading. A part of the largest
channel is therefore added to every channel of photos before they are solved, I'_c = (I_c + v max I)
/ (1 + v): grey and brightness stay, and the channels' ratio is bounded by (1 + v) / v. Reflectance
is that of I.

Limits: the information on albedo in the exposure of a photo is then lost: without it the ten
training objects have 2 % more error, in natural and in laboratory light; at a level of .55 11 %, at
.4 20 %.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..imaging.channels import is_grey
from ..imaging.resampling import resample_height
from ..photo import Photo
from ..progress import Monitor
from ..scene.diagnostics import Diagnostics, StopReason
from ..scene.known_inputs import SceneConstraints
from ..sirfs.kernel_cache import announce_compilation
from ..sirfs.priors.light_colour import with_light_colour
from ..sirfs.priors.light_posterior import light_posterior
from ..sirfs.priors.prior_file import shipped_priors
from ..sirfs.priors.priors import Priors
from ..sirfs.recover import Recovered, RecoverOptions, recover
from ..sirfs.settings import PredictionWeights, Weights, isc_weights, prediction_weights
from ..sirfs.solver import SolverOptions
from .layers import scaled_light
from .settings import Illumination
from .task import DecompositionTask

# Level of the brightest channels' percentile below, white being 1; it is .23 to .87 in the training
# photos and .4 to 1 in others.
_TYPICAL_LEVEL = 0.75
_BRIGHT = 95.0  # percentile: most highlights are smaller
_DESATURATION = 0.1  # chosen on held-out objects; docs/methods/light_colour.md
_LEAST_WEIGHT = 0.05
_FITTED_SIZE = 224  # pixels: priors of the data set were fitted to objects 227 to 503 long


@dataclass(frozen=True, eq=False)
class Shape:
    """Recovered shape and light.

    Attributes
    ----------
    height : (H, W) ndarray
        Pixels of the maps, toward the viewer.
    light : (9, 3) ndarray
        Log-shading SH coefficients, reference convention.
    diagnostics : Diagnostics
        How the solver ended.
    working_height : (h, w) ndarray
        The height at the working scale, in its pixels.
    """

    height: np.ndarray
    light: np.ndarray
    diagnostics: Diagnostics
    working_height: np.ndarray


def recover_shape(
    diffuse: np.ndarray,
    task: DecompositionTask,
    monitor: Monitor,
    weight: np.ndarray | None = None,
) -> Shape:
    """Recover shape and light by SIRFS, and bring the shape to the scale of the maps.

    Parameters
    ----------
    diffuse : (h, w, 3) ndarray
        Diffuse image of the working photo, linear Rec.709.
    task : DecompositionTask
        The photo, the settings and what is known of the scene.
    monitor : Monitor
        Receives progress.
    weight : (h, w) ndarray, optional
        Weight of each pixel's reflectance terms, see `confidence_weight`.

    Returns
    -------
    Shape
        Height, light and the solver's diagnostics.

    Raises
    ------
    InputError
        If the known quantities do not fit.
    Cancelled
        If the monitor cancels.
    """
    result = _recover(diffuse, task, task.known, monitor, weight)
    return Shape(
        height_of_maps(result.height, task),
        np.broadcast_to(result.light, (9, 3)).copy(),
        _diagnostics(result),
        result.height,
    )


def energy_of(
    diffuse: np.ndarray, shape: Shape, task: DecompositionTask, weight: np.ndarray | None = None
) -> float:
    """Evaluate the SIRFS objective of a diffuse image at a given shape and light.

    Parameters
    ----------
    diffuse : (h, w, 3) ndarray
        Diffuse image of the working photo, linear Rec.709.
    shape : Shape
        Shape and light at which the objective is evaluated.
    task : DecompositionTask
        The photo and the settings.
    weight : (h, w) ndarray, optional
        As for `recover_shape`.

    Returns
    -------
    float
        The sum of all terms.
    """
    fixed = SceneConstraints(shape.working_height, shape.light, task.known.depth)
    return _recover(diffuse, task, fixed, Monitor(), weight).terms.total


def desaturated(image: np.ndarray, amount: float = _DESATURATION) -> np.ndarray:
    """Bound the ratio of a pixel's channels.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear, not negative.
    amount : float, optional
        v above, not negative.

    Returns
    -------
    (H, W, 3) ndarray
        Of the same type; the largest channel of each pixel stays.
    """
    share = image.dtype.type(amount)
    return (image + share * image.max(axis=2, keepdims=True)) / (1 + share)


def confidence_weight(confidence: np.ndarray, enabled: bool) -> np.ndarray | None:
    """Turn a separation's confidence into weights of SIRFS' reflectance terms.

    Parameters
    ----------
    confidence : (h, w) ndarray
        In [0, 1].
    enabled : bool
        Whether pixels are weighted at all.

    Returns
    -------
    (h, w) ndarray of float64, or None
        Weights, never 0; None where all pixels weigh alike.
    """
    return np.maximum(confidence, _LEAST_WEIGHT).astype(np.float64) if enabled else None


def _recover(
    diffuse: np.ndarray,
    task: DecompositionTask,
    known: SceneConstraints,
    monitor: Monitor,
    weight: np.ndarray | None,
) -> Recovered:
    settings, working = task.settings, task.working
    announce_compilation(settings.engine, monitor)
    channels = 1 if is_grey(diffuse, working.mask) else 3
    with task.clock.stage("shape and light"):
        priors = _priors(task, channels)
    weights, loss_tolerance = _weights(task, channels)
    light = (
        known.light
        if known.light is None or channels == 3
        else known.light.mean(axis=1, keepdims=True)
    )
    if channels == 3 and settings.desaturates and task.known.light is None:
        diffuse = desaturated(diffuse)
    gain = _exposure_gain(working)
    if light is not None and gain != 1:
        light = scaled_light(light, np.log(gain))
    with task.clock.stage("shape and light"):
        found = recover(
            diffuse[..., :channels] * diffuse.dtype.type(gain),
            working.mask,
            gain * working.code_value / 2,
            priors,
            weights,
            _recover_options(task, loss_tolerance),
            pixel_weight=weight,
            predicted_normals=task.normal_estimate,
            predicted_shading=task.shading_estimate,
            silhouette=task.silhouette,
            known=SceneConstraints(known.height, light, known.depth),
            monitor=monitor,
        )
    return found if gain == 1 else replace(found, light=scaled_light(found.light, -np.log(gain)))


def _priors(task: DecompositionTask, channels: int) -> Priors:
    """The priors for this photo, with what was predicted of its light."""
    coefficients, illumination = task.light_coefficients, task.settings.illumination
    if task.prior_set is None:
        priors = shipped_priors(illumination, channels)
    else:
        priors = task.prior_set.priors(illumination, channels)
    light = priors.light
    if coefficients is not None:
        temperature = _prediction_weights(task).light_temperature
        light = light_posterior(light, coefficients, temperature)
    if channels == 3 and task.settings.expects_white_light:
        variance = task.options.light_colour_weight.variance(_plain_weights(task, 3), 3)
        light = with_light_colour(light, np.ones(3), variance)
    return replace(priors, light=light)


def _plain_weights(task: DecompositionTask, channels: int) -> Weights:
    return isc_weights(task.settings.illumination, channels)


def _weights(task: DecompositionTask, channels: int) -> tuple[Weights, float | None]:
    """The weights for what was predicted, and the optimiser's tolerance if it is another."""
    return _prediction_weights(task).applied(
        _plain_weights(task, channels),
        normals=task.normal_estimate is not None,
        shading=task.shading_estimate is not None,
        light=task.light_coefficients is not None,
    )


def _prediction_weights(task: DecompositionTask) -> PredictionWeights:
    return task.options.prediction_weights or prediction_weights(task.settings.illumination)


def _recover_options(task: DecompositionTask, loss_tolerance: float | None) -> RecoverOptions:
    settings, options = task.settings, task.options
    solver = SolverOptions(engine=settings.engine, threads=settings.threads)
    if loss_tolerance is not None:
        solver = replace(solver, lbfgs=replace(solver.lbfgs, loss_tolerance=loss_tolerance))
    is_photo = settings.illumination == Illumination.PHOTO
    return RecoverOptions(
        solve_size=options.solve_size if is_photo else min(options.solve_size, _FITTED_SIZE),
        margin=options.margin,
        reduce_larger=is_photo,
        whole_frame=options.whole_frame,
        drop_near_edge=options.drop_near_edge,
        shading_only=settings.shading_only,
        solver=solver,
    )


def _exposure_gain(photo: Photo) -> float:
    """The gain of a photo of unknown exposure; 1 for others."""
    if photo.exposed:
        return 1.0
    return exposure_normalisation(photo.image, photo.mask)


def exposure_normalisation(image: np.ndarray, mask: np.ndarray) -> float:
    """Compute the gain that makes an object as bright as those of photos.

    Parameters
    ----------
    image : (H, W, C) ndarray
        Linear light.
    mask : (H, W) ndarray of bool
        The object.

    Returns
    -------
    float
        Factor of the image.
    """
    brightest = image[mask].max(axis=1)
    level = float(np.percentile(brightest, _BRIGHT)) or float(brightest.max())
    return _TYPICAL_LEVEL / level


def height_of_maps(height: np.ndarray, task: DecompositionTask) -> np.ndarray:
    """Resample the working height to the grid of the maps.

    Parameters
    ----------
    height : (h, w) ndarray
        Working pixels toward the viewer.
    task : DecompositionTask
        Both scales.

    Returns
    -------
    (H, W) ndarray
        Pixels of the maps, toward the viewer.
    """
    if task.one_scale:
        return height
    return resample_height(height, task.maps.mask.shape, task.maps.scale / task.working.scale)


def _diagnostics(result: Recovered) -> Diagnostics:
    return Diagnostics(
        converged=result.converged,
        reason=StopReason(result.reason),
        loss=result.terms.total,
        terms=dict(result.terms.__dict__),
        iterations=result.iterations,
        evaluations=result.evaluations,
    )
