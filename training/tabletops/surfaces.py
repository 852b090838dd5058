"""Random materials, tables, walls and lamps, for Mitsuba.

Problem: tables and objects have one colour or a pattern, and are matt or glossy.

Equation: none. Materials are diffuse, or rough plastic (GGX), with one colour or a pattern of two.

Citation: microfacets: B. Walter et al. 2007, doi:10.2312/EGWR/EGSR07/195-206.

Limits: surfaces are flat; nothing is transparent.
"""

import colorsys
from typing import Any

import numpy as np

from synth.scene.variant import load_mitsuba

from ..world.patterns import Atlas
from ..world.random_draws import log_uniform

FAR = 20.0  # half side of floors and walls, object units
_GLOSSY, _GLOSSY_TABLE = 0.6, 0.35  # shares of the objects and of the tables
_PLAIN, _PLAIN_TABLE = 0.5, 0.3  # shares of one colour


def object_material(atlas: Atlas, rng: np.random.Generator) -> dict[str, Any]:
    """Draw the material of an object.

    Parameters
    ----------
    atlas : Atlas
        Patterns.
    rng : numpy.random.Generator

    Returns
    -------
    dict
        For `mitsuba.load_dict`.
    """
    return _material(_pattern(atlas, _PLAIN, rng.uniform(1, 3), rng), _GLOSSY, rng)


def table(half: float, atlas: Atlas, rng: np.random.Generator) -> dict[str, Any]:
    """Draw a square table in the plane y = 0.

    Parameters
    ----------
    half : float
        Half its side.
    atlas : Atlas
    rng : numpy.random.Generator

    Returns
    -------
    dict
        For `mitsuba.load_dict`.
    """
    transform = load_mitsuba().ScalarTransform4f()
    turn = float(rng.uniform(0, 360))
    pattern = _pattern(atlas, _PLAIN_TABLE, half * log_uniform(rng, 0.25, 4), rng)
    return {
        "type": "rectangle",
        "to_world": transform.rotate([0, 1, 0], turn).rotate([1, 0, 0], -90).scale([half, half, 1]),
        "bsdf": _material(pattern, _GLOSSY_TABLE, rng),
    }


def wall(azimuth: float, atlas: Atlas, rng: np.random.Generator) -> dict[str, Any]:
    """Draw a wall beyond the origin, seen from an azimuth.

    Parameters
    ----------
    azimuth : float
        Radians, from the x axis to the z axis.
    atlas : Atlas
    rng : numpy.random.Generator

    Returns
    -------
    dict
        For `mitsuba.load_dict`.
    """
    toward = np.array([np.cos(azimuth), 0, np.sin(azimuth)])
    at = -toward * rng.uniform(1.3, 3)
    transform = load_mitsuba().ScalarTransform4f()
    placed = transform.look_at(origin=at.tolist(), target=(at + toward).tolist(), up=[0, 1, 0])
    pattern = _pattern(atlas, _PLAIN, log_uniform(rng, 2, 20), rng)
    return {
        "type": "rectangle",
        "to_world": placed.scale([FAR, FAR, 1]),
        "bsdf": _material(pattern, 0.0, rng),
    }


def lamp(rng: np.random.Generator) -> dict[str, Any]:
    """Draw a rectangular lamp, 6 units from the origin.

    Parameters
    ----------
    rng : numpy.random.Generator

    Returns
    -------
    dict
        For `mitsuba.load_dict`.
    """
    around, above = rng.uniform(0, 2 * np.pi), rng.uniform(0.4, 1.4)
    across = np.cos(above) * np.array([np.cos(around), np.sin(around)])
    place, half = 6 * np.array([across[0], np.sin(above), across[1]]), log_uniform(rng, 0.1, 2.5)
    tint = np.array([1, rng.uniform(0.85, 1), rng.uniform(0.6, 1.1)])
    transform = load_mitsuba().ScalarTransform4f()
    placed = transform.look_at(origin=place.tolist(), target=[0, 0.5, 0], up=[0, 1, 0.01])
    radiance = {"type": "rgb", "value": (tint * rng.uniform(5, 60) / half**2).tolist()}
    return {
        "type": "rectangle",
        "to_world": placed.scale([half, half, 1]),
        "emitter": {"type": "area", "radiance": radiance},
    }


def _pattern(
    atlas: Atlas, plain: float, repeats: float, rng: np.random.Generator
) -> dict[str, Any]:
    """A texture of one colour (in a share `plain`) or of two."""
    first, second = _colour(rng), _colour(rng)
    if rng.random() < plain:
        return {"type": "rgb", "value": first.tolist()}
    k = int(rng.integers(len(atlas.maps)))
    share = atlas.maps[k].astype(np.float32)[..., None] / 255
    mi = load_mitsuba()
    return {
        "type": "bitmap",
        "bitmap": mi.Bitmap(np.float32(first * (1 - share) + second * share)),
        "raw": True,
        "to_uv": mi.ScalarTransform4f().scale([repeats, repeats, 1]),
        "wrap_mode": "repeat" if atlas.tileable[k] else "mirror",
    }


def _colour(rng: np.random.Generator) -> np.ndarray:
    """A random linear albedo."""
    coded = colorsys.hsv_to_rgb(rng.random(), rng.beta(1.5, 1.5), rng.uniform(0.15, 0.9))
    return np.power(coded, 2.2)


def _material(pattern: dict[str, Any], glossy: float, rng: np.random.Generator) -> dict[str, Any]:
    if rng.random() >= glossy:
        return {"type": "twosided", "side": {"type": "diffuse", "reflectance": pattern}}
    plastic = {
        "type": "roughplastic",
        "distribution": "ggx",
        "alpha": log_uniform(rng, 0.04, 0.4),
        "diffuse_reflectance": pattern,
    }
    return {"type": "twosided", "side": plastic}
