"""What is built from a result, and the slow part of building: meshes and the files of images.

Nothing here accesses a datablock, so it may run in another thread while the window is used.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from isc_core.errors import InputError
from isc_core.lobe_fitting.specular_layer import SpecularLayer
from isc_core.result_files.solids.back import Back

from ..datablocks.images import (
    COLOR,
    DATA,
    MAPS,
    SRGB,
    USED_MAPS,
    ImageFile,
    ImageRole,
    coded_file,
    map_file,
    texture_file,
)
from ..datablocks.mesh import MeshArrays, MeshGeometry, front_geometry, mesh_arrays
from ..files.result_arrays import ResultArrays
from ..materials.coated_surface import coated_surface, encode_normals
from ..materials.material import SpecularSettings, SpecularSource
from .camera import eye_of
from .displacement import displacement_map, flatten
from .hand_edits import mesh_checksum
from .solid_mesh import solid_geometry

# `BuildOptions.own_shadows` of each item of the panel.
OWN_SHADOWS: dict[str, bool | None] = {"auto": None, "on": True, "off": False}
_DEFAULT_ROUGHNESS = 0.5
_Jobs = dict[ImageRole, Callable[[], ImageFile]]


@dataclass(frozen=True)
class BuildOptions:
    """What is built, and which settings of the user's scene may change.

    The field names are part of the JSON text that files store.

    Attributes
    ----------
    size_metres : float
        Longer side of the object.
    own_scene : bool
        Whether to build in a new scene. In a shared scene, a new object stands at the 3D cursor,
        and world, active camera, resolution and view transform change only with the next four
        options.
    set_world, set_camera, set_resolution, set_view_transform : bool
        Settings of a shared scene that may change.
    light_and_camera : bool
        Whether the photo's camera and the estimated sun are added to a shared scene, in a
        collection of their own that is unchecked at first. A new scene always has the camera.
    photo_resolution : bool
        Whether renders have the photo's resolution instead of that of the maps.
    sun : bool
        Whether to use a sun and uniform light instead of the environment map.
    displacement : bool
        Whether to displace a flat grid by a modifier instead of building the height mesh.
    back : str
        A value of `Back`; "" builds the result's own mesh, whose vertices are pixels.
    triangles : int
        Maximum number on the visible side of a mesh with a `back`; 0 for two per pixel.
    specular_from : str
        Source of the highlights: the fitted "lobe", the photo's specular "image" until light,
        camera or pose change, or "none".
    own_shadows : bool or None
        Whether the object casts shadows and diffuse light on itself (Cycles). The recovered shading
        already contains those of the photo, so the object looks as in the photo without them. None
        enables them for a new object in a shared scene, and keeps those of an existing object.
    all_maps : bool
        Whether the file also holds the layers and maps that neither material nor exports use.
    name : str
        Name of the object; "" for the result's own.
    each : bool
        Whether each separate object of the photo becomes a Blender object.
    """

    size_metres: float = 0.1
    own_scene: bool = True
    set_world: bool = False
    set_camera: bool = False
    set_resolution: bool = False
    set_view_transform: bool = False
    light_and_camera: bool = True
    photo_resolution: bool = False
    sun: bool = False
    displacement: bool = False
    back: str = ""
    triangles: int = 50_000
    specular_from: SpecularSource = "lobe"
    own_shadows: bool | None = None
    all_maps: bool = True
    name: str = ""
    each: bool = False


@dataclass(frozen=True)
class PreparedObject:
    """What an object is built from.

    Attributes
    ----------
    result : ResultArrays
        The result.
    options : BuildOptions
        What will be built from it; before a pinhole camera, the size is that of its middle.
    mesh : MeshArrays
        The mesh.
    checksum : str
        Of the mesh, see `hand_edits`.
    files : dict of ImageRole to ImageFile
        The files of the images; `PHOTO` is one of them if no image of the file shows it.
    specular : SpecularSettings
        The specular part of the material.
    offset : tuple of float
        Offset from the first object of the same photo; metres in Blender's axes.
    """

    result: ResultArrays
    options: BuildOptions
    mesh: MeshArrays
    checksum: str
    files: dict[ImageRole, ImageFile]
    specular: SpecularSettings
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)


def prepare(
    result: ResultArrays, options: BuildOptions, *, with_photo: bool = False, fit: bool = True
) -> PreparedObject:
    """Do the slow part of building an object.

    Parameters
    ----------
    result : ResultArrays
        The result.
    options : BuildOptions
        What will be built from it.
    with_photo : bool, optional
        Whether the masked photo of the result becomes an image.
    fit : bool, optional
        Whether `fit_size` gives the object its size; otherwise its middle has it.

    Returns
    -------
    PreparedObject
        What the object is built from.

    Raises
    ------
    InputError
        If the options are invalid, or the object is too thin for a mesh.
    """
    require_options(options)
    specular = _specular_settings(result, options)
    with ThreadPoolExecutor(2) as pool:  # NumPy and zlib let other threads run
        shaped = pool.submit(_shape, result, options)
        colored = pool.submit(_color_files, result, options, specular)
        jobs = _map_jobs(result, options, with_photo) | _texture_jobs(result, options)
        encoded = {role: pool.submit(job) for role, job in jobs.items()}
        mesh, checksum, normal_map = shaped.result()
        files = {role: file.result() for role, file in encoded.items()} | colored.result()
    if normal_map is not None:
        files[ImageRole.NORMAL_MAP] = normal_map
    prepared = PreparedObject(result, options, mesh, checksum, files, specular)
    return fit_size([prepared], options.size_metres)[0] if fit else prepared


def fit_size(prepared: Sequence[PreparedObject], size_metres: float) -> list[PreparedObject]:
    """Scale objects before a pinhole camera, whose outlines and backs are farther away than their
    middles, and therefore larger than these.

    Parameters
    ----------
    prepared : sequence of PreparedObject
        One object, or the objects of one photo.
    size_metres : float
        Longer side of the largest one.

    Returns
    -------
    list of PreparedObject
        Scaled by one factor; unchanged without a pinhole camera, and where the shape is the
        result's own, whose middle the size is measured by.
    """
    if any(
        one.result.eye is None or one.options.displacement or not one.options.back
        for one in prepared
    ):
        return list(prepared)
    sides = [np.ptp(one.mesh.positions.reshape(-1, 3), axis=0)[[0, 2]].max() for one in prepared]
    return [_scaled(one, size_metres / float(max(sides))) for one in prepared]


def _scaled(prepared: PreparedObject, factor: float) -> PreparedObject:
    mesh = replace(prepared.mesh, positions=prepared.mesh.positions * np.float32(factor))
    x, y, z = prepared.offset
    return replace(
        prepared,
        options=replace(prepared.options, size_metres=prepared.options.size_metres * factor),
        mesh=mesh,
        checksum=mesh_checksum(mesh),
        offset=(factor * x, factor * y, factor * z),
    )


def _shape(result: ResultArrays, options: BuildOptions) -> tuple[MeshArrays, str, ImageFile | None]:
    """The mesh, its checksum, and its normal map, unless that is flat.

    A mesh with a vertex per pixel has all detail in its own normals.
    """
    geometry, normal_map = _geometry(result, options)
    mesh = mesh_arrays(geometry)
    is_flat = np.abs(normal_map - (0.5, 0.5, 1)).max() < 1e-3
    return mesh, mesh_checksum(mesh), None if is_flat else texture_file(normal_map, DATA)


def _color_files(
    result: ResultArrays, options: BuildOptions, specular: SpecularSettings
) -> dict[ImageRole, ImageFile]:
    """The base colour, and under gloss what is needed to follow it."""
    surface = coated_surface(result)
    is_matt = options.specular_from == "none"
    layer = None if is_matt else surface.layer(specular.level, specular.roughness)
    files = {ImageRole.BASE_COLOR: _base_color(result, layer)}
    if layer is not None:
        files[ImageRole.PLAIN_BASE_COLOR] = _base_color(result, None)
        files[ImageRole.VIEW_NORMAL] = replace(
            coded_file(encode_normals(surface.normal)), space=DATA
        )
    return files


def _map_jobs(result: ResultArrays, options: BuildOptions, with_photo: bool) -> _Jobs:
    """What encodes the maps."""
    roles = MAPS if options.all_maps else {role: MAPS[role] for role in USED_MAPS}
    jobs: _Jobs = {
        role: partial(map_file, getattr(result, role), space) for role, space in roles.items()
    }
    jobs[ImageRole.ENVIRONMENT_MAP] = partial(map_file, result.environment_map, COLOR)
    if options.displacement:
        jobs[ImageRole.DISPLACEMENT] = lambda: map_file(
            displacement_map(result, options.size_metres), DATA
        )
    if with_photo:
        part = result.part
        jobs[ImageRole.PHOTO] = lambda: map_file(
            part.placed(result.image), COLOR, part.placed(result.mask)
        )
    return jobs


def _texture_jobs(result: ResultArrays, options: BuildOptions) -> _Jobs:
    """What encodes the textures that depend on neither mesh nor gloss."""
    jobs: _Jobs = {}
    if result.specular_variation is not None:
        values = result.specular_variation / _peak(result)
        jobs[ImageRole.SPECULAR_VARIATION] = partial(texture_file, values, DATA)
    # The mesh of the result ends at its pixels, where the rim is soft, too.
    if result.alpha is not None and options.back and not options.displacement:
        jobs[ImageRole.ALPHA] = partial(texture_file, result.alpha / 255, DATA)
    return jobs


def require_options(options: BuildOptions) -> None:
    """Check the options.

    Parameters
    ----------
    options : BuildOptions
        What will be built.

    Raises
    ------
    InputError
        If a number is out of range, or there is no such back.
    """
    if not 0 < options.size_metres < 1e6:
        raise InputError(
            f"a size of {options.size_metres} metres is not possible: "
            "choose one above 0 and below 1e6"
        )
    if options.back not in ("", *Back):
        raise InputError(f"unknown back {options.back!r}: choose {', '.join(Back)}")
    if options.triangles < 0:
        raise InputError("the number of triangles cannot be negative: 0 keeps every pixel")


def _geometry(result: ResultArrays, options: BuildOptions) -> tuple[MeshGeometry, np.ndarray]:
    """The mesh, and its normal map; a displaced grid is open."""
    if options.displacement:
        sheet = front_geometry(result, options.size_metres)
        return flatten(sheet, eye_of(result, options.size_metres)), result.normal_map
    if options.back:
        return solid_geometry(result, options.size_metres, options.back, options.triangles)
    return front_geometry(result, options.size_metres), result.normal_map


def _base_color(result: ResultArrays, layer: SpecularLayer | None) -> ImageFile:
    """The base colour; with a specular layer, that of the surface under it."""
    if (codes := result.texture) is not None:
        return coded_file(codes if layer is None else layer.codes_under(codes))
    color = result.base_color
    return texture_file(color if layer is None else layer.color_under(color), SRGB)


def _specular_settings(result: ResultArrays, options: BuildOptions) -> SpecularSettings:
    """Values of the fit; without a fitted level the object is diffuse, as in the photo's light."""
    level = result.specular_level if np.isfinite(result.specular_level) else 0.0
    roughness = result.roughness if np.isfinite(result.roughness) else _DEFAULT_ROUGHNESS
    return SpecularSettings(level * _peak(result), roughness, options.specular_from)


def _peak(result: ResultArrays) -> float:
    """The largest factor of the specular level: textures hold values up to 1."""
    variation = result.specular_variation
    return 1.0 if variation is None else max(1.0, float(variation.max()))
