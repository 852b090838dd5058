# mypy: disable-error-code="no-untyped-def"
"""Highlight removal by the dark channel and maximum a posteriori estimation (Kim et al. 2013).

Problem: a pixel is diffuse plus white specular, I = D + s (1, 1, 1). Separate every pixel of one
photo.

Equation: among the pixels of a patch of diffuse colours some have a channel near zero, so the dark
channel, the least value of all channels in a patch, is close to s, and I less the dark channel is
nearly free of it: s_0 = max(dark - b u, 0), u = mean(min I). With a the unit vector of the diffuse
colour, s minimises over 0 <= s <= min I

    E = sum_x min_m |I - s 1 - m a|^2 + lambda (s - s_0)^2 + alpha sum_xy psi(s_x - s_y),
    psi(d) = 2 eps^2 (sqrt(1 + (d / eps)^2) - 1) over neighbours x, y:

diffuse colours are known, s stays near the dark channel, and its gradients are sparse. a is
constant except at edges of hue, which s does not move: a(x) is the mean colour of D over pixels of
similar hue near x, weighted by exp(-s / (t u)), so that the pixels with the least highlight
determine it. Both steps alternate. The first term is k (s - s_a)^2 with k = 3 - (1'a)^2 = 1'P1 and
s_a = 1'PI / k, P = 1 - aa': it vanishes on grey, and there the other terms interpolate s from
around. Scheme: a by a bilateral grid (position, hue) of Gaussian means; s by weights 1 / sqrt(1 +
(d / eps)^2) from the last step (half-quadratic) and over-relaxed red-black Gauss-Seidel sweeps,
clamped to the bounds.

Citation: H. Kim, H. Jin, S. Hadap and I. Kweon, "Specular reflection separation using dark channel
prior", CVPR 2013, 1460-1467, doi:10.1109/CVPR.2013.192. The paper's: the dark channel as the first
specular image, and a maximum a posteriori estimate of specular and chromaticity together. Ours:
this energy, its weights and its solution (the "paper" settings are our reading of the idea, not its
code); and as options b > 0, since few colours are as dark as the dark channel assumes; only pixels
whose smallest channel is above u lose specular; and nothing is removed where all of these together
are too little saturated to be distinguished from white reflectance.

Limits: the light must be white. A colour that is never seen without highlight, nearby and in the
same hue, keeps it in part; two colours of one hue and different saturation are distinguished by
their distance alone. Grey pixels depend on their neighbours.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ...errors import InputError
from ...imaging.channels import smallest
from ...numerics.jit import jit
from ...progress import Monitor
from ...scene.decomposition import Separation
from ..support.checks import check_arrays, require_colour
from ..support.layers import bright_layers
from ..support.specular_free import dark_channel


@dataclass(frozen=True)
class Kim2013Options:
    """Options of Kim et al. (2013).

    Attributes
    ----------
    patch : int
        Side, in pixels, of the square in which the dark channel is the least value; >= 1.
    base : float
        b, how many times the mean of the smallest channel counts as diffuse in the dark channel; >=
        0. Zero is the published idea.
    rounds : int
        Alternations of diffuse colours and specular layer; >= 0. Zero leaves the dark channel.
    reach : float
        How far colours are averaged, as a share of the mask's box (of the root of its area); >=
        .05.
    hue : float
        Which hues are alike, as a distance in the disc of unit chroma; in [.02, 1].
    purity : float
        The chroma, as a share of the mask's largest value, below which a hue is unreliable; > 0.
    trust : float
        t, the specular light, in units of u, at which a pixel's weight in the diffuse colour falls
        to 1 / e; > 0.
    prior : float
        lambda, the weight of the dark channel; > 0.
    smoothness : float
        alpha, the weight of the gradients; >= 0.
    gradient : float
        eps, above which a step of s is an edge, as a share of the mask's largest value; > 0.
    sweeps : int
        Gauss-Seidel sweeps a round; >= 0.
    bright_saturation : float
        Nothing is removed if the colour (largest minus smallest channel) of the pixels whose
        smallest channel is above u is less than this share of their largest channel, in [0, 1].
        Zero always removes.
    fade : float or None
        s grows from none where the smallest channel is u to all of it at (1 + fade) u; > 0, or None
        for all of it everywhere.
    """

    patch: int = 7
    base: float = 1.0
    rounds: int = 1
    reach: float = 0.225
    hue: float = 0.08
    purity: float = 0.01
    trust: float = 0.2
    prior: float = 0.02
    smoothness: float = 0.5
    gradient: float = 0.02
    sweeps: int = 20
    bright_saturation: float = 1 / 3
    fade: float | None = 1.0


VARIANTS: dict[str, Kim2013Options] = {
    "improved": Kim2013Options(),
    "paper": Kim2013Options(patch=15, base=0, bright_saturation=0, fade=None),
}

# Even the brightest highlight has a small weight in the diffuse colour, for a reflectance that
# occurs nowhere else.
_LEAST_WEIGHT = 1e-4
# Between 1 (plain Gauss-Seidel) and 2; the first term makes the system well conditioned, so a small
# value is best.
_OVER_RELAXATION = 1.2
_SMALLEST = 1e-12


@dataclass(frozen=True, eq=False)
class Scene:
    """What is constant during the search for s.

    Attributes
    ----------
    image : (H, W, 3) ndarray
        Largest value 1.
    mask : (H, W) bool ndarray
        Linear pixels.
    low : (H, W) ndarray
        The smallest channel, the upper bound of s.
    dark : (H, W) ndarray
        s_0.
    base : float
        u.
    cells : (4, n) ndarray
        The mask's pixels in the bilateral grid.
    grid : tuple of int
        Size of the bilateral grid.
    """

    image: np.ndarray
    mask: np.ndarray
    low: np.ndarray
    dark: np.ndarray
    base: float
    cells: np.ndarray
    grid: tuple[int, ...]


def separate(
    image: np.ndarray,
    mask: np.ndarray,
    options: Kim2013Options | None = None,
    clipped: np.ndarray | None = None,
    monitor: Monitor | None = None,
) -> Separation:
    """Separate a photo under white light into its diffuse and specular layer.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear Rec.709, not negative, of any exposure.
    mask : (H, W) bool ndarray
    options : Kim2013Options, optional
        By default the improved variant.
    clipped : (H, W) bool ndarray, optional
        Pixels whose true value lies above the recorded one: they do not influence others.
    monitor : Monitor, optional

    Returns
    -------
    Separation
        Inside the mask 0 <= diffuse <= image; the specular layer has three equal channels; the
        residual is 0 except where clipped.

    Raises
    ------
    InputError
        If shapes or options are invalid, the mask is empty, values inside it are negative or not
        finite, or the photo has no colour.
    Cancelled
        If the user cancels.
    """
    options, monitor = options or Kim2013Options(), monitor or Monitor()
    check_arrays(image, mask, clipped)
    _check_options(options)
    require_colour(image, mask, "kim_2013")

    def find(inside: np.ndarray, linear: np.ndarray, base: float) -> np.ndarray:
        scale = float(inside[mask].max())
        return scale * _specular_of(
            build_scene(inside / scale, linear, base / scale, options), options, monitor
        )

    return bright_layers(
        image, mask, clipped, find, least_saturation=options.bright_saturation, fade=options.fade
    )


def _check_options(options: Kim2013Options) -> None:
    if options.patch < 1 or options.rounds < 0 or options.sweeps < 0:
        raise InputError("patch must be at least 1, rounds and sweeps at least 0")
    positive = (options.purity, options.trust, options.prior, options.gradient)
    if not all(0 < value < np.inf for value in positive):
        raise InputError("purity, trust, prior and gradient must be finite and above 0")
    # Smaller cells would need more memory than the image.
    if not options.reach >= 0.05 or not 0.02 <= options.hue <= 1:
        raise InputError("reach must be at least 0.05, hue within [0.02, 1]")
    if not (0 <= options.base < np.inf and 0 <= options.smoothness < np.inf):
        raise InputError("base and smoothness must be finite and at least 0")
    if not 0 <= options.bright_saturation <= 1 or not (options.fade is None or options.fade > 0):
        raise InputError("bright_saturation must be within [0, 1], fade above 0 or none")


def build_scene(image: np.ndarray, mask: np.ndarray, base: float, options: Kim2013Options) -> Scene:
    """Compute the dark channel, the bounds and the bilateral grid.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Largest value 1.
    mask : (H, W) bool ndarray
        Linear pixels.
    base : float
        u.
    options : Kim2013Options

    Returns
    -------
    Scene
    """
    low = smallest(image)
    dark = dark_channel(low, mask, options.patch)
    first = np.where(mask, np.maximum(dark - options.base * base, 0), 0)
    cells = _cells(image, mask, options)
    grid = tuple(int(size) for size in np.ceil(cells.max(axis=1)) + 3)
    return Scene(image, mask, low, first, base, cells, grid)


def _cells(image: np.ndarray, mask: np.ndarray, options: Kim2013Options) -> np.ndarray:
    """Positions of the mask's pixels in the bilateral grid, (4, n): row, column and two
    coordinates of hue, in cells, starting at 2.
    """
    rows, columns = np.nonzero(mask)
    rows, columns = rows - rows.min(), columns - columns.min()
    cell = options.reach * np.sqrt((rows.max() + 1) * (columns.max() + 1))
    red, green, blue = image[mask].T
    u, v = (2 * red - green - blue) / np.sqrt(6), (green - blue) / np.sqrt(2)
    chroma = np.hypot(u, v) + options.purity
    return (
        np.stack(
            [
                rows / cell,
                columns / cell,
                (u / chroma + 1) / options.hue,
                (v / chroma + 1) / options.hue,
            ]
        )
        + 2
    )


def _specular_of(scene: Scene, options: Kim2013Options, monitor: Monitor) -> np.ndarray:
    """s (H, W) of the scene's pixels, zero elsewhere."""
    specular = scene.dark
    for done in range(options.rounds):
        monitor.report("finding diffuse colours", done / options.rounds)
        pull, target = colour_term(scene, _albedos(scene, specular, options.trust))
        total = pull + options.prior
        target = (pull * target + options.prior * scene.dark) / total
        specular = np.clip(target, 0, scene.low) if done == 0 else specular
        monitor.report("smoothing the specular layer", (done + 0.6) / options.rounds)
        specular = smooth_layer(specular, target, np.where(scene.mask, total, 0), scene, options)
    return specular


