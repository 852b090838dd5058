"""Coloured diffuse reflection under a white interface: the dichromatic reflection model (Shafer
1985).

Problem: plastic and coated surfaces reflect light that entered the body and took its colour, and
light that the interface mirrored unchanged.

Equation: f_r,c = colour_c f_diffuse + f_specular. Each term is a colour, the same from everywhere,
times a geometric factor. The light's colour is not in it: in radiance it multiplies both.

Citation: S. A. Shafer, "Using color to separate reflection components", Color Research and
Application 10(4), 210-218 (1985), doi:10.1002/col.5080100409.

Limits: insulators; metals colour their highlights. The lobes are added as they are: light that the
interface mirrors is not taken from the body, so the sum can exceed the incoming light. Reciprocal
where both lobes are.
"""

from dataclasses import dataclass, field, fields, replace
from typing import TypeVar

import numpy as np

from ...errors import InputError
from .blinn_phong import BlinnPhong
from .lambert import Lambert
from .model import Lobe, check_range

Gradient = TypeVar("Gradient")


@dataclass(frozen=True, eq=False)
class DichromaticGradient:
    """Derivatives of f_r by the parameters.

    Attributes
    ----------
    colour : (...) ndarray
        Derivative of each f_r,c by its own colour_c.
    diffuse : object
        Derivatives by the diffuse lobe's parameters; each field of that lobe's gradient, with a
        last axis of channels.
    specular : object
        Derivatives by the specular lobe's parameters (...), alike in every channel.
    """

    colour: np.ndarray
    diffuse: object
    specular: object


@dataclass(frozen=True, eq=False)
class Dichromatic:
    """The dichromatic model.

    Attributes
    ----------
    colour : (3,) or (..., 3) ndarray
        Of the diffuse lobe, in [0, 1].
    diffuse, specular : Lobe
        Models of the diffuse and of the specular lobe, neither with a colour.

    Raises
    ------
    InputError
        For other colours.
    """

    colour: np.ndarray = field(default_factory=lambda: np.ones(3))
    diffuse: Lobe = field(default_factory=Lambert)
    specular: Lobe = field(default_factory=BlinnPhong)

    def __post_init__(self) -> None:
        check_range("colour", self.colour, 0, 1)
        if np.shape(self.colour)[-1:] != (3,):
            raise InputError(
                f"colour has shape {np.shape(self.colour)}: give three channels on the last axis"
            )

    def value(self, normal: np.ndarray, view: np.ndarray, light: np.ndarray) -> np.ndarray:
        """Return f_r.

        Parameters
        ----------
        normal, view, light : (..., 3) ndarray
            Unit vectors in one frame: surface normal, and directions to the camera and to the
            light.

        Returns
        -------
        (..., 3) ndarray
            In 1/sr, 0 below the horizon.
        """
        diffuse, specular = (
            lobe.value(normal, view, light)[..., None] for lobe in (self.diffuse, self.specular)
        )
        return np.asarray(self.colour) * diffuse + specular

    def gradient(
        self, normal: np.ndarray, view: np.ndarray, light: np.ndarray
    ) -> DichromaticGradient:
        """Return the derivatives of `value` by the colour and by both lobes' parameters.

        Parameters
        ----------
        normal, view, light : (..., 3) ndarray
            Unit vectors in one frame: surface normal, and directions to the camera and to the
            light.

        Returns
        -------
        DichromaticGradient
            0 below the horizon.
        """
        diffuse = _coloured(self.diffuse.gradient(normal, view, light), np.asarray(self.colour))
        return DichromaticGradient(
            self.diffuse.value(normal, view, light),
            diffuse,
            self.specular.gradient(normal, view, light),
        )


def _coloured(gradient: Gradient, colour: np.ndarray) -> Gradient:
    """A lobe's gradient with each derivative (...) times the colour (..., 3)."""
    names = [part.name for part in fields(gradient)]  # type: ignore[arg-type]
    changes = {name: getattr(gradient, name)[..., None] * colour for name in names}
    return replace(gradient, **changes)  # type: ignore[type-var]
