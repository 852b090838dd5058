"""The refinement of a light: transport, gradients, held-out blocks, identities and the command."""

from dataclasses import fields, replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

pytest.importorskip("mitsuba")

from isc_core.errors import InputError
from isc_core.imaging.bounding_box import FramePart
from isc_core.refinement.held_out import held_out_blocks
from isc_core.refinement.reflectance_terms import ReflectanceTerms
from isc_core.refinement.working_scale import working_scale
from isc_core.result_files import maps_file
from isc_core.result_files.result_folder import load, load_part, save
from isc_core.scene.decomposition import Decomposition, Provenance
from isc_core.scene.part_of_result import placed_result
from isc_core.shading.environment_map import environment_from_shading, shading_under
from isc_core.shading.spherical_harmonics import real_sh
from isc_core.sirfs.priors.prior_file import shipped_priors
from isc_core.sirfs.settings import isc_weights
from synth.refine.held_out import BLOCK, explains_better
from synth.refine.light_field import LightField
from synth.refine.light_objective import LightObjective
from synth.refine.refine import RefineOptions, refine
from synth.refine.surface import Surface
from synth.refine.transport import light_transport, transport_of
from synth.scene.variant import load_mitsuba
from tests.core.refinement.test_gloss import glossy
from tests.synth.refine_command import command

LIGHT = np.zeros((9, 3))
LIGHT[0], LIGHT[1], LIGHT[2] = -1.0, 0.6, 0.9


def of_one_colour(normal: np.ndarray, height: np.ndarray, mask: np.ndarray) -> Decomposition:
    """The result of a surface of one colour under `LIGHT`."""
    shading = np.zeros(normal.shape, np.float32)
    shading[mask] = np.exp(real_sh(normal[mask].astype(float)) @ LIGHT)
    reflectance = np.where(mask[..., None], np.float32(0.5), np.float32(0)) * np.ones(3, np.float32)
    diffuse = reflectance * shading
    zero = np.zeros_like(diffuse)
    return Decomposition(
        diffuse, diffuse, zero, zero, reflectance, shading, normal,
        np.where(mask, height, 0).astype(np.float32), mask, mask.astype(np.float32), LIGHT,
        Provenance(input={"sha256": "0" * 64}),
    )  # fmt: skip


def dome(size: int = 48, *, wall: bool = False) -> Decomposition:
    """A flat dome, or a floor with a wall along the middle."""
    y, x = np.mgrid[:size, :size] + 0.5 - size / 2
    mask = np.hypot(x, y) < 0.45 * size
    height = np.where(np.abs(x) < 2, 15.0, 0.0) if wall else np.sqrt(size**2 - x**2 - y**2)
    normal = np.zeros((size, size, 3), np.float32)
    normal[..., 2] = 1
    if not wall:
        normal[mask] = (np.stack([x, -y, height], -1) / size)[mask]
    return of_one_colour(normal, height, mask)


def objective(d: Decomposition) -> tuple[LightObjective, LightField]:
    light = np.where(d.mask[..., None], np.log(np.maximum(d.diffuse, 1e-4)), 0).astype(float)
    light += np.where(d.mask[..., None], np.random.default_rng(0).normal(0, 0.1, light.shape), 0)
    terms = ReflectanceTerms(light, d.mask, shipped_priors("photo", 3), isc_weights("photo", 3))
    field = LightField.around(np.maximum(environment_from_shading(LIGHT, 8), 1e-3))
    found = transport_of(d, 8)
    direct, indirect = found.shadowed.astype(float), found.indirect.astype(float)
    return LightObjective(terms, field, direct, indirect, d.mask.astype(float), 0.1), field


def test_without_shadows_the_transport_is_the_shading_of_the_environment() -> None:
    d = dome()
    environment = np.random.default_rng(1).uniform(0.1, 1, (8, 16, 3))
    found = transport_of(d, 8).unshadowed @ environment.reshape(-1, 3)
    assert np.allclose(found, shading_under(environment, d.normal[d.mask].astype(float)), rtol=1e-4)


def test_a_convex_surface_shades_nothing_and_a_wall_shades_the_far_side() -> None:
    convex = transport_of(dome(), 8)
    assert convex.shadowed.sum() > 0.98 * convex.unshadowed.sum()
    d = dome(wall=True)
    found = transport_of(d, 8)
    across = np.nonzero(d.mask)[1] - d.mask.shape[1] / 2
    near = (across < -3) & (across > -12)
    share = found.shadowed[near].sum(0) / np.maximum(found.unshadowed[near].sum(0), 1e-9)
    # In front of the floor's plane: azimuths just past right, and just before left.
    from_right, from_left = share.reshape(8, 16)[3:5, 4], share.reshape(8, 16)[3:5, 11]
    assert from_right.max() < 0.5 < 0.9 < from_left.min()


