"""Household objects with straight edges: packages, books, tins, telephones, remote controls, toy
cars, houses, bricks, tea boxes, cameras.

Equation: rounded boxes and cylinders, put together by a few plans with random sizes; sides bulge,
lids gape, dents and folds are added by noise.
"""

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from ..geometry.forms import curve, displaced, placed, revolved, rounded_box, tube
from ..geometry.noise import facets, noise
from ..geometry.surface import Surface, together


def make(rng: np.random.Generator) -> Surface:
    """Make a household object.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    Surface
        y up, its front toward z.
    """
    plans: tuple[Callable[[np.random.Generator], list[Surface]], ...] = (
        _package,
        _book,
        _tin,
        _telephone,
        _keypad,
        _car,
        _house,
        _bricks,
        _camera,
    )
    return together(plans[int(rng.integers(len(plans)))](rng))


def _box(
    half: tuple[float, float, float], radius: float, at: tuple[float, float, float], cells: int = 12
) -> Surface:
    return placed(rounded_box(np.array(half), min(radius, *half), cells), at)


def _button(radius: float, high: float, at: tuple[float, float, float]) -> Surface:
    """A disc that faces z."""
    profile = np.array([[0, 0], [1, 0], [1, 0.7], [0.92, 1.0], [0.5, 1.05], [0, 1.05]])
    turn = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    return placed(revolved(profile * (radius, high), 40), at, turn=turn)


def _package(rng: np.random.Generator) -> list[Surface]:
    """A carton or parcel: bulged, dented, with flaps or tape."""
    half = rng.uniform(0.3, 1.0, 3)
    body = rounded_box(half, rng.uniform(0.01, 0.08), 64)
    bulge = rng.uniform(-0.06, 0.12) * np.cos(
        np.pi / 2 * np.clip(body.vertices / half, -1, 1)
    ).prod(1)
    dents = rng.uniform(0, 0.03) * facets(body.vertices, rng.uniform(0.3, 0.8), rng)
    edge = np.abs(body.vertices / half).min(1) < 0.9
    body = displaced(body, np.where(edge, bulge + dents, dents))
    parts = [body]
    if rng.random() < 0.5:
        wide = rng.uniform(0.05, 0.2)
        parts.append(_box((wide, half[1] + 0.015, half[2] + 0.015), 0.01, (0, 0, 0)))
    if rng.random() < 0.3:
        parts.append(_box((half[0] + 0.04, 0.12, half[2] + 0.04), 0.02, (0, float(half[1]), 0)))
    return parts


def _book(rng: np.random.Generator) -> list[Surface]:
    """Closed books, one or a pile."""
    parts, y = [], 0.0
    for _ in range(int(rng.integers(1, 5))):
        high, wide, deep = rng.uniform(0.05, 0.16), rng.uniform(0.6, 0.8), rng.uniform(0.8, 1.0)
        pages = rounded_box(np.array([wide - 0.03, high - 0.02, deep - 0.04]), 0.01, 20)
        lines = 0.004 * np.sin(pages.vertices[:, 1] * 150)
        leaves = displaced(pages, lines * (np.abs(pages.vertices[:, 1]) < high - 0.03))
        spine = tube(np.linspace((-wide, 0, -deep), (-wide, 0, deep), 8), np.full(8, high), 24, 0.5)
        covers = [_box((wide, 0.014, deep), 0.01, (0, side * high, 0)) for side in (-1, 1)]
        turn = Rotation.from_euler("y", rng.normal(0, 12), degrees=True).as_matrix()
        parts += [placed(one, (0, y + high, 0), turn=turn) for one in (leaves, spine, *covers)]
        y += 2 * high + 0.02
    return parts


def _tin(rng: np.random.Generator) -> list[Surface]:
    """A can with beads, a drum, a jar with a lid; dented at times."""
    high, beads = rng.uniform(0.4, 2.2), int(rng.integers(0, 14))
    y = np.linspace(0, high, 120)
    wall = 0.6 + 0.012 * np.sin(2 * np.pi * beads * y / high) * (np.abs(y / high - 0.5) < 0.35)
    wall += 0.025 * (np.exp(-((y / 0.02) ** 2)) + np.exp(-(((y - high) / 0.02) ** 2)))
    inside = [[0.57, high], [0.55, high - 0.04], [0.3, high - 0.045], [0, high - 0.045]]
    profile = np.concatenate([[[0, 0.02], [0.5, 0.02]], np.stack([wall, y], -1), inside])
    body = revolved(profile, 128)
    if rng.random() < 0.5:
        body = displaced(
            body, rng.uniform(0.01, 0.05) * np.minimum(noise(body.vertices, 1.6, rng), 0)
        )
    parts = [body]
    if rng.random() < 0.4:
        ring = np.array(
            [[0.1, 0, 0], [0.3, 0, 0.13], [0.42, 0, 0], [0.3, 0, -0.13], [0.1, 0, 0.01]]
        )
        parts.append(placed(tube(curve(ring, 50), np.full(50, 0.02), 10), (-0.05, high - 0.01, 0)))
    return parts


