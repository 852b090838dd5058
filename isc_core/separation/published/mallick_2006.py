# mypy: disable-error-code="no-untyped-def"
"""Highlight removal by eroding the angle between colour and white (Mallick et al. 2006).

Problem: a pixel is diffuse plus white specular, I = D + s (1, 1, 1). Separate every pixel of one
photo.

Equation: in axes S, U, V with S along white, s changes S alone. With rho = hypot(U, V), hue theta =
atan2(V, U) and phi = atan2(S, rho), a highlight is a hill of phi on a plain, as phi of diffuse
pixels of one colour is constant. The hill is eroded,

    phi_t = -g sqrt(grad phi' M grad phi),
    g = tanh(rho / 2 rho_0) / (1 + exp(|grad rho| - tau)),

with rho in 8-bit levels; M = 1 where the hue is constant, else the projection on the line of
constant hue, along which alone a textured surface has one colour. At the end S_D = rho tan(phi) and
s = (S - S_D) / sqrt(3). Scheme: upwind differences (Rouy & Tourin 1992) and explicit steps; along
lines of constant hue by bilinear samples one pixel apart.

Citation: S. P. Mallick, T. Zickler, P. N. Belhumeur and D. J. Kriegman, "Specularity removal in
images and videos: a PDE approach", ECCV 2006, LNCS 3951, 550-563, doi:10.1007/11744023_43. Ours, as
options: hue and rho are smoothed before they are differentiated; part of the erosion is reversed by
a dilation with the same g (an opening), which restores what never was a hill; and only pixels whose
smallest channel is above its mean lose specular, unless all of these together are too little
saturated to be distinguished from white reflectance. On large photos s is found on averages over 2
x 2 pixels, repeatedly, and interpolated, so that highlights that grow with the photo still vanish.

Limits: the light must be white. Erosion has no steady state except the minimum of every region:
steps * step is the radius, in pixels, of the highlights that it removes, and noise and paler
patches of that size go with them. A highlight that touches no diffuse pixel of its colour, or lies
on grey, stays.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ...errors import InputError
from ...imaging.bounding_box import mask_slices
from ...inpainting.pull_push import pull, push
from ...numerics.jit import jit
from ...progress import Monitor
from ...scene.decomposition import Separation
from ..support.checks import check_arrays, require_colour
from ..support.layers import bright_layers


@dataclass(frozen=True)
class Mallick2006Options:
    """Options of Mallick et al. (2006).

    Attributes
    ----------
    steps, step : int or float
        Number of erosion steps, >= 0, and their length in pixels, in (0, .7]; their product is
        about the radius of the highlights that go.
    longest : int or None
        Objects with a longer side, in pixels, are averaged over blocks down to this, and those
        blocks are the pixels that all lengths here mean; >= 16, or None for the published method.
    restoring_steps : int
        Steps of dilation that follow, >= 0. Zero is the published erosion, `steps` an opening.
    smoothing : float
        Standard deviation, in pixels, of the Gaussian that hue and rho get before they are
        differentiated; 0 to 1000.
    edge : float
        tau, where |grad rho| stops the erosion, in 1/255 of the mask's largest value a pixel; >= 0.
    chroma : float
        rho_0, the rho below which it slows down, in the same levels; > 0.
    texture : float
        |grad theta|, in radians a pixel, above which it runs along lines of constant hue alone; >
        0.
    bright_saturation : float
        Nothing is removed if the colour (largest minus smallest channel) of the pixels whose
        smallest channel is above the mean is less than this share of their largest channel, in [0,
        1]. Zero is the published method.
    fade : float or None
        s grows from none where the smallest channel is at its mean to all of it at 1 + fade times
        the mean; > 0, or None for the published method, which takes all of it everywhere.
    """

    steps: int = 30
    restoring_steps: int = 15
    step: float = 0.5
    smoothing: float = 2.0
    edge: float = 5.0
    chroma: float = 2.0
    texture: float = 0.1
    bright_saturation: float = 1 / 3
    fade: float | None = 1.0
    longest: int | None = 640


VARIANTS: dict[str, Mallick2006Options] = {
    "improved": Mallick2006Options(),
    "paper": Mallick2006Options(
        restoring_steps=0,
        smoothing=0,
        edge=3,
        chroma=1,
        bright_saturation=0,
        fade=None,
        longest=None,
    ),
}

_LEVELS = 255.0
_WIDEST = 1000.0  # smoothing, pixels: beyond, its window needs more memory than a photo
# Value of phi outside the mask: a neighbour this high never erodes a pixel.
_FAR = np.float32(1e9)
# Speeds below this count as zero.
_MIN_SPEED = 1e-3


def separate(
    image: np.ndarray,
    mask: np.ndarray,
    options: Mallick2006Options | None = None,
    clipped: np.ndarray | None = None,
    monitor: Monitor | None = None,
) -> Separation:
    """Separate a photo under white light into its diffuse and specular layer.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear Rec.709, not negative, of any exposure.
    mask : (H, W) bool ndarray
    options : Mallick2006Options, optional
        By default the improved variant.
    clipped : (H, W) bool ndarray, optional
        Pixels whose true value lies above the recorded one: the erosion goes around them.
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
    options, monitor = options or Mallick2006Options(), monitor or Monitor()
    check_arrays(image, mask, clipped)
    _check_options(options)
    require_colour(image, mask, "mallick_2006")

    def find(inside: np.ndarray, linear: np.ndarray, base: float) -> np.ndarray:
        box, specular = mask_slices(mask), np.zeros(mask.shape, inside.dtype)
        specular[box] = _specular_of(inside[box], linear[box], options, monitor)
        return specular

    return bright_layers(
        image, mask, clipped, find, least_saturation=options.bright_saturation, fade=options.fade
    )


