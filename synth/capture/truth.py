"""One scene with everything that a decomposition has to find.

Equation, at each pixel inside the mask: image = diffuse + specular + residual, diffuse =
reflectance * shading. Place, normal and paint come from one ray through the pixel's centre
(`surface`), radiance from one render whose lobes are kept apart (`rendering`). What a sensor does
to the image (clipping, noise, codes) goes into the residual (`sensor`).

Rendered shading is not exp(SH(normal)): `illumination` is the light of that form that fits it best,
and `light_fit_residual` says how well. It maximises sum(shading log(model) - model), Poisson
regression with a logarithmic link, which is at home with black shadows.

Citation: P. McCullagh, J. A. Nelder, "Generalized linear models", 2nd edition (1989),
doi:10.1201/9780203753736 (the fit).

Limits: those of `surface` and `rendering`. Light that the fit has never seen (normals that no pixel
has) is a guess, held back by a ridge.
"""

from dataclasses import dataclass, fields, replace

import numpy as np

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


@dataclass(frozen=True)
class GroundTruth:
    """Maps of the whole frame, float32, row 0 at the top; 0 outside the mask, where the normal is
    (0, 0, 1).

    `image, diffuse, specular, residual, reflectance, shading`: (H, W, 3) linear Rec.709. `normal`:
    (H, W, 3) unit, x right, y up, z toward the viewer. `height`: (H, W) pixels toward the viewer.
    `mask`: (H, W) bool. `strength`, `gloss`: (H, W) of the material's gloss, see `materials`.
    `shading_variance`, `specular_variance`: (H, W, 3) of the estimates, by Monte Carlo.
    `illumination`: (9, 3) coefficients of log shading, fitted; `light_fit_residual`: RMS of shading
    less its fit, over the RMS of shading. `environment`: (rows, 2 rows, 3) all lights as seen from
    the origin, laid out as `isc_core.shading.environment_map` says.
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
        """The same scene with all its lights `gain` (> 0) times as bright."""
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
        """Every map by name."""
        return {
            field.name: getattr(self, field.name)
            for field in fields(self)
            if isinstance(getattr(self, field.name), np.ndarray)
        }


def render_truth(
    scene: Scene, options: RenderOptions | None = None, monitor: Monitor | None = None
) -> GroundTruth:
    """Renders a scene with its ground truth.

    Raises `InputError` where Mitsuba is not installed or nothing is in view; `Cancelled`.
    """
    tracer = Tracer(scene.mesh)
    surface = find_surface(scene, tracer)
    lit = light_surface(
        surface, scene.material, scene.lights, tracer, options or RenderOptions(), monitor
    )
    # In a penumbra the estimate of few samples may be below 0; light is not.
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
    """The scene and its truth under lights so bright that `share` of the values of `layer` inside
    the mask stay below `level`.
    """
    peak = float(np.quantile(getattr(truth, layer)[truth.mask], share))
    gain = level / peak if peak > 0 else 1.0
    return replace(
        scene, lights=tuple(scaled(light, gain) for light in scene.lights)
    ), truth.brightened(gain)


def fit_light(normal: np.ndarray, shading: np.ndarray) -> tuple[np.ndarray, float]:
    """The light (9, 3) whose exp(SH(normal)) is nearest to the shading, and what is left: RMS over
    the RMS of shading.

    `normal`: (N, 3) unit. `shading`: (N, 3) >= 0. A channel that is black everywhere gets a
    constant that is nearly black.
    """
    basis = real_sh(normal)
    light = np.stack(
        [_fit_channel(basis, shading[:, channel].astype(float)) for channel in range(3)], axis=1
    )
    left = shading - np.exp(basis @ light)
    return light, float(np.sqrt(np.square(left).mean() / max(np.square(shading).mean(), 1e-30)))


def _fit_channel(basis: np.ndarray, shading: np.ndarray) -> np.ndarray:
    """Newton's steps on the Poisson likelihood, halved where one climbs."""
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
        gradient = basis.T @ (model - target) / len(target) + ridge * light
        curvature = (basis * model[:, None]).T @ basis / len(target) + np.diag(ridge + 1e-12)
        step = np.linalg.solve(curvature, gradient)
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