def bowl(size: int = 96, depth: float = 0.5) -> Decomposition:
    """A spherical cap that opens toward the viewer, of radius R and depth `depth` R."""
    radius = 0.45 * size / np.sqrt(depth * (2 - depth))
    y, x = np.mgrid[:size, :size] + 0.5 - size / 2
    mask = np.hypot(x, y) < 0.45 * size
    below = np.sqrt(np.maximum(radius**2 - x**2 - y**2, 0))
    normal = np.zeros((size, size, 3), np.float32)
    normal[..., 2] = 1
    normal[mask] = (np.stack([-x, y, below], -1) / radius)[mask]
    return of_one_colour(normal, below.max() - below, mask)


def test_a_bowl_lights_itself_by_its_form_factor() -> None:
    d = bowl(192)
    d = replace(d, diffuse=np.where(d.mask[..., None], np.float32([0.2, 0.3, 0.4]), 0))
    found = transport_of(d, 16)
    # Between any two points of a sphere the form factor is the same: the share of its area.
    assert np.median(found.indirect, axis=0) == pytest.approx(0.25 * d.diffuse[d.mask][0], rel=0.06)
    blocked = (found.unshadowed - found.shadowed).sum(axis=1, keepdims=True)
    assert np.mean(found.indirect - blocked * d.diffuse[d.mask]) == pytest.approx(0, abs=1e-3)


def test_a_convex_surface_reflects_no_light_on_itself() -> None:
    d = dome()
    assert transport_of(d, 8).indirect.mean() < 0.01 * d.diffuse[d.mask].mean()


def test_points_of_blocks_get_the_mean_of_their_pixels() -> None:
    d = bowl(400)
    surface, scale = Surface(d), working_scale(d)
    coarse = light_transport(surface, surface.points_at(scale), 8)
    fine = np.zeros((*d.mask.shape, 3))
    fine[d.mask] = transport_of(d, 8).indirect
    wanted = scale.reduced(fine, d.mask)[scale.mask]
    assert scale.step == 2 and len(coarse.indirect) == len(wanted)
    assert np.abs(coarse.indirect - wanted).mean() < 0.05 * wanted.mean()


def test_the_gradient_is_that_of_finite_differences() -> None:
    function, field = objective(dome())
    rng = np.random.default_rng(2)
    x, step = rng.normal(0, 0.2, field.size), rng.normal(0, 1, field.size)
    gradient, spare = np.empty_like(x), np.empty_like(x)
    function(x, gradient)
    along = (function(x + 1e-5 * step, spare) - function(x - 1e-5 * step, spare)) / 2e-5
    assert along == pytest.approx(float(gradient @ step), rel=1e-3)


def test_the_shading_that_the_image_is_made_of_explains_it_better() -> None:
    d = dome(128)
    n = d.normal[d.mask].astype(float)
    true = np.exp(2 * n[:, :1]) * np.ones(3)
    light = np.zeros(d.diffuse.shape)
    light[d.mask] = np.log(true)
    terms = ReflectanceTerms(light, d.mask, shipped_priors("photo", 3), isc_weights("photo", 3))
    blocks, flat = held_out_blocks(light[..., 0], BLOCK, 10, 0, d.mask), np.ones_like(true)
    assert explains_better(terms, blocks, flat, true)
    assert not explains_better(terms, blocks, true, flat)
    assert not explains_better(terms, blocks, true, true)
    assert not explains_better(terms, blocks[:2], flat, true)


def contrasted(d: Decomposition) -> Decomposition:
    """The result with an image of more contrast than its shading explains."""
    factor = np.exp(1.5 * d.normal[..., :1]).astype(np.float32)
    diffuse = np.where(d.mask[..., None], d.diffuse * factor, 0).astype(np.float32)
    return replace(d, image=diffuse, diffuse=diffuse, reflectance=d.reflectance * factor)


@pytest.mark.slow
@pytest.mark.parametrize("size", [96, 240])
def test_a_refined_result_keeps_every_identity_and_its_files(
    tmp_path: Path, size: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    traced = Mock(side_effect=light_transport)
    monkeypatch.setattr("synth.refine.refine.light_transport", traced)
    start = contrasted(dome(size))
    done = refine(start)
    assert done.kept and done.after < done.before
    assert (traced.call_count == 1) == (size == 96), "the working scale has the pixels of the maps"
    d = done.result
    assert d.visibility is not None and d.indirect is not None and d.environment is not None
    assert not d.identity_errors().broken()
    assert np.array_equal(d.diffuse, start.diffuse) and np.array_equal(d.normal, start.normal)
    inside = np.log(d.reflectance[d.mask])
    assert inside.std(0).max() < 0.55 * np.log(start.reflectance[d.mask]).std(0).max()
    save(d, tmp_path / "refined")
    again = load(tmp_path / "refined")
    assert np.array_equal(again.visibility, d.visibility)  # type: ignore[arg-type]
    assert np.array_equal(again.indirect, d.indirect)  # type: ignore[arg-type]
    assert np.array_equal(again.environment, d.environment)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="refined already"):
        refine(again)


