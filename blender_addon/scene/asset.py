"""An object as an asset: marked, with a preview from the photo's view, in a file of a library.

Limits: the preview is rendered by Cycles with 16 samples in the recovered light, along the photo's
view but without its perspective. Blender's render result is replaced by it. Where Cycles is
disabled, Blender makes its usual preview.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Vector

from isc_core.errors import InputError
from isc_core.io.atomic import new_file, require_writable_file

from ..datablocks.painted_images import pack_images
from ..datablocks.provenance import KEY, require_local
from ..files.names import file_stem
from .built_object import BuiltObject
from .collection import use_standard_view
from .copies import has_other_material

CATALOG = "5d1b3c5e-6a0f-4b57-9d0b-1c5a3f0e8a11"
# Blender adds a parent that is missing in the file, and then asks to save its catalogs.
CATALOG_PATHS = {"0b4f7a52-3c1d-4e57-8f60-9a2c6d1e7b34": "ISC", CATALOG: "ISC/Photo Objects"}
_CATALOGS = "blender_assets.cats.txt"
_HEADER = (
    "# This is an Asset Catalog Definition file for Blender.\n"
    "# Lines are of the form UUID:path/of/catalog:simple name\n\n"
    "VERSION 1\n\n"
)
_SIZE, _SAMPLES, _MARGIN, _DISTANCE = 256, 16, 1.1, 4.0


def save_asset(built: BuiltObject, library: Path, overwrite: bool = False) -> Path:
    """Write an object with its material as an asset into a library.

    Parameters
    ----------
    built : BuiltObject
        The object; it and its material are marked as assets in this file, too. A material that the
        user has assigned in place of it is not marked.
    library : Path
        Folder of the asset library, created if missing.
    overwrite : bool, optional
        Whether a file of that name is replaced; otherwise the new one is numbered.

    Returns
    -------
    Path
        The file in the library.

    Raises
    ------
    InputError
        If the library cannot be written to, or a part is linked from another file; nothing is
        marked then.
    """
    require_local(built.object[KEY])
    path = _free_file(library, built.object.name, overwrite)
    try:
        for file in (path, library / _CATALOGS):
            require_writable_file(file)
        catalogs = _read_catalogs(library)
    except (OSError, ValueError, InputError) as error:
        raise InputError(
            f"the asset library {library} cannot be written to: choose another, or add a folder of "
            "your own in Preferences > File Paths > Asset Libraries"
        ) from error
    shown = _shown_blocks(built)
    for block in shown:
        _mark(block)
    if hasattr(bpy.types.Scene, "cycles"):
        _set_preview(built)
    else:  # Cycles is an add-on, which may be disabled
        for block in shown:
            block.asset_generate_preview()
    pack_images(built.object, [built.material], files=True)
    if entries := _missing_entries(catalogs):
        with new_file(library / _CATALOGS) as partial:
            partial.write_text((catalogs or _HEADER) + entries, encoding="utf-8")
    with new_file(path) as partial:
        bpy.data.libraries.write(str(partial), set(shown), fake_user=True, compress=True)
    return path


def _shown_blocks(built: BuiltObject) -> list[Any]:
    """The object, and its material unless the user has assigned another."""
    material = [] if has_other_material(built.object, built.material) else [built.material]
    return [built.object, *material]


def _free_file(library: Path, name: str, overwrite: bool) -> Path:
    plain = file_stem(name)
    path, number = library / f"{plain}.blend", 1
    while path.exists() and not overwrite:
        number += 1
        path = library / f"{plain}-{number}.blend"
    return path


def _read_catalogs(library: Path) -> str:
    """Text of the library's catalogs, ending in a new line; "" if it has none."""
    with suppress(FileNotFoundError):
        text = (library / _CATALOGS).read_text(encoding="utf-8")
        return text if text.endswith("\n") else text + "\n"
    return ""


def _missing_entries(catalogs: str) -> str:
    """Lines of the catalogs that a library lacks; its user may have a parent of that path."""
    return "".join(
        f"{number}:{path}:{path.replace('/', '-')}\n"
        for number, path in CATALOG_PATHS.items()
        if number not in catalogs and (number == CATALOG or f":{path}:" not in catalogs)
    )


def _mark(block: Any) -> None:
    block.asset_mark()
    about = block.asset_data
    about.catalog_id = CATALOG
    about.description = "Object created from a photo by ISC"
    about.tags.new("ISC", skip_if_exists=True)


def _set_preview(built: BuiltObject) -> None:
    """Render the object along the photo's view into the previews of object and material."""
    before = set(bpy.data.images)
    with _preview_scene(built) as scene:
        path = Path(bpy.app.tempdir) / "isc_preview.png"
        scene.render.filepath = str(path)
        bpy.ops.render.render(write_still=True, scene=scene.name)
    picture = bpy.data.images.load(str(path))
    pixels = np.empty(4 * _SIZE * _SIZE, np.float32)
    picture.pixels.foreach_get(pixels)
    bpy.data.images.remove(picture)
    path.unlink(missing_ok=True)
    for image in set(bpy.data.images) - before:  # Blender's render result, if it had none
        bpy.data.images.remove(image)
    for block in _shown_blocks(built):
        preview = block.preview_ensure()
        preview.image_size = _SIZE, _SIZE
        preview.image_pixels_float.foreach_set(pixels)


@contextmanager
def _preview_scene(built: BuiltObject) -> Iterator[bpy.types.Scene]:
    """A scene with the object alone, which is removed at the end."""
    scene = bpy.data.scenes.new("ISC preview")
    data = bpy.data.cameras.new("ISC preview")
    camera = bpy.data.objects.new("ISC preview", data)
    try:
        scene.collection.objects.link(built.object)
        scene.collection.objects.link(camera)
        _aim(camera, built.object)
        scene.camera, scene.world = camera, built.world
        render = scene.render
        render.engine, render.film_transparent = "CYCLES", True
        scene.cycles.samples, scene.cycles.use_denoising = _SAMPLES, False
        render.resolution_x = render.resolution_y = _SIZE
        render.resolution_percentage = 100
        render.image_settings.file_format, render.image_settings.color_mode = "PNG", "RGBA"
        use_standard_view(scene)
        yield scene
    finally:
        bpy.data.objects.remove(camera)
        bpy.data.cameras.remove(data)
        bpy.data.scenes.remove(scene)


def _aim(camera: bpy.types.Object, obj: bpy.types.Object) -> None:
    """Look at an object as the photo did, with all of it in a square frame."""
    corners = np.array([Vector(corner) for corner in obj.bound_box])
    low, high = corners.min(0), corners.max(0)
    size, middle = high - low, (low + high) / 2
    location, rotation, scale = obj.matrix_world.decompose()
    longest = float(max(size * np.array(scale)))
    start = Vector(middle * np.array(scale)) + Vector((0, -_DISTANCE * longest, 0))
    place = Matrix.LocRotScale(location, rotation, None)
    camera.matrix_world = place @ Matrix.Translation(start) @ Matrix.Rotation(0.5 * np.pi, 4, "X")
    camera.data.type = "ORTHO"
    camera.data.ortho_scale = _MARGIN * float(max(size[0] * scale[0], size[2] * scale[2]))
    camera.data.clip_end = 2 * _DISTANCE * longest
