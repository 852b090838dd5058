"""What all published methods have in common: figures, identities, invariances and refusals.

The methods' modules are called directly, without the crop of `separation.separate`.
"""

import importlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from isc_core.errors import Cancelled, InputError
from isc_core.progress import Monitor
from isc_core.scene.decomposition import Separation
from tests.core.separation.scenes import (
    Scene,
    assert_layers_hold,
    conical_plate,
    disc_of_two,
    error_ratio,
    gaussian_plate,
    glossy_disc,
    highlight_photo,
    laboratory_photo,
    psnr,
    spots,
)

PUBLISHED = {
    name: importlib.import_module(f"isc_core.separation.published.{name}")
    for name in (
        *("tan_2005", "mallick_2006", "yoon_2006", "shen_2009"),
        *("yang_2010", "kim_2013", "shen_2013", "akashi_2016"),
    )
}
EVERY = [(name, variant) for name, module in PUBLISHED.items() for variant in module.VARIANTS]
every = pytest.mark.parametrize(("method", "variant"), EVERY)
FASTER: dict[str, dict[str, Any]] = {
    "akashi_2016": {"surface_colours": 2, "sample": 1000, "iterations": 60, "starts": 1}
}


def options_of(method: str, variant: str = "improved") -> Any:
    """The options of a variant, with fewer iterations where the method is slow."""
    return replace(PUBLISHED[method].VARIANTS[variant], **FASTER.get(method, {}))


def split(
    method: str, image: np.ndarray, mask: np.ndarray, variant: str = "improved", **rest: Any
) -> Separation:
    """Separate by a method's own module."""
    found: Separation = PUBLISHED[method].separate(image, mask, options_of(method, variant), **rest)
    return found


# --- published figures ---------------------------------------------------------------------------

# PSNR in dB on animals and cups, and the tolerance. Of tan_2005 rounding decides many ties of
# 8-bit values, and each tie spreads: hence the wide band.
FIGURES = [
    ("tan_2005", "sihr", 30.43, 31.59, 0.2),
    ("yang_2010", "sihr", 36.46, 37.50, 0.05),
    ("yoon_2006", "sihr", 32.896, 33.296, 0.01),
    ("kim_2013", "paper", 32.7, 32.2, 0.1),
    ("kim_2013", "improved", 38.0, 39.7, 0.1),
    ("mallick_2006", "paper", 33.6, 35.1, 0.1),
    ("mallick_2006", "improved", 38.6, 36.8, 0.1),
    ("shen_2009", "sihr", 34.9, 37.6, 0.1),
    ("shen_2009", "improved", 36.8, 37.2, 0.1),
    ("shen_2013", "improved", 37.5, 39.5, 0.06),
    ("shen_2013", "paper", 37.3, 39.2, 0.06),
    ("shen_2013", "sihr", 37.5, 38.3, 0.06),
]
IMPROVED = {"tan_2005": (37.6, 37.2), "yang_2010": (37.3, 38.4), "yoon_2006": (37.5, 37.9)}


@pytest.mark.slow
@pytest.mark.parametrize(("method", "variant", "animals", "cups", "tolerance"), FIGURES)
def test_published_figures(
    shared: Path, method: str, variant: str, animals: float, cups: float, tolerance: float
) -> None:
    for name, figure in (("animals", animals), ("cups", cups)):
        image, truth, mask = highlight_photo(shared, name)
        got = psnr(split(method, image, mask, variant), truth)
        assert got == pytest.approx(figure, abs=tolerance), name


@pytest.mark.slow
@pytest.mark.parametrize("method", IMPROVED)
def test_improved_variant_exceeds_the_published_figure(shared: Path, method: str) -> None:
    for name, least in zip(("animals", "cups"), IMPROVED[method], strict=True):
        image, truth, mask = highlight_photo(shared, name)
        assert psnr(split(method, image, mask), truth) > least, name


