"""The lobe of a model's specular layer on the recovered shape, and its diagnostics.

Where the shape was given, the fit is to its normals; otherwise to blurred recovered normals and to
the predicted light, see `lobe_fitting.recovered`.

Limits: those of `lobe_fitting`.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..imaging.channels import channel_means, largest
from ..photo.photo import Photo
from ..progress import Monitor
from ..scene.decomposition import Separation
from ..scene.diagnostics import LobeDiagnostics, LobeStatus
from ..scene.lobe_fit import LobeFit, LobeFitOptions, LobeFitOutcome, LobeModel
from ..shading.brdf.roughness import blender_from_alpha
from ..sirfs.priors.prior_file import shipped_prior_set
from ..sirfs.silhouette import silhouette_normals
from .layers import normals_and_shading
from .shape import Shape
from .task import DecompositionTask

if TYPE_CHECKING:
    from ..lobe_fitting import RecoveredScene

_NOTHING = 0.03  # of the photo's white: specular light that is nowhere brighter is none
_MUCH_CLIPPED = 0.05  # of the object


@dataclass(frozen=True)
class FittedLobe:
    """The lobe of one result.

    Attributes
    ----------
    brdf : LobeFit or None
        The fit; None where no separator was run.
    clipped : float
        Share of the object that is clipped.
    """

    brdf: LobeFit | None
    clipped: float = 0.0

    @property
    def diagnostics(self) -> LobeDiagnostics:
        """The roughness with its interval, or why it is not determined."""
        fit = self.brdf
        if fit is None:
            return LobeDiagnostics(LobeStatus.NOT_FITTED)
        if fit.outcome == LobeFitOutcome.NO_SPECULAR:
            hidden = self.clipped > _MUCH_CLIPPED
            status = LobeStatus.HIDDEN if hidden else LobeStatus.NO_HIGHLIGHTS
            return LobeDiagnostics(status, fit.outcome)
        return LobeDiagnostics(LobeStatus.FITTED, fit.outcome, _roughness(fit))


def _roughness(fit: LobeFit) -> tuple[float, float, float] | None:
    span = fit.alpha_interval
    if fit.alpha is None or span is None:
        return None
    low, likely, high = (
        round(float(blender_from_alpha(np.clip(alpha, 0, 1))), 4)
        for alpha in (span.low, fit.alpha, span.high)
    )
    return low, likely, high


def fit_specular(
    split: Separation,
    shape: Shape,
    task: DecompositionTask,
    monitor: Monitor,
    model: LobeModel = "ggx",
) -> FittedLobe:
    """Fit the lobe to the specular layer under the normals of a shape.

    Clipped pixels count as lower bounds. Data that do not determine the lobe are no error: the fit
    has an outcome.

    Parameters
    ----------
    split : Separation
        Layers of the maps' photo.
    shape : Shape
        Shape and light at the scale of the maps.
    task : DecompositionTask
        The photo and the settings.
    monitor : Monitor
        Receives progress.
    model : {"ggx", "blinn_phong"}, optional
        The lobe.

    Returns
    -------
    FittedLobe
        Without a fit where no separator was run.

    Raises
    ------
    Cancelled
        If the monitor cancels.
    """
    photo = task.maps
    none_separated = task.settings.separator == "none" and not split.specular.any()
    if none_separated or not task.options.fit_lobe:
        return FittedLobe(None)
    with task.clock.stage("fit lobe"):
        clipped = float(photo.clipped[photo.mask].mean())
        if not _shines(split.specular, photo):
            none = LobeFitOutcome.NO_SPECULAR
            return FittedLobe(LobeFit.without_lobe(model, none, photo.image.shape), clipped)
        from ..lobe_fitting import PixelData, fit_lobe

        normal, shading = normals_and_shading(shape.height, shape.light, photo.mask)
        fit = fit_lobe(
            split.specular,
            normal,
            photo.mask,
            options=LobeFitOptions(model, thresholded=True),
            pixels=PixelData(clipped=photo.clipped, height=shape.height),
            recovered=_recovered(shading, task),
            monitor=monitor,
        )
        return FittedLobe(fit, clipped)


def _shines(specular: np.ndarray, photo: Photo) -> bool:
    white = float(np.percentile(largest(photo.image[photo.mask]), 99.5))
    return float(channel_means(specular, photo.mask).max()) > _NOTHING * white


def _recovered(shading: np.ndarray, task: DecompositionTask) -> "RecoveredScene | None":
    from ..lobe_fitting import RecoveredScene

    if task.known.height is not None:
        return None
    profile = (task.prior_set or shipped_prior_set(task.settings.illumination)).silhouette
    normals = silhouette_normals(task.maps.mask, profile)
    lamps = None if task.prediction is None else task.prediction.lamps
    return RecoveredScene(shading, normals, lamps)
