"""One lobe under a few lights, and the nonlinear least squares that fits it.

Equation: the specular light, mean over the channels, at the position p (in radii of the object from
its centre) is

    s(n, p) = sum_k a_k y(n; l, alpha) / |v|^2 + b,    v = l_k - q_k p,  l = v / |v|,

y of `response`, with the unknowns log a_k, log alpha, the base b, the directions l_k, which are
updated in their tangent planes, and the nearness q_k >= 0 (0: infinitely far; otherwise 1 / q radii
from the centre). The base is a mirrored smooth environment map, sum_j c_j B_j(n), see
`mirrored_basis`; or, for the image of a separator, -c: it contains highlights only above an unknown
level, so the image is max(0, s). The loss is Charbonnier's, sum_i w_i 2 (sqrt(1 + r_i^2) - 1), r_i
= (s - s_i) / sigma_i: quadratic for small errors, linear for large ones. Steps are
Levenberg-Marquardt's with re-weighting; gradients are exact.

Citation: D. W. Marquardt, SIAM J. Appl. Math. 11(2) (1963), doi:10.1137/0111030; P. Charbonnier, L.
Blanc-Feraud, G. Aubert, M. Barlaud, IEEE TIP 6(2) (1997), doi:10.1109/83.551699.

Limits: a local search; its start matters.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..scene.lobe_fit import LobeModel
from .pixels import Pixels
from .response import mirrored_basis, respond

ALPHAS = (0.004, 0.98)
_MAX_NEARNESS = 0.6
# Smallest z of the half vector: light from farther behind reaches no visible surface.
_LOWEST_TILT = 0.2
_TYPICAL_LEVEL, _LEVEL_SPREAD, _LEVEL_WEIGHT = (
    0.15,
    0.7,
    20.0,
)  # prior of a separator's level, as a share of the peak
_TYPICAL_MIRRORED, _MIRRORED_WEIGHT = (
    0.1,
    0.1,
)  # weak prior of the mirrored map, as a share of the peak
_TYPICAL_NEARNESS, _NEARNESS_WEIGHT = (
    0.3,
    0.1,
)  # weak prior of q, for images that do not determine it


@dataclass(frozen=True, eq=False)
class Lamps:
    """K lights and a lobe.

    Attributes
    ----------
    directions : (K, 3) ndarray
        Unit vectors toward the lights.
    nearness : (K,) ndarray
        q.
    log_amplitudes : (K,) ndarray
        log a.
    base : (B,) ndarray
        c.
    log_alpha : float
        Log of the lobe's roughness.
    """

    directions: np.ndarray
    nearness: np.ndarray
    log_amplitudes: np.ndarray
    base: np.ndarray
    log_alpha: float

    @property
    def alpha(self) -> float:
        """The lobe's roughness, the same under all lights."""
        return float(np.exp(self.log_alpha))

    @property
    def count(self) -> int:
        """K."""
        return len(self.directions)


@dataclass(frozen=True)
class Problem:
    """The data of a fit, and its free parameters.

    Attributes
    ----------
    pixels : Pixels
        The fitted pixels.
    model : {"ggx", "blinn_phong"}
        The lobe.
    thresholded : bool
        The base is a separator's level.
    directions, nearness, alpha : bool
        Which parameters are free.
    """

    pixels: Pixels
    model: LobeModel
    thresholded: bool = False
    directions: bool = True
    nearness: bool = False
    alpha: bool = True

    def basis(self, normal: np.ndarray) -> np.ndarray:
        """Return the basis of the base.

        Parameters
        ----------
        normal : (N, 3) ndarray
            Unit normals.

        Returns
        -------
        (B, N) ndarray
            -1 for a separator's level (B = 1), `mirrored_basis` otherwise.
        """
        return -np.ones((1, len(normal))) if self.thresholded else mirrored_basis(normal)


@dataclass(frozen=True, eq=False)
class Fitted:
    """A minimum.

    Attributes
    ----------
    lamps : Lamps
        Parameters there.
    loss : float
        The loss there.
    residual : (N,) ndarray
        In sigmas.
    jacobian : (N, P) ndarray
        Of the residual. Columns: log amplitudes (K), base (B), log alpha if free, two of each
        direction if free (`tangents`), nearness (K) if free.
    weight : (N,) ndarray
        Weights in effect there.
    """

    lamps: Lamps
    loss: float
    residual: np.ndarray
    jacobian: np.ndarray
    weight: np.ndarray


def minimise(problem: Problem, start: Lamps, steps: int = 40) -> Fitted:
    """Find the local minimum near a start; deterministic.

    Parameters
    ----------
    problem : Problem
        Data and free parameters.
    start : Lamps
        The start.
    steps : int, optional
        Maximum number of steps.

    Returns
    -------
    Fitted
        The minimum.
    """
    best = evaluate(problem, start)
    damping = 1e-2
    for _ in range(steps):
        curvature, gradient = _normal_equations(problem, best)
        diagonal = np.diag(curvature)
        ridge = np.diag(damping * diagonal + 1e-9 * max(float(diagonal.max()), 1e-300) + 1e-300)
        trial = evaluate(
            problem,
            step_parameters(best.lamps, -np.linalg.solve(curvature + ridge, gradient), problem),
        )
        if trial.loss < best.loss:
            small = best.loss - trial.loss < 1e-7 * best.loss
            best, damping = trial, max(damping / 5, 1e-7)
            if small:
                break
        else:
            damping *= 6
            if damping > 1e6:
                break
    return best


