"""The optimal light direction: the single distant light that best explains a decomposition (thesis,
figure 4.49).

Problem: the recovered light comes from all directions; an artist, or a renderer, needs one.

Equations, summed over the pixels' normals n and the channels c, with a robust rho(r) = 2 s^2
(sqrt(1 + (r / s)^2) - 1): shading      min over l, E, A of  rho(S_c(n) - E_c / pi max(0, n . l) -
A_c), specular     min over l, E, p of  rho(S_c(n) - E_c f(n; l, p) max(0, n . l)),  f the
normalised Blinn-Phong lobe of the half vector. All directions of a grid are tried, E and A in
closed form; the best are refined by least squares.

The cone: the 68 % standard error of the direction where it is largest, from the sandwich H^-1
(sum_b g_b g_b^T) H^-1 with H the curvature and g_b the gradient summed over a block of neighbouring
pixels: errors of shape and separation are correlated within a block, so that treating pixels as
independent would be far too optimistic. The share explained: 1 - (residual sum of squares) / (that
of a model without direction, which is a constant for the shading and zero for the highlight).

Citation: J. F. Blinn 1977, doi:10.1145/563858.563893; the sandwich of clustered errors: K.-Y.
Liang, S. L. Zeger, Biometrika 73 (1986), doi:10.1093/biomet/73.1.13. H. Akbar 2016.

Limits: the cone is the uncertainty under this model, and does not include errors of shape and
separation. One light; with a window and a lamp, the direction lies between them, and the share is
low.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..imaging.luminance import luminance, white_of
from ..numerics.least_squares import robust_least_squares, robust_loss
from ..numerics.linear import nonnegative_pair
from ..scene.decomposition import Decomposition
from ..scene.lobe_fit import LobeFit, LobeFitOutcome
from ..shading.brdf.blinn_phong import BlinnPhong
from ..shading.lights import VIEW, DirectionalLight, sphere_directions
from ..shading.perspective import far_view_normals
from ..shading.radiance import directional, radiance

_SAMPLES, _GRID, _BLOCKS = 3000, 600, 8
_EXPONENTS = (6.0, 25.0, 100.0, 400.0)
_STARTS = 3
_MAX_EXPONENT = 2000.0
# Normals at the silhouette are the least certain, and specular light there is mostly background.
_RIM = 0.25
_ROBUST = 0.2  # of the white: errors from here on count linearly
_MIN_SHARE, _MAX_CONE = 0.2, 30.0
# A lobe that explains at least this share of the specular light has its highlights where the photo
# has them; its lamp is used if it explains at least this fraction of the shading that the best
# direction explains.
_LOBE_EXPLAINS, _LAMP_EXPLAINS = 0.5, 0.8


@dataclass(frozen=True)
class DirectionEstimate:
    """The distant light that best explains a decomposition.

    Attributes
    ----------
    light : DirectionalLight
        The light.
    explained : float
        Share explained, in [0, 1].
    cone : float
        68 % interval of the direction, degrees.
    exponent : float or None
        Of the Blinn-Phong lobe, for the specular light.
    """

    light: DirectionalLight
    explained: float
    cone: float
    exponent: float | None = None

    @property
    def determined(self) -> bool:
        """Whether enough is explained, and the cone is well below a hemisphere."""
        return self.explained >= _MIN_SHARE and self.cone <= _MAX_CONE


@dataclass(frozen=True, eq=False)
class _Samples:
    """Pixels of the object: `normal`, `values` (N, 3), the `block` (N,) of each, and `scale`, the
    error above which the loss is linear.
    """

    normal: np.ndarray
    values: np.ndarray
    block: np.ndarray
    scale: float


def explain_shading(d: Decomposition) -> DirectionEstimate:
    """Find the distant light with ambient light that best explains the shading.

    Parameters
    ----------
    d : Decomposition
        The decomposition.

    Returns
    -------
    DirectionEstimate
        Without an exponent.
    """
    samples = _samples(d, d.shading)
    start = _best_lambert(samples)

    def model(light: np.ndarray, others: np.ndarray) -> np.ndarray:
        return np.maximum(samples.normal @ light, 0)[:, None] * others[:3] + others[3:]

    facing = np.maximum(samples.normal @ start, 0)
    design = np.stack([facing, np.ones_like(facing)], 1)
    first = np.maximum(np.linalg.lstsq(design, samples.values, rcond=None)[0], 1e-6 * samples.scale)
    light, others, cone = _refined(samples, model, start, np.concatenate(first), np.zeros(6))
    spread = np.square(samples.values - samples.values.mean(0)).sum()
    explained = _explained(samples, samples.values - model(light, others), spread)
    return DirectionEstimate(
        DirectionalLight(light, np.pi * others[:3], others[3:]),
        explained,
        cone if explained > 0 else 180.0,
    )


def share_explained(d: Decomposition, direction: np.ndarray) -> tuple[DirectionalLight, float]:
    """Fit the shading under a light of known direction.

    Parameters
    ----------
    d : Decomposition
        The decomposition.
    direction : (3,) ndarray
        Unit vector toward the light.

    Returns
    -------
    light : DirectionalLight
        The best light from that direction.
    explained : float
        Share of the shading that it explains, in [0, 1].
    """
    samples = _samples(d, d.shading)
    facing = np.maximum(samples.normal @ direction, 0)
    even = np.ones_like(facing)
    strength, ambient = np.transpose(
        [nonnegative_pair(facing, even, column) for column in samples.values.T]
    )
    error = samples.values - (facing[:, None] * strength + ambient)
    spread = np.square(samples.values - samples.values.mean(0)).sum()
    explained = _explained(samples, error, spread)
    return DirectionalLight(direction, np.pi * strength, ambient), explained


def lies_on_highlights(fit: LobeFit) -> bool:
    """Return whether a lobe's highlights coincide with the photo's, as after `isc refine`.

    Parameters
    ----------
    fit : LobeFit

    Returns
    -------
    bool
    """
    return fit.alpha is not None and bool(fit.lights) and fit.explained >= _LOBE_EXPLAINS


def main_light(d: Decomposition) -> DirectionEstimate:
    """Find the single distant light under which to render a decomposition.

    Parameters
    ----------
    d : Decomposition
        The decomposition.

    Returns
    -------
    DirectionEstimate
        The lobe's brightest lamp, so that highlights lie where the photo has them, if the lobe
        explains the specular layer and the lamp the shading, as after `isc refine`; otherwise the
        light that best explains the shading.
    """
    best, fit = explain_shading(d), d.brdf
    if fit is None or fit.direction is None or not lies_on_highlights(fit):
        return best
    light, explained = share_explained(d, np.asarray(fit.direction, float))
    if explained < _LAMP_EXPLAINS * best.explained:
        return best
    return DirectionEstimate(light, explained, fit.lights[0].cone)


def explain_specular(d: Decomposition) -> DirectionEstimate:
    """Find the distant light and the Blinn-Phong exponent that best explain the specular layer.

    If there is no specular light, or hardly any according to the lobe fit, the share explained is
    0: a light can be fitted to any two faint spots.

    Parameters
    ----------
    d : Decomposition
        The decomposition.

    Returns
    -------
    DirectionEstimate
        With the exponent.
    """
    samples = _samples(d, d.specular, _RIM, mirroring=True)
    if not samples.values.any() or (
        d.brdf is not None and d.brdf.outcome == LobeFitOutcome.NO_SPECULAR
    ):
        return DirectionEstimate(DirectionalLight(VIEW, np.zeros(3)), 0.0, 180.0, None)

    def model(light: np.ndarray, others: np.ndarray) -> np.ndarray:
        return lobe_light(samples.normal, light, float(np.exp(others[3])))[:, None] * others[:3]

    fits = []
    for light, exponent in _best_lobes(samples):
        lobe = lobe_light(samples.normal, light, exponent)
        strength = np.maximum(lobe @ samples.values / (lobe @ lobe), 1e-6 * samples.scale)
        others = np.append(strength, np.log(exponent))
        found = _refined(
            samples,
            model,
            light,
            others,
            np.array([0, 0, 0, np.log(1.0)]),
            np.array([np.inf] * 3 + [np.log(_MAX_EXPONENT)]),
        )
        error = model(*found[:2]) - samples.values
        fits.append((robust_loss(error, samples.scale), found))
    light, others, cone = min(fits, key=lambda fit: fit[0])[1]
    error = samples.values - model(light, others)
    explained = _explained(samples, error, np.square(samples.values).sum())
    estimate = DirectionalLight(light, others[:3])
    return DirectionEstimate(
        estimate, explained, cone if explained > 0 else 180.0, float(np.exp(others[3]))
    )


def lobe_light(normal: np.ndarray, light: np.ndarray, exponent: float) -> np.ndarray:
    """Compute the radiance of a lobe of strength 1 toward the viewer under a light of irradiance 1.

    Parameters
    ----------
    normal : (..., 3) ndarray
        Unit normals.
    light : (3,) ndarray
        Unit vector toward the light.
    exponent : float
        Blinn-Phong exponent.

    Returns
    -------
    (...) ndarray
        Radiance.
    """
    return radiance(BlinnPhong(1.0, exponent), normal, VIEW, directional(light, 1.0))[..., 0]


def _samples(
    d: Decomposition, layer: np.ndarray, rim: float = 0.0, *, mirroring: bool = False
) -> _Samples:
    """An even subset of the pixels; without those whose normal's z is below `rim`, unless these are
    most of them. With a camera, `mirroring` gives normals that mirror the same light to a viewer
    along z.
    """
    normals = d.normal if d.camera is None or not mirroring else far_view_normals(d.normal, d.view)
    inside = d.mask & (normals[..., 2] >= rim)
    rows, columns = np.nonzero(inside if inside.sum() > 0.2 * d.mask.sum() else d.mask)
    step = max(1, len(rows) // _SAMPLES)
    rows, columns = rows[::step], columns[::step]
    across, down = (
        _BLOCKS * (places - places.min()) // (np.ptp(places) + 1) for places in (columns, rows)
    )
    normal = normals[rows, columns].astype(float)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return _Samples(
        normal,
        layer[rows, columns].astype(float),
        down * _BLOCKS + across,
        _ROBUST * white_of(layer, d.mask),
    )


def _best_lambert(samples: _Samples) -> np.ndarray:
    """The grid direction with the smallest residual of the luminance, irradiance and ambient in
    closed form.
    """
    grid = sphere_directions(_GRID)
    facing = np.maximum(samples.normal @ grid.T, 0)
    facing -= facing.mean(0)
    level = luminance(samples.values)
    common = np.maximum(facing.T @ (level - level.mean()), 0)  # light is never negative
    gain = common**2 / np.maximum(np.square(facing).sum(0), 1e-9)
    return grid[int(np.argmax(gain))]


def _best_lobes(samples: _Samples) -> list[tuple[np.ndarray, float]]:
    """The lights and exponents with the smallest residual of the luminance, one for each exponent
    of the grid, strength in closed form.
    """
    half = sphere_directions(2 * _GRID)[:_GRID]
    lights = 2 * half[:, 2:] * half - VIEW
    facing = np.maximum(samples.normal @ half.T, 0) * (samples.normal @ lights.T > 0)
    level = luminance(samples.values)
    found = []
    for exponent in _EXPONENTS:
        lobe = facing**exponent * np.maximum(samples.normal @ lights.T, 0)
        gain = (level @ lobe) ** 2 / np.maximum(np.square(lobe).sum(0), 1e-12)
        found.append((float(gain.max()), lights[int(np.argmax(gain))], exponent))
    return [
        (light, exponent) for _, light, exponent in sorted(found, key=lambda one: -one[0])[:_STARTS]
    ]


Model = Callable[[np.ndarray, np.ndarray], np.ndarray]


def _refined(
    samples: _Samples,
    model: Model,
    light: np.ndarray,
    others: np.ndarray,
    low: np.ndarray,
    high: np.ndarray | float = np.inf,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Robust least squares over the direction and the other parameters, from a start: light (3,),
    parameters, cone in degrees.
    """
    bounds = (
        np.concatenate([[-1.0, -1.0], low]),
        np.concatenate([[1.0, 1.0], np.broadcast_to(high, others.shape)]),
    )
    for _ in range(2):  # again around the direction found, where the tangent plane is accurate
        plane = _tangents(light)

        def errors(
            x: np.ndarray, around: np.ndarray = light, plane: np.ndarray = plane
        ) -> np.ndarray:
            return (model(_moved(around, plane, x[:2]), x[2:]) - samples.values).reshape(-1)

        start = np.concatenate([[0.0, 0.0], np.clip(others, bounds[0][2:], bounds[1][2:])])
        found = robust_least_squares(errors, start, bounds, samples.scale)
        light, others = _moved(light, plane, found[:2]), found[2:]
    return light, others, _cone(errors, found, samples)


