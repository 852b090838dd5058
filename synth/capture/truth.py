"""A rendered scene with the ground truth of all quantities that a decomposition estimates.

Equation, at each pixel inside the mask: image = diffuse + specular + residual, diffuse =
reflectance * shading. Position, normal and reflectance come from one ray through the pixel's centre
(`scene.surface`), radiance from one render with separate lobes (`rendering`). The sensor's effect
on the image (clipping, noise, quantisation) is the residual (`sensor`).

Rendered shading is not exp(SH(normal)): `illumination` is the best-fitting light of that form, and
`light_fit_residual` the misfit. The fit maximises sum(shading log(model) - model), Poisson
regression with a logarithmic link, which tolerates black shadows.

Citation: P. McCullagh, J. A. Nelder, "Generalized linear models", 2nd edition (1989),
doi:10.1201/9780203753736 (the fit).

Limits: those of `scene.surface` and `rendering`. The fitted light is unconstrained for normals that
do not occur; a ridge keeps it bounded.
"""

from dataclasses import dataclass, fields, replace

import numpy as np

from isc_core.numerics.linear import solve_linear
from isc_core.progress import Monitor
from isc_core.shading.spherical_harmonics import real_sh

from ..rendering import RenderOptions, light_surface
from ..scene.lights import lights_as_environment, scaled
from ..scene.scene import Scene
from ..scene.surface import Surface, find_surface
from ..scene.tracing import Tracer

ENVIRONMENT_ROWS = 64
_FIT_STEPS = 30
_RIDGE = 1e-4  # of the mean curvature, on all coefficients but the constant one
_DARKEST = 1e-6  # of the mean shading


@dataclass(frozen=True, eq=False)
class GroundTruth:
    """Maps of the whole frame, float32, row 0 at the top; outside the mask they are 0 and the
    normal is (0, 0, 1).

    Attributes
    ----------
    image, diffuse, specular, residual, reflectance, shading : (H, W, 3) ndarray
        Linear Rec.709.
    normal : (H, W, 3) ndarray
        Unit, x right, y up, z toward the viewer.
    height : (H, W) ndarray
        Pixels toward the viewer.
    mask : (H, W) ndarray of bool
        The object.
    strength, gloss : (H, W) ndarray
        Of the material's specular lobe, see `scene.materials`.
    shading_variance, specular_variance : (H, W, 3) ndarray
        Of the Monte Carlo estimates.
    illumination : (9, 3) ndarray
        Fitted coefficients of log shading, camera frame.
    light_fit_residual : float
        RMS of shading minus its fit, relative to the RMS of shading.
    environment : (rows, 2 rows, 3) ndarray
        All lights as seen from the origin, laid out as in `isc_core.shading.environment_map`.
    """

    image: np.ndarray
    diffuse: np.ndarray
    specular: np.ndarray
    residual: np.ndarray
    reflectance: np.ndarray
    shading: np.ndarray
    normal: np.ndarray
    height: np.ndarray
    mask: np.ndarray
    strength: np.ndarray
    gloss: np.ndarray
    shading_variance: np.ndarray
    specular_variance: np.ndarray
    illumination: np.ndarray
    light_fit_residual: float
    environment: np.ndarray

    def brightened(self, gain: float) -> "GroundTruth":
        """Return the same scene with all its lights brightened by a factor.

        Parameters
        ----------
        gain : float
            Factor of all lights, > 0.

        Returns
        -------
        GroundTruth
            Variances are multiplied by the square of `gain`; reflectance and shape are unchanged.
        """
        maps = ("image", "diffuse", "specular", "residual", "shading", "environment")
        changes = {name: getattr(self, name) * np.float32(gain) for name in maps}
        squares = {
            name: getattr(self, name) * np.float32(gain**2)
            for name in ("shading_variance", "specular_variance")
        }
        light = self.illumination.copy()
        light[0] += np.log(gain) * np.sqrt(4 * np.pi)
        return replace(self, **changes, **squares, illumination=light)

    def arrays(self) -> dict[str, np.ndarray]:
        """Return every map by name."""
        return {
            field.name: getattr(self, field.name)
            for field in fields(self)
            if isinstance(getattr(self, field.name), np.ndarray)
        }


