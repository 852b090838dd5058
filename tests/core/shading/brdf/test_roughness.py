"""Conversions between measures of gloss: inverses, the measured errors that are written down, and
that the fitted rule is a minimum.
"""

import numpy as np
import pytest

from isc_core.errors import InputError
from isc_core.shading.brdf import roughness
from isc_core.shading.brdf.blinn_phong import BlinnPhong
from isc_core.shading.brdf.ggx import Ggx
from isc_core.shading.brdf.roughness import Facets, lobe_difference

from .directions_at import UP, polar_units

# alpha: error of the usual rule, of the fitted rule.
GGX = {
    0.02: (0.279, 0.233),
    0.05: (0.278, 0.231),
    0.1: (0.274, 0.225),
    0.2: (0.254, 0.199),
    0.3: (0.222, 0.159),
    0.4: (0.187, 0.112),
}
BECKMANN = {
    0.02: (0.0005, 0.0001),
    0.05: (0.0032, 0.0009),
    0.1: (0.0128, 0.0034),
    0.2: (0.0521, 0.0119),
    0.3: (0.1207, 0.0201),
}
ROWS = [("ggx", a, *row) for a, row in {**GGX, 0.5: (0.163, 0.072)}.items()] + [
    ("beckmann", a, *row) for a, row in {**BECKMANN, 0.4: (0.2149, 0.0386)}.items()
]


@pytest.mark.parametrize(("facets", "alpha", "usual", "fitted"), ROWS)
def test_the_errors_are_those_written_down(
    facets: Facets, alpha: float, usual: float, fitted: float
) -> None:
    tolerance = 6e-4 if facets == "ggx" else 6e-5
    assert lobe_difference(
        alpha, float(roughness.exponent_from_alpha(alpha)), facets
    ) == pytest.approx(usual, abs=tolerance)
    assert lobe_difference(
        alpha, float(roughness.fitted_exponent(alpha, facets)), facets
    ) == pytest.approx(fitted, abs=tolerance)


@pytest.mark.slow
@pytest.mark.parametrize("alpha", [0.02, 0.1, 0.2, 0.3, 0.4, 0.5])
def test_the_fitted_exponent_is_next_to_the_best(alpha: float) -> None:
    best = float(roughness.fitted_exponent(alpha))
    error = lobe_difference(alpha, best)
    around = [lobe_difference(alpha, best * factor) for factor in (0.8, 0.9, 0.97, 1.03, 1.1, 1.25)]
    assert min(around) >= error - 1e-3
    assert around[0] > error < around[-1]


def test_the_lobes_that_are_compared_are_those_of_the_models() -> None:
    """The error from the models themselves, by even steps over the light's hemisphere, the view
    along the normal.
    """
    cosine = (np.arange(200_000) + 0.5) / 200_000
    light = polar_units(cosine)
    lobes = [
        model.value(UP, UP, light) * cosine for model in (Ggx(0.2, 1.0), BlinnPhong(1.0, 37.0))
    ]
    rough, blinn = (lobe / lobe.sum() for lobe in lobes)
    expected = np.sqrt(((rough - blinn) ** 2).sum() / (rough**2).sum())
    assert lobe_difference(0.2, 37.0) == pytest.approx(expected, rel=1e-4)


def test_conversions_have_inverses() -> None:
    alpha = np.linspace(0.02, 0.4, 30)
    assert np.allclose(roughness.alpha_from_exponent(roughness.exponent_from_alpha(alpha)), alpha)
    assert np.allclose(roughness.alpha_from_blender(roughness.blender_from_alpha(alpha)), alpha)
    for facets in ("ggx", "beckmann"):
        assert np.allclose(
            roughness.fitted_alpha(roughness.fitted_exponent(alpha, facets), facets), alpha
        )
    assert roughness.fitted_alpha(roughness.fitted_exponent(0.5)) == pytest.approx(0.5)
    assert roughness.alpha_from_blender(0.5) == 0.25
    assert roughness.exponent_from_alpha(0.1) == pytest.approx(198)


def test_values_outside_the_domain_are_refused() -> None:
    for wrong in (0.0, -0.1, 1.1, np.nan):
        with pytest.raises(InputError, match="alpha"):
            roughness.exponent_from_alpha(wrong)
    with pytest.raises(InputError, match="alpha"):
        roughness.fitted_exponent(0.6)
    with pytest.raises(InputError, match="exponent"):
        roughness.fitted_alpha(1.0)
    with pytest.raises(InputError, match="roughness"):
        roughness.alpha_from_blender(1.5)
    with pytest.raises(InputError, match="facets"):
        roughness.fitted_alpha(100.0, "phong")  # type: ignore[arg-type]