# Error ratio (see `error_ratio`) of the improved variant at most, of another at least. Pale objects
# must be left alone.
PALE = ("box", "phone", "squirrel", "teabag2")
LABORATORY = [
    ("tan_2005", "apple", 0.25, "sihr", 5),
    *(("tan_2005", name, 1.001, "", 0) for name in PALE),
    ("yang_2010", "apple", 0.18, "", 0),
    *(("yang_2010", name, 1.001, "paper", 20) for name in PALE),
    ("yoon_2006", "apple", 0.18, "", 0),
    *(("yoon_2006", name, 1.001, "sihr", 15) for name in PALE),
    ("kim_2013", "apple", 0.13, "paper", 0.13),
    ("kim_2013", "teabag2", 1.001, "paper", 1.001),
    ("kim_2013", "squirrel", 1.001, "paper", 1.001),
    ("mallick_2006", "apple", 0.65, "paper", 0.65),
    ("mallick_2006", "teabag2", 1.001, "paper", 1.001),
    ("mallick_2006", "squirrel", 1.001, "paper", 1.001),
    ("shen_2009", "apple", 0.8, "paper", 0.8),
    ("shen_2009", "squirrel", 1.001, "paper", 40),
    ("shen_2009", "teabag2", 1.001, "paper", 40),
    ("shen_2013", "apple", 0.2, "", 0),
    *(("shen_2013", name, 1.01, "", 0) for name in ("box", "dinosaur", "squirrel", "teabag2")),
]


@pytest.mark.parametrize(("method", "name", "most", "other", "least"), LABORATORY)
def test_laboratory_objects(
    shared: Path, method: str, name: str, most: float, other: str, least: float
) -> None:
    image, truth, mask = laboratory_photo(shared, name)
    for variant in filter(None, ("improved", other)):
        found = split(method, image, mask, variant)
        assert_layers_hold(found, image, mask)
        ratio = error_ratio(found, image, truth, mask)
        assert ratio <= most if variant == "improved" else ratio > least, variant


# --- made scenes ---------------------------------------------------------------------------------

# Error ratio at most, for some or all variants.
HIGHLIGHTS: dict[str, tuple[Callable[..., Scene], dict[str, float]]] = {
    "tan_2005": (glossy_disc, {"improved": 0.001, "paper": 0.15, "sihr": 0.15}),
    "yang_2010": (glossy_disc, {"improved": 0.03, "paper": 0.03, "sihr": 0.03}),
    "yoon_2006": (glossy_disc, {"improved": 0.001, "paper": 0.001, "sihr": 0.02}),
    "kim_2013": (gaussian_plate, {"improved": 0.1}),
    "mallick_2006": (conical_plate, {"improved": 0.1, "paper": 0.02}),
    "shen_2009": (spots, {"improved": 0.02, "paper": 0.1}),
    "shen_2013": (disc_of_two, {"improved": 0.05}),
}


@pytest.mark.parametrize("method", HIGHLIGHTS)
def test_highlights_are_removed(method: str) -> None:
    scene, bounds = HIGHLIGHTS[method]
    image, diffuse, mask = scene()
    for variant, most in bounds.items():
        found = split(method, image, mask, variant)
        assert_layers_hold(found, image, mask)
        assert error_ratio(found, image, diffuse, mask) < most, variant
        assert not found.residual.any()


DIFFUSE = [
    pair
    for pair in EVERY
    if pair[0] == "yoon_2006" or (pair[0] == "yang_2010" and pair[1] != "sihr")
]


@pytest.mark.parametrize(("method", "variant"), DIFFUSE)
def test_diffuse_surface_is_left_alone(method: str, variant: str) -> None:
    _, diffuse, mask = glossy_disc()
    specular = split(method, diffuse, mask, variant).specular[mask]
    assert np.sqrt(np.mean(specular**2)) < 0.005 * np.sqrt(np.mean(diffuse[mask] ** 2))


# Factors of the exposure. The guards of the papers are absolute.
SCALES = [
    ("tan_2005", "improved", 1024.0),
    ("tan_2005", "improved", 2.0**-17),
    ("tan_2005", "paper", 1.0),
    *((m, "improved", scale) for m in ("yang_2010", "yoon_2006") for scale in (1000.0, 1e-5)),
    *((m, "paper", 1.0) for m in ("yang_2010", "yoon_2006")),
    *((m, "improved", 1000.0) for m in ("kim_2013", "mallick_2006", "shen_2009", "shen_2013")),
    *((m, "paper", 1000.0) for m in ("kim_2013", "mallick_2006", "shen_2009")),
    ("akashi_2016", "improved", 64.0),
]