def _check_options(options: Mallick2006Options) -> None:
    if options.steps < 0 or options.restoring_steps < 0 or not 0 < options.step <= 0.7:
        raise InputError("steps and restoring_steps must be at least 0, step within (0, 0.7]")
    if not (
        0 <= options.smoothing <= _WIDEST
        and options.edge >= 0
        and options.chroma > 0
        and options.texture > 0
    ):
        raise InputError(
            f"smoothing must be within [0, {_WIDEST:g}], edge at least 0, chroma and texture above "
            "0"
        )
    if not 0 <= options.bright_saturation <= 1 or not (options.fade is None or options.fade > 0):
        raise InputError("bright_saturation must be within [0, 1], fade above 0 or none")
    if options.longest is not None and options.longest < 16:
        raise InputError("longest must be at least 16 pixels, or none")


def _specular_of(
    image: np.ndarray, mask: np.ndarray, options: Mallick2006Options, monitor: Monitor
) -> np.ndarray:
    """Specular (H, W) of `image` (H, W, 3), zero outside `mask`, computed with at most
    `options.longest` pixels a side.
    """
    if options.longest is None or max(mask.shape) <= options.longest:
        return _eroded_light(image, mask, options, monitor)
    averages, known = pull(image, mask)
    coarse = _specular_of(averages, known, options, monitor)
    nothing = np.zeros((*mask.shape, 1), np.float32), np.zeros_like(mask)
    return np.where(mask, push(*nothing, coarse[..., None])[..., 0], 0)


def _eroded_light(
    image: np.ndarray, mask: np.ndarray, options: Mallick2006Options, monitor: Monitor
) -> np.ndarray:
    """Specular (H, W) of `image` (H, W, 3), zero outside `mask`: the light that erosion removes."""
    padded = np.pad(mask, 1)
    scale = _LEVELS / image[mask].max()
    red, green, blue = (np.pad(image[..., c] * scale, 1).astype(np.float32) for c in range(3))
    s = (red + green + blue) / np.float32(math.sqrt(3))
    u = (2 * red - green - blue) / np.float32(math.sqrt(6))
    v = (green - blue) / np.float32(math.sqrt(2))
    rho = np.hypot(u, v)
    phi = np.where(padded, np.arctan2(s, rho), _FAR)
    hue_u, hue_v = (_smoothed(channel, padded, options.smoothing) for channel in (u, v))
    speed, across, down = _flow(rho, hue_u, hue_v, padded, options)
    eroded = _evolve(phi, speed, across, down, options.steps, options.step, monitor.part(0, 0.7))
    if options.restoring_steps:
        upside_down = np.where(padded, -eroded, _FAR)
        restored = -_evolve(
            upside_down,
            speed,
            across,
            down,
            options.restoring_steps,
            options.step,
            monitor.part(0.7, 1),
        )
        eroded = np.minimum(restored, phi)
    lower = padded & (eroded < phi)
    diffuse = np.where(lower, rho * np.tan(np.where(lower, eroded, 0)), s)
    return np.where(padded, np.maximum(s - diffuse, 0) / (math.sqrt(3) * scale), 0)[1:-1, 1:-1]


