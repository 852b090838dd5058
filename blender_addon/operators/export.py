"""Export for other programs: the object as GLB, USD, FBX or OBJ by Blender's own exporters, its
textures under the names of other programs, and the recovered maps as OpenEXR.

The object is exported as shown: edits are baked first, and the layer with the photo's highlights is
hidden during the export. Objects in files of earlier versions temporarily have a plain material
(`export_material`). Blender's OBJ exporter references packed textures without writing
them, so they are written beside the file.
"""
# mypy: allow-subclassing-any, disable-error-code="valid-type"
# ruff: noqa: RUF012 (Blender requires sets for operator options)

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from isc_core.errors import InputError
from isc_core.result_files.exports.targets import TARGETS

from ..datablocks.images import ImageRole
from ..datablocks.painted_images import pack_images
from ..datablocks.provenance import KEY, ROLE
from ..files.names import file_stem
from ..materials.edit_nodes import PLASTIC, specular_level, surface_node
from ..runs.messages import reason_line, sentence
from ..scene.built_object import BuiltObject
from ..scene.copies import has_other_material
from .edit import NeedsObject, require_built
from .export_material import export_material, temporarily_assigned
from .live_edits import finish_export, prepare_export
from .texture_set import linked_image, write_texture_set

_EXR_MAGIC, _PNG_MAGIC = b"v/1\x01", b"\x89PNG"
# Names of the recovered maps in files, where they differ from the role.
_MAP_NAMES: dict[str, str] = {
    ImageRole.LOBE: "specular_fit",
    ImageRole.RESIDUAL: "difference",
    ImageRole.REFLECTANCE: "albedo",
}
# Light and camera are the scene's; textures are the material's.
_NOT_MAPS = (
    ImageRole.ENVIRONMENT_MAP,
    ImageRole.PHOTO,
    ImageRole.BASE_COLOR,
    ImageRole.EDITED_BASE_COLOR,
    ImageRole.NORMAL_MAP,
)
_FORMATS = (
    ("GLB", "glTF Binary (.glb)", "One file with textures, for most programs and the web"),
    ("USD", "USD (.usdc)", "Universal Scene Description with preview surface and textures"),
    ("FBX", "FBX (.fbx)", "One file with textures, for most game engines"),
    ("OBJ", "Wavefront (.obj)", "Geometry, material library and textures"),
)
_FILE_FORMATS = (
    ("PNG8", "PNG, 8 Bits", "Eight bits per channel"),
    ("PNG16", "PNG, 16 Bits", "Sixteen bits per channel"),
    ("EXR", "OpenEXR", "Linear 32-bit floats"),
)
_NORMALS = (
    ("TARGET", "As Program", "As the chosen program expects"),
    ("OPENGL", "OpenGL", "Green upward"),
    ("DIRECTX", "DirectX", "Green downward"),
)
_PROGRAMS = tuple((name, name.title(), f"Names and packings of {name.title()}") for name in TARGETS)


def _export_gltf(path: Path) -> None:
    bpy.ops.export_scene.gltf(
        filepath=str(path),
        export_format="GLB",
        use_selection=True,
        use_active_scene=True,
        export_apply=True,
    )


def _export_usd(path: Path) -> None:
    bpy.ops.wm.usd_export(
        filepath=str(path),
        selected_objects_only=True,
        generate_preview_surface=True,
        export_custom_properties=False,
        convert_world_material=False,
    )


def _export_fbx(path: Path) -> None:
    bpy.ops.export_scene.fbx(
        filepath=str(path), use_selection=True, path_mode="COPY", embed_textures=True
    )


def _export_obj(path: Path) -> None:
    bpy.ops.wm.obj_export(
        filepath=str(path),
        export_selected_objects=True,
        export_pbr_extensions=True,
        path_mode="STRIP",
    )


_EXPORTERS: Mapping[str, tuple[str, Callable[[Path], None]]] = {
    "GLB": (".glb", _export_gltf),
    "USD": (".usdc", _export_usd),
    "FBX": (".fbx", _export_fbx),
    "OBJ": (".obj", _export_obj),
}


class _FolderOperator(NeedsObject):
    """Mixin for operators that write into a folder of the user's choice.

    `write` writes into an existing folder of the object's name, or raises `InputError`.
    """

    report: Any  # from bpy.types.Operator
    directory: str
    bl_options = {"REGISTER"}

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
        try:
            built = require_built(context)
            if not self.directory:
                raise InputError("no folder is selected: choose one")
            names = self.write(built, Path(bpy.path.abspath(self.directory)))
        except InputError as error:
            self.report({"ERROR"}, sentence(str(error)))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Exported {', '.join(names)}")
        return {"FINISHED"}

    def write(self, built: BuiltObject, parent: Path) -> list[str]:
        """Write the files of an object; returns their names.

        Parameters
        ----------
        built : BuiltObject
            The object.
        parent : Path
            Folder in which the object's folder is created.

        Returns
        -------
        list of str
            Names of the files.

        Raises
        ------
        InputError
            If the files cannot be written.
        """
        raise NotImplementedError


