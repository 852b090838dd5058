"""The reflectance models: derivatives, symmetry, the horizon, and the published formulas where they
have a simple form.
"""

from dataclasses import fields, replace

import numpy as np
import pytest

from isc_core.errors import InputError
from isc_core.shading.brdf.blinn_phong import BlinnPhong
from isc_core.shading.brdf.dichromatic import Dichromatic
from isc_core.shading.brdf.directions import cosines, half_vector
from isc_core.shading.brdf.energy import reciprocity_error
from isc_core.shading.brdf.ggx import Ggx, density, visible
from isc_core.shading.brdf.lambert import Lambert
from isc_core.shading.brdf.model import Lobe, Model
from isc_core.shading.brdf.oren_nayar import OrenNayar
from isc_core.shading.brdf.phong import Phong

from .directions_at import (
    GLOSSY_PLASTIC,
    LOBES,
    PLAIN,
    RECIPROCAL,
    UP,
    lit_triples,
    polar_units,
    random_units,
    turned,
)


def name(model: object) -> str:
    return str(model)


def numbers(gradient: object) -> list[str]:
    return [part.name for part in fields(gradient)]  # type: ignore[arg-type]


def assert_derivatives(model: Lobe, gradient: object, geometry: tuple[np.ndarray, ...]) -> None:
    """Central differences of `value` by each parameter of the gradient, to 1e-5 of the largest
    derivative.
    """
    for parameter in numbers(gradient):
        here = getattr(model, parameter)
        step = 1e-5 * max(abs(here), 1e-2)
        up, down = (
            replace(model, **{parameter: here + sign * step}).value(*geometry)  # type: ignore[type-var]
            for sign in (1, -1)
        )
        found, expected = getattr(gradient, parameter), (up - down) / (2 * step)
        assert np.abs(expected).max() > 0
        assert np.abs(found - expected).max() <= 1e-5 * np.abs(expected).max(), parameter


INSIDE = [
    Lambert(0.7),
    OrenNayar(0.8, 0.4),
    OrenNayar(0.5, 1.2),
    Ggx(0.15, 0.05),
    Ggx(0.02, 0.5),
    Ggx(0.9, 0.9),
    *(Phong(0.6, p, normal) for p in (2.0, 31.0, 900.0) for normal in (True, False)),
    *(
        BlinnPhong(0.6, p, scale)
        for p in (2.0, 47.0, 2000.0)
        for scale in ("plain", "normalised", "conserving")
    ),  # type: ignore[arg-type]
]


@pytest.mark.parametrize("model", INSIDE, ids=name)
def test_gradients_are_the_values_derivatives(model: Lobe) -> None:
    geometry = lit_triples(400)
    gradient = model.gradient(*geometry)
    assert numbers(gradient) == [
        part.name
        for part in fields(model)
        if part.type != "bool" and part.name not in ("scale", "normalised")
    ]  # type: ignore[arg-type]
    assert_derivatives(model, gradient, geometry)


def test_gradients_of_coloured_paint() -> None:
    geometry = lit_triples(400)
    gradient = GLOSSY_PLASTIC.gradient(*geometry)
    for lobe in ("diffuse", "specular"):
        inner, slopes = getattr(GLOSSY_PLASTIC, lobe), getattr(gradient, lobe)
        for parameter in numbers(slopes):
            here, step = getattr(inner, parameter), 1e-6
            changed = [replace(inner, **{parameter: here + sign * step}) for sign in (1, -1)]
            up, down = (
                replace(GLOSSY_PLASTIC, **{lobe: other}).value(*geometry) for other in changed
            )  # type: ignore[arg-type]
            expected, found = (up - down) / (2 * step), getattr(slopes, parameter)
            found = found if found.ndim == 2 else found[:, None]
            assert np.abs(found - expected).max() <= 1e-5 * np.abs(expected).max(), (
                lobe,
                parameter,
            )
    step = 1e-6
    for channel in range(3):
        shift = step * np.eye(3)[channel]
        up, down = (
            replace(GLOSSY_PLASTIC, colour=GLOSSY_PLASTIC.colour + sign * shift).value(*geometry)
            for sign in (1, -1)
        )
        assert np.allclose(
            (up - down)[:, channel] / (2 * step), gradient.colour, rtol=1e-5, atol=1e-7
        )
        assert not np.delete(up - down, channel, axis=1).any()


