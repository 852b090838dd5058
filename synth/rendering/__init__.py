"""Light reflected by a surface, its diffuse and specular lobes separate but from the same samples,
by Mitsuba's kernels or by NumPy.

`mitsuba_lobes` runs in Mitsuba's CUDA and LLVM variants; `array_lobes` runs everywhere, on
`isc_core.shading.brdf`, and needs Mitsuba only to trace rays. Both estimate the same integral, so
each tests the other.
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from isc_core.errors import InputError
from isc_core.progress import Monitor

from ..scene.lights import Light
from ..scene.materials import Material
from ..scene.surface import Surface
from ..scene.tracing import Tracer
from ..scene.variant import is_vectorised

Renderer = Literal["auto", "mitsuba", "arrays"]


@dataclass(frozen=True)
class RenderOptions:
    """Options of a render.

    Attributes
    ----------
    samples : int
        Light paths per pixel, >= 2 (one alone has no variance).
    seed : int
        Seed of the random numbers, >= 0.
    bounces : int
        Interreflections on the object, 0 to 8.
    renderer : str
        "mitsuba", "arrays", or "auto": Mitsuba's kernels if a CUDA or LLVM variant is available.

    Raises
    ------
    InputError
        Outside these ranges.
    """

    samples: int = 64
    seed: int = 0
    bounces: int = 0
    renderer: Renderer = "auto"

    def __post_init__(self) -> None:
        if self.samples < 2 or not 0 <= self.bounces <= 8 or self.seed < 0:
            raise InputError("use at least 2 samples, 0 to 8 bounces, and a seed of at least 0")
        if self.renderer not in get_args(Renderer):
            raise InputError(
                f"unknown renderer {self.renderer!r}: choose {', '.join(get_args(Renderer))}"
            )


@dataclass(frozen=True, eq=False)
class Lit:
    """Radiance of N points toward the camera, with the variance of its estimate.

    Attributes
    ----------
    shading : (N, 3) ndarray
        Of the diffuse lobe for albedo 1: diffuse = albedo * shading.
    specular : (N, 3) ndarray
        Of the specular lobe, its strength included.
    shading_variance, specular_variance : (N, 3) ndarray
        Of these estimates (of the mean, not of one sample); 0 where nothing was sampled.
    """

    shading: np.ndarray
    specular: np.ndarray
    shading_variance: np.ndarray
    specular_variance: np.ndarray


def light_surface(
    surface: Surface,
    material: Material,
    lights: tuple[Light, ...],
    tracer: Tracer,
    options: RenderOptions,
    monitor: Monitor | None = None,
) -> Lit:
    """Light the points of a surface.

    Parameters
    ----------
    surface : Surface
        The visible points.
    material : Material
        Their material.
    lights : tuple of Light
        The lights.
    tracer : Tracer
        The object, for shadows and interreflections.
    options : RenderOptions
        Samples, seed, bounces and renderer.
    monitor : Monitor, optional
        Progress and cancellation.

    Returns
    -------
    Lit
        Shading and specular radiance.

    Raises
    ------
    InputError
        If the renderer cannot run on this machine.
    Cancelled
        If the user cancels.
    """
    monitor = monitor or Monitor()
    kernels = options.renderer == "mitsuba" or (options.renderer == "auto" and is_vectorised())
    if kernels:
        from . import mitsuba_lobes

        return mitsuba_lobes.light_surface(surface, material, lights, tracer, options, monitor)
    from . import array_lobes

    return array_lobes.light_surface(surface, material, lights, tracer, options, monitor)