class ISC_OT_export(_FolderOperator, bpy.types.Operator):
    """Export the active object as it is seen."""

    bl_idname = "isc.export"
    bl_label = "Export Object"
    bl_description = "Export the object as it is shown, with its edits and textures"

    directory: StringProperty(
        name="Folder",
        description="Folder in which a folder with the object's name is created",
        subtype="DIR_PATH",
    )
    filter_folder: BoolProperty(default=True, options={"HIDDEN"}, description="Show folders")
    file_format: EnumProperty(
        name="Format", description="File format of the object", items=_FORMATS, default="GLB"
    )
    maps: BoolProperty(
        name="Recovered Maps",
        description="Also export albedo, normals, height and the other recovered maps as OpenEXR",
        default=False,
    )

    def write(self, built: BuiltObject, parent: Path) -> list[str]:
        """Write the object's file; see `_FolderOperator`.

        Parameters
        ----------
        built : BuiltObject
            The object.
        parent : Path
            Folder in which the object's folder is created.

        Returns
        -------
        list of str
            Names of the files.

        Raises
        ------
        InputError
            If the files cannot be written.
        """
        return export_object(built, parent, self.file_format, maps=self.maps)


class ISC_OT_export_textures(_FolderOperator, bpy.types.Operator):
    """Export the textures of the active object."""

    bl_idname = "isc.export_textures"
    bl_label = "Export Texture Set"
    bl_description = "Export the object's textures under the names of other programs"

    directory: StringProperty(
        name="Folder",
        description="Folder in which a folder with the object's name is created",
        subtype="DIR_PATH",
    )
    filter_folder: BoolProperty(default=True, options={"HIDDEN"}, description="Show folders")
    program: EnumProperty(
        name="Program",
        description="Names and packings of the textures",
        items=_PROGRAMS,
        default="generic",
    )
    file_format: EnumProperty(
        name="Format", description="Format of the textures", items=_FILE_FORMATS, default="PNG8"
    )
    normals: EnumProperty(
        name="Normal Map", description="Direction of green", items=_NORMALS, default="TARGET"
    )

    def write(self, built: BuiltObject, parent: Path) -> list[str]:
        """Write the textures; see `_FolderOperator`.

        Parameters
        ----------
        built : BuiltObject
            The object.
        parent : Path
            Folder in which the object's folder is created.

        Returns
        -------
        list of str
            Names of the files.

        Raises
        ------
        InputError
            If the files cannot be written.
        """
        green_down = self.normals == "DIRECTX" or (
            self.normals == "TARGET" and TARGETS[self.program].green_down
        )
        with _object_folder(built, parent) as folder, _settled():
            return write_texture_set(
                built, folder, folder.name, self.program, self.file_format, green_down
            )


def export_object(
    built: BuiltObject, parent: Path, file_format: str = "GLB", *, maps: bool = False
) -> list[str]:
    """Write the files of an object, as it is seen, into a folder with its name.

    Parameters
    ----------
    built : BuiltObject
        The object, or a copy of it.
    parent : Path
        Folder in which the object's folder is created.
    file_format : str, optional
        "GLB", "USD", "FBX" or "OBJ".
    maps : bool, optional
        Whether to write the recovered maps as OpenEXR files, too.

    Returns
    -------
    list of str
        Names of the files; of USD and OBJ without those of the textures.

    Raises
    ------
    InputError
        If the files cannot be written.
    """
    with _object_folder(built, parent) as folder:
        pack_images(built.object, [built.material])  # exporters read the packed files
        names = [_export_mesh(built, folder, file_format)]
        return names + (_export_maps(str(built.object[KEY]), folder) if maps else [])


@contextmanager
def _object_folder(built: BuiltObject, parent: Path) -> Iterator[Path]:
    """Create the folder of an object; raises `InputError` if it cannot be written to."""
    folder = parent / file_stem(built.object.name)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield folder
    except OSError as error:
        raise InputError(
            f"cannot write to {folder} ({error.strerror or error}): choose another folder"
        ) from error


@contextmanager
def _settled() -> Iterator[None]:
    """Bake all edits into the BSDF while the context lasts."""
    prepare_export()
    try:
        yield
    finally:
        finish_export()