@pytest.mark.parametrize(("method", "variant", "scale"), SCALES)
def test_exposure_and_surroundings_do_not_matter(method: str, variant: str, scale: float) -> None:
    """A wider frame, unknown outside the mask, and another exposure give the same layers."""
    image, _, mask = HIGHLIGHTS.get(method, (disc_of_two, {}))[0]()
    mask = mask.copy()
    mask[:, 90:] = False
    plain = split(method, image, mask, variant)
    assert plain.specular.max() > 0.2
    unknown = np.where(mask[..., None], image, np.nan)
    padded = np.pad(unknown, [(13, 5), (7, 11), (0, 0)], constant_values=np.inf)
    wide = split(method, scale * padded, np.pad(mask, [(13, 5), (7, 11)]), variant)
    inner = np.s_[13:-5, 7:-11]
    assert np.allclose(wide.specular[inner] / scale, plain.specular, atol=1e-5)
    assert np.allclose(wide.diffuse[inner] / scale, plain.diffuse, atol=1e-5)
    assert np.allclose(wide.confidence[inner], plain.confidence, atol=1e-4)


# The toolbox uses the whole frame; infinite values there overflow.
SUMS_THE_FRAME = [(name, "sihr") for name in ("tan_2005", "yang_2010", "yoon_2006")]


@every
def test_any_mask_and_noise_keep_the_layers_sound(method: str, variant: str) -> None:
    """Noise with grey and black stripes under a scattered mask, a column and a single pixel."""
    random = np.random.default_rng(3)
    image = random.random((40, 50, 3)) ** 3
    image[10:20] = image[10:20, :, :1]
    image[30:33] = 0
    single, column = np.zeros((40, 50), bool), np.zeros((40, 50), bool)
    single[3, 4] = column[:, 7] = True
    for mask in (random.random((40, 50)) > 0.4, single, column):
        for unknown in (np.nan,) if (method, variant) in SUMS_THE_FRAME else (np.nan, np.inf):
            found = split(method, np.where(mask[..., None], image, unknown), mask, variant)
            tinted = method == "akashi_2016" and variant != "improved"
            assert_layers_hold(found, image, mask, tinted=tinted)


# The scene, the level at which it is clipped, the error ratio at most, and whether clipped values
# leave the other pixels unchanged.
CLIPPED: dict[str, tuple[Scene, float, float, bool]] = {
    "tan_2005": (glossy_disc(0.9), 0.95, 0.1, True),
    "yang_2010": (glossy_disc(0.9), 0.95, 0.05, True),
    "yoon_2006": (glossy_disc(0.9), 0.95, 0.05, True),
    "kim_2013": (gaussian_plate(), 0.8, 0.2, False),
    "mallick_2006": (conical_plate(), 0.8, 0.2, False),
    "shen_2009": (spots((0.5, 0.6)), 0.8, 0.1, False),
    "shen_2013": (disc_of_two(), 0.85, 0.05, False),
    "akashi_2016": (disc_of_two(), 0.8, 1.0, False),
}


@pytest.mark.parametrize("method", CLIPPED)
def test_clipped_pixels_are_filled_from_around(method: str) -> None:
    (scene, diffuse, mask), level, most, alone = CLIPPED[method]
    image, clipped = np.minimum(scene, level), (scene > level).any(axis=2)
    assert clipped.sum() > (10 if method == "mallick_2006" else 20)
    found = split(method, image, mask, clipped=clipped)
    assert_layers_hold(found, image, mask)
    assert not found.confidence[clipped].any()
    before = image if method in ("kim_2013", "mallick_2006", "shen_2009") else scene
    assert error_ratio(found, before, diffuse, clipped) < most
    if alone:
        wild = np.where(clipped[..., None], [0.9, 0.0, 0.0], image)
        other, explained = split(method, wild, mask, clipped=clipped), mask & ~clipped
        assert np.array_equal(other.specular[explained], found.specular[explained])