def _smoothed(values: np.ndarray, mask: np.ndarray, deviation: float) -> np.ndarray:
    """Gaussian means (H, W) over the mask's pixels alone."""
    if deviation == 0:
        return values
    weight = ndimage.gaussian_filter(mask.astype(np.float32), deviation, mode="constant")
    total = ndimage.gaussian_filter(np.where(mask, values, 0), deviation, mode="constant")
    return np.where(mask, total / np.maximum(weight, 1e-6), 0).astype(np.float32)


def _flow(
    rho: np.ndarray, u: np.ndarray, v: np.ndarray, mask: np.ndarray, options: Mallick2006Options
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Speed g and the unit direction (x, y) of constant hue, zero where the hue is constant;
    each (H, W) float32.

    `rho` is not smoothed, so that grey pixels stay; `u` and `v`, which are differentiated, are.
    """
    speed, across, down = np.zeros_like(u), np.zeros_like(u), np.zeros_like(u)
    _measure_flow(
        rho, u, v, mask, options.edge, options.chroma, options.texture, speed, across, down
    )
    return speed, across, down


@jit(types="f4[2] f4[2] f4[2] b1[2] f8 f8 f8 f4[2] f4[2] f4[2]")
def _measure_flow(pixel_rho, u, v, mask, edge, chroma, texture, speed, across, down):
    for y in range(1, u.shape[0] - 1):
        for x in range(1, u.shape[1] - 1):
            rho = math.hypot(u[y, x], v[y, x])
            if not mask[y, x] or rho == 0:
                continue
            # Central differences; a neighbour outside the mask counts as the pixel itself.
            right, left = (x + 1 if mask[y, x + 1] else x), (x - 1 if mask[y, x - 1] else x)
            below, above = (y + 1 if mask[y + 1, x] else y), (y - 1 if mask[y - 1, x] else y)
            ux, vx = (u[y, right] - u[y, left]) / 2, (v[y, right] - v[y, left]) / 2
            uy, vy = (u[below, x] - u[above, x]) / 2, (v[below, x] - v[above, x]) / 2
            slope = math.hypot(u[y, x] * ux + v[y, x] * vx, u[y, x] * uy + v[y, x] * vy) / rho
            speed[y, x] = math.tanh(pixel_rho[y, x] / (2 * chroma)) / (
                1 + math.exp(min(slope - edge, 50.0))
            )
            turn_x, turn_y = (
                (u[y, x] * vx - v[y, x] * ux) / rho**2,
                (u[y, x] * vy - v[y, x] * uy) / rho**2,
            )
            turn = math.hypot(turn_x, turn_y)
            if turn > texture:
                across[y, x], down[y, x] = -turn_y / turn, turn_x / turn


def _evolve(
    phi: np.ndarray,
    speed: np.ndarray,
    across: np.ndarray,
    down: np.ndarray,
    steps: int,
    step: float,
    monitor: Monitor,
) -> np.ndarray:
    """`phi` (H, W) after erosion; its frame and pixels without speed keep their values."""
    here, there = phi.astype(np.float32), phi.astype(np.float32)
    for done in range(steps):
        monitor.report("eroding highlights", done / steps)
        _erode(here, speed, across, down, step, there)
        here, there = there, here
    return here


@jit(types="f4[2] f4[2] f4[2] f4[2] f8 f4[2]")
def _erode(phi, speed, across, down, step, result):
    for y in range(1, phi.shape[0] - 1):
        for x in range(1, phi.shape[1] - 1):
            if speed[y, x] < _MIN_SPEED:
                continue
            here = phi[y, x]
            if across[y, x] == 0 and down[y, x] == 0:
                fall_x = max(here - min(phi[y, x - 1], phi[y, x + 1]), 0.0)
                fall_y = max(here - min(phi[y - 1, x], phi[y + 1, x]), 0.0)
                fall = math.sqrt(fall_x * fall_x + fall_y * fall_y)
            else:
                ahead = _sampled(phi, x + across[y, x], y + down[y, x])
                behind = _sampled(phi, x - across[y, x], y - down[y, x])
                fall = max(here - min(ahead, behind), 0.0)
            result[y, x] = here - step * speed[y, x] * fall


@jit
def _sampled(values, x, y):
    column, row = min(int(x), values.shape[1] - 2), min(int(y), values.shape[0] - 2)
    right, below = x - column, y - row
    upper = (1 - right) * values[row, column] + right * values[row, column + 1]
    lower = (1 - right) * values[row + 1, column] + right * values[row + 1, column + 1]
    return (1 - below) * upper + below * lower