def _albedos(scene: Scene, specular: np.ndarray, tau: float) -> np.ndarray:
    """Unit vectors (n, 3) of the diffuse colour of the mask's pixels: means of the current
    diffuse estimate over nearby pixels of similar hue.
    """
    s = specular[scene.mask]
    weight = np.maximum(np.exp(-s / max(tau * scene.base, _SMALLEST)), _LEAST_WEIGHT)
    nearest = np.ravel_multi_index(tuple(np.rint(scene.cells).astype(np.intp)), scene.grid)
    colours = np.empty((len(s), 3))
    for channel in range(3):
        diffuse = np.maximum(scene.image[..., channel][scene.mask] - s, 0)
        sums = np.bincount(nearest, diffuse * weight, int(np.prod(scene.grid))).reshape(scene.grid)
        means = ndimage.gaussian_filter(sums, 1, mode="constant", truncate=3)
        colours[:, channel] = ndimage.map_coordinates(means, scene.cells, order=1, mode="nearest")
    return colours / np.maximum(np.linalg.norm(colours, axis=1, keepdims=True), _SMALLEST)


def colour_term(scene: Scene, albedos: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute k and s_a of the first term.

    Parameters
    ----------
    scene : Scene
    albedos : (n, 3) ndarray
        Unit vectors of the diffuse colours of the mask's pixels.

    Returns
    -------
    k : (H, W) ndarray
    s_a : (H, W) ndarray
        Within the bounds of s.
    """
    colours = scene.image[scene.mask]
    whiteness = albedos.sum(axis=1)
    pull, target = np.zeros_like(scene.low), np.zeros_like(scene.low)
    pull[scene.mask] = np.maximum(3 - whiteness**2, 0)
    across = colours.sum(axis=1) - whiteness * np.einsum("ij,ij->i", albedos, colours)
    target[scene.mask] = across / np.maximum(pull[scene.mask], _SMALLEST)
    return pull, np.clip(target, 0, scene.low)


def smooth_layer(
    specular: np.ndarray,
    target: np.ndarray,
    pull: np.ndarray,
    scene: Scene,
    options: Kim2013Options,
) -> np.ndarray:
    """Minimise sum pull (s - target)^2 + weights * steps^2 over s within its bounds.

    Parameters
    ----------
    specular : (H, W) ndarray
        Start, which also gives the weights.
    target, pull : (H, W) ndarray
    scene : Scene
    options : Kim2013Options

    Returns
    -------
    (H, W) ndarray
    """
    across = _weights(np.diff(specular, axis=1), scene.mask[:, 1:] & scene.mask[:, :-1], options)
    down = _weights(np.diff(specular, axis=0), scene.mask[1:] & scene.mask[:-1], options)
    result = np.where(scene.mask, specular, 0).astype(float)
    for _ in range(options.sweeps):
        for parity in range(2):
            _relax(result, target, pull, across, down, scene.low, parity)
    return result


def _weights(steps: np.ndarray, both: np.ndarray, options: Kim2013Options) -> np.ndarray:
    """alpha times psi'(d) / 2 d of the steps d, zero unless `both` pixels are in the
    mask.
    """
    return np.where(both, options.smoothness / np.hypot(steps / options.gradient, 1), 0)


@jit(types="f8[2] r[2] r[2] r[2] r[2] r[2] i8")
def _relax(s, target, pull, across, down, bound, parity):
    height, width = s.shape
    for y in range(height):
        for x in range((y + parity) % 2, width, 2):
            total, weight = pull[y, x] * target[y, x], pull[y, x]
            if x > 0:
                total += across[y, x - 1] * s[y, x - 1]
                weight += across[y, x - 1]
            if x < width - 1:
                total += across[y, x] * s[y, x + 1]
                weight += across[y, x]
            if y > 0:
                total += down[y - 1, x] * s[y - 1, x]
                weight += down[y - 1, x]
            if y < height - 1:
                total += down[y, x] * s[y + 1, x]
                weight += down[y, x]
            if weight > 0:
                moved = s[y, x] + _OVER_RELAXATION * (total / weight - s[y, x])
                s[y, x] = min(max(moved, 0.0), bound[y, x])