@pytest.mark.parametrize("model", [*LOBES, GLOSSY_PLASTIC], ids=name)
def test_turning_everything_changes_nothing(model: Model) -> None:
    geometry = lit_triples(300)
    here, there = model.value(*geometry), model.value(*(turned(vectors, 5) for vectors in geometry))
    assert here.min() >= 0 and here.max() > 0
    assert np.allclose(here, there, rtol=1e-9, atol=1e-12 * here.max())


@pytest.mark.parametrize("model", [*RECIPROCAL, GLOSSY_PLASTIC], ids=name)
def test_view_and_light_may_be_exchanged(model: Model) -> None:
    assert reciprocity_error(model) <= 1e-12


@pytest.mark.parametrize("model", PLAIN, ids=name)
def test_plain_lobes_are_not_reciprocal(model: Model) -> None:
    assert reciprocity_error(model) > 0.1


@pytest.mark.parametrize("model", [*LOBES, GLOSSY_PLASTIC], ids=name)
def test_below_the_horizon_nothing_leaves(model: Lobe | Dichromatic) -> None:
    cosine = np.array([1, 0.5, 1e-3, 1e-7, 1e-12, 0, -1e-12, -1e-3, -1])
    view, light = (
        polar_units(cosine)[:, None, None],
        polar_units(cosine[:, None], np.array([0, 1.0, np.pi]))[None],
    )
    value = model.value(UP, view, light)
    above = (cosine > 1e-9)[:, None, None] & (cosine > 1e-9)[None, :, None] & np.ones(3, bool)
    assert np.isfinite(value).all() and (value >= 0).all() and not value[~above].any()
    gradient = model.gradient(UP, view, light)
    parts = [gradient.diffuse, gradient.specular] if isinstance(model, Dichromatic) else [gradient]  # type: ignore[attr-defined]
    for part in parts:
        for parameter in numbers(part):
            slope = getattr(part, parameter)
            assert np.isfinite(slope).all() and not slope[~above].any()


@pytest.mark.parametrize("model", LOBES, ids=name)
def test_opposite_directions_have_no_half_vector_and_give_zero(model: Model) -> None:
    along = random_units(50)
    assert not model.value(random_units(50, seed=9), along, -along).any()
    assert not half_vector(along, -along).any()


def test_directions_broadcast_and_parameters_with_them() -> None:
    normal, view, light = (
        random_units(*shape, seed=seed) for seed, shape in enumerate([(5, 7), (7,), (4, 1, 1)])
    )
    alpha = np.linspace(0.1, 0.9, 7)
    whole = Ggx(alpha, 0.1).value(normal, view, light)
    assert whole.shape == (4, 5, 7)
    for column, one in enumerate(alpha):
        single = Ggx(float(one), 0.1).value(normal[:, column], view[column], light[:, :, 0])
        assert np.allclose(whole[..., column], single, rtol=1e-12)


def test_oren_nayar_is_its_published_form() -> None:
    rng = np.random.default_rng(3)
    a, b, azimuth = (
        rng.uniform(0, 1.5, 200),
        rng.uniform(0, 1.5, 200),
        rng.uniform(0, 2 * np.pi, 200),
    )
    value = OrenNayar(0.6, 0.5).value(UP, polar_units(np.cos(a)), polar_units(np.cos(b), azimuth))
    first, second = 1 - 0.5 * 0.25 / 0.58, 0.45 * 0.25 / 0.34
    published = (
        0.6
        / np.pi
        * (
            first
            + second
            * np.maximum(0, np.cos(azimuth))
            * np.sin(np.maximum(a, b))
            * np.tan(np.minimum(a, b))
        )
    )
    assert np.allclose(value, published, rtol=1e-9)
    assert np.allclose(OrenNayar(0.6, 0.0).value(UP, UP, polar_units(np.cos(b))), 0.6 / np.pi)


