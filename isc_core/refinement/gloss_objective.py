"""The objective of lamps, lobe and shape change.

Equation: with slopes p0 + dz/dr, q0 + dz/dc of the height, z the bumps of u (`height_bumps`), and
normals n of these slopes, the gloss is G = sum_k E_k f(n, l_k; alpha), f the GGX lobe with its
cosine. A separator returns only light above an unknown level b, so s ~ max(G - b, 0), softened:

    F = w sum_p 2 (sqrt(1 + r_p^2) - 1) + (|u|^2 + (log(alpha / alpha_0) / .28)^2
        + (max(log(sum E / E*), 0) / .3)^2 + (log(b / b_0) / .5)^2) / 2
        + log(1 + |l_0 - l*|^2 / (2 c^2)),
    r = (max(G - b, 0) - s) / sqrt((.03 P)^2 + (.15 s)^2)

P is the peak of s, l* the light of the initial lobe, alpha_0 its roughness, E* its irradiance
according to the shading (`lobe_fitting.specular_level`): a greater strength would exceed the gloss
of plastic. At clipped pixels, only too little gloss is penalised. w < 1, since errors of
neighbouring pixels are correlated. Gradients are exact.

Citation: B. Walter et al., EGSR 2007, doi:10.2312/EGWR/EGSR07/195-206. P. Charbonnier et al. 1997,
doi:10.1109/83.551699 (the loss).

Limits: distant, small lamps: the size of a lamp, the roughness and a lower curvature all widen a
highlight, so that the width is mostly determined by the prior of alpha. No shadows.
"""

from dataclasses import dataclass

import numpy as np

from ..lobe_fitting.response import respond
from ..shading.surface_stencils import (
    FIRST_DOWN,
    FIRST_RIGHT,
    derivative,
    derivative_adjoint,
)
from .height_bumps import HeightBumps

ROUGHNESS_SPREAD = 0.28  # of log alpha, from `lobe_fitting.recovered`
_WEIGHT = 0.05
_FLOOR, _RELATIVE = 0.03, 0.15
_CONE = 0.05  # radians, 3 degrees; a heavy tail, as one of four predicted lamps is over 10 off
_TOO_BRIGHT, _LEVEL_SPREAD = 0.3, 0.5
_LEVEL = 0.02  # b_0 over P
_SOFT = 0.02  # of P
_ALPHAS = (0.02, 0.9)
_LOG_STRENGTHS = (-60.0, 30.0)


@dataclass(frozen=True, eq=False)
class GlossData:
    """The data to which the gloss is fitted, at a working scale.

    Attributes
    ----------
    specular : (N,) ndarray
        Mean of the channels, at the pixels of the mask.
    clipped : (N,) ndarray of bool
        Where `specular` is a lower bound.
    weight : (N,) ndarray
        0 for held-out pixels.
    down, right : (H, W) ndarray
        Slopes of the recovered height along rows and columns.
    mask : (H, W) ndarray of bool
        The object.
    alpha : float
        alpha_0.
    direction : (3,) ndarray
        l*.
    irradiance : float
        E*.
    """

    specular: np.ndarray
    clipped: np.ndarray
    weight: np.ndarray
    down: np.ndarray
    right: np.ndarray
    mask: np.ndarray
    alpha: float
    direction: np.ndarray
    irradiance: float

    @property
    def peak(self) -> float:
        """P: the mean of the five brightest pixels."""
        return float(np.sort(self.specular)[-5:].mean())

    @property
    def log_level(self) -> float:
        """log b_0."""
        return float(np.log(_LEVEL * self.peak))


