"""Mitsuba's variants share no code for rays: each tests the other. On a graphics card too, where
there is one.
"""

import numpy as np
import pytest

pytest.importorskip("mitsuba", reason="needs the extra `synth`")

from synth.refine.transport import transport_of
from synth.rendering import Lit, Renderer, RenderOptions, light_surface
from synth.scene.variant import CUDA, LLVM, SCALAR, usable_variants
from tests.synth.small_scenes import lights, materials, seen, skittle, variant
from tests.synth.test_refine import dome

MISSING = {
    CUDA: "needs a graphics card with CUDA and OptiX, whose driver Dr.Jit can load",
    LLVM: "needs libLLVM 19 or later",
}


@pytest.fixture(params=[SCALAR, CUDA])
def other(request: pytest.FixtureRequest) -> str:
    """A variant that is compared with LLVM's."""
    return available(request.param)


def available(name: str) -> str:
    for wanted in (LLVM, name):
        if wanted not in usable_variants():
            pytest.skip(MISSING[wanted])
    return name


def render(name: str, material: str, light: str, renderer: Renderer) -> Lit:
    with variant(name):
        scene = seen(skittle(), materials()[material], size=32)
        return light_surface(
            scene.surface,
            materials()[material],
            (lights()[light],),
            scene.tracer,
            RenderOptions(16, 1, renderer=renderer),
        )


def require_same_light(one: Lit, two: Lit) -> None:
    """The same random numbers, so that only rays that graze an edge may differ."""
    for layer in ("shading", "specular"):
        first, second = getattr(one, layer), getattr(two, layer)
        assert first.max() > 0
        assert (np.abs(first - second).max(1) > 1e-4 * first.max()).mean() < 0.01


def test_variants_see_the_same_surface(other: str) -> None:
    surfaces = []
    for name in (LLVM, other):
        with variant(name):
            surfaces.append(seen(skittle(), size=32).surface)
    np.testing.assert_array_equal(surfaces[0].mask, surfaces[1].mask)
    for part in ("position", "normal", "view", "uv"):
        np.testing.assert_allclose(
            getattr(surfaces[0], part), getattr(surfaces[1], part), atol=2e-5
        )


def test_variants_give_the_arrays_the_same_light(other: str) -> None:
    require_same_light(
        render(LLVM, "blinn_phong", "panel", "arrays"),
        render(other, "blinn_phong", "panel", "arrays"),
    )


def test_variants_trace_the_same_shadows(other: str) -> None:
    """Of the refinement's transport."""
    found = []
    for name in (LLVM, other):
        with variant(name):
            found.append(transport_of(dome(wall=True), 8))
    np.testing.assert_array_equal(found[0].unshadowed, found[1].unshadowed)
    hidden = [each.shadowed < each.unshadowed for each in found]
    assert hidden[0].mean() > 0.01
    assert (hidden[0] != hidden[1]).mean() < 1e-3
    assert found[0].indirect.max() > 0
    assert np.abs(found[0].indirect - found[1].indirect).mean() < 1e-3 * found[0].indirect.mean()


@pytest.mark.parametrize("light", ["directional", "panel", "environment"])
def test_kernels_render_the_same_light_on_a_card(light: str) -> None:
    card = available(CUDA)
    require_same_light(render(LLVM, "ggx", light, "mitsuba"), render(card, "ggx", light, "mitsuba"))
