"""The response of a lobe to one distant light, and its derivatives with respect to alpha, the
light's direction and the normal.

Equation: y(n) = f_r(n, v, l) max(0, n . l) with v = (0, 0, 1) and the lobes of `shading.brdf.ggx`
and `shading.brdf.blinn_phong` ("normalised", exponent p = 2 / alpha^2 - 2). h = (l + v) / m, m =
|l + v|, so d(n . h) / dl = (n - (n . h) h) / m.

Citation: B. Walter et al., EGSR 2007, doi:10.2312/EGWR/EGSR07/195-206; J. F. Blinn, SIGGRAPH 1977,
doi:10.1145/563858.563893.

Limits: one view, orthographic. Below the light's or the viewer's horizon the response and its
derivatives are 0.
"""

from dataclasses import dataclass

import numpy as np

from ..scene.lobe_fit import LobeModel
from ..shading.brdf.ggx import F0, density

_MIN_COSINE = 1e-6  # smaller cosines are below the horizon


@dataclass(frozen=True, eq=False)
class Response:
    """The response of a lobe, with derivatives.

    Attributes
    ----------
    value : (N,) ndarray
        1/sr.
    by_log_alpha : (N,) ndarray
        Derivative with respect to log alpha.
    by_light : (N, 3) ndarray
        Derivative with respect to the light's direction; only the part perpendicular to it is
        meaningful.
    by_normal : (N, 3) ndarray
        Derivative with respect to the normal; only the part perpendicular to it is meaningful.
    """

    value: np.ndarray
    by_log_alpha: np.ndarray
    by_light: np.ndarray
    by_normal: np.ndarray


def respond(model: LobeModel, normal: np.ndarray, light: np.ndarray, alpha: float) -> Response:
    """Compute the response of surfaces to a light.

    Parameters
    ----------
    model : {"ggx", "blinn_phong"}
        The lobe.
    normal : (N, 3) ndarray
        Unit normals.
    light : (3,) or (N, 3) ndarray
        Unit directions toward the light.
    alpha : float
        Roughness in (0, 1).

    Returns
    -------
    Response
        Of each normal.
    """
    view_cos, light_cos = normal[:, 2], (normal * light).sum(axis=1)
    lit = (view_cos > _MIN_COSINE) & (light_cos > _MIN_COSINE)
    view_cos, light_cos = np.where(lit, view_cos, 1), np.where(lit, light_cos, 1)
    total = light + (0, 0, 1)
    length = np.maximum(np.sqrt((total * total).sum(axis=-1, keepdims=True)), 1e-9)
    half = total / length
    half_cos = np.clip((normal * half).sum(axis=1), 0, 1)
    view_half_cos = half[..., 2:]
    lobe = _ggx if model == "ggx" else _blinn_phong
    value, by_alpha, by_half, by_cos, by_view_half, by_view = lobe(
        view_cos, light_cos, half_cos, view_half_cos[..., 0], alpha
    )
    value = np.where(lit, value, 0)
    across = ((0, 0, 1) - view_half_cos * half) / length
    by_direction = (normal - half_cos[:, None] * half) / length
    by_light = (
        by_half[:, None] * by_direction
        + by_cos[:, None] * normal
        + np.asarray(by_view_half)[..., None] * across
    )
    by_normal = by_half[:, None] * half + by_cos[:, None] * light
    by_normal[:, 2] += by_view
    return Response(value, value * by_alpha, value[:, None] * by_light, value[:, None] * by_normal)


def mirrored_uniform(normal: np.ndarray) -> np.ndarray:
    """Compute the mirrored light of a uniform environment map of radiance 1: Schlick's F for the
    view direction, neglecting roughness.

    Parameters
    ----------
    normal : (N, 3) ndarray
        Unit normals.

    Returns
    -------
    (N,) ndarray
        The response.
    """
    return F0 + (1 - F0) * (1 - np.clip(normal[:, 2], 0, 1)) ** 5


def mirrored_basis(normal: np.ndarray) -> np.ndarray:
    """Evaluate a basis of the mirrored light of a smooth environment map: uniform light, Fresnel's
    increase toward grazing angles, slow and fast, and light that increases upward in the mirrored
    view.

    Parameters
    ----------
    normal : (N, 3) ndarray
        Unit normals.

    Returns
    -------
    (4, N) ndarray
        The basis.
    """
    grazing = 1 - np.clip(normal[:, 2], 0, 1)
    return np.stack([np.ones(len(normal)), grazing**2, grazing**5, 2 * normal[:, 2] * normal[:, 1]])


# Both lobes: y, and the derivatives of log y wrt log alpha, n . h, n . l, v . h and n . v.
_Parts = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def _ggx(
    view_cos: np.ndarray,
    light_cos: np.ndarray,
    half_cos: np.ndarray,
    view_half_cos: np.ndarray,
    alpha: float,
) -> _Parts:
    square = alpha**2
    view_root, light_root = (np.sqrt(square + (1 - square) * c * c) for c in (view_cos, light_cos))
    fresnel = F0 + (1 - F0) * (1 - view_half_cos) ** 5
    value = (
        density(alpha, half_cos)
        * fresnel
        * light_cos
        / ((view_cos + view_root) * (light_cos + light_root))
    )
    spread = square * half_cos**2 + 1 - half_cos**2
    by_alpha = 2 - 4 * square * half_cos**2 / spread
    for c, root in ((view_cos, view_root), (light_cos, light_root)):
        by_alpha = by_alpha - square * (1 - c * c) / (root * (c + root))
    by_half = 4 * (1 - square) * half_cos / spread
    by_cos = 1 / light_cos - (1 + (1 - square) * light_cos / light_root) / (light_cos + light_root)
    by_view = -(1 + (1 - square) * view_cos / view_root) / (view_cos + view_root)
    by_view_half = -5 * (1 - F0) * (1 - view_half_cos) ** 4 / fresnel
    return value, by_alpha, by_half, by_cos, by_view_half, by_view


def _blinn_phong(
    view_cos: np.ndarray,
    light_cos: np.ndarray,
    half_cos: np.ndarray,
    view_half_cos: np.ndarray,
    alpha: float,
) -> _Parts:
    del view_cos
    exponent = 2 / alpha**2 - 2
    safe = np.maximum(half_cos, 1e-9)
    value = (exponent + 8) / (8 * np.pi) * safe**exponent * light_cos
    by_alpha = -4 / alpha**2 * (1 / (exponent + 8) + np.log(safe))
    none = np.zeros_like(safe)
    return value, by_alpha, exponent / safe, 1 / light_cos, np.zeros_like(view_half_cos), none
