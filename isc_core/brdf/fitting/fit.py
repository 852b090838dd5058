"""From a specular image and normals to a lobe and its lights.

Problem: how rough a glossy object is, and where its lights stand, from the specular layer of one photo.

Method: the specular light as a function of the normal has a peak for each light (`starts`). From there, several widths are tried and the
best is refined (`lamps`); another light is added where the residual has another peak, as long as an information criterion asks for it:
n log(loss) + p log n, n being the number of independent pieces of the highlight. The alpha that comes out is held against others, each with
everything else fitted anew (profile likelihood); where the loss hardly rises, alpha is undetermined. Intervals: `uncertainty`.

Citation: G. Schwarz, "Estimating the dimension of a model", Annals of Statistics 6(2) (1978), doi:10.1214/aos/1176344136.
The lobes: see `isc_core.brdf`.

Limits: lights are far and small. A light of some width widens the lobe: seen from the object under 2 w radians, w is added to 2 alpha about
as squares are. White gloss, one roughness for the whole object, no shadows cast on the highlight.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import nnls

from ...errors import InputError
from ...progress import Monitor
from ..directions import unit
from .environment_fit import fit_under
from .lamps import ALPHAS, Fitted, Freedom, Lamps, minimise, predicted
from .pixels import Pixels, choose_pixels
from .result import CONVENTION, FOUND, NARROW, NO_LIGHT, SMOOTH, UNLIKE, Interval, LobeFit, LobeFitOptions, LobeLight
from .starts import brightest_half_vector, light_of_half_vector
from .uncertainty import covariance, naive_variance

_START_ALPHAS = (0.06, 0.2, 0.45)
_WIDEST = 0.7  # an alpha as large as that is a light as smooth as shading
_CONE = 1.515  # deviations, each way, that hold 68 % in two dimensions
_NARROWEST_PIXELS = 6  # within half of the peak
_GAIN = 0.15  # of the loss: less, and another light explains nothing
_LEAST_EXPLAINED = 0.25


def fit_lobe(
    specular: np.ndarray,
    normal: np.ndarray,
    mask: np.ndarray,
    confidence: np.ndarray | None = None,
    *,
    options: LobeFitOptions | None = None,
    light_direction: np.ndarray | None = None,
    environment: np.ndarray | None = None,
    clipped: np.ndarray | None = None,
    monitor: Monitor | None = None,
) -> LobeFit:
    """Fits a lobe to `specular` (H, W, 3), linear, >= 0, seen from (0, 0, 1), on the unit normals (H, W, 3), inside `mask` (H, W) bool.

    `confidence` (H, W) in [0, 1]: how far each pixel is believed. `clipped` (H, W) bool: where the light is a lower bound. Either the light
    is found, or it is given: `light_direction` (3,), a unit vector, or `environment` (rows, 2 rows, 3), see `isc_core.environment`.
    What cannot be known is said in the result. Raises `InputError` for arrays that do not fit together, `Cancelled`.
    """
    options, monitor = options or LobeFitOptions(), monitor or Monitor()
    scene = _checked(specular, normal, mask, confidence, clipped)
    if light_direction is not None and environment is not None:
        raise InputError("give light_direction or environment, not both")
    monitor.report("fitting the gloss", 0.0)
    if scene.peak <= options.darkest:
        return _nothing(scene, options, NO_LIGHT)
    noise = (options.floor, options.relative)
    pixels = choose_pixels(scene.specular, scene.normal, scene.inside, scene.confidence, scene.clipped, noise, options.most_pixels)
    if environment is not None:
        return fit_under(np.asarray(environment, float), pixels, scene.specular, scene.normal, scene.mask, options)
    fixed = None if light_direction is None else unit(light_direction, "light_direction")
    if fixed is not None and fixed.shape != (3,):
        raise InputError(f"light_direction has shape {fixed.shape}: give one unit vector (3,)")
    fitted = _search(pixels, options, fixed, monitor)
    monitor.report("how sure the gloss is", 0.7)
    return _answer(scene, pixels, fitted, options, fixed is None)


@dataclass(frozen=True)
class _Scene:
    """The checked arrays; `inside`: pixels that count."""

    specular: np.ndarray
    normal: np.ndarray
    mask: np.ndarray
    inside: np.ndarray
    confidence: np.ndarray
    clipped: np.ndarray

    @property
    def peak(self) -> float:
        """The brightest mean over the channels."""
        return float(self.specular[self.inside].mean(axis=1).max()) if self.inside.any() else 0.0


def _checked(
    specular: np.ndarray, normal: np.ndarray, mask: np.ndarray, confidence: np.ndarray | None, clipped: np.ndarray | None
) -> _Scene:
    specular, normal, mask = np.asarray(specular, float), np.asarray(normal, float), np.asarray(mask)
    shape = mask.shape
    confidence = np.ones(shape) if confidence is None else np.asarray(confidence, float)
    clipped = np.zeros(shape, bool) if clipped is None else np.asarray(clipped)
    if mask.ndim != 2 or mask.dtype != bool or specular.shape != (*shape, 3) or normal.shape != (*shape, 3):
        shapes = f"specular {specular.shape}, normal {normal.shape} and mask {shape} {mask.dtype}"
        raise InputError(f"{shapes} have to be (H, W, 3), (H, W, 3) and (H, W) bool")
    if confidence.shape != shape or clipped.shape != shape or clipped.dtype != bool:
        raise InputError("confidence and clipped have to be (H, W) as the mask is, clipped of bool")
    if not (np.isfinite(specular[mask]).all() and (specular[mask] >= 0).all()):
        raise InputError("the specular image has to be finite and 0 or more inside the mask")
    if not (np.isfinite(confidence[mask]).all() and (confidence[mask] >= 0).all() and (confidence[mask] <= 1).all()):
        raise InputError("the confidence has to be within [0, 1] inside the mask")
    unit(normal[mask], "normal")
    return _Scene(specular, normal, mask, mask & (confidence > 0) & (normal[..., 2] > 0), confidence, clipped)


def _search(pixels: Pixels, options: LobeFitOptions, fixed: np.ndarray | None, monitor: Monitor) -> Fitted:
    """One light after the other, as long as each is worth its parameters."""
    freedom = Freedom(directions=fixed is None)
    best = _first(pixels, options, fixed, freedom)
    for count in range(2, options.most_lights + 1 if fixed is None else 2):
        monitor.report("looking for another light", 0.2 * count)
        left = pixels.value - predicted(options.model, best.lamps, pixels.normal).sum(axis=0)
        half = brightest_half_vector(pixels.normal, left, pixels.weight)
        amplitude = _amplitude(best.lamps.alpha, 0.3 * pixels.peak)
        lamps = replace(
            best.lamps,
            directions=np.vstack([best.lamps.directions, light_of_half_vector(half)]),
            log_amplitudes=np.append(best.lamps.log_amplitudes, amplitude),
        )
        more = minimise(pixels, options.model, lamps, freedom)
        if not _worth(best, more, pixels):
            break
        best = more
    return best


def _first(pixels: Pixels, options: LobeFitOptions, fixed: np.ndarray | None, freedom: Freedom) -> Fitted:
    half = brightest_half_vector(pixels.normal, pixels.value, pixels.weight)
    direction = light_of_half_vector(half) if fixed is None else fixed
    sky = float(np.log(0.01 * pixels.peak))
    starts = [Lamps(direction[None], np.array([_amplitude(a, pixels.peak)]), sky, float(np.log(a))) for a in _START_ALPHAS]
    tried = [minimise(pixels, options.model, start, freedom, steps=8) for start in starts]
    best = min(tried, key=lambda fit: fit.loss)
    return minimise(pixels, options.model, best.lamps, freedom)


def _amplitude(alpha: float, peak: float) -> float:
    """Log of the amplitude whose GGX lobe is as high as `peak` where normal, view and light agree."""
    return float(np.log(4 * np.pi * alpha**2 * peak / 0.04))


def _worth(less: Fitted, more: Fitted, pixels: Pixels) -> bool:
    """Schwarz' criterion over independent pieces, and a gain that can be seen."""
    pieces = min(200.0, max(10.0, len(pixels.value) / max(1.0, np.sqrt(pixels.bright))))
    gain = np.log(max(less.loss, 1e-300) / max(more.loss, 1e-300))
    return bool(pieces * gain > 3 * np.log(pieces) and more.loss < (1 - _GAIN) * less.loss and less.loss > 1e-3 * len(pixels.value))


