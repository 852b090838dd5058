"""Random scenes of objects on a table, a floor, or before a wall, for Mitsuba.

Problem: a network that learns from composites alone takes print on a table and cast shadows for
parts of the object, because these have soft shadows and objects that do not fit their surroundings.
Here objects stand on the surface, cast shadows, and are mirrored in it.

Equation: none. The objects' lowest points touch the plane y = 0. Light comes from a panorama
around, and in some scenes from a rectangular lamp. A scene has one object, in a third of the cases
with another one behind; or two to four beside each other; or none in the picture, but one outside
whose shadow may fall into it.

Limits: no hands, no liquids, no transparent things. Surfaces are flat.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from isc_core.errors import InputError
from isc_core.networks.mask_network import Count
from isc_core.shading.environment_map import mean_radiance
from synth.scene.meshes import Mesh, write_ply
from synth.scene.variant import load_mitsuba

from .cameras import Box, camera
from .sources import TabletopSources
from .surfaces import FAR, lamp, object_material, table, wall

OBJECT = "object"  # name of the first object in a scene
SHARES = (0.12, 0.68, 0.2)  # of scenes with no object in the picture, with one, with several
ONE_OBJECT = (0.0, 1.0, 0.0)
_KEPT = 40  # meshes that may stand in further scenes
_OTHER, _LAMP = 0.35, 0.6  # shares of the scenes
_PLACES = {"table": 0.4, "floor": 0.35, "wall": 0.25}
_MOST = 4  # objects
_TOUCHING = 0.002  # of the vertices may lie below the plane


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
    count : Count
        Of objects in the pictures.
    objects : tuple of str
        Names of the objects; with `Count.NONE`, of one outside the pictures.
    """

    mitsuba: dict[str, Any]
    sensors: tuple[dict[str, Any], ...]
    landscape: bool
    count: Count = Count.ONE
    objects: tuple[str, ...] = (OBJECT,)


