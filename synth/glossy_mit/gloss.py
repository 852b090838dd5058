"""The specular layer without shadows under an environment or a panel, at points seen by an
orthographic camera along -z.

Problem: a Monte Carlo render leaves noise of a few per cent in the specular layer, which methods
that remove highlights mistake for texture. Without shadows no rays have to be traced: the integral
over the light is a sum over the pixels of the environment.

Equation: radiance(n) = sum_j (p + 8) / (8 pi) (n . h_j)^p max(0, n . w_j) E_j, h_j halfway between
w_j and the viewer, E_j the irradiance of a piece of the light perpendicular to its beam. Normals
are processed in small groups; a group omits pieces for which (n . h)^p is below 1e-7.

Citation: J. F. Blinn, "Models of light reflection for computer synthesized pictures", SIGGRAPH
1977, doi:10.1145/563858.563893.

Limits: there are six pieces per width of the lobe, which leaves about 1e-3 of the brightest value;
`synth.rendering` estimates the same integral.
"""

import numpy as np

from isc_core.shading.brdf.blinn_phong import BlinnPhong
from isc_core.shading.environment_map import directions, resampled, solid_angles

from ..scene.lights import PanelLight

_VIEW = np.array([0.0, 0.0, 1.0])
_CELLS = 10  # normals in one cube of side 1 / _CELLS make a group
_PIECES = 6.0  # rows of an environment per square root of the exponent
_FAINTEST = 1e-7
_BLOCK = 1024


def environment_gloss(radiance: np.ndarray, normal: np.ndarray, exponent: float) -> np.ndarray:
    """Compute the specular layer of strength 1 under an environment.

    Parameters
    ----------
    radiance : (rows, 2 rows, 3) ndarray
        The environment.
    normal : (N, 3) ndarray
        Unit normals.
    exponent : float
        Of the normalised Blinn-Phong lobe.

    Returns
    -------
    (N, 3) ndarray
        Radiance toward the viewer.
    """
    rows = len(radiance) * int(np.ceil(max(1.0, _PIECES * np.sqrt(exponent) / len(radiance))))
    power = (resampled(radiance, rows) * solid_angles(rows)[..., None]).reshape(-1, 3)
    toward = directions(rows).reshape(-1, 3)
    lit = power.any(axis=1) & (toward[:, 2] > -1 + 1e-6)
    power, toward = power[lit].astype(np.float32), toward[lit]
    half = toward + _VIEW
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    reach = np.arccos(min(1.0, _FAINTEST ** (1 / exponent)))
    gloss = np.zeros((len(normal), 3))
    for group in _groups(normal):
        normals = normal[group]
        centre = normals.mean(0) / np.linalg.norm(normals.mean(0))
        spread = np.arccos(np.clip((normals @ centre).min(), -1, 1))
        near = half @ centre > np.cos(min(reach + spread, np.pi))
        lobe = _lobe(normals.astype(np.float32) @ half[near].T.astype(np.float32), exponent)
        lobe *= np.maximum(normals.astype(np.float32) @ toward[near].T.astype(np.float32), 0)
        gloss[group] = lobe @ power[near]
    return gloss * _factor(exponent)


def panel_layers(
    panel: PanelLight, position: np.ndarray, normal: np.ndarray, exponent: float
) -> tuple[np.ndarray, np.ndarray]:
    """Compute shading and specular layer of strength 1 under a panel.

    Parameters
    ----------
    panel : PanelLight
        The panel.
    position, normal : (N, 3) ndarray
        Points and unit normals.
    exponent : float
        Of the normalised Blinn-Phong lobe.

    Returns
    -------
    shading, specular : (N, 3) ndarray
        The layers.
    """
    count = max(8, int(np.ceil(1.2 * np.sqrt(exponent))))
    steps = (np.arange(count) + 0.5) * 2 / count - 1
    shading, gloss = np.zeros((2, len(position)))
    for across in steps:
        for along in steps:
            toward = panel.centre + across * panel.right + along * panel.up - position
            square = np.einsum("ni,ni->n", toward, toward)
            toward /= np.sqrt(square)[:, None]
            received = (
                np.einsum("ni,ni->n", toward, normal).clip(0)
                * (-(toward @ panel.normal)).clip(0)
                / square
            )
            half = toward + _VIEW
            cosine = np.einsum("ni,ni->n", half, normal) / np.sqrt(
                np.einsum("ni,ni->n", half, half)
            )
            shading += received
            gloss += received * _lobe(cosine, exponent)
    piece = panel.radiance * (panel.area / count**2)
    return shading[:, None] * piece / np.pi, gloss[:, None] * piece * _factor(exponent)


def _lobe(cosine: np.ndarray, exponent: float) -> np.ndarray:
    """cosine^exponent, 0 below the horizon."""
    return np.exp(exponent * np.log(np.maximum(cosine, 1e-6)))


def _factor(exponent: float) -> float:
    return float(BlinnPhong(1.0, exponent).value(_VIEW, _VIEW, _VIEW))


def _groups(normal: np.ndarray) -> list[np.ndarray]:
    """Indices of normals that are close to each other."""
    cells = np.round(normal * _CELLS).astype(int) @ np.array([1, 100, 10000])
    order = np.argsort(cells, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(cells[order])) + 1) if len(order) else []
    return [group[k : k + _BLOCK] for group in groups for k in range(0, len(group), _BLOCK)]