def _answer(scene: _Scene, pixels: Pixels, fitted: Fitted, options: LobeFitOptions, turning: bool) -> LobeFit:
    spread = covariance(fitted.jacobian, fitted.residual, fitted.weight, pixels)
    image, colours = _coloured(scene, pixels, fitted, options)
    explained = _explained(scene, image)
    lights = _lights(fitted, spread, colours, options, turning)
    convention = CONVENTION[options.model]
    at = fitted.lamps.count + 1
    sd = float(np.sqrt(spread[at, at] + np.radians(options.normal_error) ** 2))
    reason = _reason(pixels, fitted, options, turning, explained, sd)
    alpha: float | None = fitted.lamps.alpha
    low, high = float(max(fitted.lamps.alpha * np.exp(-sd), ALPHAS[0])), float(min(fitted.lamps.alpha * np.exp(min(sd, 20)), 1.0))
    interval: Interval | None = Interval(low, high)
    if reason == NARROW:
        alpha = max(high, _step(scene, pixels))
        interval = Interval(ALPHAS[0], alpha)
    elif reason != FOUND:
        alpha = interval = None
    return LobeFit(convention, reason == FOUND, reason, alpha, interval, lights, None, None, explained, image)


def _lights(fitted: Fitted, spread: np.ndarray, colours: np.ndarray, options: LobeFitOptions, turning: bool) -> tuple[LobeLight, ...]:
    """The lights, the brightest first. `spread`: the covariance; `colours` (K, 3): strength x light."""
    systematic, count = np.radians(options.normal_error), fitted.lamps.count
    lights = []
    for k in np.argsort(-colours.mean(axis=1), kind="stable"):
        factor = float(np.exp(min(np.sqrt(spread[k, k] + (2 * systematic) ** 2), 20)))
        cone = 0.0
        if turning:
            at = count + 2 + 2 * k
            turn = (spread[at, at] + spread[at + 1, at + 1]) / 2
            cone = float(min(np.degrees(_CONE * np.sqrt(turn + systematic**2)), 180))
        lights.append(LobeLight(fitted.lamps.directions[k], cone, colours[k], Interval(colours[k] / factor, colours[k] * factor)))
    return tuple(lights)


