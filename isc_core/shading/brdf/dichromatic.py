"""Coloured paint under a clear, white gloss: the dichromatic reflection model (Shafer 1985).

Problem: plastic and paint send back light that went into the body and took its colour, and light
that the interface mirrored unchanged.

Equation: f_r,c = colour_c f_body + f_interface. Each term is a colour, the same from everywhere,
times a geometric factor. The colour of the light is the light's: in radiance it multiplies both.

Citation: S. A. Shafer, "Using color to separate reflection components", Color Research and
Application 10(4), 210-218 (1985), doi:10.1002/col.5080100409.

Limits: insulators; metals colour their highlights. The lobes are added as they are: light that the
interface mirrors is not taken from the body, so the sum can keep more than all the light.
Reciprocal where both lobes are.
"""

from dataclasses import dataclass, field, fields, replace
from typing import TypeVar

import numpy as np

from ...errors import InputError
from .blinn_phong import BlinnPhong
from .lambert import Lambert
from .model import Lobe, check_range

Gradient = TypeVar("Gradient")


@dataclass(frozen=True)
class DichromaticGradient:
    """`colour` (...): the derivative of each f_r,c by its own colour_c. `body`: the derivatives of
    f_r (..., 3) by the body's parameters, each field of the body's gradient with a last axis of
    channels. `interface`: those by the interface's (...), alike in every channel.
    """

    colour: np.ndarray
    body: object
    interface: object


@dataclass(frozen=True)
class Dichromatic:
    """`colour`: (3,) or (..., 3), of the body, in [0, 1]. `body`, `interface`: the models of the
    two lobes, neither with a colour. Raises `InputError` for other colours.
    """

    colour: np.ndarray = field(default_factory=lambda: np.ones(3))
    body: Lobe = field(default_factory=Lambert)
    interface: Lobe = field(default_factory=BlinnPhong)

    def __post_init__(self) -> None:
        check_range("colour", self.colour, 0, 1)
        if np.shape(self.colour)[-1:] != (3,):
            raise InputError(
                f"colour has shape {np.shape(self.colour)}: give three channels on the last axis"
            )

    def value(self, normal: np.ndarray, view: np.ndarray, light: np.ndarray) -> np.ndarray:
        """f_r (..., 3) in 1/sr for unit vectors (..., 3); 0 below the horizon."""
        body, interface = (
            lobe.value(normal, view, light)[..., None] for lobe in (self.body, self.interface)
        )
        return np.asarray(self.colour) * body + interface

    def gradient(
        self, normal: np.ndarray, view: np.ndarray, light: np.ndarray
    ) -> DichromaticGradient:
        """The derivatives of `value` by the colour and by both lobes' parameters."""
        body = _coloured(self.body.gradient(normal, view, light), np.asarray(self.colour))
        return DichromaticGradient(
            self.body.value(normal, view, light), body, self.interface.gradient(normal, view, light)
        )


def _coloured(gradient: Gradient, colour: np.ndarray) -> Gradient:
    """A lobe's gradient with each derivative (...) times the colour (..., 3)."""
    changes = {
        part.name: getattr(gradient, part.name)[..., None] * colour for part in fields(gradient)
    }  # type: ignore[arg-type]
    return replace(gradient, **changes)  # type: ignore[type-var]
