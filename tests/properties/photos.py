"""Photos and masks of every kind, each made from a few numbers so that failures can be repeated."""

from dataclasses import dataclass, replace

import numpy as np
from hypothesis import strategies as st

from isc_core.photo import FLOAT_STEP, Photo, PhotoSource

KINDS = (
    *("glossy", "gradient", "noise", "constant", "black", "saturated", "denormal", "wide"),
    *("huge", "dead channel", "grey", "codes", "spark", "stripes"),
)
MASKS = (
    *("disc", "full", "pixel", "row", "diagonal", "parts", "holes", "cut", "checkerboard"),
    *("specks", "ring"),
)


@dataclass(frozen=True)
class MadePhoto:
    """A photo of `rows` x `columns` pixels.

    Attributes
    ----------
    kind, mask : str
        One of `KINDS`, one of `MASKS`.
    seed : int
        Seed of the random parts of both.
    gain : float
        Factor on the radiance.
    clips : bool
        Pixels above 0.8 of the maximum count as clipped.
    """

    kind: str
    mask: str
    rows: int
    columns: int
    seed: int
    gain: float = 1.0
    clips: bool = False

    def light(self) -> np.ndarray:
        """(H, W, 3) float32, linear, finite, >= 0."""
        return (np.float32(self.gain) * _radiance(self)).astype(np.float32)

    def inside(self) -> np.ndarray:
        """(H, W) bool, the mask; at least one pixel is set."""
        mask = _masks(self)[self.mask].copy()
        if not mask.any():
            mask[self.rows // 2, self.columns // 2] = True
        return mask

    def clipped(self) -> np.ndarray:
        """(H, W) bool."""
        brightest = self.light().max(axis=2)
        return brightest >= 0.8 * brightest.max() if self.clips else np.zeros(brightest.shape, bool)

    def photo(self) -> Photo:
        """The photo as if read from a file of floats."""
        light, inside = self.light(), self.inside()
        bright = light.max(axis=2)[inside]
        step = FLOAT_STEP * float(np.percentile(bright, 99.9) or bright.max())
        source = PhotoSource("", (self.columns, self.rows), 32, "linear", "file")
        return Photo(light, inside, step, self.clipped(), source)


def photos(
    least: int = 1, most: int = 40, kinds: tuple[str, ...] = KINDS, masks: tuple[str, ...] = MASKS
) -> st.SearchStrategy[MadePhoto]:
    """Photos with sides from `least` to `most` pixels."""
    side, seed = st.integers(least, most), st.integers(0, 9999)
    kind, mask = st.sampled_from(kinds), st.sampled_from(masks)
    gain = st.sampled_from((1.0, 1.0, 1.0, 1e-3, 1e4))
    return st.builds(MadePhoto, kind, mask, side, side, seed, gain, st.booleans())


def ordinary(least: int = 24, most: int = 40) -> st.SearchStrategy[MadePhoto]:
    """Well-exposed photos of glossy objects with some noise and no clipped pixel."""
    drawn = photos(least, most, ("glossy",), ("disc", "cut", "holes"))
    return drawn.map(lambda made: replace(made, gain=1.0, clips=False))


def _grid(made: MadePhoto) -> tuple[np.ndarray, np.ndarray]:
    y, x = np.mgrid[-1 : 1 : made.rows * 1j, -1 : 1 : made.columns * 1j]
    return x, y


def _radiance(made: MadePhoto) -> np.ndarray:
    rng = np.random.default_rng(made.seed)
    shape = (made.rows, made.columns, 3)
    x, y = _grid(made)
    odd = (np.arange(made.columns) % 2 > 0)[None, :, None]
    plain = {
        "black": lambda: np.zeros(shape),
        "saturated": lambda: np.ones(shape),
        "constant": lambda: np.broadcast_to(rng.random(3), shape),
        "noise": lambda: rng.random(shape),
        "codes": lambda: rng.integers(0, 256, shape) / 255,
        "denormal": lambda: 1e-40 * rng.random(shape),
        "wide": lambda: 10.0 ** rng.uniform(-8, 4, shape),
        "huge": lambda: 1e12 * rng.random(shape),
        "gradient": lambda: np.clip((x + y + 2)[..., None] / 4 * rng.random(3), 0, 1),
        "grey": lambda: np.repeat(_glossy(rng, x, y).mean(axis=2, keepdims=True), 3, axis=2),
        "stripes": lambda: np.where(odd, rng.random(3), rng.random(3)) * np.ones(shape),
    }
    if made.kind in plain:
        return plain[made.kind]()
    light = _glossy(rng, x, y)
    if made.kind == "dead channel":
        light[..., made.seed % 3] = 0
    elif made.kind == "spark":
        light = 1e-3 * light
        light[made.seed % made.rows, made.seed % made.columns] = 1e3
    return light


def _glossy(rng: np.random.Generator, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A shaded disc of two or three albedos with two highlights and a little noise."""
    tilt = 1 + 0.3 * x * rng.uniform(-1, 1)
    shading = 0.2 + 0.7 * np.sqrt(np.clip(1.05 - x**2 - y**2, 0, 1)) * tilt
    albedos = rng.uniform(0.05, 0.7, (3, 3))
    which = (x > 0.4 * np.sin(5 * y + rng.uniform(0, 6))).astype(int) + (y > rng.uniform(0.2, 0.9))
    specular = np.zeros_like(x)
    for _ in range(2):
        a, b = rng.uniform(-0.6, 0.6, 2)
        height, width = rng.uniform(0.1, 0.6), rng.uniform(0.01, 0.08)
        specular += height * np.exp(-((x - a) ** 2 + (y - b) ** 2) / width)
    noise = 0.004 * rng.random((*x.shape, 3))
    return np.asarray(albedos[which] * shading[..., None] + specular[..., None] + noise)


def _masks(made: MadePhoto) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(made.seed + 1)
    x, y = _grid(made)
    rows, columns = made.rows, made.columns
    row, column = np.mgrid[:rows, :columns]
    disc, hole = x**2 + y**2 < 0.9, (np.abs(x - 0.2) < 0.15) & (np.abs(y) < 0.15)
    return {
        "disc": disc,
        "full": np.ones((rows, columns), bool),
        "pixel": (row == made.seed % rows) & (column == made.seed // 7 % columns),
        "row": row == made.seed % rows,
        "diagonal": np.abs(row - column) < 2,
        "parts": rng.random((3, 3))[3 * row // rows, 3 * column // columns] > 0.5,
        "holes": disc & ~hole & (rng.random(x.shape) > 0.03),
        "cut": (x - 0.5) ** 2 + (y - 0.4) ** 2 < 0.9,
        "checkerboard": (row + column) % 2 == 0,
        "specks": rng.random(x.shape) > 0.6,
        "ring": (row == 0) | (column == 0) | (row == rows - 1) | (column == columns - 1),
    }
