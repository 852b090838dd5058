"""Conversions between measures of gloss: Blinn-Phong's exponent p, the alpha of facets (GGX,
Beckmann), Blender's roughness.

Problem: show a lobe fitted with one model in a renderer that has another.

Equation: Blender's Principled surface has alpha = roughness^2. The usual rule is p = 2 / alpha^2 -
2. It makes the lobes of Blinn-Phong and of BECKMANN facets alike for small alpha; it is widely used
for GGX, whose core is sharper for the same alpha while its tails are long. The fitted rule, p = a /
alpha^2 - b, minimises the integral over the light's solid angle of the squared difference of the
reflected light f_r cos_light, with the view along the normal, each lobe scaled to the same energy.
The half angle t then is half the light's angle, and the lobes are cos^p t cos 2t against D(t)
G1(cos 2t). The rule follows the exact minima, searched for at each alpha.

Measured error (root of that integral over the integral of the squared lobe of facets;
`lobe_difference`):

    alpha                       .02    .05    .1     .2     .3     .4     .5
    GGX       usual             .279   .278   .274   .254   .222   .187   .163
              fitted            .233   .231   .225   .199   .159   .112   .072
              exact minimum     .233   .231   .225   .199   .159   .112   .071
    Beckmann  usual             .0005  .0032  .0128  .0521  .121   .215
              fitted            .0001  .0009  .0034  .0119  .0201  .0386
              exact minimum     .0001  .0008  .0030  .0111  .0200  .0219

No exponent turns a Blinn-Phong lobe into a narrow GGX lobe: a quarter of it has another shape. Away
from the normal the rule stays near the best exponent while the lobes grow apart: for GGX viewed at
60 degrees the error is .25 at alpha .05, .39 at .2 and .38 at .5, at most .03 above the best
exponent's, and from alpha .3 on no better than the usual rule's.

Citation: B. Walter, S. R. Marschner, H. Li and K. E. Torrance, "Microfacet models for refraction
through rough surfaces", EGSR 2007, 195-206, doi:10.2312/EGWR/EGSR07/195-206 (D and G1 of both; the
usual rule). B. Burley, "Physically-based shading at Disney", SIGGRAPH courses (2012), which has no
DOI (alpha = roughness^2).

Limits: the usual rule needs alpha <= 1. The fitted one was fitted on alpha .02 to .5 (GGX, p 3 to
4000) and .02 to .4 (Beckmann, p 6 to 5000), raises an error above and is sound below. Fresnel is
left out: it is nearly constant within a lobe seen along the normal.
"""

from typing import Literal, get_args

import numpy as np

from ...errors import InputError
from .ggx import density, visible
from .model import Parameter, check_range, power

Facets = Literal["ggx", "beckmann"]
# a, b and the largest alpha of the fitted rule.
_FITTED: dict[str, tuple[float, float, float]] = {
    "ggx": (1.613, 3.15, 0.5),
    "beckmann": (2.0, 6.0, 0.4),
}
_NODES = 400
# Its square is still a number that can be divided by.
_TINY = 1e-100


def alpha_from_blender(roughness: Parameter) -> np.ndarray:
    """Return the alpha of GGX from the roughness of Blender's Principled surface, both in [0, 1].

    Parameters
    ----------
    roughness : float or ndarray

    Returns
    -------
    ndarray

    Raises
    ------
    InputError
        Outside this range.
    """
    check_range("roughness", roughness, 0, 1)
    return np.square(roughness)


def blender_from_alpha(alpha: Parameter) -> np.ndarray:
    """Return the roughness of Blender's Principled surface from the alpha of GGX, both in [0, 1].

    Parameters
    ----------
    alpha : float or ndarray

    Returns
    -------
    ndarray

    Raises
    ------
    InputError
        Outside this range.
    """
    check_range("alpha", alpha, 0, 1)
    return np.sqrt(alpha)


def exponent_from_alpha(alpha: Parameter) -> np.ndarray:
    """Return p = 2 / alpha^2 - 2, >= 0, for alpha in (0, 1]: the usual rule.

    Parameters
    ----------
    alpha : float or ndarray

    Returns
    -------
    ndarray

    Raises
    ------
    InputError
        Outside this range.
    """
    check_range("alpha", alpha, _TINY, 1)
    return 2 / np.square(alpha) - 2


