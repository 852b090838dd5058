"""Runs models on the MIT-Berkeley set under one of two protocols.

Both run the pipeline of `isc decompose` (`decompose.models.solve`). "reference" is the protocol of
J. T. Barron, J. Malik (2015), doi:10.1109/TPAMI.2014.2377712: SIRFS is solved at the images' own
scale on the data set's crop; pixels are used where all channels are above zero; the occluding
contour is that of the object's mask, without the points near the border of the crop. "users" is
`decompose` with its defaults on the crop, with maps at the crop's resolution.

Limits: under "reference", no lobe is fitted and no assumptions are checked, since neither is
scored.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from ..datasets.mit_berkeley import MitBerkeleyObject
from ..decomposition.models import solve
from ..decomposition.pipeline import decompose
from ..decomposition.settings import LightPrior, Settings, ShapePrior
from ..decomposition.task import DecompositionTask, SceneEstimate, SolveOptions
from ..networks.scene_network import SceneNetwork
from ..photo import Photo, PhotoSource
from ..progress import Monitor
from ..separation import BEST
from ..shading.spherical_harmonics import light_from_reference, normal_from_reference, real_sh
from ..shading.surface_stencils import normals
from ..sirfs.priors.prior_set import PriorSet
from .evaluate import Estimate, Runner

_CODE = 1 / 65535  # of 16-bit images; separated diffuse light may be below half a code


class Protocol(StrEnum):
    """The evaluation protocol.

    Attributes
    ----------
    REFERENCE
        The published protocol: own scale, the data set's crop.
    USERS
        `decompose` with its defaults.
    """

    REFERENCE = "reference"
    USERS = "users"


@dataclass(frozen=True)
class RunnerOptions:
    """Options of the run on each object.

    The defaults evaluate SIRFS without predictions: priors of the data set, and of the silhouette.

    Attributes
    ----------
    model : str
        One of `decompose.settings.MODELS`.
    separator : str
        See `Settings`.
    engine : str
        See `SolverOptions`.
    threads : int
        See `SolverOptions`.
    confidence_weights : bool
        See `Settings`.
    light_prior, shape_prior : str or None
        See `Settings`. None: the default of the protocol.
    protocol : Protocol
        The evaluation protocol.
    """

    model: str = "sirfs"
    separator: str = BEST
    engine: str = "auto"
    threads: int = 0
    confidence_weights: bool = False
    light_prior: str | None = None
    shape_prior: str | None = None
    protocol: Protocol = Protocol.REFERENCE

    def settings(self, illumination: str = "natural") -> Settings:
        """Return the pipeline's settings.

        Parameters
        ----------
        illumination : str, optional
            Illumination of the object.

        Returns
        -------
        Settings
            Under `Protocol.USERS` with maps at the photo's resolution.
        """
        users = self.protocol == Protocol.USERS
        return Settings(
            self.model,
            self.separator,
            illumination,
            full_size=users,
            detail=Settings.detail if users else 0,
            engine=self.engine,
            threads=self.threads,
            confidence_weights=self.confidence_weights,
            light_prior=self.light_prior or (LightPrior.PREDICTED if users else LightPrior.DATASET),
            shape_prior=self.shape_prior
            or (ShapePrior.PREDICTED if users else ShapePrior.SILHOUETTE),
        )

    def check(self) -> None:
        """Validate the options.

        Raises
        ------
        InputError
            If a value is unknown or does not apply to the model.
        """
        self.settings().check()


def make_runner(
    options: RunnerOptions, prior_set: PriorSet, network: SceneNetwork | None = None
) -> Runner:
    """Create the function that `evaluate` runs on each object.

    Parameters
    ----------
    options : RunnerOptions
        Model and protocol.
    prior_set : PriorSet
        SIRFS priors.
    network : SceneNetwork, optional
        The network for predictions under `Protocol.REFERENCE`; the shipped one by default.

    Returns
    -------
    Runner
        Decomposes one object.

    Raises
    ------
    InputError
        If the options are invalid.
    """
    options.check()

    def reference(truth: MitBerkeleyObject, monitor: Monitor) -> Estimate:
        task = reference_task(truth, options, prior_set, network, monitor)
        return _estimate(truth, solve(task))

    def users(truth: MitBerkeleyObject, monitor: Monitor) -> Estimate:
        return _run_default_pipeline(truth, options, prior_set, monitor)

    return users if options.protocol == Protocol.USERS else reference


def reference_task(
    truth: MitBerkeleyObject,
    options: RunnerOptions,
    prior_set: PriorSet,
    network: SceneNetwork | None = None,
    monitor: Monitor | None = None,
) -> DecompositionTask:
    """Set up one object under the reference protocol.

    Only the image, its valid pixels and the mask of `truth` are used.

    Parameters
    ----------
    truth : MitBerkeleyObject
        The object.
    options : RunnerOptions
        Model and priors.
    prior_set : PriorSet
        SIRFS priors.
    network : SceneNetwork, optional
        The network for predictions; the shipped one by default.
    monitor : Monitor, optional
        Receives progress.

    Returns
    -------
    DecompositionTask
        For `decompose.models.solve`.
    """
    photo = _photo(truth, truth.image, truth.valid)
    protocol = SolveOptions(
        solve_size=0,
        whole_frame=True,
        drop_near_edge=True,
        layer_dtype=np.float64,
        fit_lobe=False,
        check_assumptions=False,
        scene_network=network,
    )
    return DecompositionTask(
        photo,
        photo,
        options.settings(truth.illumination),
        prior_set=prior_set,
        monitor=monitor or Monitor(),
        silhouette=truth.mask,
        options=protocol,
    )


def _run_default_pipeline(
    truth: MitBerkeleyObject, options: RunnerOptions, prior_set: PriorSet, monitor: Monitor
) -> Estimate:
    """The result of `isc decompose` for the crop and the object's mask."""
    photo = _photo(truth, truth.image.astype(np.float32), truth.mask)
    settings = options.settings(truth.illumination)
    given = prior_set if settings.takes_priors else None
    result = decompose(photo, settings, prior_set=given, name=truth.name, monitor=monitor)
    diagnostics = result.provenance.diagnostics
    return Estimate(
        result.height.astype(float),
        result.normal.astype(float),
        result.shading.astype(float),
        result.reflectance.astype(float),
        result.illumination,
        diagnostics.loss,
        diagnostics.evaluations,
    )


def _photo(truth: MitBerkeleyObject, image: np.ndarray, mask: np.ndarray) -> Photo:
    height, width = mask.shape
    source = PhotoSource("", (width, height), 16, "linear", "file")
    return Photo(image, mask, _CODE, np.zeros_like(truth.mask), source)


def _estimate(truth: MitBerkeleyObject, found: SceneEstimate) -> Estimate:
    """The maps derived from height and light, in the data set's precision."""
    normal = normal_from_reference(normals(found.height))
    light = light_from_reference(found.light)
    log_shading = real_sh(normal) @ light if found.log_shading is None else found.log_shading
    valid = truth.valid[..., None]
    log_diffuse = np.where(valid, np.log(np.maximum(found.split.diffuse, _CODE / 2)), 0.0)
    reflectance = np.where(valid, np.exp(log_diffuse - log_shading), 0.0)
    loss, evaluations = found.diagnostics.loss, found.diagnostics.evaluations
    return Estimate(
        found.height, normal, np.exp(log_shading), reflectance, light, loss, evaluations
    )
