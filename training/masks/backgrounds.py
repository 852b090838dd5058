"""Backgrounds of composites: crops of panoramas, tables before them, plain backdrops.

Problem: behind an object in a photo is a room, a street or a wood, a patterned table in front of
one of them, or a plain wall or cloth. The network should see none of them twice.

Equation: a crop is the perspective image of a camera at the panorama's centre: pixel (x, y) has the
viewing ray R (x tan(f / 2), y tan(f / 2), -1) for a field of view f and a rotation R. A table is a
plane below the horizon row h: the pattern's coordinates at (x, y) are (x, 1) k / (y - h). The
pattern is blurred by a Gaussian whose Fourier transform is exp(-2 pi^2 s^2 f^2).

Limits: panoramas of 512 columns are blurred in narrow crops.
"""

from dataclasses import dataclass

import numpy as np
import torch
from torch.nn import functional

from ..world.random_draws import log_uniforms
from ..world.tensor_batch import TensorBatch, chosen

SHARES = (0.2, 0.45)  # of plain backgrounds; of tables before crops or plain ones
_PATTERN_PIXEL = 0.3  # standard deviation of a pattern's blur, pixels at the front of the table
_STRIDE = 3  # the exposure of a crop is computed from every third row and column


@dataclass(frozen=True, eq=False)
class Crops(TensorBatch):
    """Perspective crops of panoramas.

    Attributes
    ----------
    photo : (B,) int64 tensor
        Index of the photo.
    panorama : (B,) tensor
        Index as a fraction of the number of panoramas, in [0, 1).
    half : (B,) tensor
        Tangent of half the field of view.
    rotation : (B, 3, 3) tensor
        Transpose of R of the module.
    azimuth : (B,) tensor
        Radians.
    quantile, exposure : (B,) tensor
        This quantile of the light is scaled to this value.
    """

    photo: torch.Tensor
    panorama: torch.Tensor
    half: torch.Tensor
    rotation: torch.Tensor
    azimuth: torch.Tensor
    quantile: torch.Tensor
    exposure: torch.Tensor


@dataclass(frozen=True, eq=False)
class Backdrops(TensorBatch):
    """Plain walls and cloths.

    Attributes
    ----------
    photo : (B,) int64 tensor
        Index of the photo.
    colour : (B, 3) tensor
    gradient : (B, 2) tensor
        Of the log light, right and down.
    vignette : (B,) tensor
        Decrease of the log light at distance 1 from the centre.
    grain, width : (B,) tensor
        Standard deviation of the log light of a faint texture, and its size in pixels.
    """

    photo: torch.Tensor
    colour: torch.Tensor
    gradient: torch.Tensor
    vignette: torch.Tensor
    grain: torch.Tensor
    width: torch.Tensor


@dataclass(frozen=True, eq=False)
class Tables(TensorBatch):
    """Tables before backgrounds.

    Attributes
    ----------
    photo : (B,) int64 tensor
        Index of the photo.
    pattern : (B,) tensor
        Index as a fraction of the number of patterns, in [0, 1).
    horizon, edge : (B,) tensor
        h of the module; row of the far edge.
    tilt : (B,) tensor
        Slope of the rows.
    angle, scale : (B,) tensor
        Of the pattern; radians.
    offset : (B, 2) tensor
        Of the pattern, in its sides.
    first, second : (B, 3) tensor
        Colours of the pattern.
    gradient : (B, 2) tensor
        Of the log light, right and down.
    """

    photo: torch.Tensor
    pattern: torch.Tensor
    horizon: torch.Tensor
    edge: torch.Tensor
    tilt: torch.Tensor
    angle: torch.Tensor
    scale: torch.Tensor
    offset: torch.Tensor
    first: torch.Tensor
    second: torch.Tensor
    gradient: torch.Tensor


@dataclass(frozen=True, eq=False)
class BackgroundDraws(TensorBatch):
    """Random variables of the backgrounds of a batch.

    Attributes
    ----------
    window : (B, 2, 2) tensor
        Scale and centre, right and down, of the visible part of a background.
    crops : Crops
    backdrops : Backdrops
        Of all other photos.
    tables : Tables
        In front of some of either.
    """

    window: torch.Tensor
    crops: Crops
    backdrops: Backdrops
    tables: Tables


def draw_backgrounds(
    rng: np.random.Generator, number: int, shares: tuple[float, float] = SHARES
) -> BackgroundDraws:
    """Draw backgrounds.

    Parameters
    ----------
    rng : numpy.random.Generator
    number : int
    shares : tuple of float
        Of plain backgrounds, and of backgrounds with a table.

    Returns
    -------
    BackgroundDraws
        On the CPU.
    """
    zoom = rng.uniform(0.6, 1, (number, 1))
    place = (1 - zoom) * rng.uniform(-1, 1, (number, 2))
    scale = zoom * np.stack([rng.choice([-1, 1], number), np.ones(number)], axis=1)
    plain, table = (_random_subset(rng, number, share) for share in shares)
    return BackgroundDraws(
        torch.from_numpy(np.stack([scale, place], axis=1)).float(),
        _draw_crops(rng, np.setdiff1d(np.arange(number), plain)),
        _draw_backdrops(rng, plain),
        _draw_tables(rng, table),
    )