@dataclass(frozen=True, eq=False)
class Gloss:
    """Lamps, lobe and shape change.

    Attributes
    ----------
    bumps : (B,) ndarray
        u.
    directions : (K, 3) ndarray
        Of any length > 0.
    log_strengths : (K,) ndarray
        log E.
    log_alpha, log_level : float
        Of the roughness, and of b.
    """

    bumps: np.ndarray
    directions: np.ndarray
    log_strengths: np.ndarray
    log_alpha: float
    log_level: float

    @property
    def alpha(self) -> float:
        """Roughness."""
        return float(np.exp(np.clip(self.log_alpha, *np.log(_ALPHAS))))

    @property
    def level(self) -> float:
        """b."""
        return float(np.exp(np.clip(self.log_level, -30, 5)))

    @property
    def strengths(self) -> np.ndarray:
        """E (K,), clipped: a line search may try extreme values."""
        return np.exp(np.clip(self.log_strengths, *_LOG_STRENGTHS))

    @property
    def units(self) -> np.ndarray:
        """Unit vectors (K, 3) toward the lamps."""
        return np.asarray(self.directions / np.linalg.norm(self.directions, axis=1, keepdims=True))

    def packed(self) -> np.ndarray:
        """Return all unknowns as one vector."""
        last = [self.log_alpha, self.log_level]
        return np.concatenate([self.bumps, self.directions.ravel(), self.log_strengths, last])

    @staticmethod
    def unpacked(x: np.ndarray, bumps: int) -> "Gloss":
        """Return the gloss of a vector of unknowns, of which the first `bumps` are u.

        Parameters
        ----------
        x : (bumps + 4 K + 2,) ndarray
        bumps : int

        Returns
        -------
        Gloss
        """
        count = (len(x) - bumps - 2) // 4
        first, last = bumps + 3 * count, bumps + 4 * count
        directions = x[bumps:first].reshape(count, 3)
        return Gloss(x[:bumps], directions, x[first:last], float(x[-2]), float(x[-1]))


