"""How each model is run on the MIT-Berkeley set: at the images' own scale, on the data set's crop,
with the project's weights.

The protocol of J. T. Barron, J. Malik (2015), doi:10.1109/TPAMI.2014.2377712: the image is
explained where all its channels are above zero, and the occluding contour is that of the object's
mask, without the points near the crop's frame.
"""

from dataclasses import dataclass

import numpy as np

from .. import baselines
from ..datasets.mit_berkeley import MitBerkeleyObject
from ..decompose.joint import Explain, JointOptions, believed, doubt, stepped
from ..decompose.mbp import split_reflectance
from ..decompose.pipeline import BASELINE_MODELS, Settings
from ..decompose.settings import OUTLINE, SEEN, USUAL
from ..decompose.shape import looked_at, trust_of
from ..networks.layer_network import LayerNetwork
from ..networks.light_network import predict_light
from ..networks.normal_network import predict_normals
from ..progress import Monitor
from ..scene.decomposition import Separation
from ..scene.normal_estimate import NormalEstimate
from ..separation import BEST, separate
from ..shading.occluding_contour import occluding_contour
from ..shading.spherical_harmonics import light_from_reference, normal_from_reference, real_sh
from ..shading.surface_stencils import normals
from ..sirfs.kernel_cache import announce_compilation
from ..sirfs.normal_prior import expected_field
from ..sirfs.priors.prior_set import PriorSet
from ..sirfs.priors.priors import Priors
from ..sirfs.problem import Problem
from ..sirfs.settings import Weights, isc_weights
from ..sirfs.solver import SirfsResult, SolverOptions, solve
from .evaluate import Estimate, Runner

_HALF_CODE = 0.5 / 65535  # the images have 16 bits; a separation may leave less than one code


@dataclass(frozen=True)
class RunnerOptions:
    """`model`: one of `decompose.pipeline.MODELS`; `separator`: one of `separation.METHODS`, for the models
    that separate; `engine`, `threads`: see `SolverOptions`; `confidence_weights`, `light_prior`,
    `shape_prior`: see `Settings`. SIRFS is measured by itself unless more is asked for: it expects
    the usual lights, and what the outline suggests.
    """

    model: str = "sirfs"
    separator: str = BEST
    engine: str = "auto"
    threads: int = 0
    confidence_weights: bool = False
    light_prior: str = USUAL
    shape_prior: str = OUTLINE

    def check(self) -> None:
        """Raises `InputError` for values that mean nothing."""
        Settings(
            self.model,
            self.separator,
            engine=self.engine,
            threads=self.threads,
            confidence_weights=self.confidence_weights,
            light_prior=self.light_prior,
            shape_prior=self.shape_prior,
        ).check()


@dataclass(frozen=True)
class _Expected:
    """What SIRFS is told beforehand; `seen`: of the shape, where it was asked for."""

    priors: Priors
    weights: Weights
    seen: NormalEstimate | None = None


def _expected(truth: MitBerkeleyObject, usual: Priors, options: RunnerOptions) -> _Expected:
    photo = np.maximum(truth.image, 0).astype(np.float32)
    light_estimate = predict_light(photo, truth.valid) if options.light_prior == SEEN else None
    priors = looked_at(usual, light_estimate, options.light_prior, truth.illumination)
    seen = predict_normals(photo, truth.valid) if options.shape_prior == SEEN else None
    return _Expected(priors, isc_weights(truth.illumination, 3, shape_seen=seen is not None), seen)


def make_runner(
    options: RunnerOptions, prior_set: PriorSet, network: LayerNetwork | None = None
) -> Runner:
    """What `evaluate` runs on each object; `network`: of the model joint's layers, the shipped one
    if None.

    Raises `InputError` for unknown options.
    """
    options.check()
    tables: dict[str, Priors] = {}

    def run(truth: MitBerkeleyObject, monitor: Monitor) -> Estimate:
        diffuse, trust = _separated_first(truth, options)
        log_image = _log(diffuse, truth)
        if options.model in BASELINE_MODELS:
            guess = baselines.estimate(options.model, log_image, truth.valid)
            return _estimate(
                truth, log_image, guess.height, guess.light, log_shading=guess.log_shading
            )
        announce_compilation(options.engine, monitor)
        if truth.illumination not in tables:
            tables[truth.illumination] = prior_set.priors(truth.illumination, 3)
        expected = _expected(truth, tables[truth.illumination], options)
        if options.model == "joint":
            return joint_estimate(truth, expected, options, monitor, network)
        result = solve_sirfs(truth, log_image, expected, options, monitor, trust)
        if options.model == "mbp":
            log_image = _log_separated_reflectance(truth, result, options)
        return _estimate(truth, log_image, result.height, result.light, result)

    return run


