"""Reflection of a material at many points at once, and importance sampling of its directions.

Equation: diffuse and specular lobes as in `synth.scene.materials`. Directions are sampled from the
specular lobe, those of diffuse materials by the cosine (density cos / pi): Blinn-Phong's half
vectors have the density (p + 1) / (2 pi) cos^p, those of GGX that of the visible facets, D G1(view)
(view . h) / cos_view; a half vector maps to a light direction of 1 / (4 view . h) times its
density.

Citation: B. Walter, S. R. Marschner, H. Li, K. E. Torrance, "Microfacet models for refraction
through rough surfaces", EGSR 2007, 195-206, doi:10.2312/EGWR/EGSR07/195-206; J. Dupuy, A. Benyoub,
"Sampling visible GGX normals with spherical caps", Computer Graphics Forum 42(8), e14867 (2023),
doi:10.1111/cgf.14867.

Limits: those of the lobes. Sampled directions may lie below the horizon, where nothing is
reflected.
"""

from dataclasses import dataclass

import numpy as np

from isc_core.shading.brdf.blinn_phong import BlinnPhong
from isc_core.shading.brdf.ggx import Ggx, density, visible
from isc_core.shading.brdf.oren_nayar import OrenNayar

from ..scene.materials import Material
from ..scene.tracing import LIFT
from .rough_plastic import RoughPlastic


@dataclass(frozen=True, eq=False)
class Points:
    """N points of a surface, each seen from one direction.

    Attributes
    ----------
    position, normal, view : (N, 3) ndarray
        As in `Surface`.
    strength, gloss : (N,) ndarray
        Parameters of the specular lobe, see `scene.materials`.
    """

    position: np.ndarray
    normal: np.ndarray
    view: np.ndarray
    strength: np.ndarray
    gloss: np.ndarray

    def __len__(self) -> int:
        return len(self.position)

    def lifted(self) -> np.ndarray:
        """Return the origins of rays from the points, (N, 3)."""
        return self.position + LIFT * self.normal

    def at(self, chosen: np.ndarray | slice) -> "Points":
        """Return the points that an index selects, repeated as often as it does.

        Parameters
        ----------
        chosen : ndarray of int or bool, or slice
            The index.

        Returns
        -------
        Points
            One entry per selected point.
        """
        parts = (self.position, self.normal, self.view, self.strength, self.gloss)
        return Points(*(part[chosen] for part in parts))


