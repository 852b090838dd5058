"""Files for other programs: the mesh as GLB, the maps as OpenEXR.

Where the result's folder is still there, its own files are copied: mesh.glb and the multilayer
maps.exr, as recovered. Later, or in another file, they come from the scene: the mesh as Blender's
exporter writes it, with a plain material that has the paint as it was recoloured
(`scene.stand_in`), and each packed map as an EXR of its own.
"""
# mypy: allow-subclassing-any, disable-error-code="valid-type"
# ruff: noqa: RUF012 (Blender wants its options as sets)

import shutil
from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, StringProperty

from isc_core.errors import InputError

from ..scene.build import Built, find
from ..scene.copies import is_copy
from ..scene.export_material import stand_in
from ..scene.provenance import KEY, ROLE

_FILES = ("mesh.glb", "maps.exr", "decomposition.json", "preview.png")


class ISC_OT_export(bpy.types.Operator):
    """Writes the active object's mesh and maps."""

    bl_idname = "isc.export"
    bl_label = "Export GLB and Maps"
    bl_description = "Write the object's mesh as GLB and its maps as OpenEXR into a folder"
    bl_options = {"REGISTER"}

    directory: StringProperty(
        name="Folder",
        description="Where to write: a folder with the object's name is made there",
        subtype="DIR_PATH",
    )
    filter_folder: BoolProperty(default=True, options={"HIDDEN"}, description="Show folders")
    from_scene: BoolProperty(
        name="As Edited",
        description="Write what stands in the scene, recoloured and edited, even where the recovered files are still there",
        default=False,
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        """With an object of ISC active."""
        if find(context.object) is None:
            cls.poll_message_set("Choose an object that ISC made")
            return False
        return True

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Asks for the folder."""
        del event
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: Any) -> set[str]:
        """Writes the files."""
        built = find(context.object)
        try:
            if built is None or not self.directory:
                raise InputError("choose an object that ISC made, and a folder to write to")
            names = write(built, Path(bpy.path.abspath(self.directory)), from_scene=self.from_scene)
        except InputError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"written: {', '.join(names)}")
        return {"FINISHED"}


def write(built: Built, place: Path, *, from_scene: bool = False) -> list[str]:
    """Writes the files of an object into a folder of its own in `place`; their names. A copy's
    folder has the copy's name.

    Raises `InputError` where that cannot be done.
    """
    key = str(built.object[KEY])
    name = built.object.name if is_copy(built.object) else key
    folder = place / "".join(
        letter if letter.isalnum() or letter in " -_." else "_" for letter in name
    ).strip(" .")
    recovered = Path(str(built.object.get("isc_folder", "")))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not from_scene and all((recovered / name).is_file() for name in _FILES[:2]):
            present = [name for name in _FILES if (recovered / name).is_file()]
            for name in present:
                shutil.copyfile(recovered / name, folder / name)
            return present
        return [_write_mesh(built, folder / "mesh.glb"), *_write_maps(key, folder)]
    except shutil.SameFileError as error:
        raise InputError(f"{folder} is the result's own folder: choose another") from error
    except OSError as error:
        raise InputError(
            f"cannot write to {folder} ({error.strerror or error}): choose another folder"
        ) from error


def _write_maps(key: str, folder: Path) -> list[str]:
    """Each map that is packed in this file; they are OpenEXR files already."""
    names = []
    for image in bpy.data.images:
        data = (
            image.packed_file.data
            if image.get(KEY) == key and image.packed_file is not None
            else b""
        )
        if data[:4] == b"v/1\x01":
            names.append(f"{image[ROLE]}.exr")
            (folder / names[-1]).write_bytes(data)
    return names


def _write_mesh(built: Built, path: Path) -> str:
    """The object by Blender's exporter, which knows no node groups: a plain material stands in
    while it writes.
    """
    selected, layer = (
        [thing for thing in bpy.context.selected_objects if thing != built.object],
        bpy.context.view_layer,
    )
    with stand_in(built.object, built.material):
        try:
            for thing in selected:
                thing.select_set(False)
            built.object.select_set(True, view_layer=layer)
            bpy.ops.export_scene.gltf(
                filepath=str(path),
                export_format="GLB",
                use_selection=True,
                use_active_scene=True,
                export_apply=True,
            )
        except (RuntimeError, AttributeError) as error:
            said = str(error).strip().splitlines()[-1]
            raise InputError(
                f"Blender's glTF exporter failed ({said}): enable it in the preferences"
            ) from error
        finally:
            for thing in selected:
                thing.select_set(True)
    return path.name