class TabletopScenes:
    """Draws scenes.

    Parameters
    ----------
    sources : TabletopSources
    folder : Path
        For the files of meshes, which later scenes overwrite.
    cameras : int
        Of each scene.
    shares : tuple of float
        Of scenes by `Count`.
    """

    def __init__(
        self,
        sources: TabletopSources,
        folder: Path,
        cameras: int = 4,
        shares: tuple[float, float, float] = SHARES,
    ) -> None:
        self._sources, self._atlas = sources, sources.atlas
        self._folder, self._cameras, self._shares = folder, cameras, shares
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
        count = Count(int(rng.choice(len(Count), p=self._shares)))
        meshes = self._beside(rng) if count == Count.SEVERAL else [_standing(self._mesh(rng), rng)]
        names = (OBJECT, *(f"{OBJECT}{k}" for k in range(1, len(meshes))))
        azimuth = rng.uniform(0, 2 * np.pi)
        scene: dict[str, Any] = {"type": "scene", "sky": self._sky(rng)}
        for name, mesh in zip(names, meshes, strict=True):
            scene[name] = self._solid(name, mesh, rng)
        if rng.random() < _LAMP:
            scene["lamp"] = lamp(rng)
        place = str(rng.choice(list(_PLACES), p=list(_PLACES.values())))
        scene["table"] = table(FAR if place == "floor" else rng.uniform(1.5, 5), self._atlas, rng)
        if place == "wall":
            scene["wall"] = wall(azimuth, self._atlas, rng)
        if other := rng.random() < _OTHER and count == Count.ONE:
            scene["other"] = self._solid("other", self._behind(azimuth, rng), rng)
        spread = 0.35 if other or place == "wall" else np.pi
        box = _box(meshes)
        sensors = tuple(
            camera(box, azimuth + spread * rng.uniform(-1, 1), rng, count == Count.NONE)
            for _ in range(self._cameras)
        )
        return TabletopScene(scene, sensors, bool(rng.random() < 0.65), count, names)

    def _sky(self, rng: np.random.Generator) -> dict[str, Any]:
        mi = load_mitsuba()
        turn = mi.ScalarTransform4f().rotate([0, 1, 0], float(rng.uniform(0, 360)))
        panoramas = self._sources.panoramas
        panorama = panoramas[int(rng.integers(len(panoramas)))].astype(np.float32)
        bitmap = mi.Bitmap(panorama / mean_radiance(panorama).mean())
        return {"type": "envmap", "bitmap": bitmap, "to_world": turn}

    def _mesh(self, rng: np.random.Generator) -> Mesh:
        """A mesh; half of them have stood in an earlier scene, since some take seconds to make."""
        if len(self._meshes) > _KEPT // 8 and rng.random() < 0.5:
            return self._meshes[int(rng.integers(len(self._meshes)))]
        references = self._sources.references
        for k in rng.permutation(len(references)):
            try:
                bodies = references[int(k)].load()
            except InputError:
                continue
            if bodies:
                self._meshes.append(bodies[int(rng.integers(len(bodies)))].mesh)
                del self._meshes[:-_KEPT]
                return self._meshes[-1]
        raise InputError("none of the objects can be loaded: name folders of others, or a number")

    def _beside(self, rng: np.random.Generator) -> list[Mesh]:
        """Two to four meshes whose surrounding cylinders do not meet, around the y axis."""
        found: list[Mesh] = []
        centres: list[np.ndarray] = []
        radii: list[float] = []
        for _ in range(int(rng.integers(2, _MOST + 1))):
            mesh = _standing(self._mesh(rng), rng, rng.uniform(0.6, 1))
            radius = float(np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 2]).max())
            centre = np.zeros(3)
            if found:  # at the side of an earlier one
                k, gap = int(rng.integers(len(found))), rng.uniform(1.02, 1.4)
                while True:
                    angle = rng.uniform(0, 2 * np.pi)
                    step = gap * (radii[k] + radius) * np.array([np.cos(angle), 0, np.sin(angle)])
                    centre = centres[k] + step
                    pairs = zip(centres, radii, strict=True)
                    if all(np.linalg.norm(centre - other) > radius + r for other, r in pairs):
                        break
                    gap *= 1.05
            found.append(_moved(mesh, centre))
            centres.append(centre)
            radii.append(radius)
        corners = [np.stack([mesh.vertices.min(0), mesh.vertices.max(0)]) for mesh in found]
        low, high = np.min([one[0] for one in corners], 0), np.max([one[1] for one in corners], 0)
        return [_moved(mesh, -(low + high) / 2 * [1, 0, 1]) for mesh in found]

    def _behind(self, azimuth: float, rng: np.random.Generator) -> Mesh:
        """Another, smaller mesh beyond the first, seen from an azimuth."""
        mesh = _standing(self._mesh(rng), rng, rng.uniform(0.3, 0.8))
        toward = np.array([np.cos(azimuth), 0, np.sin(azimuth)])
        across = np.array([-toward[2], 0, toward[0]]) * rng.choice([-1, 1])
        return _moved(mesh, across * rng.uniform(0.7, 1.8) - toward * rng.uniform(1.5, 2.5))

    def _solid(self, name: str, mesh: Mesh, rng: np.random.Generator) -> dict[str, Any]:
        path = self._folder / f"{name}.ply"
        write_ply(path, mesh)
        return {"type": "ply", "filename": str(path), "bsdf": object_material(self._atlas, rng)}


def _standing(mesh: Mesh, rng: np.random.Generator, size: float = 1.0) -> Mesh:
    """The mesh, turned about the y axis, above the origin of the plane y = 0."""
    cosine, sine = np.cos(angle := rng.uniform(0, 2 * np.pi)), np.sin(angle)
    turned = mesh.rotated(np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]]))
    vertices = size * turned.vertices
    low, high = vertices.min(0), vertices.max(0)
    middle = (low + high) / 2
    middle[1] = np.quantile(vertices[:, 1], _TOUCHING)
    return Mesh(vertices - middle, turned.normals, turned.uv, turned.faces)


def _moved(mesh: Mesh, offset: np.ndarray) -> Mesh:
    return Mesh(mesh.vertices + offset, mesh.normals, mesh.uv, mesh.faces)


def _box(meshes: Sequence[Mesh]) -> Box:
    high = np.max([mesh.vertices.max(0) for mesh in meshes], axis=0)
    return Box(float(high[0]), float(high[2]), float(high[1]))