def _random_subset(rng: np.random.Generator, number: int, share: float) -> np.ndarray:
    """Random indices of a share of the photos: nearly the same number in each batch."""
    return np.sort(rng.permutation(number)[: int(number * share + rng.random())])


def _draw_crops(rng: np.random.Generator, photo: np.ndarray) -> Crops:
    number = len(photo)
    rotation = _rotations(2, rng.normal(0, 5, number)) @ _rotations(0, rng.normal(10, 18, number))
    return Crops.of(
        {
            "photo": photo,
            "panorama": rng.random(number),
            "half": np.tan(np.radians(log_uniforms(rng, 35, 105, number)) / 2),
            "rotation": rotation,
            "azimuth": rng.uniform(0, 2 * np.pi, number),
            "quantile": rng.uniform(0.6, 0.98, number),
            "exposure": rng.uniform(0.4, 1, number),
        }
    )


def _rotations(axis: int, degrees: np.ndarray) -> np.ndarray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    matrix = np.tile(np.eye(3), (len(degrees), 1, 1))
    one, other = (k for k in range(3) if k != axis)
    matrix[:, one, one] = matrix[:, other, other] = c
    matrix[:, one, other], matrix[:, other, one] = -s, s
    return matrix


def _draw_backdrops(rng: np.random.Generator, photo: np.ndarray) -> Backdrops:
    number = len(photo)
    return Backdrops.of(
        {
            "photo": photo,
            "colour": _colours(rng, number),
            "gradient": rng.normal(0, 0.35, (number, 2)),
            "vignette": rng.uniform(0, 0.4, number),
            "grain": rng.uniform(0.01, 0.08, number) * (rng.random(number) < 0.4),
            "width": rng.uniform(1, 8, number),
        }
    )


def _draw_tables(rng: np.random.Generator, photo: np.ndarray) -> Tables:
    number = len(photo)
    near = rng.random(number) < 0.75
    horizon = np.where(near, rng.uniform(-2.5, 0.4, number), rng.uniform(-8, -1, number))
    edge = np.maximum(rng.uniform(-0.1, 0.7, number), horizon + 0.15)
    first, two = _colours(rng, number), rng.random((number, 1)) > 0.35
    return Tables.of(
        {
            "photo": photo,
            "pattern": rng.random(number),
            "horizon": horizon,
            "edge": np.where(rng.random(number) < 0.7, edge, -2.0),
            "tilt": rng.normal(0, 0.05, number),
            "angle": rng.uniform(0, 2 * np.pi, number),
            "scale": log_uniforms(rng, 0.3, 4, number),
            "offset": rng.random((number, 2)),
            "first": first,
            "second": first * np.exp(two * rng.normal(0, 0.5, (number, 3))),
            "gradient": rng.normal((0, 0.1), (0.3, 0.25), (number, 2)),
        }
    )


def _colours(rng: np.random.Generator, number: int) -> np.ndarray:
    """Colours (N, 3) of walls, cloths and tables, linear: mostly of low saturation."""
    spread = np.where(rng.random((number, 1)) < 0.7, 0.12, 0.6)
    tint = spread * rng.normal(0, 1, (number, 3))
    grey = log_uniforms(rng, 0.03, 0.9, (number, 1))
    return np.asarray(grey * np.exp(tint - tint.mean(axis=1, keepdims=True)))


