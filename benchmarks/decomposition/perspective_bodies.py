"""Photos of bodies of known shape by a wide-angle lens, for `benchmarks.decomposition.perspective`.

Traced bodies are balls, superellipsoids and sums of Gaussians, met by the ray of each pixel to
within 1e-9 of their size, under a random light of log spherical harmonics, in one or two colours.
Rendered ones are those of `synth`, glazed, under its environment and softboxes, by Mitsuba.

Centred bodies fill 85 % of the frame's height, the others half of it, at .45 to .6 of the angle to
the left or right edge.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from isc_core.io.focal_length import pixels_of_35mm
from isc_core.photo import Photo, PhotoSource
from isc_core.photo.camera import Camera
from isc_core.shading.brdf.blinn_phong import BlinnPhong
from isc_core.shading.perspective import view_directions
from isc_core.shading.radiance import directional, radiance
from isc_core.shading.spherical_harmonics import real_sh

SIZE = (320, 240)
KINDS = ("ball", "superellipsoid", "blobs")
_STEPS, _HALVINGS = 160, 32
_GLOSS = 80.0  # Blinn-Phong exponent

Field = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Body:
    """A photo and what it shows.

    Attributes
    ----------
    photo : Photo
        Without camera.
    camera : Camera
    normal : (H, W, 3) ndarray
        Unit, camera frame.
    place : (H, W, 3) ndarray
        Points of the surface, camera frame, any unit.
    shading : (H, W, 3) ndarray
    light : (3,) ndarray
        Direction of the light that makes the highlight; 0 for matt bodies.
    """

    photo: Photo
    camera: Camera
    normal: np.ndarray
    place: np.ndarray
    shading: np.ndarray
    light: np.ndarray


def traced_body(kind: str, aside: bool, seed: int, *, glossy: bool = False) -> Body:
    """Photograph a body.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    aside : bool
        Beside the middle of the photo.
    seed : int
    glossy : bool, optional
        With a highlight.

    Returns
    -------
    Body
    """
    rng = np.random.default_rng([seed, KINDS.index(kind), aside])
    field, bound = _field(kind, rng)
    camera, centre = _placed(aside, rng)
    mask, place, normal = _trace(field, bound, camera, centre)
    shading = np.exp(real_sh(normal) @ _light(rng))
    paint = np.sort(rng.uniform(0.08, 0.6, (2, 3)), axis=0)[:, rng.permutation(3)]
    rows, columns = np.indices(mask.shape)
    albedo = paint[(rows // 40 + columns // 40) % 2 if seed % 2 else 0 * rows]
    toward, specular = np.zeros(3), np.zeros(3)
    if glossy:
        toward = _unit(np.append(rng.uniform(-0.6, 0.6, 2), 1.0))
        view = view_directions(camera, SIZE[::-1])
        lamp = directional(toward, 1.0)
        specular = radiance(BlinnPhong(0.35, _GLOSS), normal, view, lamp)
    image = np.where(mask[..., None], albedo * shading + specular, 0)
    return Body(_photo(image, mask), camera, normal, place, shading, toward)


def rendered_body(seed: int, aside: bool, samples: int = 64) -> Body:
    """Render a glazed body by Mitsuba.

    Parameters
    ----------
    seed : int
        An even number gives the gourd, an odd one a superquadric.
    aside : bool
        Beside the middle of the photo.
    samples : int, optional
        Light paths a pixel.

    Returns
    -------
    Body
    """
    from synth.capture.truth import render_truth
    from synth.demo_scene import demo_lights
    from synth.rendering import RenderOptions
    from synth.scene.camera import Camera as PinholeCamera
    from synth.scene.materials import Material
    from synth.scene.scene import Scene
    from synth.scene.tracing import Tracer
    from synth.shapes.gourd import gourd, gourd_albedo
    from synth.shapes.superquadric import Superquadric

    rng = np.random.default_rng([seed, aside])
    camera, centre = _placed(aside, rng)
    axes = tuple(rng.uniform(0.6, 1.0, 3))
    mesh = Superquadric(axes, 0.7, 0.8).mesh() if seed % 2 else gourd()
    turn = Rotation.from_euler("yxz", rng.uniform((-60, 5, -5), (60, 30, 5)), degrees=True)
    mesh = mesh.rotated(turn.as_matrix()).fitted()
    distance = max(-float(centre[2]), 1.6)
    shift = np.array([centre[0], centre[1], 0.0]) * (distance / -centre[2])
    mesh = replace(mesh, vertices=mesh.vertices + shift)
    pinhole = PinholeCamera(*SIZE, camera.focal_length / distance, distance)
    material = Material(gourd_albedo(), "ggx", gloss=0.12, strength=1.0, ior=1.5)
    scene = Scene(mesh, material, demo_lights(), pinhole)
    truth = render_truth(scene, RenderOptions(samples=samples, seed=seed))
    hits = Tracer(mesh).hits(*(part[truth.mask] for part in pinhole.rays()))
    place = np.zeros(truth.normal.shape)
    place[truth.mask] = hits.position - (0.0, 0.0, distance)
    photo = _photo(truth.image, truth.mask)
    return Body(photo, camera, truth.normal, place, truth.shading, np.zeros(3))


def _placed(aside: bool, rng: np.random.Generator) -> tuple[Camera, np.ndarray]:
    """A lens of 26 to 35 mm, and the centre of a ball of radius 1 in its frame."""
    focal = pixels_of_35mm(rng.uniform(26, 35), SIZE)
    upper, edge = np.arctan(np.array(SIZE[::-1]) / 2 / focal)
    turn = edge * rng.uniform(0.45, 0.6) * rng.choice([-1, 1]) if aside else 0.0
    distance = 1 / np.sin(upper * (0.5 if aside else 0.85))
    return Camera.of_frame(focal, SIZE), distance * np.array([np.sin(turn), 0, -np.cos(turn)])


def _field(kind: str, rng: np.random.Generator) -> tuple[Field, float]:
    """A function of points (..., 3), above 0 inside the body, and the radius that holds it."""
    if kind == "ball":
        return lambda p: 1 - np.linalg.norm(p, axis=-1), 1.0
    if kind == "superellipsoid":
        turn = Rotation.random(random_state=int(rng.integers(1 << 31))).as_matrix()
        axes, exponent = rng.uniform(0.55, 1, 3), rng.uniform(2, 3.5)
        return lambda p: 1 - (np.abs(p @ turn / axes) ** exponent).sum(-1), 1.6
    centres = rng.normal(size=(4, 3))
    centres *= (rng.uniform(0.2, 0.65, 4) / np.linalg.norm(centres, axis=1))[:, None]
    radii = rng.uniform(0.4, 0.6, 4)

    def blobs(p: np.ndarray) -> np.ndarray:
        near = ((p[..., None, :] - centres) / radii[:, None]) ** 2
        return np.asarray(np.exp(4 - 4 * near.sum(-1)).sum(-1) - 1)

    return blobs, 1.4


def _trace(
    field: Field, bound: float, camera: Camera, centre: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The mask, and place and normal of the first point that each ray meets."""
    ray = -view_directions(camera, SIZE[::-1])
    far = float(np.linalg.norm(centre))
    steps = np.linspace(far - bound, far + bound, _STEPS)
    inside = np.stack([field(ray * t - centre) > 0 for t in steps])
    mask = inside.any(axis=0) & ~inside[0]
    low = steps[inside.argmax(axis=0)[mask] - 1]
    high, seen = low + (steps[1] - steps[0]), ray[mask]
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        hit = field(seen * middle[:, None] - centre) > 0
        low, high = np.where(hit, low, middle), np.where(hit, middle, high)
    place, normal = np.zeros((2, *mask.shape, 3))
    place[mask], normal[...] = seen * high[:, None], (0, 0, 1)
    step = 1e-4 * np.eye(3)
    around = place[mask] - centre
    normal[mask] = [[0, 0, 0]] - np.stack(
        [field(around + one) - field(around - one) for one in step], axis=-1
    )
    return mask, place, _unit(normal)


def _light(rng: np.random.Generator) -> np.ndarray:
    """Coefficients (9, 3) of log shading: brighter toward a place in the viewer's hemisphere."""
    toward = _unit(np.append(rng.uniform(-1, 1, 2), rng.uniform(0.4, 1)))
    light = np.zeros((9, 3))
    light[0] = -1.0
    light[[3, 1, 2]] = rng.uniform(0.9, 1.5) * toward[:, None]
    light[4:] = rng.normal(0, 0.12, (5, 1))
    return light + rng.normal(0, 0.03, (9, 3))


def _photo(image: np.ndarray, mask: np.ndarray) -> Photo:
    """An exposed photo whose brightest half percent is clipped at 1."""
    exposed = np.clip(image * (0.95 / np.percentile(image[mask], 99.5)), 0, 1)
    source = PhotoSource("0" * 64, SIZE, 8, "linear", "file")
    clipped = exposed.max(axis=2) >= 1
    return Photo(exposed.astype(np.float32), mask, 1 / 255 / 12.92, clipped, source)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
