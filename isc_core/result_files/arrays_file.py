"""A whole result as plain arrays in one file, for programs that have only NumPy, such as Blender.

Problem: maps are OpenEXR, the mesh is glTF, and the light is nine SH coefficients of log shading: a
program needs libraries to read them and code to evaluate them. `arrays.npz` (uncompressed, no
pickles) contains all of it as arrays, float32 unless stated otherwise:

    image, diffuse, specular, residual, reflectance, shading   (H, W, 3), linear Rec.709, 0 outside
    normal (H, W, 3), height, confidence (H, W), mask (H, W) bool   as in maps.exr
    vertices (V, 3)              metres, +X right, +Y up, +Z toward the viewer
    faces (F, 3) int32           counter-clockwise as seen by the viewer
    vertex_normals (V, 3)
    uv (V, 2)                    v counts from the BOTTOM of the texture
    vertex_pixel (V, 2) int32    row and column of each vertex
    base_color (H, W, 3)         linear, k * reflectance, continued beyond the mask; not clipped;
                                 without gloss above, unlike that of mesh files
    normal_map (H, W, 3)         tangent space, green up, [0, 1] stands for [-1, 1]
    reflectance_scale ()         k
    metres_per_pixel ()          size of the mesh
    origin (3,)                  column, row, height in pixels of the mesh's origin
    focal_length ()              of the photo's camera in map pixels; absent for orthographic views
    principal_point (2,)         x, y in map pixels from the left and upper edge; absent likewise
    eye (3,)                     the camera's position, in metres as the vertices; absent likewise
    illumination (9, 3)          SH coefficients of log shading, for `reflectance`
    mesh_illumination (9, 3)     the same for `base_color`: the shading divided by k
    sky (h, 2 h, 3)              environment map, radiance, that lights `base_color` accordingly
    sun_direction (3,)           unit vector toward the main light, see `light_direction.main_light`
    sun_strength (3,)            its irradiance across its beam, for `base_color`
    sun_ambient (3,)             the remaining ambient shading
    sun_explained ()             share of the shading in [0, 1]
    sun_cone ()                  standard error of the direction in degrees
    lamp_direction (K, 3)        unit vectors toward the lamps of the lobe, the brightest first;
                                 where it lies on the highlights, as after `isc refine`
    lamp_strength (K, 3)         their irradiance for `base_color` and `specular_level`
    lobe (H, W, 3)               specular image predicted by the fitted lobe; 0 without a fit
    roughness ()                 of Blender and glTF; NaN if unknown
    specular_level ()            for `base_color`, 1 is plastic (f0 = .04); NaN if unknown
    specular_variation (H, W)    factor of that level, where it varies; else absent
    texture (h, w, 3) uint8      `base_color` in sRGB codes at the photo's resolution, the frame is
                                 that of the maps; absent if not requested, or no finer than these
    cover (H, W)                 share of each pixel that the object covers, where more is known
                                 than the mask says; else absent
    soft (H, W) bool             where the rim is soft, see `object_cover`; absent where nowhere
    alpha (h, w) uint8           opacity in codes, of the size of `texture`, or of the maps; absent
                                 likewise
    photo_size (2,) int32        width and height of the original photo
    crop_scale ()                map pixels per photo pixel
    frame (4,) int32             x, y of the arrays' upper left pixel in the maps of the result, and
                                 width and height of these: where the object and a margin are less
                                 than half of the frame, maps, textures and pixels are those of
                                 that part

Equation: base_color * exp(SH(n; mesh_illumination)) = diffuse, and the irradiance of `sky` on a
white surface, over pi, is exp(SH(n; mesh_illumination)).

Citation: NumPy's file format, NEP 1, https://numpy.org/neps/nep-0001-npy-format.html.

Limits: `sky` is as accurate as `shading.environment_map` states.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..imaging.bounding_box import FramePart, aligned_edge
from ..io.npy import write_archive
from ..lobe_fitting.specular_level import SpecularFit
from ..lobe_fitting.specular_upper_bound import bounded_specular
from ..scene.decomposition import COLOR_MAPS, Decomposition
from ..scene.part_of_result import ResultPart
from .mesh.build import build_mesh
from .mesh.object_cover import ObjectCover
from .mesh.options import MeshOptions
from .mesh.result import MeshResult

if TYPE_CHECKING:
    from ..lobe_fitting.light_direction import DirectionEstimate

ARRAYS = "arrays.npz"
_MARGIN = 64  # pixels around the object, beyond those that the texture is extended by
_SEARCH = 64  # pixels by which the part of the frame is extended at most
_INTEGERS = {"faces", "vertex_pixel", "photo_size", "frame"}


@dataclass(frozen=True, eq=False)
class MainLights:
    """What a result is rendered under.

    Attributes
    ----------
    sky : (rows, 2 rows, 3) ndarray
        Radiance, see `shading.environment_map`.
    sun : DirectionEstimate
        The distant light that best explains the shading, or the highlights.
    """

    sky: np.ndarray
    sun: "DirectionEstimate"


def write_arrays(
    stored: ResultPart,
    path: Path,
    built: MeshResult | None = None,
    texture: np.ndarray | None = None,
    cover: ObjectCover | None = None,
    lights: MainLights | None = None,
) -> None:
    """Write the file; equal results give equal bytes.

    Parameters
    ----------
    stored : ResultPart
    path : Path
    built : MeshResult, optional
        Its mesh; built here by default.
    texture : (h, w, 3) uint8 ndarray, optional
        Of `exports.full_texture`.
    cover : ObjectCover, optional
    lights : MainLights, optional
        Found here by default.

    Raises
    ------
    InputError
        If the mask is too small for a mesh.
    OSError
        If the file cannot be written.
    """
    built = built or mesh_of(stored, finer=finer_by(texture, stored.part.shape))
    built = built if texture is None else built.with_texture(texture)
    arrays = arrays_of(stored.at(built.place), built, lights)
    if built.texture is not None:
        arrays["texture"] = built.texture
    if cover is not None:
        arrays |= _cover(cover, built)
    with path.open("wb") as file:
        write_archive(file, arrays)


def mesh_of(
    stored: ResultPart,
    options: MeshOptions | None = None,
    cover: ObjectCover | None = None,
    gloss: SpecularFit | None = None,
    finer: float = 1.0,
) -> MeshResult:
    """Build the mesh of a result, with maps and textures of the object's part of the frame.

    Parameters
    ----------
    stored : ResultPart
    options : MeshOptions, optional
    cover : ObjectCover, optional
        The mesh follows its outline, unless the object is so thin that smoothing would remove it.
    gloss : SpecularFit, optional
        From another mesh of this result, if it is known.
    finer : float, optional
        Size of a texture of the frame over the size of the maps' frame.

    Returns
    -------
    MeshResult

    Raises
    ------
    InputError
        If the mask is too small for a mesh.
    """
    place = _part_of(stored.mask, finer)
    near = stored.at(place)
    with ThreadPoolExecutor(1) as pool:  # half of the work
        found = None if gloss is not None else pool.submit(bounded_specular, near)
        built = _surface_of(near, place, options, cover)
        fit = gloss if found is None else found.result()
    assert fit is not None
    return _coated(near, built, fit)


def finer_by(texture: np.ndarray | None, shape: tuple[int, ...]) -> float:
    """Return the size of a texture of the frame over the size of the maps' frame.

    Parameters
    ----------
    texture : (h, w, ...) ndarray or None
    shape : tuple of int
        Rows and columns of that frame.

    Returns
    -------
    float
        1 without a texture.
    """
    return 1.0 if texture is None else texture.shape[1] / shape[1]


def _coated(d: Decomposition, built: MeshResult, gloss: SpecularFit) -> MeshResult:
    """The mesh with its gloss, and with the light that it reflects, if any."""
    if not gloss.specular:
        return replace(built, gloss=gloss)
    from ..lobe_fitting.specular_layer import ENVIRONMENT_ROWS, CoatedSurface
    from ..shading.environment_map import recovered_environment, resampled

    if d.environment is None:
        light = recovered_environment(d.illumination, ENVIRONMENT_ROWS, viewer=d.viewer)
    else:
        light = resampled(d.environment, ENVIRONMENT_ROWS)
    variation, k = gloss.variation, built.reflectance_scale
    coated = CoatedSurface(
        np.where(d.mask[..., None], d.normal, 0),
        d.shading / k,
        light / k,
        d.view,
        None if variation is None else variation / variation.max(),
    )
    return replace(built, gloss=gloss, coated=coated)


def _surface_of(
    d: Decomposition, part: FramePart, options: MeshOptions | None, cover: ObjectCover | None
) -> MeshResult:
    maps = d.height, d.normal, d.mask, d.reflectance
    try:
        return build_mesh(*maps, options, camera=d.camera, cover=cover, part=part)
    except InputError:
        if cover is None:
            raise
        return build_mesh(*maps, options, camera=d.camera, part=part)


def arrays_of(
    d: Decomposition, built: MeshResult, lights: MainLights | None = None
) -> dict[str, np.ndarray]:
    """Return the arrays of the file by name.

    Parameters
    ----------
    d : Decomposition
        The part of the result that the mesh covers.
    built : MeshResult
        Its mesh.
    lights : MainLights, optional
        Of the result; found here by default.

    Returns
    -------
    dict of str to ndarray
    """
    light = _light(d, built, lights or main_lights(d))
    values = _maps(d) | _mesh(built) | _camera(built) | light | _gloss(d, built)
    size, scale = (
        d.provenance.input.get("size", d.mask.shape[::-1]),
        d.provenance.input.get("scale", 1.0),
    )
    part = built.place
    values |= {"photo_size": np.array(size), "crop_scale": np.array(scale)}
    values["frame"] = np.array([*part.corner, *part.shape[::-1]])
    return {name: _typed(name, array) for name, array in values.items()}


def _part_of(mask: np.ndarray, factor: float) -> FramePart:
    """The object's part of the frame; its edges lie between pixels of a texture that is larger by
    `factor`, or nearly so.
    """
    part = FramePart.around(mask, _MARGIN + MeshOptions().bleed)
    if part.is_whole:
        return part

    def extended(along: slice, count: int) -> slice:
        if factor == 1:  # the grid of a mesh with fewer triangles is that of the whole frame
            return slice(along.start - along.start % _SEARCH, along.stop)
        first = range(along.start, max(along.start - _SEARCH, -1), -1)
        last = range(along.stop, min(along.stop + _SEARCH, count + 1))
        return slice(aligned_edge(first, factor), aligned_edge(last, factor))

    rows, columns = map(extended, (part.rows, part.columns), mask.shape)
    return FramePart(rows, columns, part.shape)


def _cover(cover: ObjectCover, built: MeshResult) -> dict[str, np.ndarray]:
    """The coverage in the mesh's part of the maps, and the opacity in that of the texture."""
    rim, alpha = cover.rim(built.place), cover.alpha(built.texture_part or built.place)
    if rim.soft is None or alpha is None:
        return {"cover": rim.cover}
    return {"cover": rim.cover, "soft": rim.soft, "alpha": alpha}


