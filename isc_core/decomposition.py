"""The results of the core, as typed frozen objects, and their files."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Separation:
    """One photo split into its layers: `image = diffuse + specular + residual` inside the mask.

    `diffuse`, `specular`, `residual`: (H, W, 3) float32, linear, 0 outside the mask; diffuse and specular >= 0.
    `confidence`: (H, W) float32 in [0, 1], how far the split can be trusted at each pixel; 0 outside the mask.
    """

    diffuse: np.ndarray
    specular: np.ndarray
    residual: np.ndarray
    confidence: np.ndarray


@dataclass(frozen=True)
class Provenance:
    """Where a result comes from: everything of `decomposition.json` that is not the scene itself (JSON-ready values)."""

    settings: dict[str, Any] = field(default_factory=dict)
    seed: int = 0
    versions: dict[str, str] = field(default_factory=dict)
    timings: dict[str, float] = field(default_factory=dict)
    input: dict[str, Any] = field(default_factory=dict)
    status: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Decomposition:
    """The intrinsic scene characteristics of one photo. Maps cover the whole frame at the scale used.

    `image, diffuse, specular, residual, reflectance, shading`: (H, W, 3) float32, linear Rec.709, 0 outside the mask.
    `normal`: (H, W, 3) float32 unit vectors, x right, y up, z toward the viewer; (0, 0, 1) outside the mask.
    `height`: (H, W) float32, pixels, toward the viewer; 0 outside. `mask`: (H, W) bool. `confidence`: (H, W) in [0, 1].
    `illumination`: (9, 3) float64; log shading_c(n) = sum_k illumination[k, c] Y_k(n), orthonormal real spherical harmonics.
    """

    image: np.ndarray
    diffuse: np.ndarray
    specular: np.ndarray
    residual: np.ndarray
    reflectance: np.ndarray
    shading: np.ndarray
    normal: np.ndarray
    height: np.ndarray
    mask: np.ndarray
    confidence: np.ndarray
    illumination: np.ndarray
    provenance: Provenance
