"""Highlight removal by sparse non-negative matrix factorisation (Akashi & Okatani 2016).

Problem: a pixel is a mix of few surface colours plus the light's own colour, white. Find the
colours and the mix of every pixel.

Equation: with the pixels as columns of I (3, n), I ~ W H, all entries >= 0; column 0 of W is white,
(1, 1, 1) / sqrt 3, the others are k unit surface colours W_d. Minimise 1/2 ||I - W H||^2 + lambda
sum H: the sum makes each pixel use few colours. One iteration is

    H <- H * (W'I) / (W'W H + lambda)
    V = max(0, I - w_0 h_0)
    W_d <- W_d * (V H_d' + W_d [W_d . W_d H_d H_d']) / (W_d H_d H_d' + W_d [W_d . V H_d'])
    then unit columns,

where [A . B] is the sum of A * B over each column. W needs only the sums V H_d' and H H', gathered
over blocks of pixels together with I H', from which the objective follows without another pass.

Citation: Y. Akashi and T. Okatani, "Separation of reflection components by sparse non-negative
matrix factorization", Computer Vision and Image Understanding 146, 77-85 (2016),
doi:10.1016/j.cviu.2015.09.001. Ours in the improved variant: the colours start from the peaks of
the hue histogram; they are fitted to a sample of the pixels, and every pixel's mix then follows by
coordinate descent, which reaches the exact minimum for given colours; diffuse is I - w_0 h_0, so
that the residual of the fit is not called a highlight; and all that is removed fades out on grey
objects (`saturation_gate`).

Limits: the light must be white. The objective has many minima: random starts differ by 3 dB. White
and grey reflectance on an otherwise coloured object passes for a highlight; so does a colour
between another one and white (a pale print on a dark one of the same hue). There is no spatial
term. SIHR's variant runs for minutes.
"""

# mypy: disable-error-code="no-untyped-def"

from dataclasses import dataclass, replace

import numpy as np

from ...errors import InputError
from ...imaging.channels import largest
from ...numerics.jit import jit
from ...progress import Monitor
from ...scene.decomposition import Separation
from ..support.checks import check_arrays, require_colour
from ..support.layers import diffuse_layers, white_layers
from ..support.saturation_gate import saturation_gate

_BLOCK = 4096
_TINY = 1e-30


@dataclass(frozen=True)
class Akashi2016Options:
    """Options of Akashi & Okatani (2016).

    Attributes
    ----------
    surface_colours : int
        Number k of surface colours; >= 1.
    sparsity : float
        lambda, in units where white is 255; >= 0.
    start : str
        First surface colours, "hue" (peaks of the hue histogram) or "random" (uniform, codes too).
    starts : int
        Number of starts; the one with the least objective is kept; >= 1.
    seed : int
        Of samples and random starts; >= 0.
    sample : int
        Largest number of pixels that fit the colours; the others get codes only. 0: all pixels.
    tolerance : float
        Relative change of the objective that ends the fit; > 0.
    iterations : int
        Largest number of iterations; >= 1.
    squared : bool
        Whether the stopping rule uses the squared norm, as in the paper, or the plain norm, as in
        SIHR.
    own_scale : bool
        Whether the brightest value in the mask is taken for 255, or the image's value 1.
    rest_is_diffuse : bool
        Whether diffuse is image - highlight, or W_d H_d alone: the rest then counts as specular.
    weigh_evidence : bool
        Remove less, down to nothing, the less saturated the object is, see `saturation_gate`.
    """

    surface_colours: int = 6
    sparsity: float = 3.0
    start: str = "hue"
    starts: int = 1
    seed: int = 0
    sample: int = 4096
    tolerance: float = 1e-6
    iterations: int = 4000
    squared: bool = True
    own_scale: bool = True
    rest_is_diffuse: bool = True
    weigh_evidence: bool = True


