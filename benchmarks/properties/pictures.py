"""Pictures and masks of every kind, drawn from a few numbers, so that a failing case can be told
and made again.
"""

from dataclasses import dataclass, replace

import numpy as np
from hypothesis import strategies as st

from isc_core.photo import FLOAT_STEP, Photo, PhotoSource

KINDS = (
    "glossy",
    "gradient",
    "noise",
    "constant",
    "black",
    "saturated",
    "denormal",
    "wide",
    "huge",
    "dead channel",
    "grey",
    "codes",
    "spark",
    "stripes",
)
ORDINARY = ("glossy",)
MASKS = (
    "disc",
    "full",
    "pixel",
    "row",
    "diagonal",
    "parts",
    "holes",
    "cut",
    "checkerboard",
    "specks",
    "ring",
)


@dataclass(frozen=True)
class Picture:
    """A picture of `rows` x `columns` pixels. `kind`, `mask`: of `KINDS`, `MASKS`; `seed` of what
    is random in both; `gain`: factor of its light; `clips`: what is above .8 of its light counts as
    clipped.
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
        return (np.float32(self.gain) * _light(self)).astype(np.float32)

    def inside(self) -> np.ndarray:
        """(H, W) bool; at least one pixel."""
        return _inside(self)

    def clipped(self) -> np.ndarray:
        """(H, W) bool."""
        brightest = self.light().max(axis=2)
        return brightest >= 0.8 * brightest.max() if self.clips else np.zeros(brightest.shape, bool)

    def photo(self) -> Photo:
        """As if read from a file of floats."""
        light, inside = self.light(), self.inside()
        bright = light.max(axis=2)[inside]
        step = FLOAT_STEP * float(np.percentile(bright, 99.9) or bright.max())
        return Photo(
            light,
            inside,
            step,
            self.clipped(),
            PhotoSource("", (self.columns, self.rows), 32, "linear", "file"),
        )


def pictures(
    least: int = 1, most: int = 40, kinds: tuple[str, ...] = KINDS, masks: tuple[str, ...] = MASKS
) -> st.SearchStrategy[Picture]:
    """Pictures with sides from `least` to `most` pixels."""
    side = st.integers(least, most)
    gains = st.sampled_from((1.0, 1.0, 1.0, 1e-3, 1e4))
    return st.builds(
        Picture,
        st.sampled_from(kinds),
        st.sampled_from(masks),
        side,
        side,
        st.integers(0, 9999),
        gains,
        st.booleans(),
    )


def ordinary(least: int = 24, most: int = 40) -> st.SearchStrategy[Picture]:
    """Photos of glossy objects with some noise, none of it clipped, exposed as photos are."""
    drawn = pictures(least, most, ORDINARY, ("disc", "cut", "holes"))
    return drawn.map(lambda picture: replace(picture, gain=1.0, clips=False))


def _light(p: Picture) -> np.ndarray:
    rng = np.random.default_rng(p.seed)
    shape = (p.rows, p.columns, 3)
    y, x = np.mgrid[-1 : 1 : p.rows * 1j, -1 : 1 : p.columns * 1j]
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
        "stripes": lambda: (
            np.where((np.arange(p.columns) % 2 > 0)[None, :, None], rng.random(3), rng.random(3))
            * np.ones(shape)
        ),
    }
    if p.kind in plain:
        return plain[p.kind]()
    light = _glossy(rng, x, y)
    if p.kind == "dead channel":
        light[..., p.seed % 3] = 0
    elif p.kind == "spark":
        light = 1e-3 * light
        light[p.seed % p.rows, p.seed % p.columns] = 1e3
    return light


def _glossy(rng: np.random.Generator, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A shaded disc of two or three paints with two highlights and a little noise."""
    shading = 0.2 + 0.7 * np.sqrt(np.clip(1.05 - x**2 - y**2, 0, 1)) * (
        1 + 0.3 * x * rng.uniform(-1, 1)
    )
    paints = rng.uniform(0.05, 0.7, (3, 3))
    which = (x > 0.4 * np.sin(5 * y + rng.uniform(0, 6))).astype(int) + (y > rng.uniform(0.2, 0.9))
    specular = np.zeros_like(x)
    for _ in range(2):
        a, b = rng.uniform(-0.6, 0.6, 2)
        specular += rng.uniform(0.1, 0.6) * np.exp(
            -((x - a) ** 2 + (y - b) ** 2) / rng.uniform(0.01, 0.08)
        )
    noise = 0.004 * rng.random((*x.shape, 3))
    return np.asarray(paints[which] * shading[..., None] + specular[..., None] + noise)


def _inside(p: Picture) -> np.ndarray:
    rng = np.random.default_rng(p.seed + 1)
    y, x = np.mgrid[-1 : 1 : p.rows * 1j, -1 : 1 : p.columns * 1j]
    row, column = np.mgrid[: p.rows, : p.columns]
    disc = x**2 + y**2 < 0.9
    masks = {
        "disc": disc,
        "full": np.ones((p.rows, p.columns), bool),
        "pixel": (row == p.seed % p.rows) & (column == p.seed // 7 % p.columns),
        "row": row == p.seed % p.rows,
        "diagonal": np.abs(row - column) < 2,
        "parts": rng.random((3, 3))[3 * row // p.rows, 3 * column // p.columns] > 0.5,
        "holes": disc
        & ~((np.abs(x - 0.2) < 0.15) & (np.abs(y) < 0.15))
        & (rng.random(x.shape) > 0.03),
        "cut": (x - 0.5) ** 2 + (y - 0.4) ** 2 < 0.9,
        "checkerboard": (row + column) % 2 == 0,
        "specks": rng.random(x.shape) > 0.6,
        "ring": (row == 0) | (column == 0) | (row == p.rows - 1) | (column == p.columns - 1),
    }
    mask = masks[p.mask]
    if not mask.any():
        mask = mask.copy()
        mask[p.rows // 2, p.columns // 2] = True
    return mask