def _export_maps(key: str, folder: Path) -> list[str]:
    """Each packed map; their packed files are OpenEXR."""
    names = []
    for image in bpy.data.images:
        packed = image.packed_file if image.get(KEY) == key else None
        role = str(image.get(ROLE, ""))
        if packed is not None and role not in _NOT_MAPS and packed.data[:4] == _EXR_MAGIC:
            names.append(f"{_MAP_NAMES.get(role, role)}.exr")
            (folder / names[-1]).write_bytes(packed.data)
    return names


def _export_mesh(built: BuiltObject, folder: Path, file_format: str) -> str:
    suffix, export = _EXPORTERS[file_format]
    path = folder / f"{folder.name}{suffix}"
    with _exportable(built), _only_selected(built.object), ExitStack() as stack:
        if file_format == "OBJ":
            stack.enter_context(_textures_beside(built.object, folder))
        if file_format == "FBX":
            stack.enter_context(_level_as_blenders(built.material))
        try:
            export(path)
        except (RuntimeError, AttributeError) as error:
            raise InputError(
                f"Blender's exporter for {file_format} failed ({reason_line(error)}): enable it in "
                "the preferences, or choose another format"
            ) from error
    return path.name


@contextmanager
def _only_selected(obj: bpy.types.Object) -> Iterator[None]:
    """Select an object alone while the context lasts.

    Exporters skip what is not selected, and Blender selects no hidden object.
    """
    layer, before = bpy.context.view_layer, list(bpy.context.selected_objects)
    layer.update()  # so that it includes what was linked a moment ago
    if layer.objects.get(obj.name) != obj:
        raise InputError(f"{obj.name} is not in this view layer: include its collection first")
    try:
        for other in before:
            other.select_set(False)
        obj.select_set(True)
        if not obj.select_get():
            raise InputError(
                f"{obj.name} is hidden, or not selectable: change this in the Outliner"
            )
        yield
    finally:
        obj.select_set(False)
        for other in before:
            other.select_set(True)


@contextmanager
def _exportable(built: BuiltObject) -> Iterator[None]:
    """Give the object a material that exporters can read while the context lasts.

    Materials that the user has assigned in place of ISC's are exported as they are.
    """
    material = built.material
    if has_other_material(built.object, material):
        with _settled():
            yield
        return
    if surface_node(material) is None:
        with export_material(built.object, material):
            yield
        return
    with _settled(), temporarily_assigned(built.object, material, material):
        color = surface_node(material).inputs["Base Color"]  # type: ignore[union-attr]
        if color.is_linked and linked_image(color) is None:
            raise InputError(
                f"the base color of {built.object.name} is not an image: connect an image texture "
                "to the node's Base Color, or bake it"
            )
        yield


@contextmanager
def _level_as_blenders(material: bpy.types.Material) -> Iterator[None]:
    """Temporarily express the specular level as Blender's own: FBX has no index of refraction."""
    surface = surface_node(material)
    if surface is None:
        yield
        return
    sockets = surface.inputs["Specular IOR Level"], surface.inputs["IOR"]
    before = [socket.default_value for socket in sockets]
    level = PLASTIC * specular_level(surface)
    try:
        for socket, value in zip(sockets, (level, 1.5), strict=True):
            socket.default_value = value
        yield
    finally:
        for socket, value in zip(sockets, before, strict=True):
            socket.default_value = value


@contextmanager
def _textures_beside(obj: bpy.types.Object, folder: Path) -> Iterator[None]:
    """Write the packed textures into the folder, and use these files while the context lasts."""
    paths_before: dict[bpy.types.Image, str] = {}
    try:
        for image in _packed_textures(obj):
            path = folder / f"{bpy.path.clean_name(image.name)}.png"
            path.write_bytes(image.packed_file.data)
            paths_before[image] = image.filepath_raw
            image.filepath_raw = str(path)
        yield
    finally:
        for image, before in paths_before.items():
            image.filepath_raw = before


def _packed_textures(obj: bpy.types.Object) -> set[bpy.types.Image]:
    """The images of an object's materials that are packed as PNG."""
    materials = (slot.material for slot in obj.material_slots if slot.material is not None)
    trees = (material.node_tree for material in materials if material.node_tree is not None)
    nodes = (node for tree in trees for node in tree.nodes)
    images = {node.image for node in nodes if node.type == "TEX_IMAGE"}
    return {
        image
        for image in images
        if image is not None
        and image.packed_file is not None
        and image.packed_file.data[:4] == _PNG_MAGIC
    }
