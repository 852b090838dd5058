"""The two renderers share no code for light and material, and Mitsuba's variants none for rays:
each tests the other.
"""

import dataclasses
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mitsuba", reason="needs the extra `synth`")

from synth.rendering import Lit, Renderer, RenderOptions, light_surface
from synth.scene.surface import Surface
from synth.scene.variant import has_llvm, load_mitsuba
from synth.validation.checks.pixel_test import (
    PixelTestOptions,
    PixelTestResult,
    keep_evidence,
    pixel_test,
)
from tests.synth.small_scenes import Seen, lights, materials, seen, skittle

SAMPLES = 256
# float32 against float64, of the brightest value: exact lights, and the closed forms under those
# that are sampled.
TOLERANCE = 2e-5

needs_llvm = pytest.mark.skipif(
    not has_llvm(), reason="only the scalar variant runs here: libLLVM 19 or later is missing"
)


@pytest.fixture(scope="module")
def waisted() -> Seen:
    return seen(skittle(), size=32)


@contextmanager
def variant(name: str) -> Iterator[None]:
    """Mitsuba temporarily in another variant."""
    mi = load_mitsuba()
    usual = mi.variant()
    mi.set_variant(name)
    try:
        yield
    finally:
        mi.set_variant(usual)


def render(
    scene: Seen, material: str, light: str, renderer: Renderer, seed: int, **options: int
) -> Lit:
    paint = materials()[material].at(scene.surface.uv)
    surface = dataclasses.replace(scene.surface, reflectance=paint)
    chosen = RenderOptions(**{"samples": SAMPLES, **options}, seed=seed, renderer=renderer)
    return light_surface(surface, materials()[material], (lights()[light],), scene.tracer, chosen)


def compared(
    surface: Surface, one: Lit, other: Lit, layer: str, samples: int = SAMPLES
) -> tuple[np.ndarray, np.ndarray, PixelTestResult]:
    difference = surface.image(getattr(one, layer) - getattr(other, layer)).astype(float)
    variance = surface.image(
        getattr(one, f"{layer}_variance") + getattr(other, f"{layer}_variance")
    ).astype(float)
    tolerance = TOLERANCE * max(float(getattr(one, layer).max()), 1e-12)
    return (
        difference,
        variance,
        pixel_test(difference, variance, PixelTestOptions(0.002, tolerance, samples)),
    )


@pytest.mark.slow
@needs_llvm
@pytest.mark.parametrize("light", lights())
@pytest.mark.parametrize("material", materials())
def test_arrays_and_kernels_agree(waisted: Seen, material: str, light: str, tmp_path: Path) -> None:
    by_arrays, by_kernels = (
        render(waisted, material, light, "arrays", 1),
        render(waisted, material, light, "mitsuba", 2),
    )
    assert by_arrays.shading.max() > 0
    for layer in ("shading", "specular"):
        difference, variance, result = compared(waisted.surface, by_arrays, by_kernels, layer)
        keep_evidence(tmp_path / layer, difference, variance, result)
        assert result.accepted, f"{layer}: {result.text()}; see {tmp_path / layer}"


@pytest.mark.slow
@needs_llvm
@pytest.mark.parametrize("light", ["directional", "environment"])
def test_arrays_and_kernels_agree_on_light_that_bounces(waisted: Seen, light: str) -> None:
    one, other = (
        render(waisted, "ggx", light, renderer, seed, bounces=2)
        for renderer, seed in (("arrays", 1), ("mitsuba", 2))
    )
    direct = render(waisted, "ggx", light, "mitsuba", 2)
    for layer in ("shading", "specular"):
        result = compared(waisted.surface, one, other, layer)[2]
        assert result.accepted, f"{layer}: {result.text()}"
        assert not compared(waisted.surface, one, direct, layer)[2].accepted


@needs_llvm
def test_the_comparison_finds_two_per_cent(waisted: Seen) -> None:
    """The sensitivity of the test above."""
    one, other = (
        render(waisted, "ggx", "environment", "arrays", 1),
        render(waisted, "ggx", "environment", "mitsuba", 2),
    )
    for layer in ("shading", "specular"):
        brighter = dataclasses.replace(other, **{layer: getattr(other, layer) * 1.02})
        assert not compared(waisted.surface, one, brighter, layer)[2].accepted


@needs_llvm
def test_variants_see_the_same_surface() -> None:
    usual = seen(skittle(), size=32)
    with variant("scalar_rgb"):
        plain = seen(skittle(), size=32)
    np.testing.assert_array_equal(plain.surface.mask, usual.surface.mask)
    for name in ("position", "normal", "view", "uv"):
        np.testing.assert_allclose(
            getattr(plain.surface, name), getattr(usual.surface, name), atol=2e-5
        )


@needs_llvm
def test_variants_give_the_arrays_the_same_light() -> None:
    """The same random numbers, so that only rays that graze an edge may differ."""
    usual = render(seen(skittle()), "blinn_phong", "panel", "arrays", 1, samples=16)
    with variant("scalar_rgb"):
        plain = render(seen(skittle()), "blinn_phong", "panel", "arrays", 1, samples=16)
    for layer in ("shading", "specular"):
        left = (
            np.abs(getattr(plain, layer) - getattr(usual, layer)).max(1)
            / getattr(usual, layer).max()
        )
        assert (left > 1e-4).mean() < 0.01
