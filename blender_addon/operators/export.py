"""Export for other programs: the mesh as GLB, the maps as OpenEXR.

While the result folder exists, its own files are copied: mesh.glb and the multilayer maps.exr, as
recovered. Otherwise the scene is exported: the mesh by Blender's exporter, with a plain material
that contains the colour edits (`scene.export_material`), and each packed map as an OpenEXR file.
"""
# mypy: allow-subclassing-any, disable-error-code="valid-type"
# ruff: noqa: RUF012 (Blender requires sets for operator options)

import shutil
from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, StringProperty

from isc_core.errors import InputError

from ..scene.build import BuiltObject, find_built
from ..scene.copies import is_copy
from ..scene.export_material import export_material
from ..scene.provenance import KEY, ROLE

_RESULT_FILES = ("mesh.glb", "maps.exr", "decomposition.json", "preview.png")
_REQUIRED_FILES = _RESULT_FILES[:2]
_EXR_MAGIC = b"v/1\x01"


class ISC_OT_export(bpy.types.Operator):
    """Export the active object's mesh and maps."""

    bl_idname = "isc.export"
    bl_label = "Export GLB and Maps"
    bl_description = "Export the object's mesh as GLB and its maps as OpenEXR"
    bl_options = {"REGISTER"}

    directory: StringProperty(
        name="Folder",
        description="Folder in which a folder with the object's name is created",
        subtype="DIR_PATH",
    )
    filter_folder: BoolProperty(default=True, options={"HIDDEN"}, description="Show folders")
    from_scene: BoolProperty(
        name="As Edited",
        description="Export the edited object of the scene even where the result folder exists",
        default=False,
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Return whether an ISC object is active.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        bool
            Where False, the tooltip gives the reason.
        """
        if find_built(context.object) is None:
            cls.poll_message_set("Select an object made by ISC")
            return False
        return True

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Open the file browser.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.
        event : bpy.types.Event
            The event that started the operator; not used.

        Returns
        -------
        set of str
            {"RUNNING_MODAL"}; Blender calls `execute` once a folder is selected.
        """
        del event
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: Any) -> set[str]:
        """Write the files.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        set of str
            {"FINISHED"}, or {"CANCELLED"} after an error has been reported.
        """
        built = find_built(context.object)
        try:
            if built is None or not self.directory:
                raise InputError("nothing to export: select an object made by ISC, and a folder")
            names = export_object(
                built, Path(bpy.path.abspath(self.directory)), from_scene=self.from_scene
            )
        except InputError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"exported {', '.join(names)}")
        return {"FINISHED"}


def export_object(built: BuiltObject, parent: Path, *, from_scene: bool = False) -> list[str]:
    """Write the files of an object into a folder with its name.

    Parameters
    ----------
    built : BuiltObject
        The object, or a copy of it.
    parent : Path
        Folder in which the object's folder is created.
    from_scene : bool, optional
        Whether to export the scene even where the result folder exists.

    Returns
    -------
    list of str
        Names of the files.

    Raises
    ------
    InputError
        If the files cannot be written.
    """
    key = str(built.object[KEY])
    name = built.object.name if is_copy(built.object) else key
    folder = parent / "".join(
        letter if letter.isalnum() or letter in " -_." else "_" for letter in name
    ).strip(" .")
    result = Path(str(built.object.get("isc_folder", "")))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not from_scene and all((result / file).is_file() for file in _REQUIRED_FILES):
            present = [file for file in _RESULT_FILES if (result / file).is_file()]
            for file in present:
                shutil.copyfile(result / file, folder / file)
            return present
        return [_export_mesh(built, folder / "mesh.glb"), *_export_maps(key, folder)]
    except shutil.SameFileError as error:
        raise InputError(f"{folder} is the result folder itself: choose another") from error
    except OSError as error:
        raise InputError(
            f"cannot write to {folder} ({error.strerror or error}): choose another folder"
        ) from error


def _export_maps(key: str, folder: Path) -> list[str]:
    """Each packed map; their packed files are OpenEXR."""
    names = []
    for image in bpy.data.images:
        packed = image.packed_file if image.get(KEY) == key else None
        if packed is not None and packed.data[:4] == _EXR_MAGIC:
            names.append(f"{image[ROLE]}.exr")
            (folder / names[-1]).write_bytes(packed.data)
    return names


def _export_mesh(built: BuiltObject, path: Path) -> str:
    """Blender's exporter ignores node groups, so the object has a plain material meanwhile."""
    selected = [obj for obj in bpy.context.selected_objects if obj != built.object]
    with export_material(built.object, built.material):
        try:
            for obj in selected:
                obj.select_set(False)
            built.object.select_set(True, view_layer=bpy.context.view_layer)
            bpy.ops.export_scene.gltf(
                filepath=str(path),
                export_format="GLB",
                use_selection=True,
                use_active_scene=True,
                export_apply=True,
            )
        except (RuntimeError, AttributeError) as error:
            reason = str(error).strip().splitlines()[-1]
            raise InputError(
                f"Blender's glTF exporter failed ({reason}): enable it in the preferences"
            ) from error
        finally:
            for obj in selected:
                obj.select_set(True)
    return path.name
