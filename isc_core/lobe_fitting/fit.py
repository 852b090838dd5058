"""Fits a lobe and its lights to a specular image and normals.

Problem: how rough a glossy object is, and where its lights are, from the specular layer of one
photo.

Method: the specular light as a function of the normal has a peak for each light (`starts`). From
there, several widths are tried and the best is refined (`lamps`); another light is added at a peak
of the residual as long as an information criterion supports it: n log(loss) + p log n, n being the
number of independent parts of the highlight. The resulting alpha is compared with others, with all
other parameters refitted (profile likelihood); where the loss hardly increases, alpha is
undetermined. Intervals: `uncertainty`.

Citation: G. Schwarz, "Estimating the dimension of a model", Annals of Statistics 6(2) (1978),
doi:10.1214/aos/1176344136. The lobes: see `isc_core.shading.brdf`.

Limits: lights are distant and small. An extended light widens the lobe: if it subtends 2 w radians,
the squares of w and 2 alpha approximately add. White highlights, one roughness for the whole
object, no shadows cast on the highlight.
"""

from dataclasses import replace

import numpy as np

from ..errors import InputError
from ..progress import Monitor
from ..scene.lobe_fit import (
    CONVENTION,
    Interval,
    LobeFit,
    LobeFitOptions,
    LobeFitOutcome,
    LobeLight,
)
from ..shading.brdf.directions import unit
from .lamps import ALPHAS, Fitted, Lamps, Problem, contributions, minimise, predicted
from .observed import GivenLight, Observed, PixelData, RecoveredScene, observe
from .pixels import Pixels, choose_pixels
from .recovered import fit_recovered
from .smooth_light import smooth_loss
from .starts import bright_half_vectors, light_of_half_vector
from .uncertainty import covariance, naive_variance

_NO_LIGHT = 1e-6  # radiance: no highlight
_START_ALPHAS = (0.06, 0.2, 0.45)
_FEW_STEPS = 7
_PIXELS_UNDER_MAP = 600  # each integrates over the whole environment map
_WIDER = (2.0, 4.0)
_SMOOTH_ALPHA = 0.7  # with a larger alpha, the highlight is as smooth as shading
_AMBIGUOUS_ALPHA = 0.35  # with a larger alpha, the light may be smooth instead
_CONE = 1.515  # deviations that contain 68 % in two dimensions
# Errors on exact images, caused by the approximate model of the environment: of log alpha, of log
# strength, of directions in radians.
_MODEL_ALPHA, _MODEL_STRENGTH, _MODEL_DIRECTION = 0.003, 0.01, 0.003
_MIN_PEAK_PIXELS = 6  # within half of the peak
_MIN_GAIN = 0.15  # smallest relative decrease of the loss for another light
_MIN_EXPLAINED = 0.25


def fit_lobe(
    specular: np.ndarray,
    normal: np.ndarray,
    mask: np.ndarray,
    *,
    options: LobeFitOptions | None = None,
    pixels: PixelData | None = None,
    light: GivenLight | None = None,
    recovered: RecoveredScene | None = None,
    monitor: Monitor | None = None,
) -> LobeFit:
    """Fit a lobe, and its lights unless they are given, to a specular image.

    Parameters
    ----------
    specular : (H, W, 3) ndarray
        Linear, >= 0, seen from (0, 0, 1).
    normal : (H, W, 3) ndarray
        Unit normals, camera frame.
    mask : (H, W) ndarray of bool
        The object.
    options : LobeFitOptions, optional
        The lobe, and how it is fitted.
    pixels : PixelData, optional
        Confidence, clipping and height.
    light : GivenLight, optional
        The light, where it is known.
    recovered : RecoveredScene, optional
        Given where normals and shading were recovered from the same photo: the fit then relies on
        the brightness of the highlight more than on its width, see `recovered`.
    monitor : Monitor, optional
        Receives progress.

    Returns
    -------
    LobeFit
        Its outcome states whether the roughness is determined.

    Raises
    ------
    InputError
        If the arrays do not fit together.
    Cancelled
        If the monitor cancels.
    """
    options, monitor, light = (
        options or LobeFitOptions(),
        monitor or Monitor(),
        light or GivenLight(),
    )
    silhouette_normals = None if recovered is None else recovered.silhouette_normals
    observed = observe(specular, normal, mask, pixels, silhouette_normals)
    fixed = _direction(light)
    monitor.report("fitting the gloss", 0.0)
    if observed.peak <= _NO_LIGHT:
        return LobeFit.without_lobe(
            options.model, LobeFitOutcome.NO_SPECULAR, observed.specular.shape
        )
    known = light.environment
    max_pixels = (
        options.most_pixels if known is None else min(options.most_pixels, _PIXELS_UNDER_MAP)
    )
    chosen = choose_pixels(observed, (options.floor, options.relative), max_pixels)
    if known is not None:
        from .environment_fit import fit_under_environment

        return fit_under_environment(np.asarray(known, float), observed, chosen, options)
    if recovered is not None:
        shading = _checked_shading(recovered.shading, observed)
        return fit_recovered(observed, chosen, shading, fixed, recovered.light_estimate, options)
    problem = Problem(
        chosen,
        options.model,
        options.thresholded,
        directions=fixed is None,
        nearness=observed.positions is not None,
    )
    fitted = _search(problem, options, fixed, monitor)
    monitor.report("estimating the uncertainty of the gloss", 0.7)
    return _result(observed, problem, fitted, options)


