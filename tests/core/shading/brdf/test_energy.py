"""What the models keep of the light: closed forms, and bounds that none may break."""

import numpy as np
import pytest

from isc_core.errors import InputError
from isc_core.shading.brdf.blinn_phong import BlinnPhong
from isc_core.shading.brdf.energy import directional_albedo
from isc_core.shading.brdf.ggx import Ggx, density
from isc_core.shading.brdf.lambert import Lambert
from isc_core.shading.brdf.model import Model
from isc_core.shading.brdf.oren_nayar import OrenNayar
from isc_core.shading.brdf.phong import Phong

from .directions_at import GLOSSY_PLASTIC, UP, polar_units

VIEWS = (1.0, 0.7, 0.3, 0.1)
EXPONENTS = (5.0, 9.0, 30.0, 200.0, 2000.0)


def even_sum(model: Model, cos_view: float, count: int = 700) -> float:
    """The same integral over even steps in the light's cosine and azimuth: slow, but it shares
    nothing with the half vectors.
    """
    cosine, azimuth = (np.arange(count) + 0.5) / count, (np.arange(count) + 0.5) * 2 * np.pi / count
    light = polar_units(cosine[:, None], azimuth)
    values = model.value(UP, light, polar_units(np.array(cos_view)))
    return float((values * cosine[:, None]).sum() * 2 * np.pi / count**2)


@pytest.mark.parametrize("cos_view", VIEWS)
def test_lambert_keeps_its_albedo(cos_view: float) -> None:
    assert directional_albedo(Lambert(0.7), cos_view) == pytest.approx(0.7, abs=1e-12)


@pytest.mark.parametrize("exponent", EXPONENTS)
def test_normalised_phong_keeps_its_strength_along_the_normal(exponent: float) -> None:
    model = Phong(0.8, exponent)
    assert directional_albedo(model, 1.0) == pytest.approx(0.8, abs=1e-9)
    assert max(directional_albedo(model, cos_view) for cos_view in VIEWS) <= 0.8 + 1e-9


@pytest.mark.parametrize("exponent", EXPONENTS)
def test_normalised_blinn_phong_keeps_a_little_too_much(exponent: float) -> None:
    """The usual factor is an approximation: the closed form along the normal lies above 1, by 7.5 %
    at most.
    """
    model = BlinnPhong(1.0, exponent)
    exact = (exponent + 8) * (exponent + 2 ** (-exponent / 2)) / ((exponent + 2) * (exponent + 4))
    assert directional_albedo(model, 1.0) == pytest.approx(exact, abs=1e-9)
    assert 1 < exact <= 1.0752
    assert max(directional_albedo(model, cos_view) for cos_view in VIEWS) <= exact + 1e-9


@pytest.mark.parametrize("exponent", [0.0, 1.0, *EXPONENTS])
def test_conserving_blinn_phong_keeps_no_more_than_its_strength(exponent: float) -> None:
    kept = [
        float(directional_albedo(BlinnPhong(0.9, exponent, "conserving"), cos_view))
        for cos_view in VIEWS
    ]
    assert kept[0] == pytest.approx(0.9, abs=1e-9)
    assert max(kept) <= 0.9 + 1e-9


@pytest.mark.parametrize("alpha", [0.02, 0.1, 0.3, 0.6, 1.0])
def test_ggx_facets_cover_the_surface_once(alpha: float) -> None:
    abscissa, weight = np.polynomial.legendre.leggauss(400)
    polar = np.pi / 2 * ((abscissa + 1) / 2) ** 3
    step = np.pi / 2 * 1.5 * ((abscissa + 1) / 2) ** 2 * weight
    covered = (
        2 * np.pi * np.sin(polar) * np.cos(polar) * density(alpha, np.cos(polar)) * step
    ).sum()
    assert covered == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("alpha", [0.03, 0.1, 0.3, 0.6, 1.0])
def test_ggx_never_outshines_a_white_sky(alpha: float) -> None:
    kept = [float(directional_albedo(Ggx(alpha, 1.0), cos_view)) for cos_view in VIEWS]
    assert max(kept) <= 1 + 1e-9
    assert min(kept) > {0.03: 0.95, 0.1: 0.87, 0.3: 0.8, 0.6: 0.59, 1.0: 0.3}[alpha]


def test_ggx_of_alpha_one_has_a_closed_form() -> None:
    """D is 1 / pi, and along the normal f cos = cos / (2 pi (1 + cos)), whose integral is 1 - log
    2.
    """
    assert directional_albedo(Ggx(1.0, 1.0), 1.0) == pytest.approx(1 - np.log(2), abs=1e-9)


def test_oren_nayar_along_the_normal_has_a_closed_form() -> None:
    assert directional_albedo(OrenNayar(1.0, 0.5), 1.0) == pytest.approx(
        1 - 0.5 * 0.25 / 0.58, abs=1e-9
    )
    assert (
        max(
            directional_albedo(OrenNayar(1.0, sigma), cos_view)
            for sigma in (0.1, 0.5, 1.5)
            for cos_view in VIEWS
        )
        <= 1.02
    )


@pytest.mark.parametrize(
    "model",
    [
        OrenNayar(0.9, 0.6),
        Phong(1.0, 20.0),
        BlinnPhong(1.0, 20.0, "plain"),
        Phong(1.0, 9.0, False),
        Ggx(0.3, 0.2),
    ],
    ids=str,
)
def test_half_vectors_and_even_steps_agree(model: Model) -> None:
    for cos_view in (0.9, 0.4):
        assert directional_albedo(model, cos_view) == pytest.approx(
            even_sum(model, cos_view), rel=2e-4
        )


def test_the_nodes_are_enough() -> None:
    models: dict[Model, float] = {
        Phong(1.0, 2000.0): 1e-6,
        BlinnPhong(1.0, 2000.0): 1e-6,
        Ggx(0.03, 1.0): 1e-6,
        OrenNayar(1.0, 0.5): 1e-4,
    }
    for model, tolerance in models.items():
        for cos_view in (1.0, 0.5, 0.174):
            assert directional_albedo(model, cos_view) == pytest.approx(
                directional_albedo(model, cos_view, 150), abs=tolerance
            )


def test_coloured_paint_has_a_channel_each() -> None:
    kept = directional_albedo(GLOSSY_PLASTIC, 0.8)
    body, gloss = (
        directional_albedo(lobe, 0.8) for lobe in (GLOSSY_PLASTIC.diffuse, GLOSSY_PLASTIC.specular)
    )
    assert np.allclose(kept, np.array([0.7, 0.3, 0.1]) * body + gloss)


@pytest.mark.parametrize(("cos_view", "nodes"), [(0.0, 10), (1.1, 10), (np.nan, 10), (0.5, 1)])
def test_impossible_views_are_refused(cos_view: float, nodes: int) -> None:
    with pytest.raises(InputError, match="cos_view"):
        directional_albedo(Lambert(), cos_view, nodes)