def _telephone(rng: np.random.Generator) -> list[Surface]:
    """A desk telephone: wedge, dial or keys, handset on its cradle."""
    body = rounded_box(np.array([0.8, 0.35, 0.7]), 0.15, 40)
    x, y, z = body.vertices.T
    slope = rng.uniform(0.3, 0.6)
    body = Surface(
        np.stack(
            [x * (1 - 0.25 * (y + 0.35)), np.where(y > 0, y - slope * (z + 0.0) * 0.5, y), z], -1
        ),
        body.faces,
    )
    t = np.linspace(-1, 1, 60)
    arch = np.stack([0.85 * t, 0.62 + 0.12 * (1 - t**2), 0 * t - 0.35], -1)
    handset = [tube(arch, 0.09 + 0.04 * t**4, 20)]
    handset += [_box((0.17, 0.13, 0.18), 0.1, (x, 0.5, -0.35), 20) for x in (-0.8, 0.8)]
    parts = [body, *handset]
    tilt = Rotation.from_euler("x", -np.pi / 2 + np.arctan(slope / 2)).as_matrix()
    for k in range(12):
        if rng.random() < 0.98:
            a, at = 2 * np.pi * k / 12, (k % 3 - 1.0, k // 3 - 1.5)
            place = (
                (0.28 * np.cos(a), 0.28 * np.sin(a))
                if slope > 0.45
                else (0.2 * at[0], 0.15 * at[1])
            )
            button = _button(0.06, 0.06, (place[0], place[1], 0))
            parts.append(placed(button, (0, 0.35 - 0.05 * slope, 0.12), turn=tilt))
    u = np.linspace(0, 1, 500)
    coil = np.stack(
        [
            -0.8 - 0.4 * np.sin(np.pi * u) + 0.06 * np.cos(150 * u),
            0.45 - 0.7 * u + 0.06 * np.sin(150 * u),
            -0.3 + 0.3 * u,
        ],
        -1,
    )
    return [*parts, tube(coil, np.full(500, 0.02), 8)]


def _keypad(rng: np.random.Generator) -> list[Surface]:
    """A mobile phone, remote control, calculator or keyboard, standing."""
    wide, high, deep = rng.uniform(0.3, 0.6), rng.uniform(0.7, 1.1), rng.uniform(0.06, 0.2)
    parts = [_box((wide, high, deep), rng.uniform(0.04, 0.15), (0, 0, 0), 40)]
    columns, rows = int(rng.integers(3, 6)), int(rng.integers(3, 8))
    screen = rng.random() < 0.7
    top = 0.1 * high if screen else 0.85 * high
    if screen:
        parts.append(_box((0.8 * wide, 0.32 * high, 0.02), 0.02, (0, 0.5 * high, deep)))
    dx, dy = 1.7 * wide / columns, (top + 0.9 * high) / rows
    round_ = rng.random() < 0.4
    for i in range(columns):
        for j in range(rows):
            at = (dx * (i - (columns - 1) / 2), top - dy * (j + 0.6), deep)
            if round_:
                parts.append(_button(0.36 * min(dx, dy), 0.05, at))
            else:
                parts.append(_box((0.38 * dx, 0.34 * dy, 0.05), 0.03, at, 8))
    turn = Rotation.from_euler("xy", [rng.uniform(-60, 0), rng.normal(0, 20)], degrees=True)
    return [placed(part, turn=turn.as_matrix()) for part in parts]


def _car(rng: np.random.Generator) -> list[Surface]:
    """A toy car, lorry or train: boxes on wheels."""
    long, high, round_ = rng.uniform(0.8, 1.1), rng.uniform(0.15, 0.3), rng.uniform(0.03, 0.14)
    parts = [_box((long, high, 0.42), round_, (0, 0, 0), 28)]
    cabin, top = rng.uniform(0.3, 0.6), rng.uniform(0.15, 0.35)
    at = rng.uniform(-0.4, 0.3)
    roof = rounded_box(np.array([cabin, top, 0.38]), min(round_, 0.1), 24)
    x, y, z = roof.vertices.T
    lean = 1 - rng.uniform(0, 0.3) * (y + top) / (2 * top)
    parts.append(
        placed(
            Surface(np.stack([x * lean, y, z * lean**0.5], -1), roof.faces),
            (at, high + 0.8 * top, 0),
        )
    )
    radius = rng.uniform(0.17, 0.28)
    for x_wheel in (-0.6 * long, 0.6 * long):
        for side in (-1, 1):
            parts.append(_button(radius, 0.12, (x_wheel, -high, 0.36 if side > 0 else -0.48)))
            parts.append(
                _button(0.45 * radius, 0.03, (x_wheel, -high, 0.47 if side > 0 else -0.51))
            )
    parts += [_box((0.03, 0.06, 0.06), 0.03, (long, 0.0, z)) for z in (-0.28, 0.28)]
    parts.append(_box((0.04, 0.05, 0.44), 0.02, (long, -0.7 * high, 0)))
    return parts


def _house(rng: np.random.Generator) -> list[Surface]:
    """A house or a bird house: walls, pitched roof, door, windows, chimney."""
    wide, deep, high = rng.uniform(0.5, 0.9), rng.uniform(0.5, 0.9), rng.uniform(0.35, 0.8)
    parts = [_box((wide, high, deep), 0.02, (0, 0, 0))]
    pitch, long = rng.uniform(0.5, 0.95), wide / np.cos(0.7) * 0.95
    for side in (-1, 1):
        slab = _box((long * 0.75, 0.035, deep * 1.15), 0.02, (0, 0, 0))
        turn = Rotation.from_euler("z", -side * pitch).as_matrix()
        shift = (
            side * 0.7 * long * np.cos(pitch),
            high + (wide - 0.7 * long * np.cos(pitch)) * np.tan(pitch),
            0,
        )
        parts.append(placed(slab, shift, turn=turn))
    rows = 8
    for k in range(rows):  # the gable, as boards
        y = (k + 0.5) / rows * wide * np.tan(pitch)
        parts.append(
            _box(
                (
                    max(wide - y / np.tan(pitch), 0.03),
                    wide * np.tan(pitch) / rows / 2 + 0.005,
                    0.97 * deep,
                ),
                0.005,
                (0, high + y, 0),
                6,
            )
        )
    parts.append(_box((0.13, 0.25, 0.03), 0.01, (0, 0.26 - high, deep)))
    for x in (-0.55, 0.55):
        parts.append(_box((0.12, 0.13, 0.025), 0.01, (x * wide, 0.15 * high, deep)))
        parts.append(_box((0.16, 0.025, 0.05), 0.01, (x * wide, 0.15 * high - 0.15, deep)))
    return [*parts, _box((0.09, 0.3, 0.09), 0.01, (0.5 * wide, high + 0.6 * wide, -0.3 * deep))]


def _bricks(rng: np.random.Generator) -> list[Surface]:
    """Building bricks with studs, stacked at random."""
    parts = []
    y = 0.0
    for _ in range(int(rng.integers(1, 6))):
        long = int(rng.integers(1, 5))
        x, z = 0.25 * rng.integers(-2, 3), 0.25 * rng.integers(-1, 2)
        parts.append(_box((0.25 * long, 0.15, 0.25), 0.01, (x, y + 0.15, z)))
        stud = revolved(
            np.array([[0, 0], [0.075, 0], [0.075, 0.05], [0.065, 0.055], [0, 0.055]]), 28
        )
        for i in range(2 * long):
            for j in (-1, 1):
                at = (x + 0.25 * (i - long + 0.5), y + 0.3, z + 0.125 * j)
                parts.append(placed(stud, at))
        y += 0.3
    return parts


def _camera(rng: np.random.Generator) -> list[Surface]:
    """A camera, radio or alarm clock: a box with discs, knobs and a handle."""
    wide, high, deep = rng.uniform(0.7, 1.0), rng.uniform(0.4, 0.65), rng.uniform(0.18, 0.4)
    parts = [_box((wide, high, deep), rng.uniform(0.03, 0.15), (0, 0, 0), 32)]
    radius, x = rng.uniform(0.2, 0.38), rng.uniform(-0.4, 0.4)
    lens = [(radius * (1 - 0.18 * k), 0.08 + 0.1 * k) for k in range(int(rng.integers(2, 5)))]
    parts += [_button(*size, (x, 0, deep)) for size in lens]
    for _ in range(int(rng.integers(1, 5))):
        at = (rng.uniform(-0.8, 0.8) * wide, high, rng.uniform(-0.5, 0.5) * deep)
        knob = revolved(
            np.array([[0, 0], [1, 0], [1, 0.9], [0.9, 1], [0, 1]]) * rng.uniform(0.05, 0.13), 32
        )
        parts.append(placed(knob, at))
    if rng.random() < 0.5:
        parts.append(_box((0.14, 0.08, 0.02), 0.01, (-0.6 * wide, 0.6 * high, deep)))
    if rng.random() < 0.5:
        t = np.linspace(0, np.pi, 40)
        path = np.stack([0.8 * wide * np.cos(t), high + 0.35 * np.sin(t) ** 0.5, 0 * t], -1)
        parts.append(tube(path, np.full(40, 0.05), 14, 1.5))
    return parts
