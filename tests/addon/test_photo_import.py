"""From a file or an image to a run: what is started, what is refused, where it is found."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

bpy = pytest.importorskip("bpy", reason="needs the extra `blender`")

from blender_addon import menus  # noqa: E402 (after the skip)
from blender_addon.operators import photo_import  # noqa: E402
from blender_addon.operators.photo_canvas import fit_rectangle  # noqa: E402
from blender_addon.operators.photo_operators import PhotoOperator, shown_photo  # noqa: E402
from isc_core.errors import InputError  # noqa: E402
from tests.addon.scene_fixture import bump  # noqa: E402


def photo_file(folder: Path, name: str, alpha: bool = False) -> Path:
    """The bump on a wall, or cut out."""
    d = bump()
    codes = np.where(d.mask[..., None], 3 * d.image + 0.2, [0.02, 0.25, 0.03])
    layers = np.dstack([codes, d.mask]) if alpha else codes
    Image.fromarray(np.rint(255 * np.clip(layers, 0, 1)).astype(np.uint8)).save(folder / name)
    return folder / name


@pytest.mark.parametrize(
    ("name", "alpha", "wanted"),
    [("a.png", False, "auto_mask"), ("a.png", True, "decompose"), ("a.jpg", False, "auto_mask")],
)
def test_only_a_photo_without_transparency_needs_a_mask_first(
    addon: Any,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    alpha: bool,
    wanted: str,
) -> None:
    started: list[str] = []
    names = {
        known: lambda *_, known=known: started.append(known) for known in ("auto_mask", "decompose")
    }
    fake = SimpleNamespace(**vars(bpy) | {"ops": SimpleNamespace(isc=SimpleNamespace(**names))})
    path = photo_file(tmp_path, name, alpha)
    monkeypatch.setattr(photo_import, "bpy", fake)
    assert addon.ops.isc.photo_as_object(filepath=str(path)) == {"FINISHED"}
    assert started == [wanted]
    settings = addon.context.scene.isc
    assert settings.image.name == name and settings.mask_source == "ALPHA"


def test_a_photo_is_an_undo_step(
    addon: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Otherwise undo could free the photo that the scene still uses."""
    started = SimpleNamespace(isc=SimpleNamespace(auto_mask=lambda *_: None))
    fake = SimpleNamespace(**vars(bpy) | {"ops": started})
    monkeypatch.setattr(photo_import, "bpy", fake)
    addon.ops.ed.undo_push(message="empty")
    path = photo_file(tmp_path, "a.png")
    addon.ops.isc.photo_as_object("EXEC_DEFAULT", True, filepath=str(path))
    addon.context.scene.isc.max_size = 300
    addon.ops.ed.undo_push(message="size")
    addon.ops.ed.undo()
    assert addon.context.scene.isc.image == addon.data.images["a.png"]
    addon.ops.ed.undo()
    assert addon.context.scene.isc.image is None and not addon.data.images


def test_a_file_that_is_no_photo_is_refused_and_leaves_nothing(addon: Any, tmp_path: Path) -> None:
    (tmp_path / "list.png").write_text("milk, eggs")
    (tmp_path / "empty.jpg").write_bytes(b"")
    for name in ("list.png", "empty.jpg", "missing.png"):
        with pytest.raises(RuntimeError, match=f"{name} is not a photo that Blender can read"):
            addon.ops.isc.photo_as_object(filepath=str(tmp_path / name))
    assert not addon.data.images and addon.context.scene.isc.image is None


def test_an_image_that_was_there_stays_when_its_file_is_no_photo(
    addon: Any, tmp_path: Path
) -> None:
    path = photo_file(tmp_path, "a.png")
    image = photo_import.load_photo(path)
    assert photo_import.load_photo(path) == image, "loaded once"
    path.write_text("overwritten")
    image.reload()
    with pytest.raises(InputError, match="is not a photo"):
        photo_import.load_photo(path)
    assert image.name in addon.data.images


@pytest.mark.parametrize("packed", [False, True])
def test_a_photo_that_changed_on_disk_is_read_again(
    addon: Any, tmp_path: Path, packed: bool
) -> None:
    path = tmp_path / "a.png"

    def write(code: int) -> None:
        Image.fromarray(np.full((16, 20, 3), code, np.uint8)).save(path)

    write(255)
    image = photo_import.load_photo(path)
    assert image.pixels[0] == 1
    if packed:
        image.pack()
    write(51)
    assert photo_import.load_photo(path) == image
    assert image.pixels[0] == pytest.approx(0.2) and (image.packed_file is not None) == packed
    if packed:
        assert image.packed_file.data == path.read_bytes()


