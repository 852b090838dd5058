"""A run gets what was asked for: the size of a confirmed update, and datablocks under new names."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

bpy = pytest.importorskip("bpy", reason="needs the extra `blender`")

from blender_addon.files.result_arrays import read_result  # noqa: E402 (after the skip)
from blender_addon.operators import decompose  # noqa: E402
from blender_addon.operators.mask import load_mask, mask_run, mask_shown_on  # noqa: E402
from blender_addon.operators.modal import advance_run  # noqa: E402
from blender_addon.runs import request as requests  # noqa: E402
from blender_addon.runs.request import request_from_settings  # noqa: E402
from blender_addon.runs.worker_run import RunOutput  # noqa: E402
from blender_addon.scene.build import build_object  # noqa: E402
from blender_addon.scene.preparation import BuildOptions  # noqa: E402
from blender_addon.worker.commands import overlay_of  # noqa: E402
from blender_addon.worker.process import WorkerUpdate  # noqa: E402
from isc_core.errors import InputError  # noqa: E402
from tests.addon.test_operators import mask_image, photo  # noqa: E402


def test_a_confirmed_update_has_the_size_that_was_asked_for(
    addon: Any, bump_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    obj = build_object(read_result(bump_folder)).object
    obj.data.vertices[0].co.x += 1
    started: list[dict[str, Any]] = []

    def confirm(_how: str, **options: Any) -> None:
        addon.ops.isc.confirm_overwrite(**options)

    calls = SimpleNamespace(
        confirm_overwrite=confirm,
        redo=lambda _how, **options: started.append(options),
        decompose=lambda _how, **options: started.append(options),
    )
    app, isc = SimpleNamespace(background=False), SimpleNamespace(isc=calls)
    monkeypatch.setattr(decompose, "bpy", SimpleNamespace(**vars(bpy) | {"app": app, "ops": isc}))
    request = requests.DecomposeRequest(build=BuildOptions(name="bump"))
    operator = SimpleNamespace(overwrite=False, request=lambda _: request)
    context = SimpleNamespace(window=addon.context.window or object())
    for name, size in (("isc.redo", {"max_size": 1024}), ("isc.decompose", {})):
        vars(operator).update(bl_idname=name, **size)
        assert decompose._OverwriteMixin.invoke(operator, context, None) == {"CANCELLED"}
    assert started == [{"overwrite": True, "max_size": 1024}, {"overwrite": True}]


def test_datablocks_that_are_renamed_during_a_run_are_still_the_requests(addon: Any) -> None:
    settings = addon.context.scene.isc
    settings.image, settings.mask_source = photo(), "IMAGE"
    settings.mask = mask_image()
    request = request_from_settings(addon.context.scene)
    renamed = requests.track_names(request)
    assert renamed() == request
    settings.image.name, settings.mask.name = "bowl", "its mask"
    addon.context.scene.name = "Mine"
    after = renamed()
    assert (after.image, after.mask, after.scene) == ("bowl", "its mask", "Mine")
    addon.data.images.remove(settings.mask)
    assert renamed().mask == request.mask


def test_a_mask_is_that_of_a_photo_that_is_renamed_meanwhile(addon: Any, tmp_path: Path) -> None:
    settings = addon.context.scene.isc
    settings.image = photo()

    def steps(*_: Any) -> Any:
        yield WorkerUpdate("finding")
        settings.image.name = "bowl"
        path = tmp_path / "mask.png"
        Image.fromarray(255 * np.eye(64, 88, dtype=np.uint8)).save(path)
        return RunOutput(path)

    run = mask_run(addon.context, "Auto Mask", steps)
    while not advance_run(addon.context, run):
        pass
    assert run.status.state == "done", run.status.message
    assert settings.mask.name == "bowl mask"


def white_mask(folder: Path) -> Path:
    """The file of a mask of the photo's size."""
    path = folder / "mask.png"
    Image.fromarray(255 * np.eye(64, 88, dtype=np.uint8)).save(path)
    return path


def test_a_found_mask_is_not_used_for_the_next_photo(addon: Any, tmp_path: Path) -> None:
    settings, scene = addon.context.scene.isc, addon.context.scene.name_full
    settings.image = photo()
    load_mask(white_mask(tmp_path), settings.image.name_full, scene)
    settings.image.name = "bowl"
    settings.image = addon.data.images["bowl"]
    assert settings.mask is not None, "still the same photo"
    settings.image = photo("other.png")
    assert settings.mask is None and settings.mask_source == "ALPHA"
    assert not request_from_settings(addon.context.scene).mask


def test_a_mask_that_was_painted_is_not_shown_by_its_old_preview(
    addon: Any, tmp_path: Path
) -> None:
    settings = addon.context.scene.isc
    settings.image = photo()
    path = white_mask(tmp_path)
    Image.new("RGB", (32, 32)).save(overlay_of(path))
    load_mask(path, settings.image.name_full, addon.context.scene.name_full)
    mask = settings.mask
    assert mask_shown_on(mask) == settings.image
    mask.pixels.foreach_set(np.ones(len(mask.pixels), np.float32))
    mask.update()
    assert mask.is_dirty and mask_shown_on(mask) is None
    mask.pack()
    assert not mask.is_dirty and mask_shown_on(mask) is None


def test_a_mask_that_the_user_chose_is_kept_with_the_next_photo(addon: Any) -> None:
    settings = addon.context.scene.isc
    settings.image, settings.mask, settings.mask_source = photo(), mask_image(), "IMAGE"
    settings.image = photo("other.png")
    assert settings.mask.name == "cup mask" and settings.mask_source == "IMAGE"


def test_a_mask_found_in_another_photo_than_the_panels_is_refused(
    addon: Any, tmp_path: Path
) -> None:
    settings, first = addon.context.scene.isc, photo()
    settings.image = photo("other.png")
    with pytest.raises(InputError, match="another photo than cup.png"):
        load_mask(white_mask(tmp_path), first.name_full, addon.context.scene.name_full)
    assert settings.mask is None and len(addon.data.images) == 2


def test_a_mask_replaces_the_one_found_earlier(addon: Any, tmp_path: Path) -> None:
    settings, scene = addon.context.scene.isc, addon.context.scene.name_full
    settings.image = photo()
    load_mask(white_mask(tmp_path), settings.image.name_full, scene)
    settings.image.name = "bowl"
    load_mask(white_mask(tmp_path), settings.image.name_full, scene)
    assert [image.name for image in addon.data.images] == ["bowl", "bowl mask"]
