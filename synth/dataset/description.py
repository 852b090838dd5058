"""The content of `scene.json`: the recipe of a scene, units and frames, and all values that are not
maps.

It contains no times or paths, so that equal seeds give equal bytes.
"""

from dataclasses import asdict, fields
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from isc_core import __version__

from ..capture.finishes import gloss_class
from ..capture.recipe import PictureSettings, Recipe
from ..capture.sensor import Sensor
from ..capture.truth import GroundTruth
from ..scene.camera import Camera
from ..scene.lights import EnvironmentLight, Light
from ..scene.materials import Material
from ..scene.scene import Scene
from ..scene.variant import is_vectorised, load_mitsuba

SCHEMA_VERSION = 2  # 2: the gloss class "matt" is called "diffuse"
KIND = "isc synth scene"
UNITS = {
    "frame": "x right, y up, z toward the viewer; row 0 at the top",
    "height": "pixels toward the viewer; object units times pixels_per_unit",
    "light": "linear Rec.709, scene-referred; 1 is the sensor's full scale",
    "shading": "radiance of a white diffuse surface: diffuse = reflectance * shading",
    "environment": (
        "latitude-longitude, row 0 straight up, first column away from the viewer, right at a "
        "quarter of the width"
    ),
}
ILLUMINATION = (
    "log shading_c(n) = sum_k coefficients[k][c] Y_k(n); orthonormal real spherical harmonics, "
    "x right, y up, z toward the viewer"
)
CONVENTIONS = {
    "lambert": "f = albedo / pi",
    "oren_nayar": (
        "f = albedo times Oren & Nayar's rough diffuse lobe, slope deviation sigma in radians"
    ),
    "blinn_phong": (
        "f = albedo / pi + strength (gloss + 8) / (8 pi) cos(n, h)^gloss: gloss is the exponent, "
        "normalised Blinn-Phong"
    ),
    "ggx": (
        "f = albedo / pi + strength D G F / (4 cos cos): gloss is alpha of GGX (Blender's "
        "roughness squared), F by Schlick from f0"
    ),
    "roughplastic": (
        "Mitsuba's roughplastic, GGX, nonlinear off: gloss is alpha, the interface's Fresnel term "
        "is exact for ior"
    ),
}


def describe(
    split: str, recipe: Recipe, scene: Scene, truth: GroundTruth, checksums: dict[str, str]
) -> dict[str, Any]:
    """Return the content of `scene.json`.

    Parameters
    ----------
    split : str
        The scene's split.
    recipe : Recipe
        How it was made.
    scene : Scene
        Its lights, material and camera.
    truth : GroundTruth
        Its maps.
    checksums : dict of str to str
        SHA-256 of the other files in its folder.

    Returns
    -------
    dict
        JSON values.
    """
    shape, light = recipe.shape, recipe.light
    return {
        "schema_version": SCHEMA_VERSION,
        "kind": KIND,
        "seed": recipe.seed,
        "split": split,
        "object": {"id": shape.name, "family": shape.family, "number": shape.number},
        "material": {"id": recipe.material.name, **_material(scene.material)},
        "albedo": {"family": recipe.albedo, "mean": _mean_color(truth.reflectance, truth.mask)},
        "light": {
            "id": light.name,
            "family": light.family,
            "number": light.number,
            "sources": [_light(part) for part in scene.lights],
        },
        "illumination": {
            "coefficients": truth.illumination.tolist(),
            "convention": ILLUMINATION,
            "light_fit_residual": float(truth.light_fit_residual),
        },
        "camera": _camera(scene.camera),
        "units": UNITS,
        "render": _render(recipe),
        "picture": describe_picture(recipe.picture),
        "measured": {"specular_share": specular_share(truth), "mask_pixels": int(truth.mask.sum())},
        "versions": versions(),
        "files": checksums,
    }