def _direction(light: GivenLight) -> np.ndarray | None:
    """The given direction, checked."""
    if light.direction is not None and light.environment is not None:
        raise InputError("give the light's direction or its environment map, not both")
    fixed = None if light.direction is None else unit(light.direction, "direction")
    if fixed is not None and fixed.shape != (3,):
        raise InputError(
            f"the light's direction has shape {fixed.shape}: give one unit vector (3,)"
        )
    return fixed


def _checked_shading(shading: np.ndarray, observed: Observed) -> np.ndarray:
    shading = np.asarray(shading)
    if shading.shape != observed.specular.shape or not (
        np.isfinite(shading[observed.mask]).all() and (shading[observed.mask] >= 0).all()
    ):
        raise InputError(
            f"shading has shape {shading.shape}: give (H, W, 3) like the specular image, finite "
            "and >= 0 inside the mask"
        )
    return shading


def _search(
    problem: Problem, options: LobeFitOptions, fixed: np.ndarray | None, monitor: Monitor
) -> Fitted:
    """Add lights one at a time, as long as the information criterion supports it."""
    pixels = problem.pixels
    best = _first_light(problem, fixed)
    for count in range(2, options.most_lights + 1 if fixed is None else 2):
        monitor.report("searching for another light", 0.2 * count)
        residual = pixels.value - predicted(problem, best.lamps, pixels.normal, pixels.position)
        more = _best_of(
            problem,
            [
                _with_another(best.lamps, half, 0.3 * pixels.peak)
                for half in _peaks(pixels, residual, 2)
            ],
        )
        if not _is_supported(best, more, pixels):
            break
        best = more
    return best


def _first_light(problem: Problem, fixed: np.ndarray | None) -> Fitted:
    pixels = problem.pixels
    directions = (
        [light_of_half_vector(half) for half in _peaks(pixels, pixels.value, 3)]
        if fixed is None
        else [fixed]
    )
    base = (
        np.array([0.1 * pixels.peak])
        if problem.thresholded
        else np.zeros(len(problem.basis(pixels.normal[:1])))
    )
    near = np.full(1, 0.1 if problem.nearness else 0.0)
    return _best_of(
        problem,
        [
            Lamps(d[None], near, np.array([_amplitude(a, pixels.peak)]), base, float(np.log(a)))
            for d in directions
            for a in _START_ALPHAS
        ],
    )


def _best_of(problem: Problem, starts: list[Lamps]) -> Fitted:
    """A few steps from each start, then a full minimisation from the best."""
    fits = [minimise(problem, start, steps=_FEW_STEPS) for start in starts]
    return minimise(problem, min(fits, key=lambda fit: fit.loss).lamps)


def _peaks(pixels: Pixels, value: np.ndarray, count: int) -> list[np.ndarray]:
    return bright_half_vectors(pixels.normal, value, pixels.weight, count)


def _with_another(lamps: Lamps, half: np.ndarray, peak: float) -> Lamps:
    return replace(
        lamps,
        directions=np.vstack([lamps.directions, light_of_half_vector(half)]),
        nearness=np.append(lamps.nearness, lamps.nearness.mean()),
        log_amplitudes=np.append(lamps.log_amplitudes, _amplitude(lamps.alpha, peak)),
    )


