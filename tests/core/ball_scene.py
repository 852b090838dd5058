"""A synthetic scene with ground truth: a chequered ball, a coloured light, a highlight."""

import numpy as np

from isc_core.scene.decomposition import Decomposition, Provenance
from isc_core.scene.diagnostics import Diagnostics
from isc_core.shading.spherical_harmonics import real_sh

LIGHT = np.array(
    [
        [-1.1, -1.25, -1.5],
        [0.75, 0.7, 0.6],
        [0.9, 0.85, 0.8],
        [-0.7, -0.55, -0.35],
        [-0.15, -0.1, 0.0],
        [0.1, 0.1, 0.15],
        [0.05, 0.0, -0.1],
        [-0.1, -0.1, -0.05],
        [0.05, 0.1, 0.1],
    ]
)


def ball(
    shape: tuple[int, int] = (96, 120),
    radius: float = 40.0,
    center: tuple[float, float] = (44.0, 66.0),
) -> Decomposition:
    """A ball of `radius` pixels at (row, column) `center`; every identity holds to the precision of
    float32.
    """
    rows, columns = np.mgrid[: shape[0], : shape[1]].astype(np.float64)
    x, y = (columns - center[1]) / radius, (center[0] - rows) / radius
    mask = x * x + y * y < 0.99**2
    z = np.sqrt(np.maximum(1 - x * x - y * y, 0))
    normal = np.where(mask[..., None], np.stack([x, y, z], -1), [0.0, 0.0, 1.0])
    shading = np.exp(real_sh(normal) @ LIGHT)
    checker = (np.floor(4 * x + 0.3) + np.floor(4 * y + 0.2)) % 2 > 0
    reflectance = np.where(checker[..., None], [0.52, 0.12, 0.07], [0.12, 0.3, 0.42])
    half = np.array([-0.35, 0.42, 0.84]) / np.linalg.norm([-0.35, 0.42, 0.84])
    specular = (0.6 * np.maximum(normal @ half, 0) ** 60)[..., None] * np.array([1.0, 0.95, 0.88])

    def inside(values: np.ndarray) -> np.ndarray:
        return np.where(mask[..., None] if values.ndim == 3 else mask, values, 0).astype(np.float32)

    diffuse, specular = inside(reflectance * shading), inside(specular)
    return Decomposition(
        image=diffuse + specular,
        diffuse=diffuse,
        specular=specular,
        residual=np.zeros_like(diffuse),
        reflectance=inside(reflectance),
        shading=inside(shading),
        normal=normal.astype(np.float32),
        height=inside(radius * z),
        mask=mask,
        confidence=inside(z),
        illumination=LIGHT.copy(),
        provenance=Provenance(
            settings={"model": "mdr", "separator": "isc", "illumination": "natural"},
            seed=7,
            versions={"isc": "0.1.0"},
            timings={"solve": 1.25},
            input={
                "name": "ball.png",
                "sha256": "0" * 64,
                "size": [shape[1], shape[0]],
                "scale": 1.0,
                "crop_box": [0, 0, *shape[::-1]],
            },
            diagnostics=Diagnostics(converged=True, loss=46.1234),
        ),
    )
