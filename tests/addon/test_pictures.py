"""The programs that make the pictures of the documentation: what stands on the table, what is cut
out.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

bpy = pytest.importorskip("bpy", reason="needs the extra `blender`")

from mathutils import Matrix, Vector  # noqa: E402

from benchmarks.blender import studio_photos  # noqa: E402
from benchmarks.blender.pictures import WINDOW, stand, window_picture  # noqa: E402
from benchmarks.blender.studio_photos import BODIES, add_body, upright  # noqa: E402
from synth.shapes.gourd import gourd  # noqa: E402


@pytest.mark.parametrize("angles", [(25, 8), (-20, -5), (0, 40)])
def test_a_leaning_body_stands_upright(angles: tuple[float, float]) -> None:
    leaning = gourd(60, 61).rotated(Rotation.from_euler("xz", angles, degrees=True).as_matrix())
    spread = np.cov(upright(leaning).vertices.T)
    assert abs(spread[0, 1]) < 1e-3 and abs(spread[2, 1]) < 1e-3, "the axis is the y axis"
    assert upright(leaning).vertices[np.argmax(gourd(60, 61).vertices[:, 1]), 1] > 0.9, "top up"


@pytest.mark.slow
def test_bodies_rest_on_the_table(blender: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(studio_photos, "_TEXELS", 64)
    for body in BODIES.values():
        obj = add_body(body)
        assert min(corner[2] for corner in obj.bound_box) == pytest.approx(0, abs=1e-5)
        assert max(obj.dimensions) == pytest.approx(2, abs=0.15)


def test_an_object_is_put_on_its_place(blender: Any) -> None:
    bpy.ops.mesh.primitive_cone_add()
    cone = bpy.context.object
    cone.matrix_world = Matrix.Rotation(0.4, 4, "X") @ Matrix.Scale(0.5, 4)
    stand(cone, Vector((2, 1, 0)))
    bpy.context.view_layer.update()
    seen = np.array([cone.matrix_world @ vertex.co for vertex in cone.data.vertices])
    middle = (seen.min(0) + seen.max(0)) / 2
    np.testing.assert_allclose([*middle[:2], seen[:, 2].min()], [2, 1, 0], atol=1e-5)


@pytest.mark.parametrize("name", sorted(WINDOW))
def test_parts_of_the_window_fill_the_picture(tmp_path: Path, name: str) -> None:
    what = WINDOW[name]
    for number, crop in enumerate(what.crops):
        shot = Image.new("RGB", (1280, 800), "black")
        shot.paste((60 * number + 60, 0, 0), crop.box)
        shot.save(tmp_path / f"{crop.shot}.png")
    made = np.asarray(window_picture(tmp_path, what))
    assert what.width - 4 * what.columns < made.shape[1] <= what.width
    shown = {60 * number + 60 for number in range(len(what.crops))}
    assert set(np.unique(made[..., 0])) <= shown | {255} and shown <= set(np.unique(made[..., 0]))
