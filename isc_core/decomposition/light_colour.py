"""The colour of the light, where it is given or a photo determines it: the photo is explained as
under white light, and the colour is put back.

Problem: separations, and the priors of a lamp's colour, assume white light.

Equation: with the light's colour c of mean 1 (`illuminant`), I' = I / c is explained by a model as
I' = D' + S' + residual'. Then

    D = c D',   S = c S',   residual = c residual',   log shading = log shading' + log c,

so that I = D + S + residual, and the reflectance D / shading is that under white light.

Citation: H.-C. Lee 1986, doi:10.1364/JOSAA.3.001694.

Limits: those of `illuminant`: few photos determine the colour. Otherwise the light is taken for
white, and the diagnostics give the reason. Light of a stronger colour than a lamp's is mostly
noticed, see `illuminant.gamut`; the confidence is then lower.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from ..illuminant.illuminant import Illuminant, estimate_illuminant, tinted, whitened
from ..photo import Photo
from ..scene.decomposition import Separation
from ..scene.diagnostics import IlluminantOutcome, LightColourDiagnostics
from ..scene.lobe_fit import Interval, LobeFit
from .layers import scale_confidence, scaled_light
from .settings import SEPARATING_MODELS, LightColour
from .task import DecompositionTask, SceneEstimate

_COLOURED = 0.1  # of a channel's share: less cannot be distinguished from white


def solve_under_estimated_light(
    task: DecompositionTask, solver: Callable[[DecompositionTask], SceneEstimate]
) -> SceneEstimate:
    """Run a model under white light, and put back the light's colour where it is to be used.

    Parameters
    ----------
    task : DecompositionTask
        The photo and the settings.
    solver : callable
        The model.

    Returns
    -------
    SceneEstimate
        Under the photo's own light.

    Raises
    ------
    InputError
        If the model cannot explain this photo.
    Cancelled
        If the monitor cancels.
    """
    settings = task.settings
    estimated = settings.light_colour == LightColour.ESTIMATE
    checked = task.options.check_assumptions and settings.model in SEPARATING_MODELS
    if not (estimated or checked):
        return solver(task)
    with ThreadPoolExecutor(1) as pool:
        future = pool.submit(_estimated, task)
        used = estimated and future.result().determined  # only then the model waits for it
        colour = future.result().colour if used else np.ones(3)
        estimate = _with_light(solver(_whitened(task, colour)), colour) if used else solver(task)
        light = future.result()
    split = scale_confidence(estimate.split) if light.outcome.too_strong else estimate.split
    diagnostics = replace(
        estimate.diagnostics, light_colour=_diagnostics(light, settings.light_colour, used)
    )
    return replace(estimate, split=split, diagnostics=diagnostics)


def _estimated(task: DecompositionTask) -> Illuminant:
    photo, kept = task.working, task.kept
    inputs = photo.image, photo.mask, photo.clipped
    with task.clock.stage("estimate light colour"):
        if kept is None:
            return estimate_illuminant(*inputs)
        found = kept.arrays(
            "light colour", inputs, lambda: _as_arrays(estimate_illuminant(*inputs))
        )
    outcome = IlluminantOutcome(str(found["outcome"]))
    return Illuminant(found["colour"], float(found["confidence"]), outcome)


def _as_arrays(light: Illuminant) -> dict[str, np.ndarray]:
    return {
        "colour": light.colour,
        "confidence": np.array(light.confidence),
        "outcome": np.array(str(light.outcome)),
    }


def solve_under_given_light(
    task: DecompositionTask, solver: Callable[[DecompositionTask], SceneEstimate]
) -> SceneEstimate:
    """Run a solver under white light where the light's colour is given as numbers.

    Parameters
    ----------
    task : DecompositionTask
        The photo and the settings.
    solver : callable
        The rest of the pipeline, predictions included: it gets the photo without the light's
        colour.

    Returns
    -------
    SceneEstimate
        Under the photo's own light.

    Raises
    ------
    InputError
        If the model cannot explain this photo.
    Cancelled
        If the monitor cancels.
    """
    given = task.settings.given_light_colour
    if given is None:
        return solver(task)
    colour = np.array(given)
    return _with_light(solver(_whitened(task, colour)), colour)


def _diagnostics(light: Illuminant, setting: str, used: bool) -> LightColourDiagnostics:
    red, green, blue = (round(float(part), 4) for part in light.colour)
    white_assumed = setting == LightColour.ESTIMATE and not used
    return LightColourDiagnostics(
        LightColour.BALANCED if white_assumed else setting,
        (red, green, blue),
        round(light.confidence, 4),
        light.outcome,
        light.determined and float(np.abs(light.colour - 1).max()) > _COLOURED,
        white_assumed,
    )


def _whitened(task: DecompositionTask, colour: np.ndarray) -> DecompositionTask:
    """The task under white light."""
    working = _recoloured(task.working, colour)
    maps = working if task.one_scale else _recoloured(task.maps, colour)
    split = None if task.split is None else _relit(task.split, 1 / colour)
    light = task.known.light
    known = (
        task.known
        if light is None
        else replace(task.known, light=scaled_light(light, -np.log(colour)))
    )
    return replace(
        task,
        working=working,
        maps=maps,
        split=split,
        known=known,
        shading_estimate=task.shading_estimate and task.shading_estimate.brighter(-np.log(colour)),
        light_coefficients=task.light_coefficients
        and task.light_coefficients.brighter(-np.log(colour)),
    )


def _recoloured(photo: Photo, colour: np.ndarray) -> Photo:
    return replace(photo, image=whitened(photo.image, colour))


def _with_light(estimate: SceneEstimate, colour: np.ndarray) -> SceneEstimate:
    """The estimate under the photo's light; height and confidence stay."""
    brdf = None if estimate.brdf is None else _lobe(estimate.brdf, colour)
    seen = estimate.prediction
    if seen is not None:
        seen = replace(seen, shading=seen.shading.brighter(np.log(colour)))
    return replace(
        estimate,
        prediction=seen,
        split=_relit(estimate.split, colour),
        light=scaled_light(estimate.light, np.log(colour)),
        brdf=brdf,
    )


def _relit(split: Separation, colour: np.ndarray) -> Separation:
    diffuse, specular, residual = (
        tinted(layer, colour) for layer in (split.diffuse, split.specular, split.residual)
    )
    return Separation(diffuse, specular, residual, split.confidence)


def _lobe(fit: LobeFit, colour: np.ndarray) -> LobeFit:
    lights = tuple(
        replace(
            light,
            strength_light=light.strength_light * colour,
            interval=Interval(light.interval.low * colour, light.interval.high * colour),
        )
        for light in fit.lights
    )
    return replace(fit, predicted=tinted(fit.predicted, colour), lights=lights)