def alpha_from_exponent(exponent: Parameter) -> np.ndarray:
    """Return alpha = sqrt(2 / (p + 2)), in (0, 1], for p >= 0: the usual rule.

    Parameters
    ----------
    exponent : float or ndarray

    Returns
    -------
    ndarray

    Raises
    ------
    InputError
        Outside this range.
    """
    check_range("exponent", exponent, 0, np.inf)
    return np.sqrt(2 / (np.asarray(exponent, float) + 2))


def fitted_exponent(alpha: Parameter, facets: Facets = "ggx") -> np.ndarray:
    """Return the exponent whose lobe is most similar to that of facets.

    Parameters
    ----------
    alpha : float or ndarray
        In (0, .5] for GGX and (0, .4] for Beckmann.
    facets : str
        "ggx" or "beckmann".

    Returns
    -------
    ndarray

    Raises
    ------
    InputError
        Outside these ranges, where no exponent gives a similar lobe, and for unknown facets.
    """
    scale, shift, largest = _rule(facets)
    check_range("alpha", alpha, _TINY, largest)
    return scale / np.square(alpha) - shift


def fitted_alpha(exponent: Parameter, facets: Facets = "ggx") -> np.ndarray:
    """Invert `fitted_exponent`.

    Parameters
    ----------
    exponent : float or ndarray
        At least the smallest that `fitted_exponent` returns (3.3 for GGX, 6.5 for Beckmann).
    facets : str
        "ggx" or "beckmann".

    Returns
    -------
    ndarray

    Raises
    ------
    InputError
        Below this exponent, and for unknown facets.
    """
    scale, shift, largest = _rule(facets)
    # The smallest exponent is passed on to the last digit by rounding, hence the tolerance.
    check_range("exponent", exponent, (scale / largest**2 - shift) * (1 - 1e-12), np.inf)
    return np.sqrt(scale / (np.asarray(exponent, float) + shift))


def lobe_difference(alpha: float, exponent: float, facets: Facets = "ggx") -> float:
    """Return the difference between a Blinn-Phong lobe and one of facets.

    It is the measured error of the module's docstring; 0 for equal lobes.

    Parameters
    ----------
    alpha : float
        In [.001, 1].
    exponent : float
        >= 0.
    facets : str
        "ggx" or "beckmann".

    Returns
    -------
    float

    Raises
    ------
    InputError
        Outside these ranges, and for unknown facets.
    """
    _rule(facets)
    check_range("alpha", alpha, 1e-3, 1)
    check_range("exponent", exponent, 0, np.inf)
    abscissa, weight = np.polynomial.legendre.leggauss(_NODES)
    root = (abscissa + 1) / 2
    half = np.pi / 4 * root**3
    solid = 2 * np.pi * np.sin(2 * half) * 2 * np.pi / 4 * 3 * root**2 * weight / 2
    cos_half, cos_light = np.cos(half), np.cos(2 * half)
    blinn = power(cos_half, exponent) * cos_light
    rough = (
        density(alpha, cos_half) * visible(alpha, cos_light)
        if facets == "ggx"
        else _beckmann(alpha, half)
    )
    blinn, rough = blinn / (solid @ blinn), rough / (solid @ rough)
    return float(np.sqrt(solid @ (blinn - rough) ** 2 / (solid @ rough**2)))


def _beckmann(alpha: float, half: np.ndarray) -> np.ndarray:
    """D G1 of Beckmann facets at the half angle `half` in (0, pi/4), the view along the normal; G1
    is Smith's, exact.
    """
    from scipy.special import erfc  # only to convert from another program's facets

    facets = np.exp(-np.square(np.tan(half) / alpha)) / (np.pi * alpha**2 * np.cos(half) ** 4)
    # The tangent is kept from rounding to 0 at the pole, where nothing is hidden.
    slope = 1 / (alpha * np.maximum(np.tan(2 * half), 1e-9))
    hidden = np.exp(-(slope**2)) / (2 * slope * np.sqrt(np.pi)) - erfc(slope) / 2
    return facets / (1 + hidden)


def _rule(facets: Facets) -> tuple[float, float, float]:
    if facets not in get_args(Facets):
        raise InputError(f"unknown facets {facets!r}: choose one of {', '.join(get_args(Facets))}")
    return _FITTED[facets]
