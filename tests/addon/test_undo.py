"""Undo and redo in any order, with colours that are baked at any moment between its steps."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blender_addon.files.result_arrays import ResultArrays, read_result

_STEPS = ("edit", "move", "build", "bake", "undo", "redo")


@pytest.fixture
def result(bump_folder: Path) -> ResultArrays:
    return replace(read_result(bump_folder), specular_level=0.8, roughness=0.4)


def material(blender: Any) -> Any:
    return next(block for block in blender.data.materials if block.get("isc_key") == "bump")


def require_no_dangling_image(blender: Any) -> None:
    """Each image that a material uses is one of the file's: a freed one crashes Blender."""
    present = {image.as_pointer() for image in blender.data.images}
    for node in material(blender).node_tree.nodes:
        if node.type == "TEX_IMAGE" and node.image is not None:
            assert node.image.as_pointer() in present, node.name


def edits(blender: Any) -> Any:
    from blender_addon.materials.edit_nodes import dichromatic_node

    node: Any = dichromatic_node(material(blender))
    return node.inputs


def shown_edits(blender: Any) -> str:
    """The edits of the base colour that the BSDF shows, as text."""
    nodes = material(blender).node_tree.nodes
    source = nodes["Principled BSDF"].inputs["Base Color"].links[0].from_node
    return str(source.image.get("isc_edits", "none"))


@pytest.mark.parametrize("seed", range(4))
def test_undo_in_any_order_frees_no_image_that_is_used(
    addon: Any, result: ResultArrays, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    from blender_addon.materials.material_edits import apply_edits, bake_edits, color_state
    from blender_addon.operators import live_edits
    from blender_addon.scene import BuildOptions, build_object

    # As in a window, where colours come later.
    monkeypatch.setattr(live_edits, "write_edits", apply_edits)
    rng = np.random.default_rng(seed)
    build_object(result, BuildOptions())
    addon.ops.ed.undo_push(message="start")
    done = set()
    for step in rng.choice(_STEPS, 40, p=(0.2, 0.15, 0.05, 0.25, 0.2, 0.15)):
        if step == "edit":
            slider = rng.choice(["Value", "Specular Gain"])
            edits(addon)[slider].default_value = rng.choice([0.25, 0.5, 0.75])
        elif step == "move":
            addon.data.objects["bump"].location.x += 1
        elif step == "build":
            build_object(result, BuildOptions())
        elif step == "bake":
            bake_edits(material(addon))
        elif getattr(addon.ops.ed, step).poll():
            getattr(addon.ops.ed, step)()
            done.add(step)
        if step in ("edit", "move", "build"):
            addon.ops.ed.undo_push(message=str(step))
        require_no_dangling_image(addon)
        addon.context.view_layer.update()
    assert done == {"undo", "redo"}
    edits(addon)["Value"].default_value = 0.6
    bake_edits(material(addon))
    assert shown_edits(addon) == color_state(material(addon))
