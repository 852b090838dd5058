"""Toy animals: dogs, dinosaurs, frogs, turtles, birds, fish, raccoons and their kin.

Equation: limbs (round cones) and ellipsoids along a skeleton, of random proportions, are blended
(`geometry/implicit.py`); fine relief is added along the normals: fur, scales, wrinkles.

Limits: left and right are mirror images, but for the pose of the head and tail.
"""

from collections.abc import Callable

import numpy as np

from ..geometry.forms import displaced
from ..geometry.implicit import Ellipsoid, Limb, Primitive, blended
from ..geometry.noise import cells, fractal
from ..geometry.surface import Surface

Point = tuple[float, float, float]


def make(rng: np.random.Generator) -> Surface:
    """Make an animal.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    Surface
        y up, the head toward x.
    """
    kinds: tuple[Callable[[np.random.Generator], list[Primitive]], ...] = (
        _quadruped,
        _quadruped,
        _dinosaur,
        _dinosaur,
        _frog,
        _turtle,
        _bird,
        _fish,
        _sitting,
        _sitting,
    )
    parts = kinds[int(rng.integers(len(kinds)))](rng)
    body = blended(parts, 10 ** rng.uniform(-1.9, -1.3))
    return textured(body, rng)


def textured(body: Surface, rng: np.random.Generator) -> Surface:
    """Add fine relief to a blended body: none, fur, scales or dents.

    Parameters
    ----------
    body : Surface
        About two units long.
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    Surface
        The same faces.
    """
    points = body.vertices
    style = int(rng.integers(5))
    if style == 0:
        hair = fractal(points * (1, 0.35, 1), rng.uniform(7, 14), 2, 0.6, rng)
        return displaced(body, rng.uniform(0.002, 0.008) * hair)
    if style == 1:
        nearest, _ = cells(points, rng.uniform(0.06, 0.12), rng)
        return displaced(body, rng.uniform(0.01, 0.02) * (0.5 - nearest))
    if style == 2:
        return displaced(body, rng.uniform(0.002, 0.012) * fractal(points, 3, 3, 0.5, rng))
    return body


def _point(x: float, y: float, z: float) -> Point:
    return float(x), float(y), float(z)


def _both(x: float, y: float, z: float, axes: Point) -> list[Primitive]:
    """An ellipsoid and its mirror image."""
    return [Ellipsoid(_point(x, y, side * z), axes) for side in (-1, 1)]


def _chain(points: list[Point], radii: list[float]) -> list[Primitive]:
    return [Limb(points[k], points[k + 1], radii[k], radii[k + 1]) for k in range(len(points) - 1)]


def _pair(points: list[Point], radii: list[float]) -> list[Primitive]:
    """A chain of limbs and its mirror image."""
    mirrored = [(x, y, -z) for x, y, z in points]
    return _chain(points, radii) + _chain(mirrored, radii)


def _head(at: Point, size: float, rng: np.random.Generator) -> list[Primitive]:
    """A head that looks along x, with muzzle, eyes and ears or horns."""
    x, y, z = at
    muzzle = rng.uniform(0.5, 1.5) * size
    drop = rng.uniform(0.0, 0.5) * size
    parts: list[Primitive] = [Ellipsoid(at, (1.05 * size, size, 0.9 * size))]
    tip = _point(x + 0.5 * size + muzzle, y - drop, z)
    blunt = rng.uniform(0.3, 0.5) * size
    parts.append(Limb(_point(x + 0.5 * size, y - 0.6 * drop, z), tip, 0.6 * size, blunt))
    if rng.random() < 0.6:
        parts.append(
            Ellipsoid(_point(tip[0] + 0.8 * blunt, tip[1] + 0.4 * blunt, z), (blunt / 3,) * 3)
        )
    eye = 0.17 * size
    for side in (-1, 1):
        parts.append(
            Ellipsoid(_point(x + 0.72 * size, y + 0.42 * size, z + side * 0.55 * size), (eye,) * 3)
        )
        root = _point(x - 0.1 * size, y + 0.75 * size, z + side * 0.5 * size)
        length = rng.uniform(0.5, 1.0) * size
        ear = _point(root[0] - 0.2 * size, root[1] + length, root[2] + side * 0.35 * size)
        if rng.random() < 0.8:
            parts.append(Limb(root, ear, 0.3 * size, 0.1 * size))
    return parts


