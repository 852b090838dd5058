"""Small scenes with known results, for the tests of the renderers."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from synth.scene import Scene
from synth.scene.camera import Camera
from synth.scene.lights import (
    DirectionalLight,
    EnvironmentLight,
    Light,
    PointLight,
    panel_toward_origin,
)
from synth.scene.materials import Material
from synth.scene.meshes import Mesh, swept
from synth.scene.surface import Surface, find_surface
from synth.scene.tracing import Tracer
from synth.scene.variant import load_mitsuba

GREY = np.full((2, 2, 3), 0.5)


@dataclass(frozen=True)
class Seen:
    """A surface and what its rays are traced with."""

    surface: Surface
    tracer: Tracer


@contextmanager
def variant(name: str) -> Iterator[None]:
    """Mitsuba temporarily in another variant."""
    mi = load_mitsuba()
    usual = mi.variant()
    mi.set_variant(name)
    try:
        yield
    finally:
        mi.set_variant(usual)


def ball(rows: int = 121, radius: float = 1.0) -> Mesh:
    """A sphere around the origin."""
    polar, angle = (
        np.linspace(0, np.pi, rows)[:, None],
        np.linspace(0, 2 * np.pi, 2 * rows - 1)[None],
    )
    up = np.broadcast_to(np.cos(polar), (rows, 2 * rows - 1))
    return swept(
        radius * np.stack([np.sin(polar) * np.sin(angle), up, np.sin(polar) * np.cos(angle)], -1)
    )


def skittle() -> Mesh:
    """A body with a deep waist: it casts shadows and reflects light onto itself."""
    polar, angle = np.linspace(0, np.pi, 61)[:, None], np.linspace(0, 2 * np.pi, 121)[None]
    width = 0.9 * np.sin(polar) * (1 - 0.75 * np.exp(-((np.cos(polar) / 0.3) ** 2)))
    points = np.stack(
        [width * np.sin(angle), np.broadcast_to(np.cos(polar), (61, 121)), width * np.cos(angle)],
        -1,
    )
    return swept(points).turned(25)


def seen(
    mesh: Mesh, material: Material | None = None, size: int = 24, distance: float = np.inf
) -> Seen:
    """What a camera sees of a mesh that is about 2 units wide."""
    scene = Scene(
        mesh, material or Material(GREY, "lambert"), (), Camera(size, size, size / 2.2, distance)
    )
    tracer = Tracer(mesh)
    return Seen(find_surface(scene, tracer), tracer)


def toward(x: float, y: float, z: float) -> np.ndarray:
    """The unit vector along (x, y, z)."""
    return np.array([x, y, z]) / np.linalg.norm([x, y, z])


def environment(rows: int = 16, seed: int = 0) -> EnvironmentLight:
    """An uneven environment with a window that is much brighter."""
    radiance = np.random.default_rng(seed).random((rows, 2 * rows, 3)) ** 3
    radiance[rows // 4 : rows // 4 + 2, rows : rows + 3] += (15.0, 12.0, 9.0)
    return EnvironmentLight(radiance)


def lights() -> dict[str, Light]:
    """One of each kind."""
    return {
        "directional": DirectionalLight(toward(-0.5, 0.6, 0.6), np.array([3.0, 2.0, 1.0])),
        "point": PointLight(np.array([1.5, 2.0, 2.0]), np.array([5.0, 6.0, 7.0])),
        "panel": panel_toward_origin((-2, 2.5, 2.5), (1.2, 0.8), (20, 18, 16)),
        "environment": environment(),
    }


def materials() -> dict[str, Material]:
    """One of each model, and narrow lobes beside wide ones."""
    return {
        "lambert": Material(GREY, "lambert"),
        "oren_nayar": Material(GREY, "oren_nayar", sigma=0.5),
        "blinn_phong": Material(GREY, "blinn_phong", 60.0, 0.1),
        "blinn_phong_narrow": Material(GREY, "blinn_phong", 2000.0, 0.1),
        "ggx": Material(GREY, "ggx", 0.3, 1.0),
        "ggx_narrow": Material(GREY, "ggx", 0.05, 1.0),
        "roughplastic": Material(GREY, "roughplastic", 0.2, 1.0),
    }


def mitsuba_camera(size: int, half: float = 1.0, samples: int = 1) -> dict[str, Any]:
    """One of Mitsuba's own cameras: `size` x `size` pixels that see [-half, half]^2 along -z.

    One sample is the ray through the centre.
    """
    look = load_mitsuba().ScalarTransform4f().look_at([0, 0, 10], [0, 0, 0], [0, 1, 0])
    wide = look @ load_mitsuba().ScalarTransform4f().scale([half, half, 1])
    film = {
        "type": "hdrfilm",
        "width": size,
        "height": size,
        "rfilter": {"type": "box"},
        "pixel_format": "rgb",
        "component_format": "float32",
    }
    centre: dict[str, Any] = {"type": "stratified", "sample_count": 1, "jitter": False}
    sampler = centre if samples == 1 else {"type": "independent", "sample_count": samples}
    return {
        "type": "orthographic",
        "near_clip": 0.1,
        "far_clip": 100.0,
        "to_world": wide,
        "film": film,
        "sampler": sampler,
    }