class Backgrounds:
    """Renders backgrounds on the device of the panoramas and patterns.

    Parameters
    ----------
    panoramas : (P, rows, 2 rows, 3) tensor
        Linear.
    patterns : (M, side, side) uint8 tensor
    """

    def __init__(self, panoramas: torch.Tensor, patterns: torch.Tensor) -> None:
        self._number, self._rows = panoramas.shape[:2]
        stacked = panoramas.float().flatten(0, 1).permute(2, 0, 1)[None]  # one above the other
        self._panoramas, self._patterns = _periodic(stacked), patterns

    def __call__(self, drawn: BackgroundDraws, side: int) -> torch.Tensor:
        """Render backgrounds.

        Parameters
        ----------
        drawn : BackgroundDraws
            On the device.
        side : int
            Pixels.

        Returns
        -------
        (B, 3, side, side) tensor
            Linear, in [0, 1].
        """
        across = (torch.arange(side, device=drawn.window.device) + 0.5) * (2 / side) - 1
        line = drawn.window[:, 0, :, None] * across + drawn.window[:, 1, :, None]
        x, y = torch.broadcast_tensors(line[:, 0, None], line[:, 1, :, None])
        light = x.new_empty(len(x), 3, side, side)
        crops, backdrops, tables = drawn.crops, drawn.backdrops, drawn.tables
        if len(at := crops.photo):
            light[at] = self._crop(crops, x[at], y[at])
        if len(at := backdrops.photo):
            light[at] = _render_backdrop(backdrops, x[at], y[at])
        if len(at := tables.photo):
            light[at] = self._with_table(light[at], tables, x[at], y[at])
        return light.clamp(0, 1)

    def _crop(self, drawn: Crops, x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
        rows, half = self._rows, drawn.half[:, None, None]
        rays = torch.stack([x * half, -y * half, -torch.ones_like(x)], dim=-1)
        rays = torch.einsum("bhwi,bij->bhwj", rays, drawn.rotation)
        up = rays[..., 1] / rays.norm(dim=-1)
        turn = torch.atan2(rays[..., 0], -rays[..., 2]) + drawn.azimuth[:, None, None]
        at = (up.clamp(-1, 1).arccos(), turn)
        row, column = (angle * (rows / torch.pi) - 0.5 for angle in at)
        floor = rows * chosen(drawn.panorama, self._number)[:, None, None]
        place = (floor + row.clamp(0, rows - 1), column)
        picture = _sampled(self._panoramas, *(one.flatten(0, 1)[None] for one in place))
        picture = picture[0].unflatten(1, row.shape[:2]).transpose(0, 1)
        bright = picture[..., ::_STRIDE, ::_STRIDE].amax(1).flatten(1).sort(1).values
        place = (drawn.quantile * (bright.shape[1] - 1)).round().long()
        bright = bright.gather(1, place[:, None])[:, 0].clamp(min=1e-6)
        return picture * (drawn.exposure / bright)[:, None, None, None]

    def _with_table(
        self, light: torch.Tensor, drawn: Tables, x: torch.Tensor, y: torch.Tensor
    ) -> torch.Tensor:
        side, size = x.shape[-1], self._patterns.shape[-1]
        value = {name: part[:, None, None] for name, part in vars(drawn).items()}
        y = y + value["tilt"] * x
        away = (y - value["horizon"]).clamp(min=0.05)
        u, v = x * value["scale"] / away, 1.5 * value["scale"] / away
        sine, cosine = value["angle"].sin(), value["angle"].cos()
        row = (sine * u + cosine * v + value["offset"][..., 0]) * size
        column = (cosine * u - sine * v + value["offset"][..., 1]) * size
        maps = self._patterns[chosen(drawn.pattern, len(self._patterns))]
        maps = _blurred(maps, drawn.scale * (_PATTERN_PIXEL / side))[:, None]
        grey = _sampled(_periodic(maps), row, column)
        gradient = value["gradient"][..., 0] * x + value["gradient"][..., 1] * y
        first, second = drawn.first[..., None, None], drawn.second[..., None, None]
        table = torch.lerp(first, second, grey) * gradient.exp()[:, None]
        share = ((y - value["edge"]) * (side / 4)).clamp(0, 1)
        return torch.lerp(light, table, share[:, None])


def _render_backdrop(drawn: Backdrops, x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
    value = {name: part[:, None, None] for name, part in vars(drawn).items()}
    side = x.shape[-1]
    noise = torch.randn(len(x), 1, side, side, device=x.device)
    place = torch.arange(side, device=x.device) / value["width"]
    row, column = torch.broadcast_tensors(place.mT, place)
    log_light = value["grain"] * _sampled(_periodic(noise), row, column)[:, 0]
    log_light = log_light + value["gradient"][..., 0] * x + value["gradient"][..., 1] * y
    log_light = log_light - value["vignette"] * (x.square() + y.square())
    return drawn.colour[..., None, None] * log_light.exp()[:, None]


def _blurred(patterns: torch.Tensor, deviation: torch.Tensor) -> torch.Tensor:
    """Blur periodic patterns (B, side, side) of 8 bits; the deviation is in units of their side."""
    side = patterns.shape[-1]
    waves = [torch.fft.fftfreq(side, 1 / side), torch.fft.rfftfreq(side, 1 / side)]
    rows, columns = (one.to(patterns.device).square() for one in waves)
    power = deviation.square()[:, None, None] * (rows[:, None] + columns)
    found = torch.fft.rfft2(patterns.float() / 255) * torch.exp(-2 * torch.pi**2 * power)
    return torch.fft.irfft2(found, s=(side, side))


def _periodic(maps: torch.Tensor) -> torch.Tensor:
    """Periodic maps (B, C, rows, columns) with their first row and column repeated at the end."""
    return functional.pad(maps, (0, 1, 0, 1), mode="circular")


def _sampled(maps: torch.Tensor, row: torch.Tensor, column: torch.Tensor) -> torch.Tensor:
    """Sample maps of `_periodic` at rows and columns (B, H, W): (B, C, H, W)."""
    rows, columns = (size - 1 for size in maps.shape[2:])
    grid = torch.stack([column % columns / columns, row % rows / rows], dim=-1) * 2 - 1
    return functional.grid_sample(maps, grid, padding_mode="border", align_corners=True)