def normals_from_slopes(down: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Compute unit normals, camera frame, from slopes along rows and columns.

    Parameters
    ----------
    down, right : (...) ndarray

    Returns
    -------
    (..., 3) ndarray
    """
    steep = np.stack([-right, down, np.ones_like(down)], axis=-1)
    return np.asarray(steep / np.linalg.norm(steep, axis=-1, keepdims=True))


def height_slopes(height: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute the slopes of a height with the stencils of a result's normals.

    Parameters
    ----------
    height : (H, W) ndarray

    Returns
    -------
    down, right : (H, W) ndarray
    """
    padded = np.pad(height, 1, mode="edge")
    return derivative(padded, FIRST_DOWN), derivative(padded, FIRST_RIGHT)


def rendered(gloss: Gloss, normal: np.ndarray) -> np.ndarray:
    """Compute G.

    Parameters
    ----------
    gloss : Gloss
    normal : (N, 3) ndarray
        Unit normals for a viewer along z.

    Returns
    -------
    (N,) ndarray
    """
    total = np.zeros(len(normal))
    for direction, strength in zip(gloss.units, gloss.strengths, strict=True):
        total += strength * respond("ggx", normal, direction, gloss.alpha).value
    return total


def thresholded(gloss: Gloss, light: np.ndarray, peak: float) -> np.ndarray:
    """Compute the light of a gloss that a separator returns, max(G - b, 0), softened.

    Parameters
    ----------
    gloss : Gloss
    light : (N,) ndarray
        G.
    peak : float
        P.

    Returns
    -------
    (N,) ndarray
    """
    over = light - gloss.level
    return np.asarray(0.5 * (over + np.sqrt(over**2 + (_SOFT * peak) ** 2)))


class GlossObjective:
    """F as a function for `numerics.lbfgs`: ``(x, gradient_out) -> loss``.

    Parameters
    ----------
    data : GlossData
    bumps : HeightBumps or None
        None keeps the shape.
    """

    def __init__(self, data: GlossData, bumps: HeightBumps | None) -> None:
        self._data, self._bumps = data, bumps
        self._size = 0 if bumps is None else bumps.size
        self._sigma = np.sqrt((_FLOOR * data.peak) ** 2 + (_RELATIVE * data.specular) ** 2)

    @property
    def weight(self) -> np.ndarray:
        """Weights (N,) of the pixels."""
        return self._data.weight

    def __call__(self, x: np.ndarray, gradient: np.ndarray) -> float:
        gloss = Gloss.unpacked(x, self._size)
        normal = normals_from_slopes(*self._slopes(gloss.bumps))[self._data.mask]
        responses = [respond("ggx", normal, light, gloss.alpha) for light in gloss.units]
        strengths = gloss.strengths
        light = np.zeros(len(normal))
        for strength, response in zip(strengths, responses, strict=True):
            light += strength * response.value
        cost, by_light, by_level = self._misfit(gloss, light)
        gradient[:] = 0
        _, to_direction, to_strength, to_last = self._parts(gradient, len(strengths))
        by_normal = np.zeros_like(normal)
        lengths = np.linalg.norm(gloss.directions, axis=1)
        for k, (strength, response) in enumerate(zip(strengths, responses, strict=True)):
            scaled = strength * by_light
            to_strength[k] = (scaled * response.value).sum()
            to_last[0] += (scaled * response.by_log_alpha).sum()
            along = np.einsum("n,nk->k", scaled, response.by_light)
            unit = gloss.units[k]
            to_direction[k] = (along - (along * unit).sum() * unit) / lengths[k]
            by_normal += scaled[:, None] * response.by_normal
        to_last[1] = by_level
        if self._bumps is not None:
            gradient[: self._size] = self._to_bumps(normal, by_normal) + gloss.bumps
        return cost + self._prior(gloss, gradient) + 0.5 * float(np.square(gloss.bumps).sum())

    def without_gloss(self) -> float:
        """Return the misfit without gloss."""
        return _WEIGHT * float((self._data.weight * _loss(self._data.specular / self._sigma)).sum())

    def _slopes(self, bumps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        data = self._data
        if self._bumps is None:
            return data.down, data.right
        down, right = height_slopes(self._bumps.height(bumps))
        return data.down + down, data.right + right

    def _misfit(self, gloss: Gloss, light: np.ndarray) -> tuple[float, np.ndarray, float]:
        """The first term, and its derivatives with respect to G (N,) and log b."""
        data = self._data
        over = light - gloss.level
        root = np.sqrt(over**2 + (_SOFT * data.peak) ** 2)
        error = (0.5 * (over + root) - data.specular) / self._sigma
        error = np.where(data.clipped & (error > 0), 0, error)
        scale = _WEIGHT * data.weight
        slope = scale * 2 * error / np.sqrt(1 + error**2) / self._sigma * 0.5 * (1 + over / root)
        return float((scale * _loss(error)).sum()), slope, -gloss.level * float(slope.sum())

    def _prior(self, gloss: Gloss, gradient: np.ndarray) -> float:
        data = self._data
        _, to_direction, to_strength, to_last = self._parts(gradient, len(gloss.log_strengths))
        rough = (gloss.log_alpha - np.log(data.alpha)) / ROUGHNESS_SPREAD
        level = (gloss.log_level - data.log_level) / _LEVEL_SPREAD
        to_last += (rough / ROUGHNESS_SPREAD, level / _LEVEL_SPREAD)
        strengths = gloss.strengths
        bright = max(float(np.log(strengths.sum() / data.irradiance)), 0.0) / _TOO_BRIGHT
        to_strength += bright / _TOO_BRIGHT * strengths / strengths.sum()
        unit = gloss.units[0]
        turn = (unit - data.direction) / _CONE
        tail = 1 + 0.5 * float((turn * turn).sum())
        along = turn / (_CONE * tail)
        to_direction[0] += (along - (along * unit).sum() * unit) / np.linalg.norm(
            gloss.directions[0]
        )
        return 0.5 * float(rough**2 + level**2 + bright**2) + float(np.log(tail))

    def _parts(
        self, gradient: np.ndarray, count: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Views of the gradient: of the bumps, directions (K, 3), strengths, alpha and level."""
        first, last = self._size + 3 * count, self._size + 4 * count
        directions = gradient[self._size : first].reshape(count, 3)
        return gradient[: self._size], directions, gradient[first:last], gradient[last:]

    def _to_bumps(self, normal: np.ndarray, by_normal: np.ndarray) -> np.ndarray:
        assert self._bumps is not None
        mask = self._data.mask
        # d normal = (d steep - n (n . d steep)) / |steep|, and 1 / |steep| = n_z
        across = by_normal - (by_normal * normal).sum(axis=1, keepdims=True) * normal
        across *= normal[:, 2:]
        down, right = np.zeros(mask.shape), np.zeros(mask.shape)
        down[mask], right[mask] = across[:, 1], -across[:, 0]
        return self._bumps.adjoint(
            derivative_adjoint(down, FIRST_DOWN) + derivative_adjoint(right, FIRST_RIGHT)
        )


def _loss(error: np.ndarray) -> np.ndarray:
    return np.asarray(2 * (np.sqrt(1 + error**2) - 1))
