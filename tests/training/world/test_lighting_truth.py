"""Lit views against Mitsuba's, which traces a ray for each lamp and each piece of the surroundings.

Both see the same placed mesh through the same camera. Compared are the shading of a white surface
and the specular light, without bounces; an error is the mean absolute difference over the mean of
what Mitsuba finds. What the lighting leaves out sets the bounds: lamps near the body cast the
shadows of distant ones; wide lamps and surroundings shine from 64 directions, none of them from
behind; mirrored surroundings are smoothed beforehand.
"""

import math
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

pytest.importorskip("torch")
pytest.importorskip("mitsuba")

import torch

from isc_core.shading.environment_map import directions, resampled
from synth.rendering import RenderOptions, light_surface
from synth.scene.camera import Camera
from synth.scene.lights import DirectionalLight, EnvironmentLight, Light, PointLight
from synth.scene.materials import Material as Painted
from synth.scene.meshes import Mesh, swept
from synth.scene.scene import Scene
from synth.scene.surface import Surface, find_surface
from synth.scene.tracing import Tracer
from synth.shapes import SHAPES
from training.world import views as views_module
from training.world.bodies.families import family_body
from training.world.environments import ROWS
from training.world.lighting import LitViews, Material, light_views
from training.world.patterns import Atlas
from training.world.pictures import bank_of, lights_of
from training.world.procedural_environments import studio
from training.world.recipes import lamp_places
from training.world.view_batches import batch_of, prepared
from training.world.views import SIDE, View, trace_view

POINTS = 1500


class Kind(StrEnum):
    """The light of a case."""

    DISTANT = "distant lamps"
    NEAR = "near lamps"
    WIDE = "wide lamps"
    SMOOTH = "smooth surroundings"
    STUDIO = "studio"
    BOTH = "studio and lamps"


SAMPLES = 4  # a pixel's side


