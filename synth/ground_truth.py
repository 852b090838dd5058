"""One object rendered with everything that a decomposition has to find.

Problem: the image of an object under direct light is, at each point, `image = diffuse + specular = reflectance * shading + specular`.
Direct light is linear in the BSDF, f = f_d + f_s, so each layer is a render of its own lobe under the same light; their sum is the image:

    f_d = reflectance / pi (Lambert),        f_s = F D G / (4 cos_i cos_o) (rough dielectric, GGX)

What belongs to a place rather than to light (reflectance, normal, height, mask) comes from one ray through each pixel's centre, so that
nothing is averaged over an edge. Colours are those of the object alone: divided by the coverage at its outline.

Limits: direct light only (no interreflection), no loss of diffuse light to the gloss above it, orthographic camera on the z axis.

References: B. Walter et al., Microfacet models for refraction through rough surfaces, EGSR 2007, doi:10.2312/EGWR/EGSR07/195-206;
S. A. Shafer, Using color to separate reflection components, Color Research & Application 1985, doi:10.1002/col.5080100409.
"""

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from .meshes import Mesh, write_ply
from .variant import load_mitsuba

_COVERED = 0.5  # a pixel belongs to the object when the ray through its centre meets it and at least this share of it is covered


@dataclass(frozen=True)
class Material:
    """`albedo`: (h, w, 3) float32 texture, linear, row 0 at v = 0. `roughness`: GGX alpha, > 0. `ior`: index of refraction of the gloss."""

    albedo: np.ndarray
    roughness: float = 0.1
    ior: float = 1.5


@dataclass(frozen=True)
class View:
    """An orthographic camera on the z axis. `size`: side of the square image in pixels; `extent`: side of what it sees, object units."""

    size: int = 320
    extent: float = 2.3
    samples: int = 49
    seed: int = 0


@dataclass(frozen=True)
class GroundTruth:
    """Maps of the whole frame, float32, row 0 at the top; 0 outside the mask, where the normal is (0, 0, 1).

    `image, diffuse, specular, reflectance, shading`: (H, W, 3) linear Rec.709. `normal`: (H, W, 3), x right, y up, z toward the viewer.
    `height`: (H, W) pixels toward the viewer. `mask`: (H, W) bool. `alpha`: (H, W) coverage in [0, 1].
    """

    image: np.ndarray
    diffuse: np.ndarray
    specular: np.ndarray
    reflectance: np.ndarray
    shading: np.ndarray
    normal: np.ndarray
    height: np.ndarray
    mask: np.ndarray
    alpha: np.ndarray


def render(mesh: Mesh, material: Material, lights: dict[str, Any], view: View) -> GroundTruth:
    """Renders `mesh` under `lights` (Mitsuba emitters by name; build them after `load_mitsuba()`), with its ground truth.

    Raises `InputError` where Mitsuba is not installed.
    """
    with TemporaryDirectory() as folder:
        ply = Path(folder) / "object.ply"
        write_ply(ply, mesh)
        diffuse, alpha = render_lit(ply, diffuse_lobe(material.albedo), lights, view)
        specular, _ = render_lit(ply, specular_lobe(material), lights, view)
        shading, _ = render_lit(ply, diffuse_lobe(np.ones((2, 2, 3), np.float32)), lights, view)
        geometry = _centre_rays(ply, diffuse_lobe(material.albedo), view)
    mask = (geometry["mask"] > 0) & (alpha >= _COVERED)
    inside = mask[..., None]
    diffuse, specular, shading = (np.where(inside, layer, 0).astype(np.float32) for layer in (diffuse, specular, shading))
    return GroundTruth(
        image=diffuse + specular,
        diffuse=diffuse,
        specular=specular,
        reflectance=np.where(inside, geometry["reflectance"], 0).astype(np.float32),
        shading=shading,
        normal=np.where(inside, geometry["normal"], np.array([0, 0, 1])).astype(np.float32),
        height=np.where(mask, geometry["height"], 0).astype(np.float32),
        mask=mask,
        alpha=alpha,
    )


def diffuse_lobe(albedo: np.ndarray) -> dict[str, Any]:
    """The Lambertian part, as a Mitsuba BSDF. `albedo`: (h, w, 3), linear."""
    mi = load_mitsuba()
    texture = {"type": "bitmap", "bitmap": mi.Bitmap(np.ascontiguousarray(albedo, np.float32)), "raw": True}
    return {"type": "diffuse", "reflectance": texture}


def specular_lobe(material: Material) -> dict[str, Any]:
    """The gloss alone, as a Mitsuba BSDF."""
    return {
        "type": "roughplastic",
        "distribution": "ggx",
        "alpha": material.roughness,
        "int_ior": material.ior,
        "diffuse_reflectance": {"type": "rgb", "value": 0.0},
    }


def render_lit(ply: Path, bsdf: dict[str, Any], lights: dict[str, Any], view: View) -> tuple[np.ndarray, np.ndarray]:
    """One layer: (H, W, 3) radiance of the object alone, and (H, W) how much of each pixel it covers."""
    mi = load_mitsuba()
    integrator = {"type": "direct", "emitter_samples": 1, "bsdf_samples": 1, "hide_emitters": True}
    sampler = {"type": "multijitter", "sample_count": view.samples}
    sensor = _camera(view, sampler, "rgba")
    scene = mi.load_dict({"type": "scene", "integrator": integrator, "object": _shape(ply, bsdf), "sensor": sensor, **lights})
    pixels = np.array(mi.render(scene, spp=view.samples, seed=view.seed), dtype=np.float32)
    alpha = np.clip(pixels[..., 3], 0, 1)
    return pixels[..., :3] / np.maximum(alpha, 1e-3)[..., None], alpha


def _centre_rays(ply: Path, bsdf: dict[str, Any], view: View) -> dict[str, np.ndarray]:
    """Geometry and reflectance at the centre of each pixel."""
    mi = load_mitsuba()
    integrator = {"type": "aov", "aovs": "place:position,normal:sh_normal,reflectance:albedo"}
    # One sample without jitter is the ray through the centre.
    sampler = {"type": "stratified", "sample_count": 1, "jitter": False}
    scene = mi.load_dict({"type": "scene", "integrator": integrator, "object": _shape(ply, bsdf), "sensor": _camera(view, sampler, "rgb")})
    channels = np.array(mi.render(scene, spp=1), dtype=np.float32)[..., -9:]
    normal = channels[..., 3:6]
    hit = np.linalg.norm(normal, axis=-1) > 0
    unit = normal / np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-6)
    return {"mask": hit, "height": channels[..., 2] * (view.size / view.extent), "normal": unit, "reflectance": channels[..., 6:9]}


def _shape(ply: Path, bsdf: dict[str, Any]) -> dict[str, Any]:
    return {"type": "ply", "filename": str(ply), "bsdf": bsdf}


def _camera(view: View, sampler: dict[str, Any], pixel_format: str) -> dict[str, Any]:
    mi = load_mitsuba()
    place = mi.ScalarTransform4f().look_at(origin=[0, 0, 10], target=[0, 0, 0], up=[0, 1, 0])
    half = 0.5 * view.extent
    return {
        "type": "orthographic",
        "to_world": place @ mi.ScalarTransform4f().scale([half, half, 1]),
        "film": {"type": "hdrfilm", "width": view.size, "height": view.size, "pixel_format": pixel_format, "rfilter": {"type": "box"}},
        "sampler": sampler,
    }
