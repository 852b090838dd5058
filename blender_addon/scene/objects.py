"""Several objects of one photo, decomposed separately: one scale, side by side, under one light.

Problem: each result has its own scale, origin and light. In one scene, the objects share them.

Equation: a pixel of the photo has one length everywhere, so that objects stand in one plane across
the view: their depths are not known. With s_i(n) the shading that light i gives a normal n, and b_i
the base colour that goes with it, diffuse light is b_i s_i. Multiplying b_i by g_i and dividing
light i by it changes nothing. Under the light of the largest object, 0, object i is as bright as in
the photo where

    g_i / g_0 = sum_n b_i s_i(n) / sum_n b_i s_0(n),

summed over its pixels; the largest g is 1, so that no base colour exceeds what it was.

Limits: one number for each object. Where the lights that were recovered differ in direction or
colour, shading differs from the photo's.
"""

from collections.abc import Generator, Sequence
from dataclasses import replace
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from isc_core.imaging.srgb import linear_to_srgb, srgb_to_linear
from isc_core.shading.spherical_harmonics import real_sh

from ..datablocks.provenance import KEY, datablock_name
from ..files.result_arrays import ResultArrays
from .build import StagedObject, key_of, place_object, require_placeable, stage_object
from .built_object import LIGHT_OF, BuiltObject
from .camera import eye_of
from .placement import world_matrix
from .preparation import BuildOptions, PreparedObject, fit_size, prepare

_CONSTANT = 0.5 / np.sqrt(np.pi)  # the first spherical harmonic
_LEAST = 1e-9
# Options that only the first object has, as they change the scene.
_SHARED = (
    "own_scene",
    "light_and_camera",
    "set_world",
    "set_camera",
    "set_resolution",
    "set_view_transform",
    "sun",
)


def prepare_objects(
    results: Sequence[ResultArrays], options: BuildOptions, *, with_photo: bool = False
) -> list[PreparedObject]:
    """Do the slow part of building several objects of a photo.

    Parameters
    ----------
    results : sequence of ResultArrays
        From left to right, in folders 1, 2 and so on, which number the objects.
    options : BuildOptions
        What will be built; the size is that of the largest object, the name that of the photo.
    with_photo : bool, optional
        Whether the masked photo becomes an image.

    Returns
    -------
    list of PreparedObject
        The largest object first, to which scene, light and camera belong.
    """
    lengths = [result.longest_side / result.crop_scale for result in results]
    step = options.size_metres / max(lengths)
    first = lengths.index(max(lengths))
    name, shadows = options.name or results[0].name, options.own_shadows
    if shadows is None and options.own_scene:
        shadows = False
    relit, made = _under_one_light(results, first), []
    for index in sorted(range(len(relit)), key=lambda index: index != first):
        numbered = f"{name} {results[index].folder.name}"
        own = replace(options, size_metres=step * lengths[index], name=numbered)
        if index != first:
            none: dict[str, Any] = dict.fromkeys(_SHARED, False)
            own = replace(own, own_shadows=shadows, **none)
        shows_photo = with_photo and index == first
        prepared = prepare(relit[index], own, with_photo=shows_photo, fit=False)
        offset = offset_between(results[first], results[index], step)
        made.append(replace(prepared, offset=offset))
    return fit_size(made, options.size_metres)


def offset_between(
    first: ResultArrays, other: ResultArrays, step: float
) -> tuple[float, float, float]:
    """Return the offset between two objects of the same photo.

    Parameters
    ----------
    first, other : ResultArrays
        The objects.
    step : float
        Metres per pixel of the photo.

    Returns
    -------
    tuple of float
        Metres in Blender's axes, from the first one's origin to the other's.
    """
    eyes = [eye_of(one, step * one.longest_side / one.crop_scale) for one in (first, other)]
    if eyes[0] is not None and eyes[1] is not None:
        right, behind, up = map(float, eyes[0] - eyes[1])  # both are before the same eye
        return right, behind, up
    (x, y), (other_x, other_y) = (
        (np.array(one.origin_in_frame) + 0.5) / one.crop_scale for one in (first, other)
    )
    return float(other_x - x) * step, 0.0, float(y - other_y) * step


