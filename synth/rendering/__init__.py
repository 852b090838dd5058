"""Light on a surface, the two lobes of its material apart: from one set of samples, by Mitsuba's
kernels or by NumPy.

`mitsuba_lobes` runs in Mitsuba's LLVM variants; `array_lobes` runs everywhere, on `isc_core.shading.brdf`,
and needs Mitsuba for its rays only. Both estimate the same integral, so each is the other's test.
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
from ..scene.variant import has_llvm

Renderer = Literal["auto", "mitsuba", "arrays"]


@dataclass(frozen=True)
class RenderOptions:
    """`samples`: light paths a pixel, >= 2 (without two there is no variance). `seed`: of the
    random numbers. `bounces`: of light between parts of the object, 0 to 8. `renderer`: "auto"
    takes Mitsuba's kernels where libLLVM lets it. Raises `InputError` outside these.
    """

    samples: int = 64
    seed: int = 0
    bounces: int = 0
    renderer: Renderer = "auto"

    def __post_init__(self) -> None:
        if self.samples < 2 or not 0 <= self.bounces <= 8 or self.seed < 0:
            raise InputError("samples have to be 2 or more, bounces 0 to 8, and the seed 0 or more")
        if self.renderer not in get_args(Renderer):
            raise InputError(
                f"unknown renderer {self.renderer!r}: choose {', '.join(get_args(Renderer))}"
            )


@dataclass(frozen=True)
class Lit:
    """Radiance toward the camera of N points, and how sure it is.

    `shading`: (N, 3) of the diffuse for albedo 1, so that diffuse = albedo * shading. `specular`: (N,
    3) of the gloss, its strength included. `shading_variance`, `specular_variance`: (N, 3), of
    these estimates (of the mean, not of one sample); 0 where nothing was drawn.
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
    """Lights the points of `surface`.

    Raises `InputError` where the renderer asked for cannot run here, `Cancelled`.
    """
    monitor = monitor or Monitor()
    kernels = options.renderer == "mitsuba" or (options.renderer == "auto" and has_llvm())
    if kernels:
        from . import mitsuba_lobes

        return mitsuba_lobes.light_surface(surface, material, lights, tracer, options, monitor)
    from . import array_lobes

    return array_lobes.light_surface(surface, material, lights, tracer, options, monitor)