def test_a_packed_or_painted_photo_is_kept_from_its_file(addon: Any, tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    Image.fromarray(np.full((16, 20, 3), 255, np.uint8)).save(path)
    image = photo_import.load_photo(path)
    image.pack()
    path.write_text("overwritten")
    with pytest.raises(InputError, match="is not a photo"):
        photo_import.load_photo(path)
    assert image.pixels[0] == 1 and image.packed_file is not None
    path.unlink()
    assert photo_import.load_photo(path) == image, "the file is gone, the packed photo is not"
    image.pixels.foreach_set(np.zeros(len(image.pixels), np.float32))
    image.update()
    Image.fromarray(np.full((16, 20, 3), 255, np.uint8)).save(path)
    assert photo_import.load_photo(path) == image and image.pixels[0] == 0, "painted, not saved"


def test_the_entries_are_in_blenders_menus(addon: Any) -> None:
    for name, draw in menus._ENTRIES:
        assert draw in getattr(bpy.types, name)._dyn_ui_initialize(), name


def test_photos_can_be_dropped_on_two_editors(addon: Any) -> None:
    handler = photo_import.ISC_FH_photo
    assert handler.bl_import_operator == "isc.photo_as_object"
    assert {".jpg", ".png", ".tif"} <= set(handler.bl_file_extensions.split(";"))
    areas = {kind: SimpleNamespace(type=kind) for kind in ("VIEW_3D", "IMAGE_EDITOR", "OUTLINER")}
    accepted = {kind for kind, area in areas.items() if drops(handler, area)}
    assert accepted == {"VIEW_3D", "IMAGE_EDITOR"} and not drops(handler, None)


def drops(handler: Any, area: Any) -> bool:
    return bool(handler.poll_drop(SimpleNamespace(area=area)))


def test_create_is_greyed_out_without_a_photo(addon: Any) -> None:
    assert not addon.ops.isc.decompose.poll()
    addon.context.scene.isc.image = addon.data.images.new("a", 8, 8)
    assert addon.ops.isc.decompose.poll()


def test_a_photo_is_laid_over_the_view_in_its_shape() -> None:
    for size, room in (((400, 100), (800, 600)), ((100, 400), (800, 600))):
        left, bottom, width, height = fit_rectangle(size, room)
        assert width / height == pytest.approx(size[0] / size[1])
        assert max(width / room[0], height / room[1]) == pytest.approx(0.9)
        assert (2 * left + width, 2 * bottom + height) == pytest.approx(room)


def test_each_editor_has_its_photo(addon: Any) -> None:
    image, other = (addon.data.images.new(name, 8, 8) for name in "ab")
    settings = SimpleNamespace(isc=SimpleNamespace(image=image))

    def context(kind: str) -> Any:
        space = SimpleNamespace(image=other)
        return SimpleNamespace(area=SimpleNamespace(type=kind), space_data=space, scene=settings)

    assert shown_photo(context("VIEW_3D")) == image
    assert shown_photo(context("IMAGE_EDITOR")) == other
    assert shown_photo(context("OUTLINER")) is None


def test_the_error_of_what_an_operator_starts_is_its_own(addon: Any, tmp_path: Path) -> None:
    """Blender shows nothing that an operator reports to Python."""
    Image.fromarray(np.zeros((4, 4, 3), np.uint8)).save(tmp_path / "tiny.bmp")
    settings = addon.context.scene.isc
    with pytest.raises(RuntimeError, match="use a larger photo"):
        addon.ops.isc.photo_as_object(filepath=str(tmp_path / "tiny.bmp"))
    assert settings.image.name == "tiny.bmp"


def test_only_a_photo_with_pixels_can_be_pointed_at(addon: Any, tmp_path: Path) -> None:
    path = photo_file(tmp_path, "a.png")
    image = addon.data.images.load(str(path))
    path.unlink()
    image.reload()
    reports: list[str] = []
    calls: list[str] = []
    window = SimpleNamespace(cursor_modal_set=calls.append)
    scene = SimpleNamespace(isc=SimpleNamespace(image=image, mask=None))
    context = SimpleNamespace(area=SimpleNamespace(type="VIEW_3D"), scene=scene, window=window)
    operator = SimpleNamespace(report=lambda kind, text: reports.append(text))
    assert PhotoOperator.invoke(operator, context, None) == {"CANCELLED"}  # type: ignore[arg-type]
    assert reports == ["The image a.png has no data: open its file again"] and not calls