def _quadruped(rng: np.random.Generator) -> list[Primitive]:
    long, thick, leg = rng.uniform(0.5, 0.9), rng.uniform(0.2, 0.38), rng.uniform(0.25, 0.75)
    parts: list[Primitive] = [
        Limb(
            (-long, 0, 0),
            _point(long, rng.uniform(0, 0.15), 0),
            thick,
            thick * rng.uniform(0.8, 1.2),
        ),
        Ellipsoid((0, -0.1 * thick, 0), (0.8 * long, 1.15 * thick, 1.05 * thick)),
    ]
    for x in (-long, 0.95 * long):
        stride, bend = rng.normal(0, 0.12), rng.normal(0, 0.1)
        foot = _point(x + stride + 0.08, -thick - leg + 0.06, 0.75 * thick)
        knee = _point(x + bend, -thick - 0.45 * leg, 0.8 * thick)
        parts += _pair(
            [
                _point(x, -0.3 * thick, 0.6 * thick),
                knee,
                foot,
                _point(foot[0] + 0.1, foot[1], foot[2]),
            ],
            [0.55 * thick, 0.35 * thick, 0.28 * thick, 0.26 * thick],
        )
    neck = _point(long + rng.uniform(0.15, 0.45), rng.uniform(0.15, 0.7), 0)
    parts.append(Limb((long, 0.1, 0), neck, 0.75 * thick, 0.5 * thick))
    parts += _head(neck, rng.uniform(0.2, 0.34), rng)
    return parts + _tail((-long, 0.05, 0), rng.uniform(0.3, 0.9), 0.3 * thick, rng)


def _tail(root: Point, length: float, thick: float, rng: np.random.Generator) -> list[Primitive]:
    """A curved tail toward -x; at times ringed and bushy."""
    rise, side = rng.uniform(-0.6, 1.0), rng.normal(0, 0.3)
    u = np.linspace(0, 1, 7)
    x = root[0] - thick - length * u * (1 - 0.3 * u * abs(rise))
    points = [
        _point(a, root[1] + rise * length * t**2, side * length * t**2)
        for a, t in zip(x, u, strict=True)
    ]
    bushy = rng.uniform(1.2, 2.2) if rng.random() < 0.35 else 0.0
    radii = [float(thick * (1 - 0.7 * t + bushy * np.sin(np.pi * t) ** 2)) for t in u]
    return _chain(points, radii)


def _dinosaur(rng: np.random.Generator) -> list[Primitive]:
    thick, upright = rng.uniform(0.34, 0.5), rng.random() < 0.6
    rise = 0.5 if upright else rng.uniform(0, 0.2)
    parts: list[Primitive] = [Limb((-0.3, 0, 0), (0.35, rise, 0), thick, 0.75 * thick)]
    long = rng.uniform(0.4, 1.0)
    neck = [
        (0.35, rise, 0.0),
        _point(0.5 + 0.2 * long, rise + 0.4 * long, 0),
        _point(0.6 + 0.5 * long, rise + 0.7 * long, 0),
    ]
    parts += _chain(neck, [0.7 * thick, 0.4 * thick, 0.3 * thick])
    parts += _head(neck[-1], rng.uniform(0.22, 0.4), rng)
    leg = rng.uniform(0.45, 0.7)
    parts += _pair(
        [
            (-0.25, -0.05, 0.7 * thick),
            _point(-0.1, -0.5 * leg, 0.9 * thick),
            _point(-0.25, -leg, 0.9 * thick),
            _point(-0.02, -leg - 0.03, 0.95 * thick),
        ],
        [0.6 * thick, 0.35 * thick, 0.22 * thick, 0.22 * thick],
    )
    reach = -leg if not upright else rise - 0.35
    parts += _pair(
        [
            _point(0.33, rise, 0.6 * thick),
            _point(0.42, (rise + reach) / 2, 0.9 * thick),
            _point(0.5, reach, 0.85 * thick),
        ],
        [0.32 * thick, 0.24 * thick, 0.18 * thick],
    )
    tail = rng.uniform(0.8, 1.3)
    u = np.linspace(0, 1, 8)
    back = [_point(-0.3 - tail * t, -0.1 - 0.3 * t + 0.5 * t**2, 0.25 * t**2) for t in u]
    parts += _chain(back, [float(0.85 * thick * (1 - 0.93 * t)) for t in u])
    if rng.random() < 0.6:  # plates along the back
        spine = [
            (-0.3 - tail * t, -0.1 - 0.3 * t + 0.5 * t**2, 0.85 * thick * (1 - t)) for t in u[:6]
        ]
        spine += [(x, rise * (x + 0.3) / 0.65, thick) for x in (0.0, 0.25)]
        size = rng.uniform(0.08, 0.2)
        parts += [
            Ellipsoid(_point(x, y + r + 0.3 * size, 0), (0.6 * size, size, 0.045))
            for x, y, r in spine
        ]
    return parts


