"""Shape and light of a diffuse image by SIRFS, as the models ask for it, and how that ended.

The priors know how bright paint and light are in photos. A float file may have any exposure: it is
brought to one that photos have, and the light found is brought back, so that neither shape nor
roughness depend on it. What the exposure of a photo tells of its paint is then lost: left out, the
ten training objects have 2 % more error so (in natural and in laboratory light; at .55 11 %, at .4
20 %).
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..imaging.resampling import resample_height
from ..photo.photo import Photo
from ..progress import Monitor
from ..scene.light_estimate import LightEstimate
from ..sirfs.kernel_cache import announce_compilation
from ..sirfs.priors.predicted_light import seen_light
from ..sirfs.priors.prior_file import shipped_prior_set
from ..sirfs.priors.priors import Priors
from ..sirfs.recover import Known, Recovered, RecoverOptions, recover
from ..sirfs.settings import isc_weights
from ..sirfs.solver import SolverOptions
from .layers import shifted
from .settings import LABORATORY, USUAL
from .task import Task

# of white, of the brightest channels' percentile below; of the training photos it is .23 to .87, of
# others .4 to 1
_USUAL = 0.75
_BRIGHT = 95.0  # percentile: most highlights are smaller
_LEAST_TRUST = 0.05


@dataclass(frozen=True)
class Shape:
    """`height` (H, W) in pixels of the maps and `light` (9, 3), reference convention; `status`: how
    they were found, JSON-ready. `working_height` (h, w): at the working scale.
    """

    height: np.ndarray
    light: np.ndarray
    status: dict[str, Any]
    working_height: np.ndarray


def recover_shape(
    diffuse: np.ndarray, task: Task, monitor: Monitor, trust: np.ndarray | None = None
) -> Shape:
    """SIRFS on the working photo's diffuse image (H, W, 3), brought to the scale of the maps.
    `trust` (H, W): see `trust_of`.

    Raises `InputError`, `Cancelled`.
    """
    result = _recover(diffuse, task, task.known, monitor, trust)
    return Shape(
        height_of_maps(result.height, task),
        np.broadcast_to(result.light, (9, 3)).copy(),
        _status(result),
        result.height,
    )


def energy_of(
    diffuse: np.ndarray, shape: Shape, task: Task, trust: np.ndarray | None = None
) -> float:
    """The SIRFS objective of the working photo's `diffuse` image (H, W, 3) at `shape`;

    `trust` (H, W): see `trust_of`.
    """
    return _recover(
        diffuse, task, Known(shape.working_height, shape.light, task.known.depth), Monitor(), trust
    ).terms.total


def trust_of(confidence: np.ndarray, wanted: bool) -> np.ndarray | None:
    """How much a pixel's reflectance counts in SIRFS, (H, W), of a separation's `confidence` (H, W)
    in [0, 1]: never nothing.

    None, so that all count alike, unless that is `wanted`.
    """
    return np.maximum(confidence, _LEAST_TRUST).astype(np.float64) if wanted else None


def _recover(
    diffuse: np.ndarray, task: Task, known: Known, monitor: Monitor, trust: np.ndarray | None
) -> Recovered:
    settings, working = task.settings, task.working
    announce_compilation(settings.engine, monitor)
    channels = 1 if _is_grey(diffuse, working.mask) else 3
    priors = (task.prior_set or shipped_prior_set()).priors(settings.illumination, channels)
    priors = looked_at(priors, task.light_estimate, settings.light_prior, settings.illumination)
    options = RecoverOptions(
        shading_only=settings.shading_only,
        solver=SolverOptions(engine=settings.engine, threads=settings.threads),
    )
    weights = isc_weights(settings.illumination, channels, shape_seen=task.seen is not None)
    light = (
        known.light
        if known.light is None or channels == 3
        else known.light.mean(axis=1, keepdims=True)
    )
    gain = _usual_exposure(working)
    if light is not None and gain != 1:
        light = shifted(light, np.log(gain))
    with task.clock.stage("shape and light"):
        found = recover(
            diffuse[..., :channels] * diffuse.dtype.type(gain),
            working.mask,
            gain * working.code_value / 2,
            priors,
            weights,
            options,
            trust=trust,
            seen=task.seen,
            known=Known(known.height, light, known.depth),
            monitor=monitor,
        )
    return found if gain == 1 else replace(found, light=shifted(found.light, -np.log(gain)))


def looked_at(
    priors: Priors, light_estimate: LightEstimate | None, light_prior: str, illumination: str
) -> Priors:
    """`priors`, told how the photo's light looks where that is asked for and somebody looked.

    A laboratory's light is known as well.
    """
    if light_estimate is None or light_prior == USUAL or illumination == LABORATORY:
        return priors
    return replace(
        priors, light=seen_light(priors.light, light_estimate.light, light_estimate.deviations)
    )


def _usual_exposure(photo: Photo) -> float:
    """What the light of a photo of unknown exposure is multiplied by, so that it is as bright as
    photos are; 1 of others.
    """
    if photo.exposed:
        return 1.0
    return exposure_normalisation(photo.image, photo.mask)


def exposure_normalisation(image: np.ndarray, mask: np.ndarray) -> float:
    """What linear light (H, W, C) is multiplied by, so that it is as bright inside `mask` (H, W)
    bool as photos are.
    """
    brightest = image[mask].max(axis=1)
    level = float(np.percentile(brightest, _BRIGHT)) or float(brightest.max())
    return _USUAL / level


def height_of_maps(height: np.ndarray, task: Task) -> np.ndarray:
    """The working height (h, w) on the grid of the maps and in its pixels, smoothly: (H, W)."""
    if task.one_scale:
        return height
    return resample_height(height, task.maps.mask.shape, task.maps.scale / task.working.scale)


def _is_grey(image: np.ndarray, mask: np.ndarray) -> bool:
    inside = image[mask]
    return bool(
        np.array_equal(inside[:, 0], inside[:, 1]) and np.array_equal(inside[:, 0], inside[:, 2])
    )


def _status(result: Recovered) -> dict[str, Any]:
    trouble = "the solver ran out of evaluations, so the result may not be its best: a cleaner mask or the other --illumination may help"
    return {
        "converged": result.converged,
        "reason": result.reason,
        "loss": result.terms.total,
        "terms": dict(result.terms.__dict__),
        "iterations": result.iterations,
        "evaluations": result.evaluations,
        "help": "" if result.converged else trouble,
    }
