"""The stage "gloss": roughness from the specular layer, with the true shape and the true layers.

The ground truth of a spatially varying roughness is its median, weighted by the specular light;
Blinn-Phong exponents are compared as alpha.

Limits: under low-frequency light the roughness is undetermined. The metric "determined" counts the
scenes where the fit returns one.
"""

from dataclasses import dataclass

import numpy as np

from isc_core.imaging.framing import continued_height
from isc_core.lobe_fitting import PixelData, fit_lobe
from isc_core.progress import Monitor
from isc_core.scene.lobe_fit import LobeFit, LobeFitOptions
from isc_core.shading.brdf.roughness import alpha_from_exponent
from isc_core.shading.spherical_harmonics import normal_from_reference
from isc_core.shading.surface_stencils import normals

from ...capture.truth import GroundTruth
from .pictures import exposure, lit
from .types import Metric, Stage, StageInputs, StageOptions, StagePicture

_NO_GLOSS = 0.01  # of the image's light: less specular light counts as none


@dataclass(frozen=True, eq=False)
class FittedLobe:
    """The fitted lobe, and the specular layer (H, W, 3) that it was fitted to."""

    fit: LobeFit
    specular: np.ndarray


@dataclass(frozen=True)
class LobeScores:
    """Errors of the roughness. None: undefined.

    Attributes
    ----------
    alpha_factor : float or None
        Ratio of estimated and true alpha, or its inverse, >= 1. Only if alpha was determined and
        the material has one.
    explained : float or None
        Share of the squared specular image that the fit explains.
    determined : float or None
        1 or 0: whether alpha was determined on a glossy scene.
    invented : float or None
        1 or 0: whether alpha was determined on a scene without specular light.
    """

    alpha_factor: float | None = None
    explained: float | None = None
    determined: float | None = None
    invented: float | None = None


def run_lobe(inputs: StageInputs, options: StageOptions, monitor: Monitor) -> FittedLobe:
    """Fit a lobe to the specular layer.

    Parameters
    ----------
    inputs : StageInputs
        Photo, diffuse layer and height.
    options : StageOptions
        Unused.
    monitor : Monitor
        Progress and cancellation.

    Returns
    -------
    FittedLobe
        The fit.

    Raises
    ------
    Cancelled
        If the user cancels.
    """
    if inputs.diffuse is None or inputs.height is None:
        raise ValueError("fitting a lobe needs a known shape and a known diffuse image")
    specular = np.where(inputs.mask[..., None], np.maximum(inputs.image - inputs.diffuse, 0), 0)
    normal = normal_from_reference(
        normals(continued_height(inputs.height, inputs.mask).astype(float))
    )
    fit = fit_lobe(
        specular,
        normal,
        inputs.mask,
        options=LobeFitOptions(),
        monitor=monitor,
        pixels=PixelData(clipped=inputs.clipped, height=inputs.height),
    )
    return FittedLobe(fit, specular)


def score_lobe(truth: GroundTruth, answer: FittedLobe) -> LobeScores:
    """Compare the fitted roughness with the material's.

    Parameters
    ----------
    truth : GroundTruth
        The scene.
    answer : FittedLobe
        The fit.

    Returns
    -------
    LobeScores
        The scores.
    """
    fit, light = answer.fit, truth.specular[truth.mask].sum(axis=1, dtype=float)
    determined = fit.determined and fit.alpha is not None
    if light.sum() < _NO_GLOSS * truth.image[truth.mask].sum(dtype=float):
        return LobeScores(invented=float(determined))
    if not determined or fit.alpha is None:
        return LobeScores(determined=0.0)
    true = _alpha(truth, light)
    return LobeScores(
        float(np.exp(abs(np.log(fit.alpha / true)))) if true > 0 else None, fit.explained, 1.0
    )


def show_lobe(truth: GroundTruth, answer: FittedLobe) -> tuple[StagePicture, ...]:
    """Return pictures of the specular layers, with one exposure.

    Parameters
    ----------
    truth : GroundTruth
        The scene.
    answer : FittedLobe
        The fit.

    Returns
    -------
    tuple of StagePicture
        The photo, the true and the fitted specular layer.
    """
    gain = exposure(truth.image, truth.mask)
    pairs = (
        ("photo", truth.image),
        ("specular, true", truth.specular),
        ("specular, fitted", answer.fit.predicted),
    )
    return tuple(StagePicture(caption, lit(gain * values, truth.mask)) for caption, values in pairs)


def lobe_maps(answer: FittedLobe) -> dict[str, np.ndarray]:
    """Return the channels of the specular layer and of the fit.

    Parameters
    ----------
    answer : FittedLobe
        The stage's result.

    Returns
    -------
    dict of str to (H, W) ndarray
        By channel name: "specular.R", "lobe.R".
    """
    layers = {"specular": answer.specular, "lobe": answer.fit.predicted}
    return {
        f"{name}.{letter}": values[..., k]
        for name, values in layers.items()
        for k, letter in enumerate("RGB")
    }


def _alpha(truth: GroundTruth, light: np.ndarray) -> float:
    """The material's alpha: the median over the specular light."""
    gloss = truth.gloss[truth.mask].astype(float)
    order = np.argsort(gloss)
    middle = float(gloss[order][np.searchsorted(np.cumsum(light[order]), light.sum() / 2)])
    return (
        middle if middle <= 1 else float(alpha_from_exponent(middle))
    )  # exponents are above 1, alphas are not


LOBE = Stage(
    name="gloss",
    title="Roughness of the specular lobe, with true shape and layers",
    needs=("diffuse", "shape"),
    metrics=(
        Metric("alpha_factor", "alpha, ratio to the truth"),
        Metric(
            "explained",
            "explained share of the specular image",
            geometric=False,
            larger_is_better=True,
            margin=0.1,
        ),
        Metric(
            "determined",
            "determined on glossy scenes",
            geometric=False,
            larger_is_better=True,
            margin=0.1,
        ),
        Metric("invented", "determined on diffuse scenes", geometric=False, margin=0.05),
    ),
    run=run_lobe,
    score=score_lobe,
    show=show_lobe,
    maps=lobe_maps,
)