@pytest.mark.slow
def test_the_start_is_kept_if_it_is_optimal(tmp_path: Path) -> None:
    start = dome(64)
    done = refine(start)
    assert not done.kept
    assert np.array_equal(done.result.shading, start.shading)
    assert done.result.visibility is None
    save(start, tmp_path / "start")
    line = command([str(tmp_path / "start"), "--light", "-o", str(tmp_path / "out")])[1]
    reason = "the objective did not fall" if done.after >= done.before else "held-out pixels"
    assert line.startswith(f"the light was not refined: {reason}")


@pytest.mark.slow
def test_the_command_writes_the_same_bytes_again(tmp_path: Path) -> None:
    start = contrasted(dome(96))
    save(start, tmp_path / "start", cover=start.mask * 0.7)
    for name in ("first", "second"):
        lines = command([str(tmp_path / "start"), "--light", "-o", str(tmp_path / name)])
        assert "no highlight" in lines[0] and "light was refined" in lines[1]
    for file in ("maps.exr", "environment.exr", "decomposition.json"):
        first, second = ((tmp_path / name / file).read_bytes() for name in ("first", "second"))
        assert first == second
    note = load(tmp_path / "first").provenance.settings["refine"]
    assert note["variant"] == load_mitsuba().variant()
    kept = [(tmp_path / name / "mask.png").read_bytes() for name in ("start", "first")]
    assert kept[0] == kept[1], "the soft mask goes along"


@pytest.mark.slow
@pytest.mark.parametrize("light", [False, True])
def test_the_files_are_those_of_the_whole_frame(tmp_path: Path, light: bool) -> None:
    """Results of large frames store, and the refinement reads, the object's part."""
    near = contrasted(dome(96)) if light else glossy(96)
    start = placed_result(near, FramePart(slice(50, 146), slice(200, 296), (250, 400)))
    save(start, tmp_path / "whole")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(maps_file, "_LEAST_PIXELS", 100)
        save(start, tmp_path / "part")
        output, words = str(tmp_path / "part_out"), ["--light"] * light
        assert not load_part(tmp_path / "part").part.is_whole
        lines = command([str(tmp_path / "part"), *words, "-o", output])
    assert "was refined" in lines[1] if light else "gloss refined" in lines[0]
    assert command([str(tmp_path / "whole"), *words, "-o", str(tmp_path / "out")])[:1] == lines[:1]
    found, wanted = load(tmp_path / "part_out"), load(tmp_path / "out")
    for field in fields(wanted):
        values = getattr(wanted, field.name)
        if isinstance(values, np.ndarray):
            assert np.array_equal(getattr(found, field.name), values), field.name
    for name in ("decomposition.json", "mesh.glb", "preview.png"):
        one, other = ((tmp_path / of / name).read_bytes() for of in ("part_out", "out"))
        assert one == other, name


def test_gloss_needs_no_renderer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def absent() -> None:
        raise InputError("Mitsuba is not installed")

    monkeypatch.setattr("synth.scene.variant.load_mitsuba", absent)
    start, output = tmp_path / "start", tmp_path / "out"
    save(dome(), start)
    assert "gloss not refined" in command([str(start), "-o", str(output)])[0]
    assert np.array_equal(load(output).shading, load(start).shading)
    with pytest.raises(InputError, match="not installed"):
        command([str(start), "--light", "-o", str(tmp_path / "other")])
    assert not (tmp_path / "other").exists()


def test_bad_inputs_are_refused_and_nothing_is_written(tmp_path: Path) -> None:
    start, output, photo = tmp_path / "start", tmp_path / "out", tmp_path / "photo.png"
    save(dome(), start)
    photo.write_bytes(b"another photo")
    cases = [
        ([str(tmp_path / "none"), "-o", str(output)], "not a result folder"),
        ([str(start), "-o", str(start)], "cannot replace its input"),
        ([str(start), "--photo", str(photo), "-o", str(output)], "another checksum"),
        ([str(start), "--photo", str(tmp_path / "no.png"), "-o", str(output)], "cannot read"),
    ]
    for words, message in cases:
        with pytest.raises(InputError, match=message):
            command(words)
        assert not output.exists()
    lit = replace(glossy(32), provenance=Provenance(input={"known": ["light"]}))
    save(lit, tmp_path / "lit")
    with pytest.raises(InputError, match="light of the result is exact"):
        command([str(tmp_path / "lit"), "--light", "-o", str(output)])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["lit", "photo.png", "start"]
    dark = dome()
    with pytest.raises(InputError, match="light of the result is zero"):
        refine(replace(dark, shading=np.zeros_like(dark.shading)))
    with pytest.raises(InputError, match="strictness above 0"):
        RefineOptions(strictness=0)
