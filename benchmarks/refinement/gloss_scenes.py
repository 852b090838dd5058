"""Rendered glossy scenes for the refinement of gloss: truth, photo, and the result it starts from.

Scene k has its own object, albedo, GGX lobe and light, drawn from (`SEED`, k); every eighth object
is matt. The photo is one of 8 bits, exposed so that 1.5 % of the object at most is clipped. Lights
in turn: directional, small panel, point, large panel, area, smooth. The truth also holds the object
under another, directional light. FOLDER keeps what was rendered and decomposed.

Scenes below `CHOSEN_ON` may be used to choose constants; those from there on are for reports.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from isc_core.decomposition.pipeline import decompose
from isc_core.decomposition.settings import Settings
from isc_core.imaging.srgb import linear_to_srgb, srgb_to_linear
from isc_core.photo import Photo, PhotoSource
from isc_core.result_files.result_folder import load, save
from isc_core.scene.decomposition import Decomposition
from synth.albedos import make_albedo
from synth.capture.recipe import camera_around
from synth.capture.truth import exposed, render_truth
from synth.light_rigs import make_lights
from synth.light_rigs.placing import ambient, places, toward, white
from synth.rendering import RenderOptions
from synth.scene import Scene
from synth.scene.lights import DirectionalLight, EnvironmentLight, Light, panel_toward_origin
from synth.scene.materials import Material
from synth.shapes import SHAPES, make_shape

from .scenes import centred

SEED, CHOSEN_ON = 31, 100
KINDS = ("directional", "small", "point", "panel", "area", "sh")
_PANELS = {"small": 2.0, "panel": 6.0}
_ALBEDOS = ("uniform", "patches", "print", "noise")
_ALPHAS, _STRENGTHS = (0.06, 0.4), (0.6, 1.5)
_MAPS = ("image", "specular", "reflectance", "normal", "mask")
_MATT = 8
_LEVEL, _UNCLIPPED, _DISTANCE = 0.6, 0.985, 12.0


@dataclass(frozen=True, eq=False)
class GlossScene:
    """A rendered scene.

    Attributes
    ----------
    number : int
        Number of the scene.
    truth : dict of str to ndarray
        True maps by name; `alpha`, `strength` (0 for a matt object), `directions` (K, 3) of its
        lamps, and of the new light `new_direction` and the specular layer `new_specular`.
    start : Decomposition
        What the refinement starts from.
    folder : Path
        Its result folder.
    """

    number: int
    truth: dict[str, np.ndarray]
    start: Decomposition
    folder: Path


def gloss_scene(folder: Path, number: int, size: int, odds: float) -> GlossScene:
    """Read a scene; render and decompose it if it is missing.

    Parameters
    ----------
    folder : Path
        Where scenes are kept.
    number : int
        Number of the scene.
    size : int
        Side of the image in pixels.
    odds : float
        `highlight_odds` of the decomposition.

    Returns
    -------
    GlossScene
        The scene.
    """
    place = folder / f"gloss{number:04d}_{size}"
    truth, start = place / "truth.npz", place / f"odds{odds:g}"
    if not truth.exists():
        place.mkdir(parents=True, exist_ok=True)
        np.savez(truth, **_rendered(number, size))
    with np.load(truth, allow_pickle=False) as stored:
        maps = {name: stored[name] for name in stored.files}
    if not start.exists():
        settings = Settings(highlight_odds=odds)
        save(decompose(_photo(maps), settings, name=place.name), start)
    return GlossScene(number, maps, load(start), start)


def _photo(maps: dict[str, np.ndarray]) -> Photo:
    mask = maps["mask"]
    codes = np.round(255 * linear_to_srgb(np.clip(maps["image"], 0, 1).astype(float)))
    clipped = mask & (codes >= 255).any(axis=2)
    light = np.where(mask[..., None], srgb_to_linear(codes / 255), 0).astype(np.float32)
    source = PhotoSource("", (mask.shape[1], mask.shape[0]), 8, "srgb", "file")
    return Photo(light, mask, 1e-3, clipped, source)


def _rendered(number: int, size: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng([SEED, number])
    mesh = centred(make_shape(SHAPES[(number * 5 + number // 6) % len(SHAPES)], rng))
    alpha = float(np.exp(rng.uniform(*np.log(_ALPHAS))))
    strength = 0.0 if number % _MATT == _MATT - 1 else float(rng.uniform(*_STRENGTHS))
    albedo = make_albedo(_ALBEDOS[(number // 2) % len(_ALBEDOS)], rng, 256)
    material = Material(albedo, "ggx", alpha, strength) if strength else Material(albedo, "lambert")
    lights, lamps = _lights(KINDS[number % len(KINDS)], rng)
    scene = Scene(mesh, material, lights, camera_around(mesh, size, 0.88))
    scene, truth = exposed(scene, render_truth(scene, RenderOptions(64, number)), _LEVEL)
    bright = float(np.quantile(truth.image[truth.mask].max(axis=1), _UNCLIPPED))
    scene, truth = exposed(scene, truth, _LEVEL * min(1.0, 1 / bright))
    direction = toward(rng.uniform(20, 60), rng.uniform(-95, 95))
    moved = replace(scene, lights=(DirectionalLight(direction, np.full(3, np.pi)),))
    found = {name: getattr(truth, name) for name in _MAPS}
    return found | {
        "alpha": np.array(alpha),
        "strength": np.array(strength),
        "directions": lamps,
        "new_direction": direction,
        "new_specular": render_truth(moved, RenderOptions(32, number)).specular,
    }


def _lights(kind: str, rng: np.random.Generator) -> tuple[tuple[Light, ...], np.ndarray]:
    """The lights, and the directions (K, 3) of the lamps among them."""
    if kind in _PANELS:
        side, found, towards = _PANELS[kind], list[Light](), []
        for place, strength in places(rng):
            light = strength * np.pi * _DISTANCE**2 / side**2 * white(rng)
            found.append(panel_toward_origin(tuple(_DISTANCE * place), (side, side), tuple(light)))
            towards.append(place)
        return (*found, ambient(rng, 0.05, 0.3)), np.array(towards)
    lights = make_lights(kind, rng)
    lamps = [light for light in lights if not isinstance(light, EnvironmentLight)]
    return lights, np.array([_toward(lamp) for lamp in lamps]).reshape(-1, 3)


def _toward(lamp: Light) -> np.ndarray:
    place = getattr(lamp, "direction", None)
    place = getattr(lamp, "position", None) if place is None else place
    place = np.asarray(lamp.centre if place is None else place, float)  # type: ignore[union-attr]
    return np.asarray(place / np.linalg.norm(place))
