"""What is known of a scene besides its photo: exact shape, exact light, observed depth."""

from dataclasses import dataclass
from numbers import Real

import numpy as np

from ..errors import InputError

# Log shading of a channel: its exponential must be a float32. Photos have less than 10.
_MOST_LOG_LIGHT = 60.0
_SIGMAS, _WEIGHTS = (1e-6, 1e9), (0.0, 1e9)


@dataclass(frozen=True, eq=False)
class KnownInputs:
    """Known quantities of a scene as a user supplies them, at the photo's full size.

    Attributes
    ----------
    height : (H, W) ndarray or None
        Exact shape, photo pixels toward the viewer.
    light : (9, 3) ndarray or None
        Exact log-shading SH coefficients, ISC's convention (`shading.spherical_harmonics`).
    depth : (H, W) ndarray or None
        Observed depth, photo pixels toward the viewer, with holes (NaN).
    depth_sigma : float
        Standard error of `depth`, photo pixels.
    depth_weight : float
        Weight of the depth term in the objective.
    """

    height: np.ndarray | None = None
    light: np.ndarray | None = None
    depth: np.ndarray | None = None
    depth_sigma: float = 2.0
    depth_weight: float = 10.0

    def check(self, shape: tuple[int, ...]) -> None:
        """Check the known quantities, before long work begins.

        Parameters
        ----------
        shape : tuple of int
            (H, W) of the photo.

        Raises
        ------
        InputError
            If an array is not one of numbers, or not of the right size, or a number is out of
            range; or if both an exact shape and a measured depth are given.
        """
        for what, values in (("shape", self.height), ("depth", self.depth)):
            if values is not None:
                _check_map(what, values, shape)
        if self.height is not None and self.depth is not None:
            raise InputError(
                "a known shape is exact, and a measured depth cannot change it: give --shape or "
                "--depth, not both"
            )
        if self.light is not None:
            _check_light(self.light)
        for what, value, (least, most) in (
            ("sigma", self.depth_sigma, _SIGMAS),
            ("weight", self.depth_weight, _WEIGHTS),
        ):
            if not isinstance(value, Real) or not least <= float(value) <= most:
                raise InputError(
                    f"the {what} of the depth must be a number from {least:g} to {most:g}, not "
                    f"{value!r}"
                )


def _check_map(what: str, values: object, shape: tuple[int, ...]) -> None:
    if not isinstance(values, np.ndarray) or values.ndim != 2 or values.dtype.kind not in "fiu":
        raise InputError(f"the {what} map must be an array of numbers (height, width)")
    if values.shape != shape:
        (rows, columns), (h, w) = values.shape, shape
        raise InputError(
            f"the {what} map is {columns} x {rows} but the photo {w} x {h}: give it at the "
            "photo's full size"
        )


def _check_light(light: object) -> None:
    try:
        values = np.asarray(light, float)
    except (TypeError, ValueError):
        values = np.empty(0)
    if values.shape != (9, 3) or not np.isfinite(values).all():
        raise InputError(
            "the light must be an array (9, 3) of finite numbers: red, green and blue of each "
            "spherical harmonic"
        )
    if (largest := float(np.abs(values).sum(axis=0).max())) > _MOST_LOG_LIGHT:
        raise InputError(
            f"the light's coefficients add up to {largest:g}, at most {_MOST_LOG_LIGHT:g} is "
            "allowed: give coefficients of the logarithm of shading"
        )


@dataclass(frozen=True, eq=False)
class DepthObservation:
    """Heights from another source, such as a depth sensor: a map with holes.

    Attributes
    ----------
    height : (H, W) ndarray
        Pixels toward the viewer, up to an additive constant; NaN where nothing was measured.
    sigma : float
        Standard error, pixels; larger differences cost linearly, so that outliers do not dominate.
    weight : float
        Weight of the whole term.
    """

    height: np.ndarray
    sigma: float = 2.0
    weight: float = 10.0


@dataclass(frozen=True, eq=False)
class SceneConstraints:
    """What SIRFS takes as given, each at the image's scale; read inside the mask only.

    Attributes
    ----------
    height : (H, W) ndarray or None
        Fixed shape, pixels toward the viewer.
    light : (9, C) ndarray or None
        Fixed log-shading SH coefficients, reference convention.
    depth : DepthObservation or None
        Observed depth.
    """

    height: np.ndarray | None = None
    light: np.ndarray | None = None
    depth: DepthObservation | None = None
