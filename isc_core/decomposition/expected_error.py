"""Expected errors of normals and reflectance, in degrees and in log units.

Problem: a confidence between 0 and 1 ranks pixels, but .4 has no unit. A user needs the error of
the normals in degrees, and where it is large.

Equation: the scene network gives the mean m of the probable unit normals at each pixel, so that
s = arccos |m| is how widely they spread, and the log shading with its deviation q. SIRFS ends at a
normal n, at the angle d from m, and at a log shading at the mean distance r over the channels from
the predicted one, brightness aside. If the two sources were independent, squares would add:

    error of the normal = sqrt(a^2 + b^2 s^2 + c^2 d^2)
    error of log reflectance = sqrt(f^2 q^2 + g^2 r^2)

The second holds as the diffuse image is reflectance times shading. The five constants are fitted by
least squares to the errors on held-out objects, see `CALIBRATION`. The confidence is 2^(-error of
the normal / 20 degrees).

Citation: calibration of a regression's uncertainty: V. Kuleshov, N. Fenner, S. Ermon, "Accurate
uncertainties for deep learning using calibrated regression", ICML 2018, arXiv:1807.00263; Laplace
and normal deviations: see `networks.scene_network`.

Limits: the mean error over many pixels of about the same expectation; a single pixel's error varies
by as much. Errors of the separation count only as far as they bend shape and shading. Calibrated on
opaque objects: for mirrors and glass it is a little low, for hair and cast shadows of other objects
unknown. Measured in docs/methods/expected_error.md.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..filters.distance import nearest_pixels
from ..imaging.resampling import nearest_samples
from ..imaging.upsampling import enlarge_inside
from ..networks.scene_network import ScenePrediction
from ..photo import Photo
from ..scene.decomposition import Decomposition
from ..scene.diagnostics import ExpectedErrorDiagnostics
from ..scene.expected_error import ExpectedError
from .assumption_checks import confidence_factor

HALF = 20.0  # degrees of error at which the confidence is .5
_DARKEST = 1e-6


@dataclass(frozen=True)
class Calibration:
    """Constants of the expected errors; all are at least 0.

    Attributes
    ----------
    normal_floor : float
        a, degrees.
    normal_spread, normal_distance : float
        b and c, factors of the spread and of the distance.
    shading_deviation, shading_distance : float
        f and g.
    """

    normal_floor: float
    normal_spread: float
    normal_distance: float
    shading_deviation: float
    shading_distance: float


# python -m benchmarks.decomposition.expected_error WORLD --panoramas HDRI: 60 photos of held-out
# objects of the project's world under panoramas that no fit has seen.
CALIBRATION = Calibration(7.337, 0.723, 0.780, 0.660, 1.015)


@dataclass(frozen=True, eq=False)
class Evidence:
    """Quantities that predict the errors, at N pixels.

    Attributes
    ----------
    spread, distance : (N,) ndarray
        s and d, degrees.
    deviation, shading_distance : (N,) ndarray
        q and r, log units.
    """

    spread: np.ndarray
    distance: np.ndarray
    deviation: np.ndarray
    shading_distance: np.ndarray

    @classmethod
    def of(
        cls, prediction: ScenePrediction, normal: np.ndarray, shading: np.ndarray, mask: np.ndarray
    ) -> "Evidence":
        """Compare a result with the network's prediction.

        Parameters
        ----------
        prediction : ScenePrediction
        normal, shading : (H, W, 3) ndarray
            Of the result, on the grid of the prediction.
        mask : (H, W) bool ndarray

        Returns
        -------
        Evidence
            Of the pixels inside the mask, row by row.
        """
        mean, found = prediction.normals.normal[mask].astype(float), normal[mask].astype(float)
        length = np.linalg.norm(mean, axis=1)
        cosine = np.einsum("nc,nc->n", mean, found) / np.maximum(length, 1e-9)
        off = np.log(np.maximum(shading[mask], _DARKEST)) - prediction.shading.log_shading[mask]
        return cls(
            np.degrees(np.arccos(np.clip(length, 0, 1))),
            np.degrees(np.arccos(np.clip(cosine, -1, 1))),
            prediction.shading.deviation[mask].astype(float),
            np.abs(off - np.median(off)).mean(axis=1),
        )

    def errors(self, constants: Calibration = CALIBRATION) -> tuple[np.ndarray, np.ndarray]:
        """Compute the expected errors.

        Parameters
        ----------
        constants : Calibration

        Returns
        -------
        normal : (N,) ndarray
            Degrees.
        reflectance : (N,) ndarray
            Log units.
        """
        normal = np.sqrt(
            constants.normal_floor**2
            + np.square(constants.normal_spread * self.spread)
            + np.square(constants.normal_distance * self.distance)
        )
        reflectance = np.hypot(
            constants.shading_deviation * self.deviation,
            constants.shading_distance * self.shading_distance,
        )
        return np.minimum(normal, 180.0), reflectance


def confidence_of(normal_error: np.ndarray) -> np.ndarray:
    """Turn expected errors of normals into confidences.

    Parameters
    ----------
    normal_error : ndarray
        Degrees, at least 0.

    Returns
    -------
    ndarray
        In (0, 1]; .5 at `HALF` degrees.
    """
    return np.asarray(np.exp2(-np.asarray(normal_error) / HALF))


def with_expected_error(
    d: Decomposition,
    prediction: ScenePrediction,
    working: Photo,
    normal: np.ndarray | None = None,
) -> Decomposition:
    """Add the expected errors to a result, and the confidence that follows from them.

    Parameters
    ----------
    d : Decomposition
    prediction : ScenePrediction
        Of the working photo.
    working : Photo
    normal : (H, W, 3) ndarray, optional
        Normals relative to the ray of each pixel, as predicted ones are; by default those of the
        result, as without a camera.

    Returns
    -------
    Decomposition
        The confidence of a photo that violates assumptions is lower by the factor of
        `assumption_checks.confidence_factor`.
    """
    shading, mask = d.shading, working.mask
    normal = d.normal if normal is None else normal
    factor = mask.shape[0] / d.mask.shape[0]
    if mask.shape != d.mask.shape:
        # of the object alone: at its rim, the centre of a working pixel may lie outside of it
        rows, columns = (
            nearest_samples(part, mask.shape, factor).astype(int) for part in nearest_pixels(d.mask)
        )
        normal, shading = normal[rows, columns], shading[rows, columns]
    small = np.zeros((*mask.shape, 2))
    small[mask] = np.stack(Evidence.of(prediction, normal, shading, mask).errors(), axis=1)
    if mask.shape != d.mask.shape:
        small = small[nearest_pixels(mask)]
    maps = np.empty((*d.mask.shape, 2), np.float32)
    enlarge_inside(small, d.mask, 1 / factor, maps)
    error, diagnostics = ExpectedError(maps[..., 0], maps[..., 1]), d.provenance.diagnostics
    means = (round(float(part[d.mask].mean(dtype=float)), 4) for part in np.moveaxis(maps, -1, 0))
    diagnostics = replace(diagnostics, expected_error=ExpectedErrorDiagnostics(*means))
    confidence = confidence_factor(diagnostics) * confidence_of(error.normal)
    return replace(
        d,
        confidence=np.where(d.mask, confidence, 0).astype(np.float32),
        expected_error=error,
        provenance=replace(d.provenance, diagnostics=diagnostics),
    )