def _amplitude(alpha: float, peak: float) -> float:
    """Log of the amplitude of a GGX lobe of height `peak` where normal, view and light coincide."""
    return float(np.log(4 * np.pi * alpha**2 * peak / 0.04))


def _is_supported(less: Fitted, more: Fitted, pixels: Pixels) -> bool:
    """Schwarz' criterion over independent parts, and a minimum gain."""
    parts = min(200.0, max(10.0, len(pixels.value) / max(1.0, np.sqrt(pixels.bright))))
    gain = np.log(max(less.loss, 1e-300) / max(more.loss, 1e-300))
    return bool(
        parts * gain > 3 * np.log(parts)
        and more.loss < (1 - _MIN_GAIN) * less.loss
        and less.loss > 1e-3 * len(pixels.value)
    )


def _result(
    observed: Observed, problem: Problem, fitted: Fitted, options: LobeFitOptions
) -> LobeFit:
    pixels = problem.pixels
    spread = covariance(fitted.jacobian, fitted.residual, fitted.weight, pixels)
    image, gains, explained = _coloured(observed, problem, fitted)
    at = fitted.lamps.count + len(fitted.lamps.base)
    sd = float(np.sqrt(spread[at, at] + np.radians(options.normal_error) ** 2 + _MODEL_ALPHA**2))
    outcome = _outcome(problem, fitted, explained, sd)
    if outcome == LobeFitOutcome.UNEXPLAINED:
        empty = LobeFit.without_lobe(options.model, outcome, observed.specular.shape)
        return replace(empty, explained=explained)
    lights = _lights(problem, fitted, spread, gains, options)
    alpha: float | None = fitted.lamps.alpha
    low, high = (
        float(max(fitted.lamps.alpha * np.exp(-sd), ALPHAS[0])),
        float(min(fitted.lamps.alpha * np.exp(min(sd, 20)), 1.0)),
    )
    interval: Interval | None = Interval(low, high)
    if outcome == LobeFitOutcome.NARROW:
        alpha = max(high, _pixel_angle(observed, pixels))
        interval = Interval(ALPHAS[0], alpha)
    elif outcome != LobeFitOutcome.DETERMINED:
        alpha = interval = None
    return LobeFit(
        CONVENTION[options.model],
        outcome,
        alpha,
        interval,
        lights,
        None,
        None,
        explained,
        image,
    )


def _lights(
    problem: Problem, fitted: Fitted, spread: np.ndarray, gains: np.ndarray, options: LobeFitOptions
) -> tuple[LobeLight, ...]:
    """The lights, brightest first, with direction and irradiance at their highlights. `spread`: the
    covariance; `gains` (K, 3): of the channels over the mean amplitude.
    """
    systematic, count, lamps = np.radians(options.normal_error), fitted.lamps.count, fitted.lamps
    shares = contributions(problem.model, lamps, problem.pixels.normal, problem.pixels.position)
    lights = []
    for k in range(count):
        weight = problem.pixels.weight * shares[k] ** 2
        middle = weight @ problem.pixels.position / max(float(weight.sum()), 1e-300)
        toward = lamps.directions[k] - lamps.nearness[k] * middle
        length = float(np.linalg.norm(toward))
        colour = gains[k] * np.exp(lamps.log_amplitudes[k]) / length**2
        factor = float(
            np.exp(min(np.sqrt(spread[k, k] + (2 * systematic) ** 2 + _MODEL_STRENGTH**2), 20))
        )
        cone = 0.0
        if problem.directions:
            at = count + len(lamps.base) + 1 + 2 * k
            variance = (spread[at, at] + spread[at + 1, at + 1]) / 2
            cone = float(
                min(
                    np.degrees(_CONE * np.sqrt(variance + systematic**2 + _MODEL_DIRECTION**2)), 180
                )
            )
        lights.append(
            LobeLight(toward / length, cone, colour, Interval(colour / factor, colour * factor))
        )
    return tuple(sorted(lights, key=lambda light: -float(light.strength_light.mean())))


