"""The results of the core as typed frozen objects, and the identities that they satisfy.

Inside the mask `image = diffuse + specular + residual`, `diffuse = reflectance * shading` (both to
1e-5 of the image's maximum), `shading = exp(SH(normal))` (to 1e-4 relative), and normals have unit
length. After `isc refine --light`, `shading = exp(SH(normal)) * visibility + indirect`.
`result_files.result_folder` writes and reads their files.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..photo.camera import Camera
from ..shading.lights import VIEW
from ..shading.perspective import object_axis, view_directions
from ..shading.spherical_harmonics import real_sh
from .diagnostics import Abstention, Diagnostics
from .expected_error import ExpectedError
from .lobe_fit import LobeFit


@dataclass(frozen=True, eq=False)
class Separation:
    """One photo split into its layers: `image = diffuse + specular + residual` inside the mask.

    Attributes
    ----------
    diffuse, specular : (H, W, 3) ndarray of float32
        Linear, >= 0, 0 outside the mask.
    residual : (H, W, 3) ndarray of float32
        Linear, 0 outside the mask.
    confidence : (H, W) ndarray of float32
        Reliability of the split in [0, 1]; 0 outside the mask.
    abstention : Abstention or None
        Why the method `separation.BEST` removed nothing; None otherwise.
    image : (H, W, 3) ndarray or None
        The photo, linear, of which `isc_core.save` writes a copy; None where it is the sum of the
        layers.
    mask : (H, W) ndarray of bool or None
        The object; None where it is the pixels that are not black.
    cover : (H, W) ndarray or None
        Coverage of the pixels by the object, if its mask was found in the photo.
    """

    diffuse: np.ndarray
    specular: np.ndarray
    residual: np.ndarray
    confidence: np.ndarray
    abstention: Abstention | None = None
    image: np.ndarray | None = None
    mask: np.ndarray | None = None
    cover: np.ndarray | None = None


@dataclass(frozen=True)
class Provenance:
    """Origin of a result: everything in decomposition.json except the scene itself.

    Attributes
    ----------
    settings : dict
        The settings, JSON-ready.
    seed : int
        Of random numbers.
    versions : dict of str to str
        Versions of ISC, Python and the numerical packages.
    timings : dict of str to float
        Seconds by stage.
    input : dict
        The photo, JSON-ready.
    diagnostics : Diagnostics
        How the decomposition ended.
    """

    settings: dict[str, Any] = field(default_factory=dict)
    seed: int = 0
    versions: dict[str, str] = field(default_factory=dict)
    timings: dict[str, float] = field(default_factory=dict)
    input: dict[str, Any] = field(default_factory=dict)
    diagnostics: Diagnostics = field(default_factory=Diagnostics)

    @property
    def known(self) -> frozenset[str]:
        """What was given besides the photo: "shape", "light", "depth", "priors"."""
        names = self.input.get("known")  # from a file, which may hold anything
        return frozenset(map(str, names)) if isinstance(names, list) else frozenset()


@dataclass(frozen=True)
class IdentityErrors:
    """The largest violation of each identity inside the mask.

    Attributes
    ----------
    image, shading_product : float
        Largest absolute error over the image's maximum.
    sh : float
        Largest relative error of the shading.
    normal_length : float
        Largest deviation of a normal's length from 1.
    """

    image: float
    shading_product: float
    sh: float
    normal_length: float

    def broken(self) -> tuple[str, ...]:
        """Return the violated identities, one text each; empty for a sound result."""
        tests = (
            (self.image, 1e-5, "image = diffuse + specular + residual"),
            (self.shading_product, 1e-5, "diffuse = reflectance * shading"),
            (self.sh, 1e-4, "shading = exp(SH(normal)) * visibility + indirect"),
            (self.normal_length, 1e-4, "normals of length 1"),
        )
        return tuple(
            f"{name} (error {error:.2g})"
            for error, tolerance, name in tests
            if not error <= tolerance
        )


@dataclass(frozen=True, eq=False)
class Decomposition:
    """The intrinsic scene characteristics of one photo.

    Maps cover the whole frame at the working scale.

    Attributes
    ----------
    image, diffuse, specular, residual, reflectance, shading : (H, W, 3) ndarray of float32
        Linear Rec.709, 0 outside the mask.
    normal : (H, W, 3) ndarray of float32
        Unit vectors, camera frame: x right, y up, z toward the viewer; (0, 0, 1) outside the mask.
    height : (H, W) ndarray of float32
        Pixels toward the viewer; 0 outside the mask. Before a camera: along the axis toward the
        object, see `shading.perspective`.
    mask : (H, W) ndarray of bool
        The object.
    confidence : (H, W) ndarray
        In [0, 1]; falls with the expected error of the normals.
    illumination : (9, 3) ndarray of float64
        log shading_c(n) = sum_k illumination[k, c] Y_k(n), orthonormal real spherical harmonics.
    provenance : Provenance
        Origin of the result.
    brdf : LobeFit or None
        Lobe fitted to the specular layer; None where no fit was tried.
    expected_error : ExpectedError or None
        How wrong normals and reflectance probably are; None where it is not known.
    camera : Camera or None
        Pinhole camera of the maps; None for an orthographic view.
    visibility : (H, W, 3) ndarray of float32 or None
        Direct shading over exp(SH(normal)): cast shadows, and what no such light can say; > 0, may
        exceed 1; 1 outside the mask. None: 1 everywhere.
    indirect : (H, W, 3) ndarray of float32 or None
        Shading by light that the visible surface itself reflects; at least 0; 0 outside the mask.
        None: 0 everywhere.
    environment : (rows, 2 rows, 3) ndarray of float32 or None
        Radiance of the light, see `shading.environment_map`; None where only the coefficients are
        known.
    cover : (H', W') ndarray of float32 or None
        Coverage of the photo's pixels by the object, which `isc_core.save` writes as `mask.png`;
        None where only the mask is known.
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
    confidence: np.ndarray
    illumination: np.ndarray
    provenance: Provenance
    brdf: LobeFit | None = None
    expected_error: ExpectedError | None = None
    camera: Camera | None = None
    visibility: np.ndarray | None = None
    indirect: np.ndarray | None = None
    environment: np.ndarray | None = None
    cover: np.ndarray | None = None

    @property
    def view(self) -> np.ndarray:
        """Unit vectors toward the viewer, camera frame: (3,), or (H, W, 3) before a camera."""
        if self.camera is None:
            return VIEW
        return view_directions(self.camera, (self.mask.shape[0], self.mask.shape[1]))

    @property
    def viewer(self) -> np.ndarray:
        """Unit vector (3,) from the middle of the object toward the viewer, camera frame."""
        return VIEW if self.camera is None else -object_axis(self.camera, self.mask)

    @property
    def view_inside(self) -> np.ndarray:
        """`view` of the mask's N pixels: (3,) or (N, 3)."""
        return self.view if self.camera is None else self.view[self.mask]

    @property
    def lobe(self) -> np.ndarray:
        """Specular image (H, W, 3) that the fitted lobe predicts; 0 without a fit."""
        return np.zeros_like(self.specular) if self.brdf is None else self.brdf.predicted

    def identity_errors(self) -> IdentityErrors:
        """Measure how well the maps satisfy the identities inside the mask.

        Returns
        -------
        IdentityErrors
            The largest violations.

        Raises
        ------
        ValueError
            If the mask is empty.
        """
        if not self.mask.any():
            raise ValueError("the mask is empty: there is nothing to check")
        inside = {
            name: getattr(self, name)[self.mask].astype(np.float64)
            for name in COLOR_MAPS + ("normal",)
        }
        scale = max(float(np.abs(inside["image"]).max()), 1e-6)
        layers = inside["diffuse"] + inside["specular"] + inside["residual"]
        with np.errstate(over="ignore"):  # an absurd light: then the identity is violated anyway
            expected = np.exp(real_sh(inside["normal"]) @ self.illumination)
            if self.visibility is not None:
                expected = expected * self.visibility[self.mask]
            if self.indirect is not None:
                expected = expected + self.indirect[self.mask]
        return IdentityErrors(
            image=_worst(inside["image"] - layers) / scale,
            shading_product=_worst(inside["diffuse"] - inside["reflectance"] * inside["shading"])
            / scale,
            sh=_worst(expected / np.maximum(inside["shading"], 1e-9) - 1),
            normal_length=_worst(np.linalg.norm(inside["normal"], axis=-1) - 1),
        )


COLOR_MAPS = ("image", "diffuse", "specular", "residual", "reflectance", "shading")


def _worst(error: np.ndarray) -> float:
    return float(np.abs(error).max())