def render_truth(
    scene: Scene, options: RenderOptions | None = None, monitor: Monitor | None = None
) -> GroundTruth:
    """Render a scene with its ground truth.

    Parameters
    ----------
    scene : Scene
        The scene.
    options : RenderOptions, optional
        Samples, seed, bounces and renderer.
    monitor : Monitor, optional
        Progress and cancellation.

    Returns
    -------
    GroundTruth
        The maps.

    Raises
    ------
    InputError
        If Mitsuba is not installed or the object is not in view.
    Cancelled
        If the user cancels.
    """
    tracer = Tracer(scene.mesh)
    surface = find_surface(scene, tracer)
    lit = light_surface(
        surface, scene.material, scene.lights, tracer, options or RenderOptions(), monitor
    )
    # In a penumbra the estimate from few samples may be negative, which light cannot be.
    found = np.maximum(lit.shading, 0)
    illumination, misfit = fit_light(surface.normal, found)
    picture = surface.image
    shading, reflectance, specular = (
        picture(found),
        picture(surface.reflectance.albedo),
        picture(lit.specular),
    )
    diffuse = reflectance * shading
    return GroundTruth(
        image=diffuse + specular,
        diffuse=diffuse,
        specular=specular,
        residual=np.zeros_like(diffuse),
        reflectance=reflectance,
        shading=shading,
        normal=picture(surface.normal, (0, 0, 1)),
        height=picture(_height(scene, surface)),
        mask=surface.mask,
        strength=picture(surface.reflectance.strength),
        gloss=picture(surface.reflectance.gloss),
        shading_variance=picture(lit.shading_variance),
        specular_variance=picture(lit.specular_variance),
        illumination=illumination,
        light_fit_residual=misfit,
        environment=lights_as_environment(scene.lights, ENVIRONMENT_ROWS),
    )


def exposed(
    scene: Scene, truth: GroundTruth, level: float, share: float = 0.995, layer: str = "diffuse"
) -> tuple[Scene, GroundTruth]:
    """Scale a scene's lights to a given exposure.

    Parameters
    ----------
    scene : Scene
        The scene.
    truth : GroundTruth
        Its render.
    level : float
        Value of the quantile after scaling.
    share : float, optional
        The quantile, of the values inside the mask.
    layer : str, optional
        Name of the layer.

    Returns
    -------
    scene : Scene
        With scaled lights.
    truth : GroundTruth
        With scaled layers.
    """
    peak = float(np.quantile(getattr(truth, layer)[truth.mask], share))
    gain = level / peak if peak > 0 else 1.0
    return replace(
        scene, lights=tuple(scaled(light, gain) for light in scene.lights)
    ), truth.brightened(gain)


def fit_light(normal: np.ndarray, shading: np.ndarray) -> tuple[np.ndarray, float]:
    """Fit a light of the form exp(SH(normal)) to rendered shading.

    Parameters
    ----------
    normal : (N, 3) ndarray
        Unit normals.
    shading : (N, 3) ndarray
        Shading >= 0. A black channel gets a nearly black constant.

    Returns
    -------
    light : (9, 3) ndarray
        Log-shading coefficients.
    residual : float
        RMS of the misfit, relative to the RMS of shading.
    """
    basis = real_sh(normal)
    light = np.stack(
        [_fit_channel(basis, shading[:, channel].astype(float)) for channel in range(3)], axis=1
    )
    left = shading - np.exp(basis @ light)
    return light, float(np.sqrt(np.square(left).mean() / max(np.square(shading).mean(), 1e-30)))


def _fit_channel(basis: np.ndarray, shading: np.ndarray) -> np.ndarray:
    """Newton steps on the Poisson likelihood, halved where one increases the loss.

    Sums have a fixed order: those of BLAS and LAPACK depend on the number of threads.
    """
    mean = max(float(shading.mean()), 1e-12)
    target = shading / mean
    light = np.zeros(9)
    ridge = _RIDGE * np.array([0.0] + [1.0] * 8)

    def loss(values: np.ndarray) -> float:
        log_model = np.clip(basis @ values, np.log(_DARKEST), 30)
        return float(
            (np.exp(log_model) - target * log_model).mean() + 0.5 * (ridge * values**2).sum()
        )

    now = loss(light)
    for _ in range(_FIT_STEPS):
        model = np.exp(np.clip(basis @ light, np.log(_DARKEST), 30))
        gradient = np.einsum("nk,n->k", basis, model - target) / len(target) + ridge * light
        curvature = np.einsum("nk,nl->kl", basis * model[:, None], basis) / len(target)
        curvature += np.diag(ridge + 1e-12)
        step = solve_linear(curvature, gradient[:, None])[:, 0]
        size = 1.0
        while (after := loss(light - size * step)) > now and size > 1e-4:
            size /= 2
        if now - after < 1e-12:
            break
        light, now = light - size * step, after
    light[0] += np.log(mean) * np.sqrt(4 * np.pi)
    return light


def _height(scene: Scene, surface: Surface) -> np.ndarray:
    return surface.position[:, 2] * scene.camera.pixels_per_unit