def _frog(rng: np.random.Generator) -> list[Primitive]:
    wide = rng.uniform(0.4, 0.55)
    parts: list[Primitive] = [
        Ellipsoid((-0.1, 0, 0), _point(0.65, 0.36, wide)),
        Ellipsoid((0.4, 0.15, 0), _point(0.42, 0.25, 0.9 * wide)),
    ]
    bulge = rng.uniform(0.1, 0.16)
    parts += _both(0.35, 0.38, 0.5 * wide, (bulge, bulge, bulge))
    parts += _both(0.42, 0.42, 0.53 * wide, (0.6 * bulge,) * 3)
    parts += _pair(
        [
            (-0.5, -0.1, 0.7 * wide),
            _point(0.1, 0.05, 1.35 * wide),
            _point(-0.45, -0.3, 1.45 * wide),
            _point(0.0, -0.36, 1.6 * wide),
        ],
        [0.2, 0.16, 0.09, 0.07],
    )
    parts += _pair(
        [(0.35, -0.1, 0.7 * wide), _point(0.4, -0.25, 1.1 * wide), _point(0.6, -0.37, 1.0 * wide)],
        [0.13, 0.09, 0.07],
    )
    mouth = rng.uniform(-0.02, 0.06)
    return [*parts, Limb(_point(0.6, mouth, -0.6 * wide), _point(0.6, mouth, 0.6 * wide), 0.1, 0.1)]


def _turtle(rng: np.random.Generator) -> list[Primitive]:
    high = rng.uniform(0.35, 0.6)
    parts: list[Primitive] = [
        Ellipsoid((0, 0.0, 0), _point(0.75, high, 0.62)),
        Ellipsoid((0, -0.05, 0), (0.85, 0.1, 0.72)),
        Limb((0.7, 0, 0), _point(1.0, rng.uniform(0.05, 0.35), 0), 0.16, 0.13),
    ]
    neck = parts[-1]
    assert isinstance(neck, Limb)
    parts += _head(neck.end, rng.uniform(0.13, 0.2), rng)[:5]
    for x in (-0.55, 0.55):
        foot = _point(x + np.sign(x) * 0.15, -0.4, 0.6)
        parts += _pair(
            [_point(x, -0.1, 0.45), foot, _point(foot[0] + 0.1, -0.42, 0.62)], [0.16, 0.13, 0.12]
        )
    # Shields of the shell.
    for ring, count in ((0.45, 5), (0.8, 9)):
        for a in np.linspace(0, 2 * np.pi, count, endpoint=False):
            x, z = 0.75 * ring * np.cos(a), 0.62 * ring * np.sin(a)
            y = high * np.sqrt(1 - ring**2)
            parts.append(Ellipsoid(_point(x, y, z), (0.16, 0.08, 0.14)))
    return [*parts, Limb((-0.8, -0.05, 0), (-1.05, -0.12, 0), 0.09, 0.03)]