def _step(scene: _Scene, pixels: Pixels) -> float:
    """How far the normal turns from the highlight's peak to a neighbouring pixel, radians: what the picture can resolve."""
    row, column = pixels.place[int(np.argmax(pixels.value))]
    near = (slice(max(row - 1, 0), row + 2), slice(max(column - 1, 0), column + 2))
    cosines = (scene.normal[near] @ scene.normal[row, column])[scene.inside[near]]
    return float(np.clip(np.arccos(np.clip(cosines.min(), -1, 1)), ALPHAS[0], 1))


def _reason(pixels: Pixels, fitted: Fitted, options: LobeFitOptions, turning: bool, explained: float, sd: float) -> str:
    if explained < _LEAST_EXPLAINED:
        return UNLIKE
    if pixels.bright < _NARROWEST_PIXELS:
        return NARROW
    if fitted.lamps.alpha > _WIDEST or _reaches(pixels, fitted, options, turning, sd, (2.0, 4.0)):
        return SMOOTH
    return FOUND


def _reaches(pixels: Pixels, fitted: Fitted, options: LobeFitOptions, turning: bool, sd: float, ladder: tuple[float, ...]) -> bool:
    """Whether an alpha that is one of `ladder` times the best explains the image within one deviation, everything else fitted anew."""
    naive = naive_variance(fitted.jacobian, fitted.weight, fitted.lamps.count + 1)
    allowed = sd**2 / max(naive, 1e-300)
    for factor in ladder:
        log_alpha = float(np.clip(fitted.lamps.log_alpha + np.log(factor), *np.log(ALPHAS)))
        start = replace(fitted.lamps, log_alpha=log_alpha, log_amplitudes=fitted.lamps.log_amplitudes + 2 * np.log(factor))
        if minimise(pixels, options.model, start, Freedom(turning, False), steps=10).loss - fitted.loss < allowed:
            return True
    return False


def _coloured(scene: _Scene, pixels: Pixels, fitted: Fitted, options: LobeFitOptions) -> tuple[np.ndarray, np.ndarray]:
    """The predicted image and the strength x light (K, 3) of each light: amplitudes per channel, the shapes kept."""
    shapes = predicted(options.model, fitted.lamps, pixels.normal)
    root = np.sqrt(fitted.weight) / pixels.sigma
    gains = np.stack([nnls((shapes * root).T, pixels.colour[:, c] * root)[0] for c in range(3)], axis=1)
    image = np.zeros(scene.specular.shape, np.float32)
    image[scene.mask] = predicted(options.model, fitted.lamps, scene.normal[scene.mask]).T @ gains
    return image, gains[:-1] * np.exp(fitted.lamps.log_amplitudes)[:, None]


def _explained(scene: _Scene, image: np.ndarray) -> float:
    total = float(np.square(scene.specular[scene.inside]).sum())
    left = float(np.square(scene.specular[scene.inside] - image[scene.inside]).sum())
    return float(np.clip(1 - left / max(total, 1e-300), 0, 1))


def _nothing(scene: _Scene, options: LobeFitOptions, reason: str) -> LobeFit:
    empty = np.zeros(scene.specular.shape, np.float32)
    return LobeFit(CONVENTION[options.model], False, reason, None, None, (), None, None, 0.0, empty)
