"""The lobe of an object of which normals, shading and specular light were recovered from a single
photo.

Problem: recovered normals are wrong by 10 to 20 degrees, most of all in highlights, so the width of
the highlight in terms of these normals carries hardly any information (alpha had a deviation of a
factor 1.9, the light was 30 to 60 degrees off). Its brightness carries more: a dielectric reflects
about f0 = 4 % of the light at normal incidence, and the shading shows how bright that light is. So
does the share of the object's area that the highlight covers, regardless of the normals there: all
normals that face the viewer occur somewhere on the object.

Equation: with A the brightest shading (97th percentile), a light with irradiance E = pi A across
its beam, and the highlight's peak P, the lobe's height D F G / (4 cos) at n = h gives

    alpha_P = sqrt(f0 A / (4 cos P)),
    f = sum of max(s - .2 P, 0) over the object / (P times its pixels),
    log alpha = a + b log alpha_P + c log sqrt(f),    strength E = pi A,

s the specular light (a separator may or may not include darker parts), cos = .85 the typical tilt
of h. h is the mean of the normals, weighted by the squared specular light, after the normals were
blurred over .3 of the object's size (the root of its area): this retains the position of the
highlight on the object. Where the silhouette's normals are given, h is the mean of both. Where the
light was predicted (`light_estimate`), the prediction is the light's direction, and h is only used
to place the highlight on these normals.

a, b and c were fitted to 44 rendered GGX objects (alpha .05 to .45, strength .6 to 1.5, ior 1.5)
that went through the whole pipeline; in leave-one-out validation, alpha was within a factor 1.5 on
83 % of those from .1 to .4 (70 % without f), strength over shading within 40 % on 77 %, and the
light 22 degrees off in the median (28 without the silhouette). The intervals contain 68 % of 30 of
them, with SIRFS using predicted shape and light. `benchmarks/decomposition/lobe_fitting.py`
measures others.

Citation: the brightness of highlights as a measure of gloss: J. A. Ferwerda, F. Pellacini, D. P.
Greenberg, "A psychophysically-based model of surface gloss perception", SPIE 4299 (2001),
doi:10.1117/12.429501. Microfacets: B. Walter et al., doi:10.2312/EGWR/EGSR07/195-206.

A clipped highlight was brighter than P: alpha_P is then too large, and the result is an upper
bound.

Limits: dielectrics (metals reflect ten times as much) under lights that are small compared with the
highlight; one light, the strongest. Strength is relative to the given shading: one photo does not
determine how dark an albedo is, so the shading's own scale may be off by two.
"""

from dataclasses import replace

import numpy as np

from ..filters.gaussian import gaussian_average
from ..imaging.bounding_box import mask_slices
from ..imaging.channels import channel_means, length
from ..imaging.row_blocks import row_blocks
from ..imaging.upsampling import enlarged
from ..scene.light_estimate import LightEstimate
from ..scene.lobe_fit import (
    CONVENTION,
    Interval,
    LobeFit,
    LobeFitOptions,
    LobeFitOutcome,
    LobeLight,
)
from ..shading.brdf.ggx import F0
from .lamps import ALPHAS, Lamps, contributions
from .observed import Observed
from .pixels import Pixels
from .starts import light_of_half_vector

_BLUR = 0.3  # of the root of the object's area
_BLOCKS = 16  # per width of the blur
_BRIGHTEST = 97.0  # percentile of the shading
_TILT = 0.85
_OFFSET, _SLOPE, _COVERED = 0.319, 0.589, 0.434
_COVER_LEVEL = 0.2  # of the peak: brighter pixels count as covered
_ALPHA_SPREAD, _STRENGTH_SPREAD, _CONE = (
    0.28,
    0.34,
    30.0,
)  # 68 % intervals: log factors, degrees
_MIN_SHARE = 1e-3  # of specular light over shading: separators find less on diffuse objects
_MAX_ALPHA = 0.6
_MIN_PEAK_PIXELS = 6
_MIN_Z = 0.05
_MAX_CLIPPED = 0.5  # of the pixels of the peak


def fit_recovered(
    observed: Observed,
    pixels: Pixels,
    shading: np.ndarray,
    direction: np.ndarray | None,
    light_estimate: LightEstimate | None,
    options: LobeFitOptions,
) -> LobeFit:
    """Fit a lobe where normals and shading are recovered.

    Parameters
    ----------
    observed : Observed
        The specular image.
    pixels : Pixels
        The fitted pixels.
    shading : (H, W, 3) ndarray
        Of a white Lambertian surface.
    direction : (3,) ndarray or None
        Known direction of the light.
    light_estimate : LightEstimate or None
        The predicted light.
    options : LobeFitOptions
        The lobe.

    Returns
    -------
    LobeFit
        With one light.
    """
    convention, inside = CONVENTION[options.model], observed.inside
    shading_level = channel_means(shading, inside)
    brightest, specular_level = (
        float(np.percentile(shading_level, _BRIGHTEST)),
        observed.brightness,
    )
    if brightest <= 0 or specular_level.sum() < _MIN_SHARE * shading_level.sum():
        return LobeFit.without_lobe(
            options.model, LobeFitOutcome.NO_SPECULAR, observed.specular.shape
        )
    by_brightness = 0.5 * float(np.log(F0 * brightest / (4 * _TILT * pixels.peak)))
    by_size = 0.5 * float(np.log(np.maximum(specular_level / pixels.peak - _COVER_LEVEL, 0).mean()))
    log_alpha = _OFFSET + _SLOPE * by_brightness + _COVERED * by_size
    alpha = float(np.clip(np.exp(log_alpha), *ALPHAS))
    normal = blurred_normals(observed.normal, observed.mask)
    highlight_light = _light_direction(observed, normal) if direction is None else direction
    if direction is not None:
        toward, cone = direction, 0.0
    else:
        toward, cone = (
            (highlight_light, _CONE)
            if light_estimate is None
            else (light_estimate.direction, light_estimate.cone)
        )
    colour = (pixels.weight * pixels.value) @ pixels.colour
    mirrored = (
        1.0 if options.model == "ggx" else F0
    )  # the strength of the Blinn-Phong lobe includes f0
    product = mirrored * np.pi * brightest * colour / max(float(colour.mean()), 1e-300)
    light = LobeLight(
        toward,
        cone,
        product,
        Interval(product * np.exp(-_STRENGTH_SPREAD), product * np.exp(_STRENGTH_SPREAD)),
    )
    image, explained = _predicted(
        observed, normal, replace(light, direction=highlight_light), alpha, options
    )
    outcome = _outcome(alpha, pixels, light_estimate)
    interval: Interval | None = Interval(
        max(alpha * np.exp(-_ALPHA_SPREAD), ALPHAS[0]), min(alpha * np.exp(_ALPHA_SPREAD), 1.0)
    )
    if outcome == LobeFitOutcome.SMOOTH_LIGHT:
        return LobeFit(convention, outcome, None, None, (light,), None, None, explained, image)
    if outcome.bounded:
        alpha = float(interval.high) if interval else alpha
        interval = Interval(ALPHAS[0], alpha)
    return LobeFit(convention, outcome, alpha, interval, (light,), None, None, explained, image)