def _pixel_angle(observed: Observed, pixels: Pixels) -> float:
    """Largest angle between the normal at the highlight's peak and those of neighbouring pixels,
    radians: the angular resolution of the image.
    """
    row, column = pixels.cell[int(np.argmax(pixels.value))]
    near = (slice(max(row - 1, 0), row + 2), slice(max(column - 1, 0), column + 2))
    normals, middle = observed.normal_at(near), np.asarray(observed.normal[row, column], float)
    cosines = (normals @ middle)[observed.inside[near]]
    return float(np.clip(np.arccos(np.clip(cosines.min(), -1, 1)), ALPHAS[0], 1))


def _outcome(problem: Problem, fitted: Fitted, explained: float, sd: float) -> LobeFitOutcome:
    if explained < _MIN_EXPLAINED:
        return LobeFitOutcome.UNEXPLAINED
    if problem.pixels.bright < _MIN_PEAK_PIXELS:
        return LobeFitOutcome.NARROW
    alpha = fitted.lamps.alpha
    smooth = alpha > _SMOOTH_ALPHA or (
        alpha > _AMBIGUOUS_ALPHA and smooth_loss(problem.pixels) < fitted.loss
    )
    return (
        LobeFitOutcome.SMOOTH_LIGHT
        if smooth or _wider_fits_as_well(problem, fitted, sd)
        else LobeFitOutcome.DETERMINED
    )


def _wider_fits_as_well(problem: Problem, fitted: Fitted, sd: float) -> bool:
    """Whether an alpha twice or four times as large explains the image within one deviation, with
    all other parameters refitted.
    """
    allowed = sd**2 / max(
        naive_variance(fitted.jacobian, fitted.weight, fitted.lamps.count + len(fitted.lamps.base)),
        1e-300,
    )
    for factor in _WIDER:
        log_alpha = float(np.clip(fitted.lamps.log_alpha + np.log(factor), *np.log(ALPHAS)))
        start = replace(
            fitted.lamps,
            log_alpha=log_alpha,
            log_amplitudes=fitted.lamps.log_amplitudes + 2 * np.log(factor),
        )
        if minimise(replace(problem, alpha=False), start, steps=10).loss - fitted.loss < allowed:
            return True
    return False


def _coloured(
    observed: Observed, problem: Problem, fitted: Fitted
) -> tuple[np.ndarray, np.ndarray, float]:
    """The predicted image, the gains (K, 3) of each light's channels, and the share explained; the
    lobe's shape stays fixed.
    """
    from scipy.optimize import nnls

    pixels, lamps = problem.pixels, fitted.lamps
    shapes = contributions(problem.model, lamps, pixels.normal, pixels.position)
    root = np.sqrt(fitted.weight) / pixels.sigma
    if problem.thresholded:
        root, colour = np.where(pixels.value > pixels.dark, root, 0), pixels.colour + lamps.base[0]
    else:
        mirrored = lamps.base @ problem.basis(pixels.normal)
        # The environment map is too weak to estimate its colour: the lamps' mean colour is used.
        colour = pixels.colour - mirrored[:, None] * _mean_colour(pixels)
    gains = np.stack([nnls((shapes * root).T, colour[:, c] * root)[0] for c in range(3)], axis=1)
    cells = np.argwhere(observed.mask)
    position = (
        np.zeros((len(cells), 3)) if observed.positions is None else observed.positions.at(cells)
    )
    inside = observed.normal_at(observed.mask)
    values = contributions(problem.model, lamps, inside, position).T @ gains
    if not problem.thresholded:
        values = np.maximum(
            values + (lamps.base @ problem.basis(inside))[:, None] * _mean_colour(pixels), 0
        )
    image = np.zeros(observed.specular.shape, np.float32)
    image[observed.mask] = values
    counted, given = observed.inside[observed.mask], observed.specular_at(observed.mask)
    residual = given - (np.maximum(values - lamps.base[0], 0) if problem.thresholded else values)
    explained = 1 - np.square(residual[counted]).sum() / max(
        float(np.square(given[counted]).sum()), 1e-300
    )
    return image, gains, float(np.clip(explained, 0, 1))


def _mean_colour(pixels: Pixels) -> np.ndarray:
    """(3,), of mean 1."""
    colour = pixels.weight @ pixels.colour
    return colour / max(float(colour.mean()), 1e-300)
