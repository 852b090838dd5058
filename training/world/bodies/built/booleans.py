"""Machined and moulded bodies: primitives cut from and added to each other, with bevelled edges,
with Blender's boolean and bevel modifiers.
"""

from typing import Any

import numpy as np

from ..geometry.blender import emptied, surface_of
from ..geometry.parts import largest_piece
from ..geometry.surface import Surface, welded


def make(rng: np.random.Generator) -> Surface:
    """Make a body of primitives.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    Surface
        y up.
    """
    bpy = emptied()
    body = _primitive(bpy, rng, np.zeros(3), rng.uniform(0.5, 1, 3))
    for _ in range(int(rng.integers(3, 6))):
        cut = rng.random() < 0.65
        place = 0.85 * _outside(rng)
        tool = _primitive(bpy, rng, place, rng.uniform(0.2, 0.55, 3))
        change = body.modifiers.new("change", "BOOLEAN")
        change.operation, change.object = ("DIFFERENCE" if cut else "UNION"), tool
        change.solver = "MANIFOLD"  # fast, and the same on any number of threads
    bevel = body.modifiers.new("bevel", "BEVEL")
    bevel.width, bevel.segments = float(10 ** rng.uniform(-2, -1.2)), 3
    bevel.limit_method, bevel.angle_limit = "ANGLE", float(np.radians(35))
    return largest_piece(welded(surface_of(body))[0])


def _outside(rng: np.random.Generator) -> np.ndarray:
    """A place around the surface: on an axis half of the time, as holes and slots are."""
    way = rng.normal(size=3)
    if rng.random() < 0.6:
        way = np.eye(3)[int(rng.integers(3))] * rng.choice([-1, 1]) + 0.15 * rng.normal(size=3)
    return np.asarray(rng.uniform(0.5, 1.0) * way / np.linalg.norm(way))


def _primitive(bpy: Any, rng: np.random.Generator, place: np.ndarray, size: np.ndarray) -> Any:
    """A box, cylinder, ball, cone or ring."""
    turn = (rng.integers(0, 2, 3) * np.pi / 2).tolist()
    if rng.random() < 0.25:
        turn = rng.uniform(0, np.pi, 3).tolist()
    where = {"location": place.tolist(), "rotation": turn}
    kind = int(rng.integers(5))
    if kind == 0:
        bpy.ops.mesh.primitive_cube_add(size=2, **where)
    elif kind == 1:
        bpy.ops.mesh.primitive_cylinder_add(vertices=int(rng.choice([6, 48, 64])), **where)
    elif kind == 2:
        bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=24, **where)
    elif kind == 3:
        bpy.ops.mesh.primitive_cone_add(vertices=48, radius2=float(rng.uniform(0, 0.8)), **where)
    else:
        bpy.ops.mesh.primitive_torus_add(
            major_segments=48,
            minor_segments=16,
            minor_radius=float(rng.uniform(0.15, 0.4)),
            **where,
        )
    obj = bpy.context.object
    obj.scale = size.tolist()
    return obj