def _typed(name: str, values: np.ndarray) -> np.ndarray:
    kind = np.int32 if name in _INTEGERS else bool if name == "mask" else np.float32
    return np.ascontiguousarray(values, kind).reshape(np.shape(values))


def _maps(d: Decomposition) -> dict[str, np.ndarray]:
    return {
        name: getattr(d, name) for name in (*COLOR_MAPS, "normal", "height", "confidence", "mask")
    }


def _mesh(built: MeshResult) -> dict[str, np.ndarray]:
    mesh = built.mesh
    return {
        "vertices": mesh.vertices,
        "faces": mesh.faces,
        "vertex_normals": mesh.vertex_normals,
        "uv": mesh.uv,
        "vertex_pixel": built.vertex_pixel,
        "base_color": built.base_color,
        "normal_map": (built.detail + 1) / 2,
        "reflectance_scale": np.array(built.reflectance_scale),
        "metres_per_pixel": np.array(built.metres_per_pixel),
        "origin": np.array(built.origin),
    }


def _camera(built: MeshResult) -> dict[str, np.ndarray]:
    if built.camera is None or built.eye is None:
        return {}
    return {
        "focal_length": np.array(built.camera.focal_length),
        "principal_point": np.array(built.camera.principal_point),
        "eye": built.eye,
    }