def _bird(rng: np.random.Generator) -> list[Primitive]:
    fat, tall = rng.uniform(0.3, 0.45), rng.uniform(0.0, 0.6)
    parts: list[Primitive] = [
        Limb((-0.2, 0, 0), _point(0.15, tall, 0), fat, 0.7 * fat),
    ]
    size = rng.uniform(0.2, 0.3)
    head = _point(0.3, tall + 0.35 + 0.3 * fat, 0)
    parts += [
        Limb(_point(0.15, tall, 0), head, 0.6 * fat, 0.7 * size),
        Ellipsoid(head, (size, size, 0.9 * size)),
    ]
    beak = rng.uniform(0.15, 0.5)
    parts.append(
        Limb(
            _point(head[0] + 0.8 * size, head[1], 0),
            _point(head[0] + size + beak, head[1] - 0.1, 0),
            0.09,
            0.03,
        )
    )
    parts += _both(head[0] + 0.6 * size, head[1] + 0.3 * size, 0.65 * size, (0.05, 0.05, 0.05))
    spread = rng.uniform(0.85, 1.1)
    parts += _both(-0.2, 0.05 + 0.4 * tall, spread * fat, _point(0.5, 0.24 + 0.3 * tall, 0.09))
    parts.append(Ellipsoid(_point(-0.2 - fat - 0.25, 0.05, 0), (0.4, 0.07, 0.2)))
    parts += _pair([_point(0, -0.8 * fat, 0.15), _point(0.02, -fat - 0.25, 0.16)], [0.06, 0.045])
    return parts + _pair(
        [_point(0.02, -fat - 0.25, 0.16), _point(0.25, -fat - 0.28, 0.2)], [0.05, 0.04]
    )


def _fish(rng: np.random.Generator) -> list[Primitive]:
    high, wide = rng.uniform(0.25, 0.55), rng.uniform(0.13, 0.28)
    parts: list[Primitive] = [
        Ellipsoid((0.15, 0, 0), _point(0.75, high, wide)),
        Limb((-0.3, 0, 0), (-0.75, 0, 0), 0.6 * wide, 0.3 * wide),
        Ellipsoid(_point(0.0, high, 0), _point(0.4, rng.uniform(0.1, 0.3), 0.045)),
        Ellipsoid(_point(-0.2, -high, 0), (0.25, 0.14, 0.045)),
    ]
    for side in (-1, 1):
        root, tip = _point(-0.75, 0, 0), _point(-1.1, side * rng.uniform(0.25, 0.45), 0)
        parts.append(Limb(root, tip, 0.08, 0.05))
        parts.append(Ellipsoid(_point(-0.95, side * 0.16, 0), (0.2, 0.2, 0.04)))
    parts += _both(0.2, -0.3 * high, wide, (0.22, 0.1, 0.05))
    return parts + _both(0.62, 0.15 * high, 0.75 * wide, (0.07, 0.07, 0.05))


def _sitting(rng: np.random.Generator) -> list[Primitive]:
    """A sitting bear, cat or raccoon, upright."""
    fat = rng.uniform(0.35, 0.5)
    size = rng.uniform(0.28, 0.42)
    top = 0.55 + 0.5 * size
    parts: list[Primitive] = [
        Ellipsoid((0, 0, 0), _point(fat, 0.55, fat)),
        *_head(_point(0.05, top, 0), size, rng),
    ]
    parts += _pair(
        [_point(0.05, 0.3, 0.8 * fat), _point(0.35, 0.05, 0.9 * fat), _point(0.5, -0.1, 0.5 * fat)],
        [0.15, 0.12, 0.1],
    )
    parts += _pair(
        [
            _point(0.1, -0.4, 0.7 * fat),
            _point(0.6, -0.45, 0.9 * fat),
            _point(0.68, -0.32, 0.9 * fat),
        ],
        [0.2, 0.15, 0.13],
    )
    return parts + _tail((-fat * 0.8, -0.35, 0), rng.uniform(0.2, 0.7), 0.12, rng)
