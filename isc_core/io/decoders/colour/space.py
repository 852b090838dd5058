"""Colour spaces of image files other than sRGB: tone curves and primaries.

Equation: linear light of a channel is curve(code / peak); its colour in CIE XYZ is the sum of the
three colorants, each times its channel.

    PowerCurve:    y = (a x + b)^g + e   if x >= d,   c x + f   otherwise
    SampledCurve:  piecewise linear through equally spaced samples

Citation: International Color Consortium, Specification ICC.1:2022, sections 10.6 and 10.18.

Limits: the curves are clamped to [0, 1]. The conversion to Rec.709 is in `photo.primaries`.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np


class ToneCurve(Protocol):
    """From codes to linear light, both in [0, 1]; monotonic."""

    def __call__(self, codes: np.ndarray) -> np.ndarray:
        """Return the linear light of codes.

        Parameters
        ----------
        codes : ndarray
            In [0, 1].

        Returns
        -------
        ndarray
            Of the shape of `codes`, in [0, 1].
        """
        ...


@dataclass(frozen=True)
class PowerCurve:
    """A power law with a linear part near black.

    Attributes
    ----------
    g, a, b, c, d, e, f : float
        See the equation of this module.
    """

    g: float
    a: float = 1.0
    b: float = 0.0
    c: float = 0.0
    d: float = 0.0
    e: float = 0.0
    f: float = 0.0

    def __call__(self, codes: np.ndarray) -> np.ndarray:
        """Return the linear light of codes.

        Parameters
        ----------
        codes : ndarray
            In [0, 1].

        Returns
        -------
        ndarray
            Of the shape of `codes`, in [0, 1].
        """
        power = np.maximum(self.a * codes + self.b, 0.0) ** self.g + self.e
        return np.clip(np.where(codes >= self.d, power, self.c * codes + self.f), 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class SampledCurve:
    """A curve through equally spaced samples.

    Attributes
    ----------
    samples : (N,) ndarray
        In [0, 1], at 0, 1 / (N - 1), ..., 1; N at least 2.
    """

    samples: np.ndarray

    def __call__(self, codes: np.ndarray) -> np.ndarray:
        """Return the linear light of codes.

        Parameters
        ----------
        codes : ndarray
            In [0, 1].

        Returns
        -------
        ndarray
            Of the shape of `codes`, in [0, 1].
        """
        return np.interp(codes, np.linspace(0.0, 1.0, len(self.samples)), self.samples)


LINEAR = PowerCurve(1.0)


@dataclass(frozen=True, eq=False)
class ColourSpace:
    """The colour space of an image file.

    Attributes
    ----------
    name : str
        For messages, in printable characters.
    curves : tuple of ToneCurve
        One per channel, or one for all; empty: the default curve of the format.
    colorants : (3, 3) ndarray or None
        CIE XYZ of the primaries in the columns, whose sum is white; None: Rec.709.
    profile : bytes
        The ICC profile, empty without one.
    is_table : bool
        The profile is a table of colours, without curves and colorants.
    """

    name: str
    curves: tuple[ToneCurve, ...] = ()
    colorants: np.ndarray | None = None
    profile: bytes = b""
    is_table: bool = False


def colorants_of(chromaticities: np.ndarray) -> np.ndarray:
    """Return the colorants of three primaries and a white.

    Parameters
    ----------
    chromaticities : (4, 2) ndarray
        CIE x, y of red, green, blue and white.

    Returns
    -------
    (3, 3) ndarray
        CIE XYZ in the columns; their sum is white, of Y = 1.

    Raises
    ------
    ValueError
        If they are invalid: not finite, collinear, or a white without light or outside the triangle
        of the primaries.
    """
    xy = np.asarray(chromaticities, float)
    if not np.isfinite(xy).all() or np.abs(xy).max() > 10 or not xy[3, 1] > 1e-3:
        raise ValueError("not chromaticities")
    ends = np.stack([xy[:, 0], xy[:, 1], 1 - xy.sum(axis=1)])
    if abs(np.linalg.det(ends[:, :3])) < 1e-6:
        raise ValueError("the primaries lie on a line")
    amounts = np.linalg.solve(ends[:, :3], ends[:, 3] / xy[3, 1])
    if not (amounts > 0).all():
        raise ValueError("white is outside of the primaries")
    return ends[:, :3] * amounts