def contributions(
    model: LobeModel, lamps: Lamps, normal: np.ndarray, position: np.ndarray
) -> np.ndarray:
    """Return each light's contribution to the specular light.

    Parameters
    ----------
    model : {"ggx", "blinn_phong"}
        The lobe.
    lamps : Lamps
    normal : (N, 3) ndarray
        Unit normals.
    position : (N, 3) ndarray
        In radii of the object from its centre.

    Returns
    -------
    (K, N) ndarray
        Without the base.
    """
    parts = []
    for direction, near, log_amplitude in zip(
        lamps.directions, lamps.nearness, lamps.log_amplitudes, strict=True
    ):
        light, length = light_directions(direction, near, position)
        parts.append(
            np.exp(log_amplitude) * respond(model, normal, light, lamps.alpha).value / length**2
        )
    return np.stack(parts)


def predicted(
    problem: Problem, lamps: Lamps, normal: np.ndarray, position: np.ndarray
) -> np.ndarray:
    """Return the mean specular light of the channels.

    Parameters
    ----------
    problem : Problem
        Its model and base; its pixels are not used.
    lamps : Lamps
    normal : (N, 3) ndarray
        Unit normals.
    position : (N, 3) ndarray
        In radii of the object from its centre.

    Returns
    -------
    (N,) ndarray
        Not negative.
    """
    total = contributions(problem.model, lamps, normal, position).sum(
        axis=0
    ) + lamps.base @ problem.basis(normal)
    return np.maximum(total, 0)


def light_directions(
    direction: np.ndarray, nearness: float, position: np.ndarray
) -> tuple[np.ndarray, np.ndarray | float]:
    """Compute the directions toward a light.

    Parameters
    ----------
    direction : (3,) ndarray
        Unit direction from the centre of the object.
    nearness : float
        q; 0 for a distant light.
    position : (N, 3) ndarray
        Positions.

    Returns
    -------
    light : (3,) or (N, 3) ndarray
        Unit directions toward the light.
    length : float or (N,) ndarray
        Its distance over that from the centre.
    """
    if nearness == 0:
        return direction, 1.0
    toward = direction - nearness * position
    length = np.maximum(np.sqrt((toward * toward).sum(axis=1)), 1e-6)
    return toward / length[:, None], length


def tangents(direction: np.ndarray) -> np.ndarray:
    """Return two unit vectors perpendicular to a unit direction and to each other.

    Duff et al., JCGT 6(1), 2017 (no DOI).

    Parameters
    ----------
    direction : (3,) ndarray

    Returns
    -------
    (2, 3) ndarray
    """
    x, y, z = direction
    # Divided by 1 + |z|, which is never near 0.
    sign = 1.0 if z >= 0 else -1.0
    a = -1 / (sign + z)
    b = x * y * a
    return np.array([[1 + sign * x * x * a, sign * b, -sign * x], [b, sign + y * y * a, -y]])


def evaluate(problem: Problem, lamps: Lamps) -> Fitted:
    """Compute residuals, their Jacobian and the loss at given parameters.

    Parameters
    ----------
    problem : Problem
    lamps : Lamps

    Returns
    -------
    Fitted
    """
    pixels, columns, by_direction, by_nearness = problem.pixels, [], [], []
    by_alpha = np.zeros(len(pixels.value))
    for direction, near, log_amplitude in zip(
        lamps.directions, lamps.nearness, lamps.log_amplitudes, strict=True
    ):
        light, length = light_directions(direction, near, pixels.position)
        response = respond(problem.model, pixels.normal, light, lamps.alpha)
        scale = np.exp(log_amplitude) / length**2
        columns.append(scale * response.value)
        by_alpha += scale * response.by_log_alpha
        if problem.directions or problem.nearness:
            along = (response.by_light * light).sum(axis=1) + 2 * response.value
            by_toward = (response.by_light - along[:, None] * light) * (
                np.ones(1) * scale / length
            )[:, None]
            by_direction += (
                list((by_toward @ tangents(direction).T).T) if problem.directions else []
            )
            by_nearness += [-(by_toward * pixels.position).sum(axis=1)] if problem.nearness else []
    basis = problem.basis(pixels.normal)
    total = np.sum(columns, axis=0) + lamps.base @ basis
    residual = (total - pixels.value) / pixels.sigma
    jacobian = (
        np.stack(
            [*columns, *basis, *([by_alpha] if problem.alpha else []), *by_direction, *by_nearness],
            axis=1,
        )
        / pixels.sigma[:, None]
    )
    inactive = pixels.clipped & (residual > 0)
    if problem.thresholded:
        inactive |= (pixels.value <= pixels.dark) & (total < pixels.value)
    residual = np.where(inactive, 0, residual)
    root = np.sqrt(1 + residual**2)
    loss = float(pixels.weight @ (2 * (root - 1))) + sum(_priors(problem, lamps)[0])
    return Fitted(lamps, loss, residual, jacobian, np.where(inactive, 0, pixels.weight / root))