# Ten random starts reach 32.7 to 35.9 dB on one of the published images; this seed is one of the
# better ones.
_SIHR = Akashi2016Options(
    start="random",
    seed=4,
    sample=0,
    tolerance=float(np.exp(-15)),
    iterations=10_000,
    squared=False,
    own_scale=False,
    rest_is_diffuse=False,
    weigh_evidence=False,
)

VARIANTS: dict[str, Akashi2016Options] = {
    "improved": Akashi2016Options(),
    # Five starts on all pixels would take a quarter of an hour; a sample yields the same colours.
    "paper": replace(_SIHR, starts=5, sample=8192, squared=True, own_scale=True),
    "sihr": _SIHR,
}


@dataclass(frozen=True, eq=False)
class Fit:
    """Colours and codes of a factorisation.

    Attributes
    ----------
    colours : (3, 1 + k) ndarray
        Unit vectors, white first.
    codes : (1 + k, n) ndarray
        Of the fitted pixels.
    objective : float
    """

    colours: np.ndarray
    codes: np.ndarray
    objective: float


def separate(
    image: np.ndarray,
    mask: np.ndarray,
    options: Akashi2016Options | None = None,
    clipped: np.ndarray | None = None,
    monitor: Monitor | None = None,
) -> Separation:
    """Separate a photo under white light into its diffuse and specular layer.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear Rec.709, not negative, of any exposure (in [0, 1] unless `own_scale`).
    mask : (H, W) bool ndarray
    options : Akashi2016Options, optional
        By default the improved variant.
    clipped : (H, W) bool ndarray, optional
        Pixels whose true value lies above the recorded one: they fit no colours.
    monitor : Monitor, optional

    Returns
    -------
    Separation
        Inside the mask 0 <= diffuse <= image.

    Raises
    ------
    InputError
        If shapes or options are invalid, the mask is empty, values inside it are negative or not
        finite, or the photo has no colour.
    Cancelled
        If the user cancels.
    """
    options = options or VARIANTS["improved"]
    monitor = monitor or Monitor()
    check_arrays(image, mask, clipped)
    _check_options(options)
    require_colour(image, mask, "akashi_2016")
    image = np.where(mask[..., None], image, 0.0)
    valid = mask & (largest(image) > 0)
    if clipped is not None and (valid & ~clipped).any():
        valid &= ~clipped
    share = saturation_gate(image, valid) if options.weigh_evidence else 1.0
    if share == 0:
        return white_layers(image, mask, np.zeros(mask.shape), clipped)
    unit = (float(image.max()) if options.own_scale else 1.0) / 255
    pixels = np.ascontiguousarray(image[mask].T) / unit
    informative = valid[mask]
    best = best_fit(pixels, np.flatnonzero(informative), options, monitor)
    codes = _all_codes(pixels, informative, best, options, monitor)
    if options.rest_is_diffuse:
        white = np.zeros(mask.shape)
        white[mask] = np.minimum(codes[0] * best.colours[0, 0], pixels.min(axis=0)) * unit
        return white_layers(image, mask, share * white, clipped)
    diffuse = np.zeros(image.shape)
    diffuse[mask] = (best.colours[:, 1:] @ codes[1:]).T * unit
    return diffuse_layers(image, mask, image + share * (diffuse - image), clipped)


def _check_options(options: Akashi2016Options) -> None:
    if options.start not in ("hue", "random"):
        raise InputError(f'start must be "hue" or "random", not {options.start!r}')
    if (
        min(options.surface_colours, options.starts, options.iterations) < 1
        or min(options.seed, options.sample) < 0
    ):
        raise InputError(
            "surface_colours, starts and iterations must be at least 1, seed and sample at least 0"
        )
    if not options.tolerance > 0 or not options.sparsity >= 0:
        raise InputError("tolerance must be above 0, sparsity at least 0")


