"""Raised text: single words and letters, and words on plates, discs and cups, with Blender.

Limits: Blender's own font only, sheared, stretched, made bold by an offset, and rounded.
"""

import numpy as np

from ..geometry.blender import emptied, linked, surface_of
from ..geometry.forms import placed, revolved, rounded_box
from ..geometry.surface import Surface, together

_LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghkmnoprstuvwxyz0123456789&?!@#"
_WORDS = "TEA SALT ISC Milk Open Coffee SUGAR 2024 No.5 Oil Home flour HELLO Love 100% Rice KEYS"


def make(rng: np.random.Generator) -> Surface:
    """Make letters, alone or on something.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    Surface
        Facing z.
    """
    lines = [str(rng.choice(_WORDS.split())) for _ in range(int(rng.integers(1, 4)))]
    if rng.random() < 0.3:
        count = int(rng.integers(1, 4))
        lines = ["".join(rng.choice(list(_LETTERS), count))]
    text = _text("\n".join(lines), rng)
    style = rng.random()
    if style < 0.35:
        return text
    if style < 0.7:
        half = np.array([*(np.abs(text.vertices[:, :2]).max(0) * 1.2 + 0.05), 0.12])
        plate = rounded_box(half, rng.uniform(0.02, 0.1), 24)
        return together([plate, placed(text, (0, 0, 0.12))])
    if style < 0.85:
        radius = 1.12 * np.linalg.norm(text.vertices[:, :2], axis=1).max()
        profile = (
            np.array([[0, 0], [1, 0], [1, 0.06], [0.94, 0.1], [0.9, 0.05], [0, 0.05]]) * radius
        )
        lying = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
        disc = placed(revolved(profile, 120), turn=lying.T)
        return together([disc, placed(text, (0, 0, 0.05 * radius))])
    return _around_a_tin(text, rng)


def _text(words: str, rng: np.random.Generator) -> Surface:
    """Letters, centred in x and y, their back at z = 0."""
    bpy = emptied()
    data = bpy.data.curves.new("body", "FONT")
    data.body, data.align_x, data.size = words, "CENTER", 0.6
    data.extrude, data.shear = float(rng.uniform(0.03, 0.2)), float(rng.uniform(-0.1, 0.4))
    data.offset = float(rng.uniform(0, 0.02))
    data.bevel_depth, data.bevel_resolution = float(rng.uniform(0.005, 0.03)), 3
    data.resolution_u = 5
    obj = linked(bpy, data)
    x, y, z = surface_of(obj).vertices.T
    faces = surface_of(obj).faces
    vertices = np.stack([x * rng.uniform(0.7, 1.3), -z, y], -1)  # upright: it lay on the floor
    low, high = vertices.min(0), vertices.max(0)
    return Surface(vertices - [*((low + high) / 2)[:2], low[2]], faces)


def _around_a_tin(text: Surface, rng: np.random.Generator) -> Surface:
    """Letters bent around a cylinder."""
    wide, high = np.abs(text.vertices[:, :2]).max(0)
    radius = max(wide / rng.uniform(0.8, 1.4), 0.3)
    x, y, z = text.vertices.T
    out = radius - 0.02 + 0.5 * z
    bent = np.stack([out * np.sin(x / radius), y, out * np.cos(x / radius)], -1)
    tall = high * rng.uniform(1.2, 1.8) + 0.1
    rim = np.array(
        [
            [0, -1],
            [0.97, -1],
            [1, -0.97],
            [1, 0.95],
            [1.03, 0.96],
            [1.03, 1],
            [0.97, 1],
            [0.95, 0.94],
            [0, 0.94],
        ]
    )
    return together([revolved(rim * (radius, tall), 128), Surface(bent, text.faces)])
