"""Mitsuba's variants share no code for rays: each tests the other. On a graphics card too, where
there is one.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mitsuba", reason="needs the extra `synth`")

from isc_core.result_files.result_folder import load, save
from isc_core.scene.decomposition import Decomposition
from synth.refine.transport import transport_of
from synth.rendering import Lit, Renderer, RenderOptions, light_surface
from synth.scene.variant import CHOICE, CUDA, LLVM, SCALAR, usable_variants
from tests.synth.small_scenes import lights, materials, seen, skittle, variant
from tests.synth.test_refine import bowl, contrasted, dome

ROOT = Path(__file__).resolve().parents[2]
MISSING = {
    CUDA: "needs a graphics card with CUDA and OptiX, whose driver Dr.Jit can load",
    LLVM: "needs libLLVM 19 or later",
}


@pytest.fixture(params=[(LLVM, SCALAR), (LLVM, CUDA), (SCALAR, CUDA)], ids="-".join)
def pair(request: pytest.FixtureRequest) -> tuple[str, str]:
    """Two variants that are compared."""
    require(*request.param)
    return request.param


def require(*names: str) -> None:
    for name in names:
        if name not in usable_variants():
            pytest.skip(MISSING[name])


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


def test_variants_see_the_same_surface(pair: tuple[str, str]) -> None:
    surfaces = []
    for name in pair:
        with variant(name):
            surfaces.append(seen(skittle(), size=32).surface)
    np.testing.assert_array_equal(surfaces[0].mask, surfaces[1].mask)
    for part in ("position", "normal", "view", "uv"):
        np.testing.assert_allclose(
            getattr(surfaces[0], part), getattr(surfaces[1], part), atol=2e-5
        )


def test_variants_give_the_arrays_the_same_light(pair: tuple[str, str]) -> None:
    one, two = (render(name, "blinn_phong", "panel", "arrays") for name in pair)
    require_same_light(one, two)


def test_variants_trace_the_same_shadows(pair: tuple[str, str]) -> None:
    """Of the refinement's transport."""
    found = []
    for name in pair:
        with variant(name):
            found.append(transport_of(dome(wall=True), 8))
    np.testing.assert_array_equal(found[0].unshadowed, found[1].unshadowed)
    hidden = [each.shadowed < each.unshadowed for each in found]
    assert hidden[0].mean() > 0.01
    assert (hidden[0] != hidden[1]).mean() < 1e-3
    assert found[0].indirect.max() > 0
    assert np.abs(found[0].indirect - found[1].indirect).mean() < 1e-3 * found[0].indirect.mean()


def refined(name: str, start: Path, output: Path) -> Decomposition:
    """By the command, in a process of its own, which is told the variant as users tell it."""
    code = "import sys; from tests.synth.test_refine import command; command(sys.argv[1:])"
    words = [sys.executable, "-c", code, str(start), "--light", "-o", str(output)]
    done = subprocess.run(
        words,
        cwd=ROOT,
        env={**os.environ, CHOICE: name},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return load(output)


@pytest.mark.slow
def test_variants_refine_to_the_same_result(pair: tuple[str, str], tmp_path: Path) -> None:
    """To 1 % of root mean square, of a bowl that shadows and lights itself.

    A ray that grazes an edge may be blocked in one variant only, and then the optimiser takes
    slightly other steps: 0.1 % of all rays, chosen at random, change the shading by 0.7 %.
    """
    save(contrasted(bowl()), tmp_path / "start")
    found = [refined(name, tmp_path / "start", tmp_path / name) for name in pair]
    notes = [each.provenance.settings["refine"] for each in found]
    assert [note["variant"] for note in notes] == list(pair)
    assert all(note["kept"] for note in notes)
    assert notes[0]["after"] == pytest.approx(notes[1]["after"], rel=0.02)
    mask = found[0].mask
    for part in ("shading", "reflectance", "visibility", "indirect", "environment"):
        one, two = (getattr(each, part) for each in found)
        if part != "environment":
            one, two = one[mask], two[mask]
        assert np.sqrt(np.mean((one - two) ** 2)) < 0.01 * np.sqrt(np.mean(one**2)), part


@pytest.mark.parametrize("light", ["directional", "panel", "environment"])
def test_kernels_render_the_same_light_on_a_card(light: str) -> None:
    require(LLVM, CUDA)
    require_same_light(render(LLVM, "ggx", light, "mitsuba"), render(CUDA, "ggx", light, "mitsuba"))
