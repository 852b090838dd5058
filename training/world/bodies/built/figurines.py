"""Standing and sitting figures, busts and statuettes on a base.

Equation: limbs and ellipsoids along a human skeleton of random proportions and pose, blended; robes
are cones with folds, the base is a body of revolution or a box.
"""

import numpy as np

from ..geometry.forms import displaced, placed, revolved, rounded_box
from ..geometry.implicit import Ellipsoid, Limb, Primitive, blended
from ..geometry.noise import fractal
from ..geometry.surface import Surface, together
from .creatures import textured


def make(rng: np.random.Generator) -> Surface:
    """Make a figure.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    Surface
        y up, looking toward z.
    """
    if rng.random() < 0.3:
        figure, low = _bust(rng), -0.75
    else:
        figure, low = _figure(rng), -1.25
    figure = textured(figure, rng)
    return together([figure, _base(low, rng)]) if rng.random() < 0.6 else figure


def _point(x: float, y: float, z: float) -> tuple[float, float, float]:
    return float(x), float(y), float(z)


def _face(
    y: float, size: float, rng: np.random.Generator
) -> tuple[list[Primitive], list[Primitive]]:
    """A head that looks along z, and the holes of eyes and mouth."""
    parts: list[Primitive] = [
        Ellipsoid(_point(0, y, 0), _point(0.8 * size, size, 0.85 * size)),
        Ellipsoid(
            _point(0, y - 0.55 * size, 0.3 * size), _point(0.5 * size, 0.5 * size, 0.45 * size)
        ),
    ]
    nose = rng.uniform(0.12, 0.25) * size
    parts.append(
        Limb(
            _point(0, y + 0.2 * size, 0.8 * size),
            _point(0, y - 0.12 * size, 0.85 * size + nose),
            0.07 * size,
            0.13 * size,
        )
    )
    for side in (-1, 1):
        x = side * 0.32 * size
        parts.append(
            Limb(
                _point(x - 0.15 * size, y + 0.3 * size, 0.74 * size),
                _point(x + 0.15 * size, y + 0.3 * size, 0.74 * size),
                0.08 * size,
                0.08 * size,
            )
        )
        parts.append(Ellipsoid(_point(x, y + 0.1 * size, 0.68 * size), (0.12 * size,) * 3))
        parts.append(
            Ellipsoid(_point(side * 0.8 * size, y, 0), _point(0.1 * size, 0.25 * size, 0.15 * size))
        )
    lip = _point(0.22 * size, 0.06 * size, 0.1 * size)
    parts += [Ellipsoid(_point(0, y + k * size, 0.74 * size), lip) for k in (-0.42, -0.52)]
    if rng.random() < 0.7:  # hair, a cap or a hat
        parts.append(
            Ellipsoid(
                _point(0, y + 0.35 * size, -0.18 * size),
                _point(0.92 * size, 0.85 * size, 0.9 * size),
            )
        )
    if rng.random() < 0.25:
        parts.append(
            Ellipsoid(_point(0, y + 0.6 * size, 0), _point(1.4 * size, 0.1 * size, 1.4 * size))
        )
        parts.append(
            Limb(
                _point(0, y + 0.7 * size, 0), _point(0, y + 1.2 * size, 0), 0.7 * size, 0.55 * size
            )
        )
    holes: list[Primitive] = [
        Ellipsoid(
            _point(0, y - 0.47 * size, 0.9 * size), _point(0.2 * size, 0.03 * size, 0.15 * size)
        )
    ]
    return parts, holes


def _bust(rng: np.random.Generator) -> Surface:
    size = rng.uniform(0.42, 0.55)
    parts, holes = _face(0.45, size, rng)
    wide = rng.uniform(0.45, 0.7)
    parts += [
        Limb((0, 0.3, -0.05), (0, -0.3, -0.08), 0.42 * size, 0.5 * size),
        Limb(_point(-wide, -0.4, -0.05), _point(wide, -0.4, -0.05), 0.25, 0.25),
        Ellipsoid((0, -0.55, 0), _point(0.8 * wide, 0.3, 0.35)),
    ]
    body = blended(parts, 0.02, holes, 84)
    hair = body.vertices[:, 1] > 0.45 + 0.3 * size
    strands = fractal(body.vertices * (1, 0.4, 1), rng.uniform(6, 10), 2, 0.6, rng)
    return displaced(body, np.where(hair, 0.02 * strands, 0))


