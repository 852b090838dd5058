"""Small made scenes with everything known, and priors made from formulas, for tests of the SIRFS
objective and its solver.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from isc_core.scene.known_inputs import DepthObservation
from isc_core.shading.irradiance_basis import basis
from isc_core.shading.occluding_contour import occluding_contour
from isc_core.shading.surface_stencils import normals
from isc_core.sirfs.priors.priors import AbsoluteTable, LightPrior, Priors, SilhouetteProfile
from isc_core.sirfs.priors.tabulated_potential import TabulatedPotential
from isc_core.sirfs.problem import Problem
from isc_core.sirfs.settings import Weights
from isc_core.sirfs.shading_term import ExpectedShading
from isc_core.sirfs.silhouette import ExpectedNormals, normals_from_silhouette

NODES = 30
BRIGHTNESS = (-0.8, -0.9, -1.1)
PALETTE = np.array([[0.55, 0.2, 0.12], [0.15, 0.35, 0.5], [0.6, 0.55, 0.4]])
# As on a half ball: at relative depth u the normal leans outward by 1 - u.
PROFILE = SilhouetteProfile(np.linspace(0.95, 0.05, 10), np.linspace(0.1, 0.4, 10))
# A light from the upper left: constants of the reference's basis (down, right, toward the viewer),
# one column a channel.
LIGHT = np.array(
    [
        [-1.0, -1.1, -1.3],
        [-0.45, -0.4, -0.3],
        [0.6, 0.65, 0.7],
        [-0.5, -0.45, -0.4],
        [0.1, 0.05, 0.0],
        [-0.05, 0.05, 0.1],
        [0.1, 0.0, -0.05],
        [0.05, -0.05, 0.0],
        [-0.1, 0.0, 0.1],
    ]
)


def mixture_cost(x: np.ndarray, shares: np.ndarray, scales: np.ndarray) -> np.ndarray:
    """-log of a zero-mean Gaussian scale mixture at `x`, 0 at x = 0."""
    height = np.log(shares / scales)[:, None]
    density = np.logaddexp.reduce(height - 0.5 * (x / scales[:, None]) ** 2, axis=0)
    return np.logaddexp.reduce(height[:, 0]) - density


def symmetric_table(widest: float, scales: tuple[float, ...]) -> TabulatedPotential:
    x = np.linspace(-widest, widest, 20001)
    return TabulatedPotential(
        -widest,
        float(x[1] - x[0]),
        mixture_cost(x, np.full(len(scales), 1 / len(scales)), np.array(scales)),
    )


def square_table(widest: float, scales: tuple[float, ...]) -> TabulatedPotential:
    """Cost of m = d^2 / 2 from 0 on."""
    m = np.linspace(0, widest, 20001)
    cost = mixture_cost(np.sqrt(2 * m), np.full(len(scales), 1 / len(scales)), np.array(scales))
    return TabulatedPotential(0.0, float(m[1] - m[0]), cost)


def made_priors(channels: int = 3, seed: int = 0) -> Priors:
    """Priors of plausible shape for `channels`; the light's Gaussian is around `LIGHT`."""
    rng = np.random.default_rng(seed)

    def near_identity(size: float) -> np.ndarray:
        a = rng.normal(size=(channels, channels)) * 0.15
        return size * (np.eye(channels) + (a + a.T) / 2)

    count = 9 * channels
    mixing = rng.normal(size=(count, count)) * 0.15 / np.sqrt(count) + 0.3 * np.eye(count)
    covariance = mixing @ mixing.T
    values, vectors = np.linalg.eigh(covariance)
    mean = np.ascontiguousarray(LIGHT[:, :channels].T).ravel()
    light = LightPrior(mean, covariance, (vectors * np.sqrt(values)) @ vectors.T, mean)
    table = ndimage.gaussian_filter(rng.normal(size=(NODES,) * channels), 2.0, mode="nearest")
    table = 8 * (table - table.min()) / np.ptp(table)
    smooth = square_table(6.0, (0.03, 0.3)) if channels == 3 else symmetric_table(4.0, (0.03, 0.3))
    return Priors(
        channels,
        symmetric_table(2.0, (0.01, 0.1)),
        smooth,
        near_identity(1.0),
        near_identity(0.8),
        AbsoluteTable(-7.0, 4.0, table),
        light,
    )


@dataclass(frozen=True)
class Scene:
    """A rendered bumpy blob:

    `image` (H, W, C) linear, `mask` (H, W), the true `height` (H, W) and `light` (9, C).
    """

    image: np.ndarray
    mask: np.ndarray
    height: np.ndarray
    light: np.ndarray