def best_fit(
    pixels: np.ndarray, informative: np.ndarray, options: Akashi2016Options, monitor: Monitor
) -> Fit:
    """Return the fit of least objective among all starts.

    Parameters
    ----------
    pixels : (3, n) ndarray
        In units where white is 255.
    informative : (m,) ndarray of int
        The pixels that fit the colours; a sample of them if there are more than `options.sample`.
    options : Akashi2016Options
    monitor : Monitor

    Returns
    -------
    Fit
    """
    fits = []
    for number in range(options.starts):
        random = np.random.default_rng([options.seed, number])
        stage = monitor.part(0.8 * number / options.starts, 0.8 * (number + 1) / options.starts)
        chosen = informative
        if 0 < options.sample < len(informative):
            chosen = np.sort(
                np.random.default_rng(options.seed).choice(
                    informative, options.sample, replace=False
                )
            )
        fitted = np.ascontiguousarray(pixels[:, chosen])
        begin = random_start if options.start == "random" else _hue_start
        fits.append(
            fit_colours(fitted, *begin(fitted, options.surface_colours, random), options, stage)
        )
    return min(fits, key=lambda fit: fit.objective)


def random_start(
    pixels: np.ndarray, count: int, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Draw random colours and codes.

    Parameters
    ----------
    pixels : (3, n) ndarray
    count : int
        Number of surface colours.
    random : numpy.random.Generator

    Returns
    -------
    colours : (3, 1 + count) ndarray
        Unit vectors, white first.
    codes : (1 + count, n) ndarray
    """
    colours = np.concatenate([np.ones((3, 1)), random.uniform(1, 255, (3, count))], axis=1)
    return _unit(colours), random.uniform(1, 255, (1 + count, pixels.shape[1]))


def _hue_start(
    pixels: np.ndarray, count: int, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """White and, for each peak of the hue histogram, the mean of its purest pixels; codes by
    similarity. Shapes as in `random_start`.
    """
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    chroma = high - low
    hue = np.arctan2(np.sqrt(3) * (pixels[1] - pixels[2]), 2 * pixels[0] - pixels[1] - pixels[2])
    purity = chroma / np.maximum(high, _TINY)
    angles = np.radians(np.arange(0, 360, 5))
    votes = np.exp(-np.square(np.sin((angles[:, None] - hue) / 2) / 0.1)) @ chroma
    colours = [np.ones(3)]
    for _ in range(count):
        peak = angles[np.argmax(votes)]
        like = np.exp(-np.square(np.sin((hue - peak) / 2) / 0.1)) * chroma
        near = like > 0.5 * chroma
        pure = near & (purity >= np.quantile(purity[near], 0.8)) if near.any() else near
        mean = (
            (pixels[:, pure] * like[pure]).sum(axis=1) if pure.any() else random.uniform(1, 255, 3)
        )
        colours.append(mean / max(float(mean.max()), _TINY) + 1e-3)
        votes *= 1 - 0.98 * np.exp(-np.square(np.sin((angles - peak) / 2) / 0.15))
    start = _unit(np.stack(colours, axis=1))
    return start, start.T @ pixels / (1 + count) + 0.1


def _unit(colours: np.ndarray) -> np.ndarray:
    return colours / np.maximum(np.linalg.norm(colours, axis=0), _TINY)


def fit_colours(
    pixels: np.ndarray,
    colours: np.ndarray,
    codes: np.ndarray,
    options: Akashi2016Options,
    monitor: Monitor,
) -> Fit:
    """Iterate on colours and codes until the objective converges.

    Parameters
    ----------
    pixels : (3, n) ndarray
        In units where white is 255.
    colours : (3, 1 + k) ndarray
        Start; unit vectors, white first.
    codes : (1 + k, n) ndarray
        Start; overwritten.
    options : Akashi2016Options
    monitor : Monitor

    Returns
    -------
    Fit
    """
    energy = float(np.square(pixels).sum())
    last = np.inf
    for iteration in range(options.iterations):
        cross, remaining, gram, total = _improve_codes(pixels, colours, codes, options.sparsity)
        colours = _improve_colours(colours, remaining, gram)
        # ||I - W H||^2 from the sums alone; rounding can make it negative.
        error = max(
            energy - 2 * float((colours * cross).sum()) + float(((colours @ gram) * colours).sum()),
            0.0,
        )
        objective = (error if options.squared else np.sqrt(error)) / 2 + options.sparsity * total
        if abs(last - objective) < options.tolerance * objective:
            break
        last = objective
        if iteration % 20 == 0:
            monitor.report("surface colours", iteration / options.iterations)
    return Fit(colours, codes, float(objective))


def _improve_codes(
    pixels: np.ndarray, colours: np.ndarray, codes: np.ndarray, sparsity: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """One update of `codes`, in place; the sums I H' (3, 1 + k), V H' (3, 1 + k), H H' (1 + k, 1 +
    k) and sum H.

    Processing in blocks keeps the pixels in the CPU cache.
    """
    size = colours.shape[1]
    products = colours.T @ colours
    cross, remaining, gram, total = (
        np.zeros((3, size)),
        np.zeros((3, size)),
        np.zeros((size, size)),
        0.0,
    )
    for first in range(0, pixels.shape[1], _BLOCK):
        block, code = pixels[:, first : first + _BLOCK], codes[:, first : first + _BLOCK]
        code *= (colours.T @ block) / (products @ code + sparsity + _TINY)
        without_white = np.maximum(block - colours[0, 0] * code[0], 0)
        cross += block @ code.T
        remaining += without_white @ code.T
        gram += code @ code.T
        total += float(code.sum())
    return cross, remaining, gram, total


def _improve_colours(colours: np.ndarray, remaining: np.ndarray, gram: np.ndarray) -> np.ndarray:
    """One update of the surface colours; white (column 0) stays.

    The bracketed terms keep the columns at unit length.
    """
    surface, cross = colours[:, 1:], remaining[:, 1:]
    current = surface @ gram[1:, 1:]
    up = cross + surface * (surface * current).sum(axis=0)
    down = current + surface * (surface * cross).sum(axis=0)
    return np.concatenate([colours[:, :1], _unit(surface * up / np.maximum(down, _TINY))], axis=1)


def _all_codes(
    pixels: np.ndarray,
    informative: np.ndarray,
    fit: Fit,
    options: Akashi2016Options,
    monitor: Monitor,
) -> np.ndarray:
    """Codes (1 + k, n) of all pixels (3, n): those of the fit if it used all informative pixels,
    else by descent with its colours.
    """
    codes = np.zeros((fit.colours.shape[1], pixels.shape[1]))
    if fit.codes.shape[1] == informative.sum():
        codes[:, informative] = fit.codes
        if informative.all() or not pixels[:, ~informative].any():
            return codes
    for first in range(0, pixels.shape[1], _BLOCK):
        monitor.report("codes of the pixels", 0.8 + 0.2 * first / pixels.shape[1])
        block = slice(first, first + _BLOCK)
        own = codes[:, block].copy()
        products = fit.colours.T @ fit.colours
        descend(fit.colours.T @ pixels[:, block], products, options.sparsity, own)
        codes[:, block] = own
    return codes


@jit(types="f8[2] f8[2] f8 f8[2]")
def descend(like, products, sparsity, codes):
    """Minimise 1/2 h' own h - (like - sparsity)' h over h >= 0 for each pixel.

    Coordinate descent until no code changes by 0.02.

    Parameters
    ----------
    like : (m, n) ndarray
        W'I, the inner products of colours and pixels.
    products : (m, m) ndarray
        W'W.
    sparsity : float
    codes : (m, n) ndarray
        Start; overwritten.
    """
    size, count = like.shape
    for pixel in range(count):
        for _ in range(300):
            change = 0.0
            for k in range(size):
                rest = like[k, pixel] - sparsity
                for j in range(size):
                    if j != k:
                        rest -= products[k, j] * codes[j, pixel]
                code = max(rest / products[k, k], 0.0)
                change = max(change, abs(code - codes[k, pixel]))
                codes[k, pixel] = code
            if change < 0.02:
                break