def _priors(problem: Problem, lamps: Lamps) -> tuple[list[float], np.ndarray, np.ndarray]:
    """Weak priors: their losses, and half of their gradients and curvatures, ordered like the
    columns of the Jacobian.
    """
    count = lamps.count
    direction_count = 2 * count if problem.directions else 0
    size = (
        count
        + len(lamps.base)
        + int(problem.alpha)
        + direction_count
        + (count if problem.nearness else 0)
    )
    gradient, curvature, losses = np.zeros(size), np.zeros(size), []
    if problem.thresholded:
        deviation, slope = (
            np.log(lamps.base[0] / (_TYPICAL_LEVEL * problem.pixels.peak)) / _LEVEL_SPREAD,
            1 / (_LEVEL_SPREAD * lamps.base[0]),
        )
        losses.append(_LEVEL_WEIGHT * float(deviation) ** 2)
        gradient[count], curvature[count] = (
            _LEVEL_WEIGHT * deviation * slope,
            _LEVEL_WEIGHT * slope**2,
        )
    else:
        typical = _TYPICAL_MIRRORED * problem.pixels.peak
        losses.append(_MIRRORED_WEIGHT * float(np.square(lamps.base / typical).sum()))
        gradient[count : count + len(lamps.base)] = _MIRRORED_WEIGHT * lamps.base / typical**2
        curvature[count : count + len(lamps.base)] = _MIRRORED_WEIGHT / typical**2
    if problem.nearness:
        losses.append(_NEARNESS_WEIGHT * float(np.square(lamps.nearness / _TYPICAL_NEARNESS).sum()))
        gradient[-count:] = _NEARNESS_WEIGHT * lamps.nearness / _TYPICAL_NEARNESS**2
        curvature[-count:] = _NEARNESS_WEIGHT / _TYPICAL_NEARNESS**2
    return losses, gradient, curvature


def _normal_equations(problem: Problem, fitted: Fitted) -> tuple[np.ndarray, np.ndarray]:
    _, gradient, curvature = _priors(problem, fitted.lamps)
    return weighted_product(fitted.jacobian, fitted.weight, fitted.jacobian) + np.diag(curvature), (
        weighted_product(fitted.jacobian, fitted.weight, fitted.residual[:, None])[:, 0] + gradient
    )


def weighted_product(left: np.ndarray, weight: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Compute sum_n left_ni weight_n right_nj.

    Without BLAS, whose threads take longer to start than the product of a few columns.

    Parameters
    ----------
    left : (N, P) ndarray
    weight : (N,) ndarray
    right : (N, Q) ndarray

    Returns
    -------
    (P, Q) ndarray
    """
    return np.einsum("ni,nj->ij", left * weight[:, None], right)


def step_parameters(lamps: Lamps, step: np.ndarray, problem: Problem) -> Lamps:
    """Update the parameters by a step, within their bounds.

    Parameters
    ----------
    lamps : Lamps
    step : (P,) ndarray
        In the order of the columns of the Jacobian.
    problem : Problem

    Returns
    -------
    Lamps
    """
    count = lamps.count
    log_alpha, at = lamps.log_alpha, count + len(lamps.base)
    if problem.alpha:
        log_alpha, at = (
            float(np.clip(log_alpha + np.clip(step[at], -0.7, 0.7), *np.log(ALPHAS))),
            at + 1,
        )
    directions, nearness = lamps.directions, lamps.nearness
    if problem.directions:
        directions = np.stack(
            [
                _rotated(d, np.clip(step[at + 2 * k : at + 2 * k + 2], -0.4, 0.4))
                for k, d in enumerate(directions)
            ]
        )
    if problem.nearness:
        # Not exactly 0, where the light would be treated as infinitely far, without a derivative.
        nearness = np.clip(nearness + np.clip(step[-count:], -0.15, 0.15), 1e-6, _MAX_NEARNESS)
    amplitudes = np.clip(lamps.log_amplitudes + np.clip(step[:count], -1.5, 1.5), -200, 200)
    base = lamps.base + step[count : count + len(lamps.base)]
    if problem.thresholded:
        base = np.clip(base, lamps.base / 3, lamps.base * 3)
    return replace(
        lamps,
        directions=directions,
        nearness=nearness,
        log_amplitudes=amplitudes,
        base=base,
        log_alpha=log_alpha,
    )


def _rotated(direction: np.ndarray, step: np.ndarray) -> np.ndarray:
    moved = direction + step @ tangents(direction)
    moved /= np.linalg.norm(moved)
    lowest = 2 * _LOWEST_TILT**2 - 1
    if moved[2] < lowest:
        flat = moved[:2] / max(float(np.linalg.norm(moved[:2])), 1e-12)
        moved = np.array([*(np.sqrt(1 - lowest**2) * flat), lowest])
    return moved
