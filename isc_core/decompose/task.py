"""What every model is given, and what it answers."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..photo.photo import Photo
from ..progress import Monitor
from ..scene.decomposition import Separation
from ..scene.light_estimate import LightEstimate
from ..scene.lobe_fit import LobeFit
from ..scene.normal_estimate import NormalEstimate
from ..sirfs.priors.prior_set import PriorSet
from ..sirfs.recover import Known
from .settings import Settings


@dataclass
class Clock:
    """Seconds spent in each stage."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Adds up what the `with` block takes."""
        start = time.perf_counter()
        yield
        self.seconds[name] = round(self.seconds.get(name, 0.0) + time.perf_counter() - start, 4)


@dataclass(frozen=True)
class Task:
    """One photo to be explained.

    `working`: the photo at the scale at which shape and light are looked for; `maps`: at the scale
    of the result's maps, the same object where the two scales are one. `known`: at the working
    scale. `prior_set`: the shipped one if None. `split`: the layers of `maps` by the separator of
    the settings, where they have been found before; else None. `light_estimate`: how the photo's light
    looks, `seen`: how its shape does, at the working scale; None where nobody has looked yet.
    """

    working: Photo
    maps: Photo
    settings: Settings
    known: Known = field(default_factory=Known)
    prior_set: PriorSet | None = None
    monitor: Monitor = field(default_factory=Monitor)
    clock: Clock = field(default_factory=Clock)
    split: Separation | None = None
    light_estimate: LightEstimate | None = None
    seen: NormalEstimate | None = None

    @property
    def one_scale(self) -> bool:
        """Whether the maps have the working scale."""
        return self.maps is self.working


@dataclass(frozen=True)
class Answer:
    """`split`: the layers of `Task.maps`, which sum up to the image. `height` (H, W) in pixels of
    the maps and `light` (9, 3), both in SIRFS' reference convention: normals, shading and
    reflectance follow from them. `status`: JSON-ready, how the solver ended. `brdf`: the lobe
    fitted to the specular layer, None where the model has no specular layer.
    """

    split: Separation
    height: np.ndarray
    light: np.ndarray
    status: dict[str, Any]
    brdf: LobeFit | None = None