def describe_picture(picture: PictureSettings) -> dict[str, Any]:
    """Return the settings of a picture that affect the files.

    Parameters
    ----------
    picture : PictureSettings
        How scenes are photographed.

    Returns
    -------
    dict
        JSON values.
    """
    return {
        "size": picture.size,
        "samples": picture.samples,
        "bounces": picture.bounces,
        "perspective": picture.perspective,
        "exposure": picture.exposure,
        "renderer": picture.renderer,
        "sensor": _sensor(picture.sensor),
    }


def specular_share(truth: GroundTruth) -> float:
    """Return the specular share of all light inside the mask.

    Parameters
    ----------
    truth : GroundTruth
        The scene's maps.

    Returns
    -------
    float
        In [0, 1].
    """
    specular, diffuse = (
        float(layer[truth.mask].sum(dtype=np.float64)) for layer in (truth.specular, truth.diffuse)
    )
    return specular / max(specular + diffuse, 1e-30)


def versions() -> dict[str, str]:
    """Return the versions of everything that affects the numbers."""
    found = {"isc": __version__}
    for name in ("mitsuba", "drjit", "numpy"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "unknown"
    return found


def _render(recipe: Recipe) -> dict[str, Any]:
    options = recipe.render_options()
    kernels = options.renderer == "mitsuba" or (options.renderer == "auto" and is_vectorised())
    return {
        "samples": options.samples,
        "seed": options.seed,
        "interreflection": options.bounces > 0,
        "bounces": options.bounces,
        "renderer": "mitsuba" if kernels else "arrays",
        "variant": str(load_mitsuba().variant()),
    }


def _camera(camera: Camera) -> dict[str, Any]:
    """The camera; `view_width`: object units across the picture at the origin (Blender's
    orthographic scale), `focal_length`: pixels.
    """
    return {
        "kind": "perspective" if camera.perspective else "orthographic",
        "width": camera.width,
        "height": camera.height,
        "pixels_per_unit": camera.pixels_per_unit,
        "view_width": camera.width / camera.pixels_per_unit,
        "distance": camera.distance if camera.perspective else None,
        "focal_length": camera.distance * camera.pixels_per_unit if camera.perspective else None,
        "principal_point": [camera.width / 2, camera.height / 2],
        "world_to_camera": camera.matrices(),
    }


def _material(material: Material) -> dict[str, Any]:
    described: dict[str, Any] = {
        "model": material.model,
        "convention": CONVENTIONS[material.model],
        "gloss_class": gloss_class(material),
    }
    if not material.is_diffuse:
        described |= {"gloss": _span(material.gloss), "strength": _span(material.strength)}
    if material.model in ("ggx", "roughplastic"):
        described |= {"ior": material.ior, "f0": material.f0}
    if material.model == "oren_nayar":
        described |= {"sigma": material.sigma}
    return described


def _span(values: float | np.ndarray) -> dict[str, float]:
    """A texture in three numbers, all equal for a uniform one."""
    return {
        "least": float(np.min(values)),
        "median": float(np.median(values)),
        "most": float(np.max(values)),
    }


def _mean_color(layer: np.ndarray, mask: np.ndarray) -> list[float]:
    return [float(value) for value in layer[mask].mean(0, dtype=np.float64)]


def _light(light: Light) -> dict[str, Any]:
    """Every number of a light; of an environment only its size, since `environment.exr` has its
    pixels.
    """
    kind = type(light).__name__.removesuffix("Light").lower()
    if isinstance(light, EnvironmentLight):
        return {"kind": kind, "rows": len(light.radiance)}
    return {
        "kind": kind,
        **{
            field.name: np.asarray(getattr(light, field.name), float).tolist()
            for field in fields(light)
        },
    }


def _sensor(sensor: Sensor) -> dict[str, Any]:
    """All except the exposure, which is in the picture's settings."""
    return {name: value for name, value in asdict(sensor).items() if name != "exposure_level"}
