"""One lobe under a few far lights, and the nonlinear least squares that fits it.

Equation: the specular light, mean over the channels, is

    s(n) = sum_k a_k y(n; l_k, alpha) + b F(n),        y of `response`, F the mirrored uniform sky,

over log a_k, log b, log alpha and the directions l_k, which move in their tangent planes. The loss is Charbonnier's,
sum_i w_i 2 (sqrt(1 + r_i^2) - 1), r_i = (s(n_i) - s_i) / sigma_i: quadratic for small errors, linear for large ones. Steps are
Levenberg-Marquardt's with re-weighting; the gradient is exact.

Citation: D. W. Marquardt, SIAM J. Appl. Math. 11(2) (1963), doi:10.1137/0111030; P. Charbonnier, L. Blanc-Feraud, G. Aubert, M. Barlaud,
IEEE TIP 6(2) (1997), doi:10.1109/83.551699.

Limits: a local search; where it starts matters.
"""

from dataclasses import dataclass, replace

import numpy as np

from .pixels import Pixels
from .response import LobeModel, respond, sky_response

ALPHAS = (0.004, 0.98)
_LOWEST_TILT = 0.2  # least z of the half vector: farther behind the object no light reaches what the viewer sees


@dataclass(frozen=True)
class Lamps:
    """K lights: unit `directions` (K, 3), log of `amplitudes` (K,), of `sky` and of `alpha`."""

    directions: np.ndarray
    log_amplitudes: np.ndarray
    log_sky: float
    log_alpha: float

    @property
    def alpha(self) -> float:
        """Of the lobe, the same under all lights."""
        return float(np.exp(self.log_alpha))

    @property
    def count(self) -> int:
        """K."""
        return len(self.directions)


@dataclass(frozen=True)
class Freedom:
    """What may move: the `directions`, `alpha`."""

    directions: bool = True
    alpha: bool = True


@dataclass(frozen=True)
class Fitted:
    """`lamps` at the minimum, its `loss`, the `residual` (N,) in sigmas, the `jacobian` (N, P) of it and the weights (N,) in force there.
    Columns: log amplitudes (K), log sky, log alpha if free, then two of each direction if free (`tangents`)."""

    lamps: Lamps
    loss: float
    residual: np.ndarray
    jacobian: np.ndarray
    weight: np.ndarray


def minimise(pixels: Pixels, model: LobeModel, start: Lamps, freedom: Freedom, steps: int = 40) -> Fitted:
    """The minimum near `start`; deterministic."""
    best = _measured(pixels, model, start, freedom)
    damping = 1e-2
    for _ in range(steps):
        scaled = best.jacobian * best.weight[:, None]
        curvature, gradient = scaled.T @ best.jacobian, scaled.T @ best.residual
        diagonal = np.diag(curvature)
        ridge = np.diag(damping * diagonal + 1e-9 * max(float(diagonal.max()), 1e-300) + 1e-300)
        step = -np.linalg.solve(curvature + ridge, gradient)
        tried = _measured(pixels, model, _moved(best.lamps, step, freedom), freedom)
        if tried.loss < best.loss:
            small = best.loss - tried.loss < 1e-7 * best.loss
            best, damping = tried, max(damping / 5, 1e-7)
            if small:
                break
        else:
            damping *= 6
            if damping > 1e6:
                break
    return best


def predicted(model: LobeModel, lamps: Lamps, normal: np.ndarray) -> np.ndarray:
    """(K + 1, N): each light's part of the specular light, then the sky's."""
    parts = [np.exp(a) * respond(model, normal, d, lamps.alpha).value for d, a in zip(lamps.directions, lamps.log_amplitudes, strict=True)]
    return np.stack([*parts, np.exp(lamps.log_sky) * sky_response(normal)])


def tangents(direction: np.ndarray) -> np.ndarray:
    """Two unit vectors (2, 3) across a unit direction and each other."""
    axis = np.eye(3)[int(np.argmin(np.abs(direction)))]
    first = np.cross(direction, axis)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(direction, first)])


def _measured(pixels: Pixels, model: LobeModel, lamps: Lamps, freedom: Freedom) -> Fitted:
    columns, by_alpha, turns = [], np.zeros(len(pixels.value)), []
    for direction, log_amplitude in zip(lamps.directions, lamps.log_amplitudes, strict=True):
        answer = respond(model, pixels.normal, direction, lamps.alpha)
        amplitude = np.exp(log_amplitude)
        columns.append(amplitude * answer.value)
        by_alpha += amplitude * answer.by_log_alpha
        if freedom.directions:
            turns += list((amplitude * answer.by_light @ tangents(direction).T).T)
    columns.append(np.exp(lamps.log_sky) * sky_response(pixels.normal))
    left = (np.sum(columns, axis=0) - pixels.value) / pixels.sigma
    jacobian = np.stack([*columns, *([by_alpha] if freedom.alpha else []), *turns], axis=1) / pixels.sigma[:, None]
    silent = pixels.clipped & (left > 0)
    left = np.where(silent, 0, left)
    root = np.sqrt(1 + left**2)
    loss = float(pixels.weight @ (2 * (root - 1)))
    return Fitted(lamps, loss, left, jacobian, np.where(silent, 0, pixels.weight / root))


def _moved(lamps: Lamps, step: np.ndarray, freedom: Freedom) -> Lamps:
    count = lamps.count
    step = np.clip(step, -1.5, 1.5)
    log_alpha, at = lamps.log_alpha, count + 1
    if freedom.alpha:
        log_alpha, at = float(np.clip(log_alpha + np.clip(step[at], -0.7, 0.7), *np.log(ALPHAS))), at + 1
    directions = lamps.directions
    if freedom.directions:
        directions = np.stack([_turned(d, np.clip(step[at + 2 * k : at + 2 * k + 2], -0.4, 0.4)) for k, d in enumerate(directions)])
    amplitudes = np.clip(lamps.log_amplitudes + step[:count], -200, 200)
    sky = float(np.clip(lamps.log_sky + step[count], -200, 200))
    return replace(lamps, directions=directions, log_amplitudes=amplitudes, log_sky=sky, log_alpha=log_alpha)


def _turned(direction: np.ndarray, step: np.ndarray) -> np.ndarray:
    moved = direction + step @ tangents(direction)
    moved /= np.linalg.norm(moved)
    lowest = 2 * _LOWEST_TILT**2 - 1
    if moved[2] < lowest:
        flat = moved[:2] / max(float(np.linalg.norm(moved[:2])), 1e-12)
        moved = np.array([*(np.sqrt(1 - lowest**2) * flat), lowest])
    return moved
