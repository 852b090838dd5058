"""A result folder becomes a Blender scene whose render is the photo's diffuse image. Runs the command as a user does."""

import importlib.util
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from blender_addon.headless import main
from blender_addon.result import read_placement
from isc_core.brdf.fitting import fit_lobe
from isc_core.brdf.ggx import Ggx
from isc_core.brdf.shading import directional, radiance
from isc_core.decomposition import Decomposition, Provenance
from isc_core.result_folder import save
from isc_core.sirfs.frames import real_sh

ROOT = Path(__file__).resolve().parents[2]
needs_bpy = pytest.mark.skipif(importlib.util.find_spec("bpy") is None, reason="needs the extra `blender` (Python 3.11 or 3.13)")


def ball(rows: int = 72, columns: int = 96, radius: float = 26.0, centre: tuple[float, float] = (30.0, 40.0)) -> Decomposition:
    """A ball off the middle of a wide frame, red above and blue below, lit from the upper left; height and normal are exact."""
    row, column = np.indices((rows, columns)).astype(float)
    x, y = (column - centre[1]) / radius, (centre[0] - row) / radius
    mask = x * x + y * y < 0.96
    z = np.sqrt(np.maximum(1 - x * x - y * y, 0.04))
    normal = np.where(mask[..., None], np.dstack([x, y, z]), np.array([0.0, 0, 1]))
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    light = np.zeros((9, 3))
    light[0], light[1], light[3] = [-2.2, -2.6, -3.0], 0.5, -0.4
    paint = np.where((y > 0)[..., None], [0.45, 0.10, 0.08], [0.08, 0.14, 0.40])
    shading = np.exp(real_sh(normal) @ light) * mask[..., None]
    image = (paint * shading).astype(np.float32)
    none = np.zeros_like(image)
    reflectance = (paint * mask[..., None]).astype(np.float32)
    height = (radius * z * mask).astype(np.float32)
    maps = (image, image, none, none, reflectance, shading.astype(np.float32), normal.astype(np.float32), height)
    confidence = mask.astype(np.float32)
    about = {"sha256": "0" * 64, "size": [columns, rows], "scale": 1.0, "crop_box": [0, 0, columns, rows]}
    return Decomposition(*maps, mask, confidence, light, Provenance(input=about, status={"converged": True}))


@needs_bpy
def test_the_scene_renders_as_the_photo_shows_it(tmp_path: Path) -> None:
    known = ball()
    save(known, tmp_path / "result")
    blend, picture = tmp_path / "scene" / "out.blend", tmp_path / "scene" / "out.png"
    done = blender(tmp_path / "result", "--blend", blend, "--render", picture, "--samples", 64)
    assert done.returncode == 0, done.stdout + done.stderr
    assert blend.stat().st_size > 10_000
    got, alpha = linear_picture(picture)
    assert alpha.shape == known.mask.shape
    overlap = ((alpha > 0.5) & known.mask).sum() / ((alpha > 0.5) | known.mask).sum()
    assert overlap > 0.95, "the camera does not frame the object as the photo does"
    inner = cv2.erode(known.mask.astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
    rows = np.indices(known.mask.shape)[0]
    for half in (inner & (rows < 28), inner & (rows > 32)):  # apart, so that the paint's contrast does not hide the shading's
        np.testing.assert_allclose(got[half].mean(0), known.diffuse[half].mean(0), rtol=0.03)
        strongest = known.diffuse[half].mean(0).argmax()
        assert np.corrcoef(got[half][:, strongest], known.diffuse[half][:, strongest])[0, 1] > 0.98


def blender(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "blender_addon.headless", *map(str, arguments)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=300)


def linear_picture(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """A 16-bit PNG as linear colour, (H, W, 3), and alpha, (H, W)."""
    pixels = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)[..., [2, 1, 0, 3]].astype(float) / 65535
    coded = pixels[..., :3]
    return np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4), pixels[..., 3]


def glossy(strength: float) -> Decomposition:
    """The ball under the gloss of a lamp, alpha .2, with the lobe that fits."""
    d = ball()
    lamp = np.array([-0.37, 0.46, 0.807])
    lamp /= np.linalg.norm(lamp)
    gloss = strength * radiance(Ggx(0.2, 0.04), d.normal.astype(float), np.array([0.0, 0, 1]), directional(lamp, 1.0))
    specular = np.where(d.mask[..., None], gloss, 0).astype(np.float32)
    return replace(d, image=d.diffuse + specular, specular=specular, brdf=fit_lobe(specular, d.normal, d.mask))


@needs_bpy
@pytest.mark.parametrize("strength", [0.0, 0.6])
def test_the_material_has_the_fitted_gloss(tmp_path: Path, strength: float) -> None:
    """Roughness and specular level of the shader are those of the fit; what has no highlights has no gloss."""
    from blender_addon.legacy_scene import build

    save(glossy(strength), tmp_path / "result")
    placement = read_placement(tmp_path / "result")
    assert placement.gloss_is_fitted == (strength > 0)
    scene = build(placement)
    shader = principled(scene)
    record = json.loads((tmp_path / "result" / "decomposition.json").read_text())
    level = shader.inputs["Specular IOR Level"].default_value * shader.inputs["Specular Tint"].default_value[0]
    assert level == pytest.approx(0.5 * record["mesh"]["specular"]["value"], rel=1e-5)
    if strength > 0:
        assert shader.inputs["Roughness"].default_value == pytest.approx(record["brdf"]["blender_roughness"], rel=1e-5)
        assert record["brdf"]["blender_roughness"] == pytest.approx(0.2**0.5, rel=0.05)
        assert record["mesh"]["specular"]["source"] == "fitted"
    else:
        assert level == 0


@needs_bpy
def test_a_gloss_that_was_not_fitted_is_kept_on_demand_only(tmp_path: Path) -> None:
    from blender_addon.legacy_scene import build

    save(ball(), tmp_path / "result")
    placement = read_placement(tmp_path / "result")
    levels = [principled(build(placement, gloss=keep)).inputs["Specular IOR Level"].default_value for keep in (False, True)]
    assert levels == [0, 0.5]


def principled(scene: Any) -> Any:
    """The shader of the scene's only mesh."""
    (mesh,) = (thing for thing in scene.objects if thing.type == "MESH")
    return next(node for node in mesh.material_slots[0].material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")


@needs_bpy
def test_a_damaged_mesh_is_refused_in_one_line(tmp_path: Path) -> None:
    save(ball(), tmp_path / "result")
    (tmp_path / "result" / "mesh.glb").write_bytes(b"glTF no more")
    done = blender(tmp_path / "result", "--blend", tmp_path / "out.blend")
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out.blend").exists()


def test_a_folder_that_is_no_result_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path), "--blend", str(tmp_path / "out.blend")]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "decomposition.json" in message


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"mesh": {}}', '{"mesh": 3}', '{"mesh": {"illumination": {"coefficients": [[1]]}}}'])
def test_damaged_descriptions_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str) -> None:
    (tmp_path / "mesh.glb").write_bytes(b"")
    (tmp_path / "decomposition.json").write_text(text)
    assert main([str(tmp_path), "--blend", str(tmp_path / "out.blend")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_without_bpy_the_message_names_the_extra(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    save(ball(), tmp_path / "result")
    monkeypatch.setitem(sys.modules, "bpy", None)
    assert main([str(tmp_path / "result"), "--blend", str(tmp_path / "out.blend")]) == 2
    assert "isc3d[blender]" in capsys.readouterr().err
