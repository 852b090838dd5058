"""The two renderers share no code for light and material: each tests the other."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mitsuba", reason="needs the extra `synth`")

from synth.rendering import Lit, Renderer, RenderOptions, light_surface
from synth.scene.surface import Surface
from synth.scene.variant import is_vectorised
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

needs_kernels = pytest.mark.skipif(
    not is_vectorised(),
    reason="only the scalar variant runs here: CUDA or libLLVM 19 or later is missing",
)


@pytest.fixture(scope="module")
def waisted() -> Seen:
    return seen(skittle(), size=32)


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
@needs_kernels
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
@needs_kernels
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


@needs_kernels
def test_the_comparison_finds_two_per_cent(waisted: Seen) -> None:
    """The sensitivity of the test above."""
    one, other = (
        render(waisted, "ggx", "environment", "arrays", 1),
        render(waisted, "ggx", "environment", "mitsuba", 2),
    )
    for layer in ("shading", "specular"):
        brighter = dataclasses.replace(other, **{layer: getattr(other, layer) * 1.02})
        assert not compared(waisted.surface, one, brighter, layer)[2].accepted
