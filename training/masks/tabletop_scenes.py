"""Random scenes of an object on a table, a floor, or before a wall, for Mitsuba.

Problem: the network takes print on a table and cast shadows for parts of the object, because the
composites of `composites` have soft shadows alone and objects that do not fit their surroundings.
Here objects stand on the surface, cast shadows, and are mirrored in it.

Equation: none. The object's lowest points touch the plane y = 0. Light comes from a panorama
around, and in some scenes from a rectangular lamp. Materials are diffuse, or rough plastic (GGX),
with one colour or a pattern of two. In a third of the scenes, another object stands behind.

Citation: microfacets: B. Walter et al. 2007, doi:10.2312/EGWR/EGSR07/195-206.

Limits: one object in front; no hands, no liquids, no transparent things. Surfaces are flat.
"""

import colorsys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from isc_core.errors import InputError
from synth.scene.meshes import Mesh, write_ply
from synth.scene.variant import load_mitsuba

from ..world.bodies.sources import BodyReference
from ..world.patterns import Atlas
from ..world.random_draws import log_uniform

OBJECT = "object"  # name of the target in a scene
_KEPT = 40  # meshes that may stand in further scenes
_OTHER, _LAMP, _GLOSSY, _GLOSSY_TABLE = 0.35, 0.6, 0.6, 0.35  # shares of the scenes
_PLACES = {"table": 0.4, "floor": 0.35, "wall": 0.25}
_PLAIN, _PLAIN_TABLE = 0.5, 0.3  # shares of one colour
_TOUCHING = 0.002  # of the vertices may lie below the plane
_FAR = 20.0  # half side of floors and walls, object units
_FIELDS = (22.0, 32.0, 45.0, 60.0)  # degrees, of the picture's longer side
_OFF_CENTRE = 0.15  # share of the pictures whose object may be cut by the frame


@dataclass(frozen=True)
class TabletopScene:
    """A scene and the cameras that see it.

    Attributes
    ----------
    mitsuba : dict
        For `mitsuba.load_dict`, without sensor.
    sensors : tuple of dict
        For `mitsuba.load_dict`, without film and sampler.
    landscape : bool
        Whether pictures are wider than high.
    """

    mitsuba: dict[str, Any]
    sensors: tuple[dict[str, Any], ...]
    landscape: bool