def blob(
    shape: tuple[int, int] = (64, 72),
    channels: int = 3,
    *,
    bumps: float = 1.0,
    one_color: bool = False,
) -> Scene:
    """A blob that fills most of the frame, under `LIGHT`, coloured in three colours."""
    rows, columns = np.mgrid[: shape[0], : shape[1]].astype(float)
    size = min(shape)
    y, x = (
        (rows - shape[0] / 2 + 0.3) / (0.4 * size),
        (columns - shape[1] / 2 - 0.4) / (0.42 * size),
    )
    radius = np.hypot(x, y) / (1 + 0.06 * np.cos(3 * np.arctan2(y, x)))
    mask = radius < 1
    height = 0.35 * size * np.sqrt(
        np.maximum(1.001 - np.minimum(radius, 1) ** 2, 0)
    ) + bumps * np.sin(rows / 5) * np.cos(columns / 6)
    n1, n2, n3 = np.moveaxis(normals(height), -1, 0)
    light = LIGHT[:, :channels]
    color = PALETTE[
        np.where(x + 0.3 * y > 0.25, 0, np.where(y > 0.1, 1, 2)) * (not one_color), :channels
    ]
    image = color * np.exp(np.einsum("khw,kc->hwc", basis(n1, n2, n3), light))
    return Scene(np.where(mask[..., None], image, 0), mask, np.where(mask, height, 0), light)


def weights(**changes: float) -> Weights:
    """A laboratory-like set with `changes`."""
    return replace(Weights(13.4543, 3.3636, 1.6818, 4.7568, 6.7272, 2.3784, 4, 4.7568), **changes)


def only(term: str) -> Weights:
    """A set in which only `term` counts."""
    names = (
        "smoothness",
        "parsimony",
        "absolute",
        "curvature",
        "slant",
        "contour",
        "light",
        "silhouette",
        "shading_only",
        "predicted_normals",
        "predicted_shading",
    )
    none = dict.fromkeys(names, 0.0)
    return weights(**(none | {term: 3.0} if term in none else none))


def make_problem(
    scene: Scene,
    chosen: Weights | None = None,
    *,
    priors: Priors | None = None,
    observation: DepthObservation | None = None,
    shading_only: bool = False,
    holes: bool = False,
    outline: bool = False,
) -> Problem:
    """The SIRFS problem of `scene`;

    `holes` makes some pixels of the mask invalid, `outline` adds what the silhouette says.
    """
    valid = scene.mask.copy()
    if holes:
        valid &= np.random.default_rng(3).random(valid.shape) > 0.05
    log_image = np.where(valid[..., None], np.log(np.where(valid[..., None], scene.image, 1)), 0.0)
    priors = priors or made_priors(scene.image.shape[2])
    field = normals_from_silhouette(scene.mask, PROFILE) if outline else None
    contour = occluding_contour(scene.mask)
    return Problem(
        log_image,
        valid,
        scene.mask,
        contour,
        priors,
        chosen or weights(),
        observation,
        shading_only,
        silhouette=field,
    )


def some_pixel_weight(shape: tuple[int, ...]) -> np.ndarray:
    """How far pixels of a photo may be weighted: between 0 and 1, not at all in places."""
    weight = np.random.default_rng(12).uniform(-0.3, 1, shape)
    return np.maximum(weight, 0)


def some_shading(valid: np.ndarray, channels: int) -> ExpectedShading:
    """A random expected log shading; in places, nothing is expected."""
    rng = np.random.default_rng(13)
    mean = ndimage.gaussian_filter(rng.normal(size=(*valid.shape, channels)), (4, 4, 0))
    return ExpectedShading(3 * mean, np.maximum(rng.uniform(-3, 25, valid.shape), 0))


def some_normals(valid: np.ndarray) -> ExpectedNormals:
    """Random expected normals; in places, nothing is expected."""
    rng = np.random.default_rng(14)
    down, right = ndimage.gaussian_filter(rng.normal(size=(2, *valid.shape)), (0, 4, 4))
    return ExpectedNormals(5 * down, 5 * right, np.maximum(rng.uniform(-3, 25, valid.shape), 0))


def random_state(
    shape: tuple[int, int], channels: int, seed: int, size: float = 3.0
) -> tuple[np.ndarray, np.ndarray]:
    """A smooth random height with slopes of up to about 1, and a light near the prior's mean."""
    rng = np.random.default_rng(seed)
    height = ndimage.gaussian_filter(rng.normal(size=shape), 3.0, mode="nearest")
    height *= size / height.std()
    return height, LIGHT[:, :channels] + 0.2 * rng.normal(size=(9, channels))