def pose(
    truth: MitBerkeleyObject,
    log_image: np.ndarray,
    priors: Priors,
    weights: Weights,
    trust: np.ndarray | None = None,
    seen: NormalEstimate | None = None,
) -> Problem:
    """The problem as the reference program poses it; `log_image` (H, W, 3) is read where
    `truth.valid`. `trust` (H, W): see `Problem`; `seen`: of the shape, instead of what the outline
    suggests.
    """
    contour = occluding_contour(truth.mask, drop_near_edge=True)
    field = expected_field(truth.mask, priors.silhouette, seen)
    return Problem(
        log_image, truth.valid, truth.mask, contour, priors, weights, silhouette=field, trust=trust
    )


def solve_sirfs(
    truth: MitBerkeleyObject,
    log_image: np.ndarray,
    expected: _Expected,
    options: RunnerOptions,
    monitor: Monitor,
    trust: np.ndarray | None = None,
) -> SirfsResult:
    """SIRFS on one object of the set;

    `log_image` (H, W, 3) is read where `truth.valid`. Looks at nothing else but `truth.mask`.
    """
    problem = pose(truth, log_image, expected.priors, expected.weights, trust, expected.seen)
    return solve(
        problem, SolverOptions(engine=options.engine, threads=options.threads), monitor=monitor
    )


def joint_estimate(
    truth: MitBerkeleyObject,
    expected: _Expected,
    options: RunnerOptions,
    monitor: Monitor,
    network: LayerNetwork | None = None,
) -> Estimate:
    """`decompose.joint` on one object; `network`: of its layers, the shipped one if None."""
    joint, valid = JointOptions(), truth.valid
    split = separate(options.separator, truth.image, valid)
    by_colour = _left_of(truth, split)
    found = doubt(truth.image, by_colour, valid, joint, network)
    trust = trust_of(believed(split.confidence, found), options.confidence_weights)
    how = SolverOptions(engine=options.engine, threads=options.threads)

    def energy(diffuse: np.ndarray, there: SirfsResult) -> float:
        problem = pose(
            truth, _log(diffuse, truth), expected.priors, expected.weights, trust, expected.seen
        )
        return solve(problem, how, known_height=there.height, known_light=there.light).terms.total

    explain = Explain(
        solve=lambda diffuse: solve_sirfs(
            truth, _log(diffuse, truth), expected, options, monitor, trust
        ),
        shading=lambda there: np.exp(
            _log_shading(normal_from_reference(normals(there.height)), there.light)
        ),
        energy=energy,
    )
    step = stepped(found, by_colour, valid, explain, joint)
    return _estimate(
        truth, _log(step.diffuse, truth), step.shape.height, step.shape.light, step.shape
    )


def _separated_first(
    truth: MitBerkeleyObject, options: RunnerOptions
) -> tuple[np.ndarray, np.ndarray | None]:
    """What shape and light are recovered from (H, W, 3), the diffuse image if separation comes
    first, and its trust (H, W) if wanted.
    """
    if options.model != "mdr":
        return truth.image, None
    split = separate(options.separator, truth.image, truth.valid)
    return _left_of(truth, split), trust_of(split.confidence, options.confidence_weights)


def _left_of(truth: MitBerkeleyObject, split: Separation) -> np.ndarray:
    """The diffuse image (H, W, 3) in the image's own precision, so that SIRFS sees the same image
    where nothing was taken off.
    """
    return np.asarray(np.maximum(truth.image - split.specular, 0))


def _log_separated_reflectance(
    truth: MitBerkeleyObject, result: SirfsResult, options: RunnerOptions
) -> np.ndarray:
    """Log of the diffuse image (H, W, 3), 0 where it is not valid, if what SIRFS took for
    reflectance is separated.
    """
    shading = np.exp(_log_shading(normal_from_reference(normals(result.height)), result.light))
    return _log(
        split_reflectance(truth.image, shading, truth.valid, None, options.separator).diffuse, truth
    )


def _log(diffuse: np.ndarray, truth: MitBerkeleyObject) -> np.ndarray:
    return np.where(truth.valid[..., None], np.log(np.maximum(diffuse, _HALF_CODE)), 0.0)


def _estimate(
    truth: MitBerkeleyObject,
    log_image: np.ndarray,
    height: np.ndarray,
    light: np.ndarray,
    result: SirfsResult | None = None,
    log_shading: np.ndarray | None = None,
) -> Estimate:
    """The maps that follow from height and light (9, 3), both in the reference's convention.

    `log_shading` (H, W, 3): a method's own, where it has one; else that of the light on the
    normals.
    """
    normal = normal_from_reference(normals(height))
    log_shading = _log_shading(normal, light) if log_shading is None else log_shading
    reflectance = np.where(truth.valid[..., None], np.exp(log_image - log_shading), 0.0)
    loss, evaluations = (None, None) if result is None else (result.terms.total, result.evaluations)
    return Estimate(
        height,
        normal,
        np.exp(log_shading),
        reflectance,
        light_from_reference(light),
        loss,
        evaluations,
    )


def _log_shading(normal: np.ndarray, light: np.ndarray) -> np.ndarray:
    """(H, W, 3) of normals in the camera's frame under a light in the reference's convention."""
    return real_sh(normal) @ light_from_reference(light)