class TabletopScenes:
    """Draws scenes.

    Parameters
    ----------
    references : sequence of BodyReference
        Objects; those that cannot be loaded or pass no screening are skipped.
    panoramas : sequence of (rows, 2 rows, 3) ndarray
        Linear.
    atlas : Atlas
        Patterns.
    folder : Path
        For the files of meshes, which later scenes overwrite.
    cameras : int
        Of each scene.
    """

    def __init__(
        self,
        references: Sequence[BodyReference],
        panoramas: Sequence[np.ndarray],
        atlas: Atlas,
        folder: Path,
        cameras: int = 4,
    ) -> None:
        self._references, self._panoramas, self._atlas = references, panoramas, atlas
        self._folder, self._cameras = folder, cameras
        self._meshes: list[Mesh] = []

    def draw(self, rng: np.random.Generator) -> TabletopScene:
        """Draw a scene.

        Parameters
        ----------
        rng : numpy.random.Generator

        Returns
        -------
        TabletopScene

        Raises
        ------
        InputError
            If no object can be loaded.
        """
        mi = load_mitsuba()
        mesh, azimuth = _standing(self._mesh(rng), rng), rng.uniform(0, 2 * np.pi)
        turn = mi.ScalarTransform4f().rotate([0, 1, 0], float(rng.uniform(0, 360)))
        panorama = self._panoramas[int(rng.integers(len(self._panoramas)))].astype(np.float32)
        scene: dict[str, Any] = {
            "type": "scene",
            "sky": {
                "type": "envmap",
                "bitmap": mi.Bitmap(panorama / panorama.mean()),
                "to_world": turn,
            },
            OBJECT: self._solid(OBJECT, mesh, rng),
        }
        if rng.random() < _LAMP:
            scene["lamp"] = _lamp(rng)
        place = str(rng.choice(list(_PLACES), p=list(_PLACES.values())))
        scene["table"] = self._table(_FAR if place == "floor" else rng.uniform(1.5, 5), rng)
        if place == "wall":
            scene["wall"] = self._wall(azimuth, rng)
        if other := rng.random() < _OTHER:
            scene["other"] = self._solid("other", self._behind(azimuth, rng), rng)
        spread = 0.35 if other or place == "wall" else np.pi
        sensors = tuple(
            _sensor(mesh, azimuth + spread * rng.uniform(-1, 1), rng) for _ in range(self._cameras)
        )
        return TabletopScene(scene, sensors, bool(rng.random() < 0.65))

    def _mesh(self, rng: np.random.Generator) -> Mesh:
        """A mesh; half of them have stood in an earlier scene, since some take seconds to make."""
        if len(self._meshes) > _KEPT // 8 and rng.random() < 0.5:
            return self._meshes[int(rng.integers(len(self._meshes)))]
        for k in rng.permutation(len(self._references)):
            try:
                bodies = self._references[int(k)].load()
            except InputError:
                continue
            if bodies:
                self._meshes.append(bodies[int(rng.integers(len(bodies)))].mesh)
                del self._meshes[:-_KEPT]
                return self._meshes[-1]
        raise InputError("none of the objects can be loaded: name folders of others, or a number")

    def _behind(self, azimuth: float, rng: np.random.Generator) -> Mesh:
        """Another, smaller mesh beyond the first, seen from an azimuth."""
        mesh = _standing(self._mesh(rng), rng, rng.uniform(0.3, 0.8))
        toward = np.array([np.cos(azimuth), 0, np.sin(azimuth)])
        across = np.array([-toward[2], 0, toward[0]]) * rng.choice([-1, 1])
        offset = across * rng.uniform(0.7, 1.8) - toward * rng.uniform(1.5, 2.5)
        return Mesh(mesh.vertices + offset, mesh.normals, mesh.uv, mesh.faces)

    def _solid(self, name: str, mesh: Mesh, rng: np.random.Generator) -> dict[str, Any]:
        path = self._folder / f"{name}.ply"
        write_ply(path, mesh)
        pattern = self._pattern(_PLAIN, rng.uniform(1, 3), rng)
        return {"type": "ply", "filename": str(path), "bsdf": _material(pattern, _GLOSSY, rng)}

    def _table(self, half: float, rng: np.random.Generator) -> dict[str, Any]:
        transform = load_mitsuba().ScalarTransform4f()
        turn = float(rng.uniform(0, 360))
        pattern = self._pattern(_PLAIN_TABLE, half * log_uniform(rng, 0.25, 4), rng)
        return {
            "type": "rectangle",
            "to_world": transform.rotate([0, 1, 0], turn)
            .rotate([1, 0, 0], -90)
            .scale([half, half, 1]),
            "bsdf": _material(pattern, _GLOSSY_TABLE, rng),
        }

    def _wall(self, azimuth: float, rng: np.random.Generator) -> dict[str, Any]:
        toward = np.array([np.cos(azimuth), 0, np.sin(azimuth)])
        at = -toward * rng.uniform(1.3, 3)
        transform = load_mitsuba().ScalarTransform4f()
        placed = transform.look_at(origin=at.tolist(), target=(at + toward).tolist(), up=[0, 1, 0])
        return {
            "type": "rectangle",
            "to_world": placed.scale([_FAR, _FAR, 1]),
            "bsdf": _material(self._pattern(0.5, log_uniform(rng, 2, 20), rng), 0.0, rng),
        }

    def _pattern(self, plain: float, repeats: float, rng: np.random.Generator) -> dict[str, Any]:
        """A texture of one colour (in a share `plain`) or of two."""
        first, second = _colour(rng), _colour(rng)
        if rng.random() < plain:
            return {"type": "rgb", "value": first.tolist()}
        k = int(rng.integers(len(self._atlas.maps)))
        share = self._atlas.maps[k].astype(np.float32)[..., None] / 255
        mi = load_mitsuba()
        return {
            "type": "bitmap",
            "bitmap": mi.Bitmap(np.float32(first * (1 - share) + second * share)),
            "raw": True,
            "to_uv": mi.ScalarTransform4f().scale([repeats, repeats, 1]),
            "wrap_mode": "repeat" if self._atlas.tileable[k] else "mirror",
        }


def _standing(mesh: Mesh, rng: np.random.Generator, size: float = 1.0) -> Mesh:
    """The mesh, turned about the y axis, above the origin of the plane y = 0."""
    cosine, sine = np.cos(angle := rng.uniform(0, 2 * np.pi)), np.sin(angle)
    turned = mesh.rotated(np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]]))
    vertices = size * turned.vertices
    low, high = vertices.min(0), vertices.max(0)
    middle = (low + high) / 2
    middle[1] = np.quantile(vertices[:, 1], _TOUCHING)
    return Mesh(vertices - middle, turned.normals, turned.uv, turned.faces)


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


def _lamp(rng: np.random.Generator) -> dict[str, Any]:
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


def _sensor(mesh: Mesh, azimuth: float, rng: np.random.Generator) -> dict[str, Any]:
    """A pinhole camera that looks at a standing mesh, 4 to 60 degrees from above."""
    high = mesh.vertices.max(0)
    wide, middle = float(np.hypot(high[0], high[2])), np.array([0, high[1] / 2, 0])
    above, field = np.radians(rng.uniform(4, 60)), float(rng.choice(_FIELDS))
    fill, tangent = rng.uniform(0.28, 0.85), float(np.tan(np.radians(field / 2)))
    distance = max(float(high[1]), 1.2 * wide) / (2 * tangent * fill) + wide / 2
    ground = np.cos(above) * np.array([np.cos(azimuth), np.sin(azimuth)])
    eye = middle + distance * np.array([ground[0], np.sin(above), ground[1]])
    forward = (middle - eye) / np.linalg.norm(middle - eye)
    right = np.cross(forward, [0, 1, 0])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    shift = (1 - fill) * distance * tangent * (1.4 if rng.random() < _OFF_CENTRE else 0.6)
    aim = middle + shift * (right * rng.uniform(-1, 1) + 0.6 * up * rng.uniform(-1, 1))
    tilted = up + right * np.tan(np.radians(rng.normal(0, 3)))
    transform = load_mitsuba().ScalarTransform4f()
    return {
        "type": "perspective",
        "fov": field,
        "fov_axis": "larger",
        "to_world": transform.look_at(origin=eye.tolist(), target=aim.tolist(), up=tilted.tolist()),
    }