def _outcome(alpha: float, pixels: Pixels, light_estimate: LightEstimate | None) -> LobeFitOutcome:
    if pixels.peak_clipped > _MAX_CLIPPED:
        # Even if the bound is large: clipping does not indicate smooth light.
        return LobeFitOutcome.CLIPPED
    if alpha > _MAX_ALPHA or (light_estimate is not None and light_estimate.smooth):
        return LobeFitOutcome.SMOOTH_LIGHT
    return LobeFitOutcome.NARROW if pixels.bright < _MIN_PEAK_PIXELS else LobeFitOutcome.DETERMINED


def blurred_normals(normal: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Blur normals over .3 of the object's size.

    For speed, the blur is applied to sums over blocks of a sixteenth of its width.

    Parameters
    ----------
    normal : (H, W, 3) ndarray
        Unit normals.
    mask : (H, W) ndarray of bool
        The object.

    Returns
    -------
    (H, W, 3) ndarray
        Unit normals; (0, 0, 1) outside the mask.
    """
    box = mask_slices(mask)
    inside = mask[box]
    width = _BLUR * float(np.sqrt(inside.sum()))
    step = max(1, int(width / _BLOCKS))
    sums = np.dstack(
        [
            gaussian_average(layer, width / step, mirrored=False)
            for layer in _block_sums(normal[box], inside, step)
        ]
    )
    blurred = np.zeros(normal.shape)
    blurred[..., 2] = 1
    of_box = blurred[box]
    for block in row_blocks(inside.shape):
        here = inside[block.rows]
        near = enlarged(sums, here.shape, step, (block.rows.start, 0))
        means = near[..., :3] / np.maximum(near[..., 3:], 1e-9)
        means[..., 2] = np.maximum(means[..., 2], _MIN_Z)
        unit = means / length(means)[..., None]
        of_box[block.rows][here] = unit[here]
    return blurred


def _block_sums(normal: np.ndarray, inside: np.ndarray, step: int) -> np.ndarray:
    """Sums (4, h, w) of the normals inside and their number, over blocks of `step` x `step`
    pixels.
    """
    sums = []
    for block in row_blocks((-(-len(inside) // step), step * inside.shape[1])):
        rows = slice(step * block.rows.start, step * block.rows.stop)
        here = inside[rows]
        layers = np.where(here[..., None], np.dstack([normal[rows], np.ones(here.shape)]), 0)
        padded = np.pad(layers, [(0, -n % step) for n in here.shape] + [(0, 0)])
        height, width = (n // step for n in padded.shape[:2])
        sums.append(padded.reshape(height, step, width, step, -1).sum(axis=(1, 3)))
    return np.concatenate(sums).transpose(2, 0, 1)


def _light_direction(observed: Observed, normal: np.ndarray) -> np.ndarray:
    """From the mean normal of the highlight, averaged with the silhouette's if given."""
    weight = np.square(observed.brightness) * observed.confidence[observed.inside]
    half = _unit(weight @ normal[observed.inside])
    if observed.silhouette_normals is not None:
        half = _unit(
            half + _unit(weight @ np.asarray(observed.silhouette_normals[observed.inside], float))
        )
    return light_of_half_vector(half)


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / max(float(np.linalg.norm(vector)), 1e-300)


def _predicted(
    observed: Observed, normal: np.ndarray, light: LobeLight, alpha: float, options: LobeFitOptions
) -> tuple[np.ndarray, float]:
    """The fit's specular image on the blurred normals, and the share that it explains."""
    lamps = Lamps(
        light.direction[None], np.zeros(1), np.zeros(1), np.zeros(1), float(np.log(alpha))
    )
    image = np.zeros(observed.specular.shape, np.float32)
    for block in row_blocks(observed.mask.shape):
        here = observed.mask[block.rows]
        inside = normal[block.rows][here]
        shares = contributions(options.model, lamps, inside, np.zeros_like(inside))[0]
        image[block.rows][here] = shares[:, None] * light.strength_light
    given = observed.specular_at(observed.inside)
    error = given - image[observed.inside]
    remaining, total = (float(np.square(one, out=one).sum()) for one in (error, given))
    return image, float(np.clip(1 - remaining / max(total, 1e-300), 0, 1))
