"""Difficult targets: of several parts, and cut by the frame.

Problem: an animal, a lamp or a cup on its saucer has parts of different shape and colour, but is
one object. A portrait is cut by the frame.

Equation: lengths are relative to the object's. A compound is a stack, whose parts overlap the one
below; a head on a body; limbs around a body; or patches on it. It is scaled so that the squares
around its parts have the object's length together. An object of length L is cut by a side of the
frame if its centre lies L (1/2 - f) before that side, 0 < f < 1/2.

Limits: parts are chosen without regard to each other; few compounds have a gap.
"""

from dataclasses import dataclass

import numpy as np

from ..world.random_draws import log_uniforms

MOST_PARTS = 5
_LENGTHS = (0.6, 1.5)  # of objects that are cut, of the frame
_SIDES = ((0, 1), (1, 0), (-1, 0), (0, -1))  # right and down: below, right, left, above
_SIDE_SHARES = (0.6, 0.15, 0.15, 0.1)
_SECOND_SIDE = 0.3  # share of objects that are cut by two sides
_KINDS = (0.3, 0.25, 0.25, 0.2)  # shares of stacks, heads, limbs and patches


@dataclass(frozen=True, eq=False)
class Parts:
    """Parts of compound objects, from the back to the front.

    Attributes
    ----------
    number : (B,) int ndarray
        2 to `MOST_PARTS`.
    length : (B, MOST_PARTS) ndarray
        Relative to the object's.
    place : (B, MOST_PARTS, 2) ndarray
        Right and down of its centre, in units of half its length.
    """

    number: np.ndarray
    length: np.ndarray
    place: np.ndarray


def draw_parts(rng: np.random.Generator, number: int) -> Parts:
    """Draw the parts of compound objects.

    Parameters
    ----------
    rng : numpy.random.Generator
    number : int
        Of objects.

    Returns
    -------
    Parts
    """
    kind = rng.choice(len(_KINDS), number, p=_KINDS)
    layouts = [draw(rng, number) for draw in (_stacks, _heads, _limbs, _patches)]
    count, length, place = (
        np.stack([getattr(one, name) for one in layouts])[kind, np.arange(number)]
        for name in ("number", "length", "place")
    )
    absent = np.arange(MOST_PARTS) >= count[:, None]
    half = np.where(absent, -np.inf, length)[..., None]
    low, high = (place - half).min(axis=1), (place + half).max(axis=1)
    whole = (high - low).max(axis=1) / 2
    place = (place - ((low + high) / 2)[:, None]) / whole[:, None, None]
    return Parts(count, length / whole[:, None], place)


def _stacks(rng: np.random.Generator, number: int) -> Parts:
    length = rng.uniform(0.5, 1, (number, MOST_PARTS))
    step = (length[:, 1:] + length[:, :-1]) * rng.uniform(0.3, 0.6, (number, MOST_PARTS - 1))
    up = np.cumsum(np.concatenate([np.zeros((number, 1)), step], axis=1), axis=1)
    aside = rng.normal(0, 0.1, (number, MOST_PARTS))
    upward = rng.choice([-1, 1], (number, 1))  # the upper or the lower one is in front
    return Parts(rng.integers(2, 5, number), length, np.stack([aside, upward * up], axis=-1))


def _heads(rng: np.random.Generator, number: int) -> Parts:
    length = rng.uniform(0.35, 0.7, (number, MOST_PARTS))
    length[:, 0] = 1
    down = -rng.uniform(0.45, 0.95, (number, MOST_PARTS))
    place = np.stack([rng.normal(0, 0.15, (number, MOST_PARTS)), down], axis=-1)
    place[:, 0] = 0
    return Parts(rng.integers(2, 4, number), length, place)


def _limbs(rng: np.random.Generator, number: int) -> Parts:
    length = rng.uniform(0.25, 0.6, (number, MOST_PARTS))
    turn = rng.uniform(0, 2 * np.pi, (number, MOST_PARTS))
    away = rng.uniform(0.4, 0.8, (number, MOST_PARTS, 1))
    place = away * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    last = rng.random(number) < 0.5  # the body is in front of its limbs
    count = rng.integers(2, MOST_PARTS + 1, number)
    body = np.where(last, count - 1, 0)
    length[np.arange(number), body], place[np.arange(number), body] = 1, 0
    return Parts(count, length, place)


def _patches(rng: np.random.Generator, number: int) -> Parts:
    length = rng.uniform(0.15, 0.5, (number, MOST_PARTS))
    place = rng.uniform(-0.35, 0.35, (number, MOST_PARTS, 2))
    length[:, 0], place[:, 0] = 1, 0
    return Parts(rng.integers(2, MOST_PARTS + 1, number), length, place)


def cut_by_frame(
    rng: np.random.Generator, shape: np.ndarray, unit: float
) -> tuple[np.ndarray, np.ndarray]:
    """Draw lengths and places of objects that are cut by one or two sides of the frame.

    Parameters
    ----------
    rng : numpy.random.Generator
    shape : (B, 2) ndarray
        Width and height of the photos, relative to the longer one.
    unit : float
        Length of the frame.

    Returns
    -------
    length : (B,) ndarray
        In units of `unit`.
    place : (B, 2) ndarray
        As `scenes.PastedObjects.place`; in the frame.
    """
    number = len(shape)
    part = log_uniforms(rng, *_LENGTHS, number)[:, None] * shape.min(axis=1, keepdims=True) ** 0.5
    side = np.array(_SIDES)[rng.choice(len(_SIDES), number, p=_SIDE_SHARES)]
    other = side[:, ::-1] * rng.choice([-1, 1], (number, 1))
    beyond = shape - part * (1 - 2 * rng.uniform(0.03, 0.42, (number, 2)))
    beyond = np.clip(beyond, -0.3 * shape, 0.9 * shape)
    free = np.maximum(shape - part, 0.15 * part) * rng.normal(0, 0.4, shape.shape).clip(-1, 1)
    second = rng.random((number, 1)) < _SECOND_SIDE
    place = np.where(side != 0, side * beyond, np.where(second, other * beyond, free))
    return part[:, 0] * unit, place
