"""The statistics of each training object that the fit of the priors needs, computed once, so that
the fit to any selection of objects is fast.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..progress import Monitor
from ..sirfs.priors.color_mixture import ColorCells
from ..sirfs.priors.scale_mixture import Magnitudes
from ..sirfs.surface import geometry
from .pairs import pair_differences
from .silhouette import SilhouetteMoments


@dataclass(frozen=True, eq=False)
class TrainingObject:
    """An object whose intrinsic characteristics are known.

    Attributes
    ----------
    name : str
    reflectance : (H, W, 3) ndarray
        Linear.
    valid : (H, W) bool ndarray
        Where the reflectance is reliable.
    height : (H, W) ndarray
        Pixels toward the viewer, NaN where unknown.
    mask : (H, W) bool ndarray
        The object.
    natural_light, laboratory_light : (9, 3) ndarray or None
        Log-shading SH coefficients, reference convention (`sirfs.priors.priors`), where known.
    """

    name: str
    reflectance: np.ndarray
    valid: np.ndarray
    height: np.ndarray
    mask: np.ndarray
    natural_light: np.ndarray | None = None
    laboratory_light: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class ObjectStatistics:
    """One object's contribution to every prior.

    Attributes
    ----------
    curvature, grey_smoothness : Magnitudes
    color_smoothness : ColorCells
        Differences over neighbouring pixels.
    log_reflectance : (n, 3) float32 ndarray
    grey_log_reflectance : (n, 1) float32 ndarray
        All valid pixels; grey is the log of the mean of the channels.
    silhouette : SilhouetteMoments
    natural_light, laboratory_light : (9, 3) ndarray or None
        Where known.
    """

    curvature: Magnitudes
    grey_smoothness: Magnitudes
    color_smoothness: ColorCells
    log_reflectance: np.ndarray
    grey_log_reflectance: np.ndarray
    silhouette: SilhouetteMoments
    natural_light: np.ndarray | None = None
    laboratory_light: np.ndarray | None = None

    def second_moment(self) -> np.ndarray:
        """Return the mean of a a^T over the log reflectances a, (3, 3)."""
        a = self.log_reflectance.astype(float)
        return a.T @ a / len(a)


def object_statistics(training: TrainingObject) -> ObjectStatistics:
    """Compute the statistics of one object; pixels with a channel at or below 0 are excluded.

    Parameters
    ----------
    training : TrainingObject

    Returns
    -------
    ObjectStatistics

    Raises
    ------
    InputError
        If there are no neighbouring valid pixels.
    """
    valid = training.valid & (training.reflectance > 0).all(axis=-1)
    positive = np.where(valid[..., None], training.reflectance, 1.0)
    log_reflectance, log_grey = np.log(positive), np.log(positive.mean(axis=-1))
    curvature = geometry(np.asarray(training.height, float)).curvature
    curvature_differences = pair_differences(curvature, np.isfinite(curvature))
    color_differences = pair_differences(log_reflectance, valid)
    if len(curvature_differences) == 0 or len(color_differences) == 0:
        raise InputError(
            f"training object '{training.name}' has no neighbouring valid pixels: leave it out"
        )
    return ObjectStatistics(
        curvature=Magnitudes.of(curvature_differences),
        grey_smoothness=Magnitudes.of(pair_differences(log_grey, valid)),
        color_smoothness=ColorCells.of(color_differences),
        log_reflectance=log_reflectance[valid].astype(np.float32),
        grey_log_reflectance=log_grey[valid].astype(np.float32)[:, None],
        silhouette=SilhouetteMoments.of(np.asarray(training.height, float), training.mask),
        natural_light=training.natural_light,
        laboratory_light=training.laboratory_light,
    )


def collect_statistics(
    objects: Mapping[str, TrainingObject], monitor: Monitor | None = None
) -> dict[str, ObjectStatistics]:
    """Compute the statistics of each object.

    Parameters
    ----------
    objects : mapping of str to TrainingObject
    monitor : Monitor, optional

    Returns
    -------
    dict of str to ObjectStatistics
        Under the same names.
    """
    monitor = monitor or Monitor()
    collected = {}
    for count, (name, training) in enumerate(objects.items()):
        monitor.report(f"statistics of {name}", count / len(objects))
        collected[name] = object_statistics(training)
    return collected