def _cone(errors: Callable[[np.ndarray], np.ndarray], x: np.ndarray, samples: _Samples) -> float:
    """Degrees: the largest standard error of the direction, from the curvature and the spread of
    the blocks' gradients.
    """
    steps = 1e-5 * np.maximum(np.abs(x), 1e-3)
    jacobian = np.stack(
        [(errors(x + h) - errors(x - h)) / (2 * h.sum()) for h in np.diag(steps)], 1
    )
    error = errors(x)
    weight = 1 / np.sqrt(1 + np.square(error / samples.scale))
    curvature = jacobian.T @ (weight[:, None] * jacobian)
    blocks = np.zeros((int(samples.block.max()) + 1, len(x)))
    np.add.at(blocks, np.repeat(samples.block, 3), (weight * error)[:, None] * jacobian)
    # The parameters' units differ with the exposure; the direction's curvature is of squared light.
    unit = np.sqrt(np.diag(curvature))
    unit = np.where(unit > 0, unit, 1)
    unit = unit[:, None] * unit
    inverse = np.linalg.pinv(curvature / unit, hermitian=True) / unit
    spread = (inverse @ (blocks.T @ blocks) @ inverse)[:2, :2]
    # A direction without effect has no curvature, and its error is unbounded.
    flat = np.linalg.eigvalsh(curvature[:2, :2])[0] <= 1e-12 * max(
        float(np.square(samples.values).sum()), 1e-300
    )
    return (
        180.0
        if flat
        else float(min(180.0, np.rad2deg(np.sqrt(max(np.linalg.eigvalsh(spread)[-1], 0)))))
    )


def _explained(samples: _Samples, error: np.ndarray, whole: float) -> float:
    """The share explained; 0 where the `whole` is rounding, whatever the exposure."""
    least = 1e-12 * max(error.size, 1) * (samples.scale / _ROBUST) ** 2
    return float(np.clip(1 - np.square(error).sum() / whole, 0, 1)) if whole > least else 0.0


def _tangents(direction: np.ndarray) -> np.ndarray:
    """Two unit vectors (2, 3) perpendicular to `direction` and to each other."""
    other = np.eye(3)[int(np.argmin(np.abs(direction)))]
    first = np.cross(direction, other)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(direction, first)])


def _moved(direction: np.ndarray, plane: np.ndarray, by: np.ndarray) -> np.ndarray:
    moved = direction + by @ plane
    return moved / np.linalg.norm(moved)