def test_plain_lobes_give_the_published_radiance() -> None:
    normal, view, light = lit_triples(300)
    cos_light = (normal * light).sum(-1)
    mirrored = 2 * cos_light[:, None] * normal - light
    phong = Phong(0.5, 30.0, normalised=False).value(normal, view, light) * cos_light
    assert np.allclose(
        phong, 0.5 * np.maximum((mirrored * view).sum(-1), 0) ** 30, rtol=1e-6, atol=1e-12
    )
    blinn = BlinnPhong(0.5, 30.0, "plain").value(normal, view, light) * cos_light
    assert np.allclose(
        blinn, 0.5 * (normal * half_vector(view, light)).sum(-1) ** 30, rtol=1e-6, atol=1e-12
    )


def test_ggx_is_the_product_of_its_published_factors() -> None:
    normal, view, light = lit_triples(300)
    angles = cosines(normal, view, light)
    fresnel = 0.04 + 0.96 * (1 - angles.deviation) ** 5
    tangents = [np.sqrt(1 / cosine**2 - 1) for cosine in (angles.view, angles.light)]
    hidden = [2 / (1 + np.sqrt(1 + (0.3 * tangent) ** 2)) for tangent in tangents]
    published = (
        density(0.3, angles.half)
        * hidden[0]
        * hidden[1]
        * fresnel
        / (4 * angles.view * angles.light)
    )
    assert np.allclose(Ggx(0.3, 0.04).value(normal, view, light), published, rtol=1e-9)
    assert np.allclose(visible(0.3, angles.view), hidden[0], rtol=1e-9)


def test_dichromatic_is_colour_times_body_plus_white() -> None:
    geometry = lit_triples(300)
    value = GLOSSY_PLASTIC.value(*geometry)
    difference = value - GLOSSY_PLASTIC.specular.value(*geometry)[:, None]
    assert np.allclose(
        difference, GLOSSY_PLASTIC.diffuse.value(*geometry)[:, None] * [0.7, 0.3, 0.1]
    )
    assert np.allclose(value[:, 0] - value[:, 1], 0.4 * GLOSSY_PLASTIC.diffuse.value(*geometry))


@pytest.mark.parametrize(
    ("model", "changes", "words"),
    [
        (Lambert, {"albedo": 1.1}, "albedo"),
        (Lambert, {"albedo": np.array([0.1, np.nan])}, "albedo"),
        (Lambert, {"albedo": "white"}, "albedo"),
        (OrenNayar, {"sigma": -0.1}, "sigma"),
        (Phong, {"exponent": -1.0}, "exponent"),
        (Phong, {"strength": np.inf}, "strength"),
        (BlinnPhong, {"exponent": np.nan}, "exponent"),
        (BlinnPhong, {"scale": "exact"}, "scale"),
        (Ggx, {"alpha": 0.0}, "alpha"),
        (Ggx, {"f0": 2.0}, "f0"),
        (Dichromatic, {"colour": np.ones(4)}, "channels"),
        (Dichromatic, {"colour": np.array([0.5, 0.5, -0.1])}, "colour"),
    ],
)
def test_impossible_parameters_are_refused(
    model: type, changes: dict[str, object], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        model(**changes)


@pytest.mark.parametrize(
    ("light", "words"),
    [
        (2 * UP, "length 1"),
        (np.zeros(3), "length 1"),
        (np.full(3, np.nan), "length 1"),
        (np.ones(2), "shape"),
    ],
)
def test_unfit_directions_are_refused(light: np.ndarray, words: str) -> None:
    with pytest.raises(InputError, match=words):
        Lambert().value(UP, UP, light)


def test_directions_that_do_not_fit_together_are_refused() -> None:
    with pytest.raises(InputError, match="broadcast"):
        Lambert().value(random_units(4), random_units(5), UP)
