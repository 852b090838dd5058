"""The albedo of a reflectance model, and whether it is reciprocal.

Problem: integrals of f_r cos over the hemisphere, for lobes from diffuse to a thousandth of it.

Equation: the half vector h takes the place of the light l, d omega_l = 4 (view . h) d omega_h: h
stays near the normal where the lobe is narrow, so nodes are dense there. With h at the polar angle
t and azimuth a from the view's plane, l is above the horizon exactly while t < pi/4 +
atan2(sin_view cos a, cos_view) / 2; within that limit the integrand is smooth, and Gauss-Legendre
nodes in t^(1/3) converge.

Citation: the Jacobian is that of B. Walter et al., "Microfacet models for refraction through rough
surfaces", EGSR 2007, doi:10.2312/EGWR/EGSR07/195-206.

Limits: isotropic models. With the default number of nodes the error is below 1e-6 for exponents to
2000 and alpha >= .03, for views up to 80 degrees from the normal; 1e-4 for Oren-Nayar, whose maxima
make edges.
"""

import numpy as np

from ...errors import InputError
from .model import Model


def directional_albedo(model: Model, cos_view: float, nodes: int = 96) -> np.ndarray:
    """Compute the share of the light from one direction that leaves in all directions.

    For a reciprocal model this is also the radiance toward that direction in a white environment of
    radiance 1.

    Parameters
    ----------
    model : Model
    cos_view : float
        Cosine between the direction and the normal, in (0, 1].
    nodes : int
        In each of the two angles, >= 2; the cost grows with its square.

    Returns
    -------
    () or (3,) ndarray
        For a model without or with colour.

    Raises
    ------
    InputError
        Outside these ranges.
    """
    if not 0 < cos_view <= 1 or nodes < 2:
        raise InputError("cos_view has to be within (0, 1] and nodes at least 2")
    view = np.array([np.sqrt(1 - cos_view**2), 0, cos_view])
    half, weight = _half_vectors(view, nodes)
    across = half @ view
    light = 2 * across[:, None] * half - view
    light /= np.sqrt((light * light).sum(axis=1, keepdims=True))
    # The light comes from `view`: for a plain Phong lobe the order matters.
    reflected = model.value(np.array([0.0, 0, 1]), light, view)
    return (weight * 4 * across * np.maximum(light[:, 2], 0)) @ reflected


def reciprocity_error(model: Model, count: int = 1000, seed: int = 0) -> float:
    """Return the largest |f_r(view, light) - f_r(light, view)| relative to the largest f_r.

    Parameters
    ----------
    model : Model
    count : int
        Number of random pairs.
    seed : int

    Returns
    -------
    float
        0 for a reciprocal model.
    """
    directions = np.random.default_rng(seed).normal(size=(2, count, 3))
    directions[..., 2] = np.abs(directions[..., 2])
    a, b = directions / np.sqrt((directions**2).sum(axis=-1, keepdims=True))
    normal = np.array([0.0, 0, 1])
    there, back = model.value(normal, a, b), model.value(normal, b, a)
    return float(np.abs(there - back).max() / max(there.max(), np.finfo(float).tiny))


def _half_vectors(view: np.ndarray, nodes: int) -> tuple[np.ndarray, np.ndarray]:
    """Half vectors (n, 3) whose light is above the horizon, and their solid angles (n,)."""
    abscissa, weight = np.polynomial.legendre.leggauss(nodes)
    root, weight = (abscissa + 1) / 2, weight / 2
    azimuth = (np.arange(2 * nodes) + 0.5) * np.pi / nodes
    limit = np.pi / 4 + np.arctan2(view[0] * np.cos(azimuth), view[2]) / 2
    polar = limit[:, None] * root**3
    solid = limit[:, None] * 3 * root**2 * weight * np.sin(polar) * np.pi / nodes
    across = np.sin(polar)
    half = np.stack(
        [across * np.cos(azimuth)[:, None], across * np.sin(azimuth)[:, None], np.cos(polar)],
        axis=-1,
    )
    return half.reshape(-1, 3), solid.ravel()
