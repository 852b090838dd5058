"""Directions and models that the tests of reflectance share."""

import numpy as np

from isc_core.shading.brdf.blinn_phong import BlinnPhong
from isc_core.shading.brdf.dichromatic import Dichromatic
from isc_core.shading.brdf.ggx import Ggx
from isc_core.shading.brdf.lambert import Lambert
from isc_core.shading.brdf.model import Lobe
from isc_core.shading.brdf.oren_nayar import OrenNayar
from isc_core.shading.brdf.phong import Phong

UP = np.array([0.0, 0.0, 1.0])
RECIPROCAL: list[Lobe] = [
    Lambert(0.7),
    OrenNayar(0.8, 0.4),
    OrenNayar(1.0, 0.0),
    Phong(0.6, 31.0),
    BlinnPhong(0.6, 47.0),
    BlinnPhong(0.6, 7.0, "conserving"),
    Ggx(0.15, 0.05),
    Ggx(1.0, 0.9),
]
PLAIN: list[Lobe] = [Phong(0.6, 31.0, normalised=False), BlinnPhong(0.6, 47.0, "plain")]
LOBES = RECIPROCAL + PLAIN
GLOSSY_PLASTIC = Dichromatic(np.array([0.7, 0.3, 0.1]), OrenNayar(0.9, 0.3), Ggx(0.2, 0.04))


def random_units(*shape: int, seed: int = 0) -> np.ndarray:
    """Unit vectors (*shape, 3), even on the sphere."""
    vectors = np.random.default_rng(seed).normal(size=(*shape, 3))
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def lit_triples(count: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Normals, views and lights (count, 3), half of the lights near the mirror direction so that
    narrow lobes are seen.
    """
    normal = random_units(count, seed=seed)
    view, light = (
        (lambda d: d * np.sign((d * normal).sum(-1, keepdims=True)))(
            random_units(count, seed=seed + k)
        )
        for k in (1, 2)
    )
    mirror = 2 * (view * normal).sum(-1, keepdims=True) * normal - view
    near = mirror + 0.1 * random_units(count, seed=seed + 3)
    light = np.where(np.arange(count)[:, None] % 2 == 0, light, near)
    light = light / np.linalg.norm(light, axis=-1, keepdims=True)
    above = ((view * normal).sum(-1) > 0.02) & ((light * normal).sum(-1) > 0.02)
    return normal[above], view[above], light[above]


def turned(vectors: np.ndarray, seed: int) -> np.ndarray:
    """Vectors (..., 3) after one random rotation."""
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return vectors @ (q * np.sign(np.linalg.det(q)))


def polar_units(cosine: np.ndarray, azimuth: np.ndarray | float = 0.0) -> np.ndarray:
    """Unit vectors (..., 3) at a cosine from the z axis."""
    cosine, azimuth = np.broadcast_arrays(np.asarray(cosine, float), azimuth)
    sine = np.sqrt(1 - cosine**2)
    return np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine], axis=-1)