def main_lights(d: Decomposition) -> MainLights:
    """Find the lights under which the file's readers render a result.

    Parameters
    ----------
    d : Decomposition

    Returns
    -------
    MainLights
    """
    from ..lobe_fitting.light_direction import main_light
    from ..shading.environment_map import recovered_environment

    sky = d.environment
    if sky is None:
        sky = recovered_environment(d.illumination, viewer=d.viewer)
    return MainLights(sky, main_light(d))


def _light(d: Decomposition, built: MeshResult, lights: MainLights) -> dict[str, np.ndarray]:
    k, sun = built.reflectance_scale, lights.sun
    return {
        "illumination": d.illumination,
        "mesh_illumination": built.illumination(d.illumination),
        "sky": lights.sky / k,
        "sun_direction": sun.light.direction,
        "sun_strength": sun.light.irradiance / k,
        "sun_ambient": sun.light.ambient / k,
        "sun_explained": np.array(sun.explained),
        "sun_cone": np.array(sun.cone),
    }


def _gloss(d: Decomposition, built: MeshResult) -> dict[str, np.ndarray]:
    gloss = built.gloss
    values = {
        "lobe": d.lobe,
        "roughness": np.array(np.nan if gloss.roughness is None else gloss.roughness),
        "specular_level": np.array(np.nan if gloss.specular is None else built.specular),
    }
    if gloss.variation is not None:
        values["specular_variation"] = gloss.variation
    return values | _lamps(d, built)


def _lamps(d: Decomposition, built: MeshResult) -> dict[str, np.ndarray]:
    from ..lobe_fitting.light_direction import lies_on_highlights

    if d.brdf is None or not built.specular or not lies_on_highlights(d.brdf):
        return {}
    return {
        "lamp_direction": np.stack([light.direction for light in d.brdf.lights]),
        "lamp_strength": np.stack([light.strength_light for light in d.brdf.lights])
        / built.specular,
    }
