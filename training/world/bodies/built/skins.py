"""Branched bodies from stick figures: corals, roots, twigs, hands, stick animals, with Blender's
skin modifier and subdivision.
"""

import numpy as np

from ..geometry.blender import emptied, linked, surface_of
from ..geometry.forms import displaced
from ..geometry.noise import fractal
from ..geometry.surface import Surface, welded


def make(rng: np.random.Generator) -> Surface:
    """Make a branched body.

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
    places, edges, radii = _hand(rng) if rng.random() < 0.35 else _branches(rng)
    mesh = bpy.data.meshes.new("body")
    mesh.from_pydata(places.tolist(), edges, [])
    obj = linked(bpy, mesh)
    skin = obj.modifiers.new("skin", "SKIN")
    skin.branch_smoothing = 0.5
    for vertex, radius in zip(mesh.skin_vertices[0].data, radii, strict=True):
        vertex.radius = (radius, radius * float(rng.uniform(0.8, 1.2)))
    mesh.skin_vertices[0].data[0].use_root = True
    smooth = obj.modifiers.new("smooth", "SUBSURF")
    smooth.levels = 3
    surface = welded(surface_of(obj))[0]
    rough = fractal(surface.vertices, rng.uniform(2, 5), 3, 0.5, rng)
    return displaced(surface, rng.choice([0, 0.005, 0.015]) * rough)


def _branches(rng: np.random.Generator) -> tuple[np.ndarray, list[tuple[int, int]], list[float]]:
    """A tree of sticks that grows away from its root."""
    places, radii = [np.zeros(3)], [float(rng.uniform(0.09, 0.16))]
    ways = [np.array([0.0, 0.0, 1.0])]
    edges: list[tuple[int, int]] = []
    for _ in range(int(rng.integers(6, 22))):
        parent = int(rng.integers(max(0, len(places) - 6), len(places)))
        way = ways[parent] + rng.normal(0, 0.45, 3)
        way /= np.linalg.norm(way)
        edges.append((parent, len(places)))
        places.append(places[parent] + rng.uniform(0.35, 0.6) * way)
        ways.append(way)
        radii.append(radii[parent] * float(rng.uniform(0.7, 1.0)))
    return np.array(places), edges, radii


def _hand(rng: np.random.Generator) -> tuple[np.ndarray, list[tuple[int, int]], list[float]]:
    """A palm with fingers: also a paw, a starfish, an octopus."""
    count = int(rng.integers(4, 9))
    spread = rng.uniform(0.5, np.pi)
    places, radii = [np.zeros(3), np.array([0, 0, 0.3])], [0.15, float(rng.uniform(0.14, 0.2))]
    edges = [(0, 1)]
    for angle in np.linspace(-spread, spread, count, endpoint=spread < 2.5):
        parent, length = 1, rng.uniform(0.25, 0.4)
        way = np.array([np.sin(angle), rng.normal(0, 0.15), np.cos(angle)])
        for k in range(3):
            way = way + (0, rng.uniform(0, 0.5), 0)
            edges.append((parent, len(places)))
            places.append(places[parent] + length * way / np.linalg.norm(way))
            parent = len(places) - 1
            radii.append(float(0.09 - 0.018 * k))
    return np.array(places), edges, radii