def rotated(environment: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """An environment (rows, 2 rows, 3) whose light from w now comes from `rotation` w."""
    rows = len(environment)
    came = directions(rows * SAMPLES) @ rotation
    row = np.clip((np.arccos(np.clip(came[..., 1], -1, 1)) * (rows / np.pi)).astype(int), 0, None)
    azimuth = np.arctan2(came[..., 0], -came[..., 2]) % (2 * np.pi)
    column = (azimuth * (rows / np.pi)).astype(int) % (2 * rows)
    return resampled(environment.astype(float)[np.minimum(row, rows - 1), column], rows)


CASES = (
    4 * (Kind.DISTANT,)
    + 4 * (Kind.NEAR,)
    + 4 * (Kind.WIDE,)
    + 3 * (Kind.SMOOTH,)
    + 3 * (Kind.STUDIO,)
    + 2 * (Kind.BOTH,)
)
# Errors of shading and specular light, (mean over the cases of a kind, largest); in the comments
# those measured. Where each pixel gets light along one ray, only rounding is left.
BOUNDS = {
    Kind.DISTANT: ((0.001, 0.002), (0.002, 0.004)),  # (.0001, .0007), (.0001, .0014)
    Kind.NEAR: ((0.03, 0.08), (0.07, 0.25)),  # (.016, .044), (.044, .16)
    Kind.WIDE: ((0.03, 0.06), (0.06, 0.14)),  # (.017, .032), (.035, .085)
    Kind.SMOOTH: ((0.08, 0.17), (0.1, 0.2)),  # (.054, .12), (.065, .13)
    Kind.STUDIO: ((0.16, 0.5), (0.25, 0.9)),  # (.10, .37), (.13, .68)
    Kind.BOTH: ((0.22, 0.32), (0.36, 0.45)),  # (.19, .21), (.30, .25)
}


@dataclass(frozen=True)
class Case:
    """A body in light, as both programs take it."""

    kind: Kind
    view: View
    mesh: Mesh
    tracer: Tracer
    albedo: np.ndarray
    alpha: float
    ior: float
    surroundings: np.ndarray
    turn: np.ndarray
    ambient: float
    lamp: np.ndarray
    power: np.ndarray
    distance: np.ndarray
    radius: np.ndarray


def placed_view(mesh: Mesh, rng: np.random.Generator) -> tuple[View, Mesh, Tracer]:
    """A view of a body, its mesh as `trace_view` placed it, and that mesh's tracer."""
    made: list[tuple[Mesh, Tracer]] = []

    class Spy(Tracer):
        def __init__(self, placed: Mesh) -> None:
            super().__init__(placed)
            made.append((placed, self))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(views_module, "Tracer", Spy)
        view = trace_view("body", "family", mesh, rng)
    return view, *made[-1]


def make_case(kind: Kind, mesh: Mesh, rng: np.random.Generator) -> Case:
    view, placed, tracer = placed_view(mesh, rng)
    count = int(rng.integers(1, 4))
    lamps = float(kind not in (Kind.SMOOTH, Kind.STUDIO))
    around = studio(rng)
    if kind == Kind.SMOOTH:
        axis = Rotation.random(random_state=int(rng.integers(2**31))).as_matrix()[0]
        around = np.exp(1.2 * (directions(ROWS) @ axis))[..., None] * rng.uniform(0.5, 1.5, 3)
    return Case(
        kind,
        view,
        placed,
        tracer,
        albedo=rng.uniform(0.05, 0.9, 3),
        alpha=math.exp(rng.uniform(math.log(0.08), math.log(0.5))),
        ior=rng.uniform(1.3, 1.8),
        surroundings=around / around.mean(),
        turn=Rotation.random(random_state=int(rng.integers(2**31))).as_matrix(),
        ambient=rng.uniform(0.3, 1.5) * (kind == Kind.BOTH or not lamps),
        lamp=lamp_places(view.directions, rng, count),
        power=rng.uniform(0.3, 1, (count, 3)) * lamps,
        distance=rng.uniform(2, 6, count) if kind == Kind.NEAR else np.full(count, np.inf),
        radius=np.radians(rng.uniform(5, 25, count)) if kind == Kind.WIDE else np.full(count, 0.01),
    )


def family_case(number: int) -> Case:
    body = family_body(SHAPES[number % len(SHAPES)], number)
    return make_case(CASES[number], body, np.random.default_rng([25, number]))


def slim_case(kind: Kind) -> Case:
    """A slim body of few pixels, which is traced quickly; its waist casts shadows."""
    turn, polar = np.meshgrid(np.linspace(0, 2 * np.pi, 49), np.linspace(0, np.pi, 33))
    wide = 0.2 * np.sin(polar) * (1 - 0.6 * np.exp(-8 * np.cos(polar) ** 2))
    points = [wide * np.sin(turn), np.cos(polar), wide * np.cos(turn)]
    return make_case(kind, swept(np.stack(points, -1)), np.random.default_rng(8))


def lit(case: Case) -> LitViews:
    pixels = int(case.view.mask.sum())
    numbers = {
        "ambient": np.full(3, case.ambient),
        "turn": case.turn,
        "power": case.power,
        "distance": case.distance,
        "radius": case.radius,
        "harmonic_noise": np.zeros((9, 3)),
        "standing": np.array(0),
        "table": np.zeros(3),
        "table_light": np.zeros(3),
        "given": np.array(0),
        "bounce": np.array(0),
    }
    recipe = {name: torch.from_numpy(values).float()[None] for name, values in numbers.items()}
    recipe |= {"environment": torch.tensor([0]), "lamp": torch.from_numpy(case.lamp)[None]}
    no_atlas = Atlas(np.zeros((1, 4, 4), np.uint8), np.zeros(1), np.zeros(1))
    front = ((case.ior - 1) / (case.ior + 1)) ** 2
    material = Material(
        torch.from_numpy(case.albedo).float().expand(1, pixels, 3),
        torch.full((1, pixels), case.alpha),
        torch.full((1, pixels, 3), front),
        *torch.zeros(3, 1),
    )
    bank = bank_of([case.surroundings], no_atlas)
    return light_views(batch_of([prepared(case.view)]), material, lights_of(recipe, bank))


def rendered_lights(case: Case) -> tuple[Light, ...]:
    lights: list[Light] = []
    if case.ambient:
        lights.append(EnvironmentLight(case.ambient * rotated(case.surroundings, case.turn.T)))
    if not case.power.any():
        return tuple(lights)
    for k, toward in enumerate(case.view.directions[case.lamp].astype(float)):
        toward = toward / np.linalg.norm(toward)
        irradiance, distance = np.pi * case.power[k], case.distance[k]
        if np.isfinite(distance):
            lights.append(PointLight(distance * toward, irradiance * distance**2))
        else:
            parts = disc(toward, case.radius[k])
            lights += [DirectionalLight(part, irradiance / len(parts)) for part in parts]
    return tuple(lights)


def disc(toward: np.ndarray, radius: float) -> np.ndarray:
    """Directions (M, 3) spread over a lamp of half the angle `radius`; one for a small lamp."""
    if radius < 0.02:
        return toward[None]
    k = np.arange(40) + 0.5
    away, turn = np.sqrt(k / len(k)) * radius, np.pi * (1 + np.sqrt(5)) * k
    right = np.cross(toward, (0.0, 1.0, 0.0) if abs(toward[1]) < 0.8 else (1.0, 0.0, 0.0))
    right /= np.linalg.norm(right)
    up = np.cross(toward, right)
    across = np.cos(turn)[:, None] * right + np.sin(turn)[:, None] * up
    return np.cos(away)[:, None] * toward + np.sin(away)[:, None] * across


def truth(case: Case, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shading and specular light (M, 3) of some of the view's pixels."""
    scene = Scene(
        case.mesh,
        Painted(case.albedo[None, None], "ggx", case.alpha, 1.0, case.ior),
        rendered_lights(case),
        Camera(SIDE, SIDE, SIDE / 2, case.view.distance),
    )
    whole = find_surface(scene, case.tracer)
    np.testing.assert_array_equal(whole.mask, case.view.mask)
    some = Surface(
        whole.mask,
        whole.position[chosen],
        whole.normal[chosen],
        whole.view[chosen],
        whole.uv[chosen],
        scene.material.at(whole.uv[chosen]),
    )
    found = light_surface(
        some, scene.material, scene.lights, case.tracer, RenderOptions(samples=96)
    )
    return found.shading, found.specular


def chosen_pixels(case: Case, most: int) -> np.ndarray:
    return np.random.default_rng(0).permutation(int(case.view.mask.sum()))[:most]


def errors(
    case: Case, found: tuple[np.ndarray, np.ndarray], chosen: np.ndarray
) -> tuple[float, float]:
    """Of shading and specular light, relative to what Mitsuba found."""
    ours = lit(case)
    pairs = zip((ours.shading, ours.specular), found, strict=True)
    shading, gloss = (
        float(np.abs(mine[0].numpy()[chosen] - true).mean() / true.mean()) for mine, true in pairs
    )
    print(f"{case.kind:20} alpha {case.alpha:.2f} shading {shading:.4f} specular {gloss:.4f}")
    return shading, gloss


@pytest.mark.slow
@pytest.mark.parametrize("kind", Kind)
def test_lit_views_agree_with_mitsuba(kind: Kind) -> None:
    found = []
    for number in (k for k, one in enumerate(CASES) if one == kind):
        case = family_case(number)
        chosen = chosen_pixels(case, POINTS)
        found.append(errors(case, truth(case, chosen), chosen))
    mean, most = BOUNDS[kind]
    assert (np.mean(found, axis=0) < mean).all() and (np.max(found, axis=0) < most).all()


@pytest.mark.parametrize("kind", [Kind.DISTANT, Kind.SMOOTH])
def test_a_slim_body_agrees_with_mitsuba_and_a_wrong_frame_does_not(kind: Kind) -> None:
    case, most = slim_case(kind), BOUNDS[kind][1]
    chosen = chosen_pixels(case, 200)
    found = truth(case, chosen)
    assert (np.array(errors(case, found, chosen)) < most).all()
    mirrored = {"surroundings": case.surroundings[:, ::-1].copy(), "lamp": (case.lamp + 5) % 64}
    for wrong in (mirrored, {"turn": case.turn.T, "power": case.power / np.pi}):
        assert (np.array(errors(replace(case, **wrong), found, chosen)) > 2 * np.array(most)).all()