class Reflection:
    """A material without its albedo.

    Parameters
    ----------
    material : Material
        The material.

    Raises
    ------
    InputError
        For rough plastic, if Mitsuba is not installed.
    """

    def __init__(self, material: Material) -> None:
        self._model, self._f0, self._sigma = material.model, material.f0, material.sigma
        self.is_diffuse = material.is_diffuse
        if material.model == "roughplastic":
            self._plastic = RoughPlastic(float(material.gloss), material.ior)

    def diffuse(self, points: Points, light: np.ndarray) -> np.ndarray:
        """Evaluate the diffuse lobe for albedo 1.

        Parameters
        ----------
        points : Points
            N points.
        light : (N, 3) ndarray
            Unit directions to the light, above the horizon.

        Returns
        -------
        (N,) ndarray
            f_r in 1/sr.
        """
        if self._model == "oren_nayar":
            return OrenNayar(1.0, self._sigma).value(points.normal, points.view, light)
        if self._model == "roughplastic":
            return self._plastic.diffuse(points.normal, points.view, light)
        return np.full(len(points), 1 / np.pi)

    def gloss(self, points: Points, light: np.ndarray) -> np.ndarray:
        """Evaluate the specular lobe, its strength included.

        Parameters
        ----------
        points : Points
            N points.
        light : (N, 3) ndarray
            Unit directions to the light, above the horizon.

        Returns
        -------
        (N,) ndarray
            f_r in 1/sr.
        """
        if self.is_diffuse or not len(points):
            return np.zeros(len(points))
        if self._model == "blinn_phong":
            return BlinnPhong(points.strength, points.gloss, "normalised").value(
                points.normal, points.view, light
            )
        if self._model == "ggx":
            return points.strength * Ggx(points.gloss, self._f0).value(
                points.normal, points.view, light
            )
        return self._plastic.gloss(points.normal, points.view, light)

    def draw(self, rng: np.random.Generator, points: Points, count: int) -> np.ndarray:
        """Sample directions from the specular lobe; by the cosine for diffuse materials.

        Parameters
        ----------
        rng : numpy.random.Generator
            Random numbers.
        points : Points
            N points.
        count : int
            Directions per point.

        Returns
        -------
        (N, count, 3) ndarray
            Unit directions.
        """
        if self.is_diffuse:
            return cosine_directions(rng, points, count)
        first, turn = rng.random((2, len(points), count))
        turn = turn * (2 * np.pi)
        frame = _frames(points.normal)
        view = points.view[:, None]
        if self._model == "blinn_phong":
            half = _upright(first ** (1 / (points.gloss[:, None] + 1)), turn) @ frame
        else:
            half = (
                _visible_facets(
                    first, turn, np.einsum("nij,nj->ni", frame, points.view), points.gloss
                )
                @ frame
            )
        return 2 * np.einsum("...i,...i->...", view, half)[..., None] * half - view

    def density(self, points: Points, light: np.ndarray) -> np.ndarray:
        """Return the density of `draw`.

        Parameters
        ----------
        points : Points
            N points.
        light : (N, 3) ndarray
            Unit directions, above the horizon.

        Returns
        -------
        (N,) ndarray
            Per steradian.
        """
        if self.is_diffuse:
            return cosine_density(points, light)
        half = points.view + light
        half /= np.sqrt(_dot(half, half))[:, None]
        cosine, deviation = (
            np.clip(_dot(points.normal, half), 0, 1),
            np.maximum(_dot(points.view, half), 1e-9),
        )
        if self._model == "blinn_phong":
            return (points.gloss + 1) / (8 * np.pi) * cosine**points.gloss / deviation
        toward = np.clip(_dot(points.normal, points.view), 1e-9, 1)
        return density(points.gloss, cosine) * visible(points.gloss, toward) / (4 * toward)


def cosine_directions(rng: np.random.Generator, points: Points, count: int) -> np.ndarray:
    """Sample directions above each point with the density cos / pi.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.
    points : Points
        N points.
    count : int
        Directions per point.

    Returns
    -------
    (N, count, 3) ndarray
        Unit directions.
    """
    first, turn = rng.random((2, len(points), count))
    return _upright(np.sqrt(first), turn * (2 * np.pi)) @ _frames(points.normal)


def cosine_density(points: Points, light: np.ndarray) -> np.ndarray:
    """Return the density of `cosine_directions`.

    Parameters
    ----------
    points : Points
        N points.
    light : (N, 3) ndarray
        Unit directions.

    Returns
    -------
    (N,) ndarray
        Per steradian.
    """
    return np.maximum(_dot(points.normal, light), 0) / np.pi


def _upright(cosine: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Unit vectors (..., 3) at a cosine (...) from +z, rotated about it."""
    across = np.sqrt(np.maximum(1 - cosine * cosine, 0))
    return np.stack([across * np.cos(turn), across * np.sin(turn), cosine], -1)


def _visible_facets(
    first: np.ndarray, turn: np.ndarray, view: np.ndarray, alpha: np.ndarray
) -> np.ndarray:
    """Half vectors (N, count, 3) in the frame of each normal, for views (N, 3) there.

    On facets stretched to a sphere the visible part is a cap whose directions, halved with the
    view, are uniform.
    """
    stretch = np.stack([alpha, alpha, np.ones_like(alpha)], -1)
    seen = view * stretch
    seen = (seen / np.linalg.norm(seen, axis=1, keepdims=True))[:, None]
    half = _upright(np.clip((1 - first) * (1 + seen[..., 2]) - seen[..., 2], -1, 1), turn) + seen
    half = half * stretch[:, None]
    half[..., 2] = np.maximum(half[..., 2], 0)
    return half / np.maximum(np.sqrt(np.einsum("...i,...i->...", half, half)), 1e-12)[..., None]


def _frames(normal: np.ndarray) -> np.ndarray:
    """Two tangents and the normal, as rows: (N, 3, 3)."""
    side = np.where(np.abs(normal[:, :1]) < 0.7, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    across = np.cross(side, normal)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return np.stack([across, np.cross(normal, across), normal], 1)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i->...", a, b)