@pytest.mark.parametrize("method", ["kim_2013", "mallick_2006"])
def test_nothing_is_specular_where_everything_is_clipped(method: str) -> None:
    image, _, mask = HIGHLIGHTS[method][0]()
    assert not split(method, image, mask, clipped=mask).specular.any()


# --- progress and refusals -----------------------------------------------------------------------


@pytest.mark.parametrize("method", sorted({*PUBLISHED} - {"shen_2009", "shen_2013"}))
def test_progress_rises_and_a_cancel_stops_every_variant(method: str) -> None:
    image, _, mask = glossy_disc()
    heard: list[float] = []
    split(method, image, mask, monitor=Monitor(lambda event: heard.append(event.fraction)))
    assert heard == sorted(heard) and heard[0] >= 0 and heard[-1] <= 1
    for variant in PUBLISHED[method].VARIANTS:
        with pytest.raises(Cancelled):
            split(method, image, mask, variant, monitor=Monitor(cancelled=lambda: True))


@every
def test_unusable_arrays_are_refused(method: str, variant: str) -> None:
    image, _, mask = disc_of_two()
    for wrong_image, wrong_mask, message in (
        (np.repeat(image[..., :1], 3, axis=2), mask, "no colour"),
        (image, np.zeros_like(mask), "mask is empty"),
        (image, mask[1:], "like the image"),
        (image[..., 0], mask, "colour image"),
        (np.where(mask[..., None], np.nan, image), mask, "non-finite"),
    ):
        with pytest.raises(InputError, match=message):
            split(method, wrong_image, wrong_mask, variant)


# Option, unusable value, a word of the message.
BAD_OPTIONS: dict[str, list[tuple[str, object, str]]] = {
    "akashi_2016": [
        ("start", "best", "start must be"),
        ("starts", 0, "at least 1"),
        ("tolerance", 0, "tolerance"),
    ],
    "kim_2013": [
        *((name, 0, name) for name in ("patch", "reach", "purity", "prior", "gradient", "hue")),
        *((name, -1, name) for name in ("rounds", "sweeps", "base")),
        *((name, 0, name) for name in ("trust", "fade")),
        ("smoothness", np.nan, "smoothness"),
        ("bright_saturation", 2, "bright_saturation"),
    ],
    "mallick_2006": [
        *((name, -1, name) for name in ("steps", "restoring_steps", "smoothing")),
        *((name, 0, name) for name in ("chroma", "texture", "fade")),
        ("step", 0.8, "step"),
        ("edge", np.nan, "edge"),
        ("bright_saturation", 2, "bright_saturation"),
        ("longest", 8, "longest"),
    ],
    "shen_2009": [
        *(("ring_width", width, "ring_width") for width in (4, 1)),
        ("region_share", 1, "region_share"),
        ("deviations", np.nan, "region_share"),
        ("bright_saturation", 2, "region_share"),
    ],
    "shen_2013": [
        ("bright_saturation", 1.1, "bright_saturation"),
        ("cluster_radius", 0, "cluster_radius"),
    ],
    "tan_2005": [
        *((name, -1, name) for name in ("start", "dark")),
        *((name, 0, name) for name in ("step", "noise", "colour_step", "cells")),
        *((name, 2, name) for name in ("quantile", "window")),
    ],
    "yang_2010": [
        *((name, 0, "range_sigma") for name in ("spatial_sigma", "range_sigma", "tolerance")),
        ("rounds", 0, "range_sigma"),
        ("dark", -1, "range_sigma"),
        ("spatial_sigma", np.inf, "range_sigma"),
    ],
    "yoon_2006": [
        *((name, 0, name) for name in ("colour_step", "cells")),
        *((name, -1, name) for name in ("dark", "sweeps", "tolerance")),
        *((name, 2, name) for name in ("quantile", "window")),
    ],
}


@pytest.mark.parametrize("method", BAD_OPTIONS)
def test_unusable_options_are_refused(method: str) -> None:
    image, _, mask = disc_of_two()
    for name, value, word in BAD_OPTIONS[method]:
        options = replace(PUBLISHED[method].VARIANTS["improved"], **{name: value})
        with pytest.raises(InputError, match=word):
            PUBLISHED[method].separate(image, mask, options)