def _figure(rng: np.random.Generator) -> Surface:
    size, wide = rng.uniform(0.15, 0.32), rng.uniform(0.2, 0.32)
    hips = _point(rng.normal(0, 0.06), -0.25, 0)
    parts, holes = _face(0.5 + size, size, rng)
    chest = _point(0, 0.25, 0)
    parts += [
        Limb(chest, hips, 0.8 * wide, 0.75 * wide),
        Ellipsoid(_point(0, 0.3, 0.03), _point(wide, 0.22, 0.65 * wide)),
        Limb(_point(0, 0.4, 0), _point(0, 0.6, 0), 0.45 * size, 0.45 * size),
    ]
    for side in (-1, 1):
        shoulder = _point(side * 1.05 * wide, 0.42, 0)
        out, ahead = rng.uniform(0.0, 0.3), rng.uniform(-0.15, 0.3)
        elbow = _point(
            shoulder[0] + side * out, shoulder[1] - 0.35 + out * rng.uniform(0, 2), ahead
        )
        hand = _point(
            elbow[0] + side * rng.uniform(-0.25, 0.15),
            elbow[1] + rng.uniform(-0.35, 0.35),
            elbow[2] + rng.uniform(0, 0.3),
        )
        parts += [
            Limb(shoulder, elbow, 0.11, 0.085),
            Limb(elbow, hand, 0.085, 0.06),
            Ellipsoid(hand, (0.08, 0.09, 0.07)),
        ]
    if rng.random() < 0.35:
        parts.append(Limb(hips, _point(0, -1.1, 0), 0.9 * wide, rng.uniform(1.2, 2.0) * wide))
        body = blended(parts, 0.03, holes, 84)
        return _robed(body, rng)
    for side in (-1, 1):
        hip = _point(hips[0] + side * 0.6 * wide, -0.3, 0)
        knee = _point(hip[0] + side * rng.uniform(0, 0.12), -0.75, rng.uniform(-0.05, 0.2))
        foot = _point(knee[0], -1.15, knee[2] - rng.uniform(0, 0.15))
        parts += [Limb(hip, knee, 0.15, 0.11), Limb(knee, foot, 0.11, 0.08)]
        parts.append(Limb(foot, _point(foot[0] + side * 0.04, -1.17, foot[2] + 0.2), 0.08, 0.07))
    return blended(parts, 10 ** rng.uniform(-2, -1.4), holes, 84)


def _robed(body: Surface, rng: np.random.Generator) -> Surface:
    """Folds that deepen toward the hem."""
    x, y, z = body.vertices.T
    angle = np.arctan2(x, z)
    count, phase = int(rng.integers(7, 16)), 1.5 * fractal(body.vertices, 1.2, 1, 1, rng)
    depth = rng.uniform(0.02, 0.06) * np.clip(-(y + 0.2), 0, 1)
    return displaced(body, depth * np.sin(count * angle + phase))


def _base(low: float, rng: np.random.Generator) -> Surface:
    high, wide = rng.uniform(0.06, 0.3), rng.uniform(0.45, 0.7)
    if rng.random() < 0.4:
        return placed(
            rounded_box(np.array([wide, high / 2, wide]), 0.2 * high, 16),
            (0, low - high / 2 + 0.05, 0),
        )
    steps = np.array(
        [[0, 0], [1, 0], [1, 0.3], [0.85, 0.4], [0.85, 0.7], [0.95, 0.8], [0.9, 1], [0, 1]]
    )
    return placed(revolved(steps * (wide, high), 96), (0, low - high + 0.05, 0))