def stage_objects(
    prepared: Sequence[PreparedObject], *, photo: bpy.types.Image | None = None
) -> Generator[None, None, list[StagedObject]]:
    """Create the images and the meshes of objects in short steps, see `build.stage_object`.

    Parameters
    ----------
    prepared : sequence of PreparedObject
        What they are built of.
    photo : bpy.types.Image, optional
        Image behind the objects; not used after the first step, as an undo may free it.

    Returns
    -------
    list of StagedObject
        For `place_objects`, to be called at once.
    """
    keys = [key_of(one, photo) for one in prepared]
    staged: list[StagedObject] = []
    complete = False
    try:
        while not complete:
            for one, key in zip(prepared, keys, strict=True):
                made = yield from stage_object(one, key)
                staged.append(made)
            # An undo in the meantime removes what was created first.
            complete = all(one.blocks.exist for one in staged)
            if not complete:
                discard(staged)
        return staged
    finally:
        if not complete:
            discard(staged)


def discard(staged: list[StagedObject]) -> None:
    """Remove the datablocks of staged objects that were not placed.

    Parameters
    ----------
    staged : list of StagedObject
        Emptied.
    """
    while staged:
        staged.pop().blocks.discard()


def place_objects(
    staged: Sequence[StagedObject],
    *,
    scene: bpy.types.Scene | None = None,
    photo: bpy.types.Image | None = None,
) -> list[BuiltObject]:
    """Place objects in a scene as they are placed in the photo, in one short call.

    Parameters
    ----------
    staged : sequence of StagedObject
        One object, or the objects of one photo; their datablocks are used or removed.
    scene, photo
        As of `build.build_object`.

    Returns
    -------
    list of BuiltObject
        In the same order; existing objects stay where they are.

    Raises
    ------
    InputError
        Before any change, as of `build.build_object`.
    """
    first, *others = staged
    try:
        for one in staged:
            require_placeable(one, scene=scene, photo=photo)
        built = [place_object(first, scene=scene, photo=photo, bounds=_joint_bounds(staged))]
        place = Matrix.LocRotScale(*world_matrix(built[0].object).decompose()[:2], None)
        for one in others:
            beside = place @ Matrix.Translation(one.prepared.offset)
            built.append(place_object(one, scene=built[0].scene, photo=photo, matrix=beside))
            built[-1].object[LIGHT_OF] = built[0].object[KEY]
        built[0].object.pop(LIGHT_OF, None)  # it was not the largest one before an update
        options = first.prepared.options
        if options.each and options.own_scene:
            _name_scene(built[0])
        return built
    finally:
        discard([*staged])


def _name_scene(built: BuiltObject) -> None:
    """Name a new scene after the photo, not after its first object."""
    key = str(built.object[KEY])
    if built.scene.name == datablock_name(key):
        built.scene.name = datablock_name(key.rpartition(" ")[0])


def _joint_bounds(staged: Sequence[StagedObject]) -> np.ndarray:
    """Minimum and maximum corner (2, 3) of all objects, relative to the first one's origin."""
    corners = []
    for one in staged:
        points = one.prepared.mesh.positions.reshape(-1, 3) + np.array(one.prepared.offset)
        corners += [points.min(axis=0), points.max(axis=0)]
    return np.stack([np.min(corners, axis=0), np.max(corners, axis=0)])


def _under_one_light(results: Sequence[ResultArrays], first: int) -> list[ResultArrays]:
    light = results[first].mesh_illumination
    gains = np.array([_gain(result, light) for result in results])
    return [
        _with_gain(result, float(gain))
        for result, gain in zip(results, gains / gains.max(), strict=True)
    ]


def _gain(result: ResultArrays, light: np.ndarray) -> float:
    """Factor of an object's base colour that keeps its brightness under another light."""
    basis = real_sh(result.normal[result.mask].astype(float))
    color = result.base_color[result.mask].astype(float)
    own, under = (
        float((color * np.exp(basis @ coefficients)).sum())
        for coefficients in (result.mesh_illumination.astype(float), light.astype(float))
    )
    return max(own, _LEAST) / max(under, _LEAST)


def _with_gain(result: ResultArrays, gain: float) -> ResultArrays:
    """The same result with the base colour multiplied, and the light divided, by a gain."""
    light = result.mesh_illumination.copy()
    light[0] -= np.float32(np.log(gain) / _CONSTANT)
    codes = srgb_to_linear(np.arange(256) / 255)
    codes = np.rint(255 * np.clip(linear_to_srgb(gain * codes), 0, 1)).astype(np.uint8)
    return replace(
        result,
        base_color=result.base_color * np.float32(gain),
        texture=None if result.texture is None else codes[result.texture],
        reflectance_scale=result.reflectance_scale * gain,
        mesh_illumination=light,
        environment_map=result.environment_map / np.float32(gain),
        sun_strength=result.sun_strength / np.float32(gain),
        sun_ambient=result.sun_ambient / np.float32(gain),
        specular_level=result.specular_level * gain,
    )
