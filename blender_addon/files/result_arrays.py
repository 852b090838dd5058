"""The arrays that `isc decompose --arrays` writes, read with Python and NumPy alone.

`ResultArrays` has the names, shapes and units of `arrays.npz`. Maps cover `part` of the frame of
the result, row 0 at the top, and are 0 outside the mask. Colours are linear Rec.709. Vectors are in
the frame of the camera (x right, y up, z toward the viewer).

Limits: a damaged file, or one of an unsupported version, is refused; nothing is repaired.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from isc_core.errors import InputError
from isc_core.imaging.bounding_box import FramePart
from isc_core.io.json_files import read_json
from isc_core.io.npy import read_arrays
from isc_core.photo.camera import Camera

ARRAYS, DESCRIPTION = "arrays.npz", "decomposition.json"


# Shape of each array; a letter is a size that several arrays share.
_COLORS = (
    "image",
    "diffuse",
    "specular",
    "residual",
    "reflectance",
    "shading",
    "normal",
    "lobe",
    "base_color",
    "normal_map",
)
_VALUES = ("height", "mask", "confidence", "specular_variation", "cover", "soft")
_NUMBERS = (
    "reflectance_scale",
    "metres_per_pixel",
    "sun_explained",
    "sun_cone",
    "roughness",
    "specular_level",
    "crop_scale",
    "focal_length",
)
_LAMPS = ("lamp_direction", "lamp_strength")
_SHAPES: dict[str, tuple[str | int, ...]] = {
    **dict.fromkeys(_COLORS, ("H", "W", 3)),
    **dict.fromkeys(_VALUES, ("H", "W")),
    **dict.fromkeys(_NUMBERS, ()),
    **dict.fromkeys(("vertices", "vertex_normals"), ("V", 3)),
    **dict.fromkeys(("uv", "vertex_pixel"), ("V", 2)),
    **dict.fromkeys(("illumination", "mesh_illumination"), (9, 3)),
    **dict.fromkeys(("origin", "sun_direction", "sun_strength", "sun_ambient"), (3,)),
    **dict.fromkeys(_LAMPS, ("lamps", 3)),
    "faces": ("F", 3),
    "texture": ("rows", "columns", 3),
    "alpha": ("h_alpha", "w_alpha"),
    "environment_map": ("h", "w", 3),
    "photo_size": (2,),
    "frame": (4,),
    "principal_point": (2,),
    "eye": (3,),
}
_DTYPES = {
    **dict.fromkeys(("mask", "soft"), np.dtype(bool)),
    **dict.fromkeys(("texture", "alpha"), np.dtype(np.uint8)),
    **dict.fromkeys(("faces", "vertex_pixel", "photo_size", "frame"), np.dtype(np.int32)),
}
_CAMERA = ("focal_length", "principal_point", "eye")
_OPTIONAL, _MAY_BE_NAN = (
    {"specular_variation", "texture", "cover", "soft", "alpha", "frame", *_CAMERA, *_LAMPS},
    {"roughness", "specular_level"},
)
_MAX_LAMPS = 3
# Names that earlier versions wrote.
_FORMER_NAMES = {"environment_map": "sky"}


@dataclass(frozen=True, eq=False)
class ResultArrays:
    """One decomposition. Arrays are float32 unless stated otherwise.

    Attributes
    ----------
    image, diffuse, specular, residual, reflectance, shading : (H, W, 3) ndarray
        Photo and its layers.
    normal : (H, W, 3) ndarray
        Unit normals.
    height : (H, W) ndarray
        Pixels toward the viewer.
    mask : (H, W) ndarray of bool
        Pixels of the object.
    confidence : (H, W) ndarray
        Confidence of the shape in [0, 1].
    lobe : (H, W, 3) ndarray
        Specular image predicted by the fitted lobe.
    vertices : (V, 3) ndarray
        Metres in the camera frame.
    faces : (F, 3) ndarray of int32
        Vertices of each triangle, counter-clockwise for the viewer.
    vertex_normals : (V, 3) ndarray
        Unit normals.
    uv : (V, 2) ndarray
        Texture coordinates, v from the bottom.
    vertex_pixel : (V, 2) ndarray of int32
        Row and column of each vertex.
    base_color : (H, W, 3) ndarray
        `reflectance_scale` * `reflectance`, extrapolated beyond the mask.
    normal_map : (H, W, 3) ndarray
        Tangent-space normals, [0, 1] for [-1, 1].
    reflectance_scale : float
        Factor from `reflectance` to `base_color`.
    metres_per_pixel : float
        Scale of `vertices`.
    origin : (3,) ndarray
        Column, row and height in pixels of the origin of `vertices`.
    illumination, mesh_illumination : (9, 3) ndarray
        Log-shading SH coefficients for `reflectance` and for `base_color`.
    environment_map : (h, 2 h, 3) ndarray
        Radiance that gives `base_color` its shading, in the layout of the core's environment maps.
    sun_direction : (3,) ndarray
        Unit vector toward the light.
    sun_strength : (3,) ndarray
        Irradiance of the sun for `base_color`.
    sun_ambient : (3,) ndarray
        Uniform shading in addition to the sun.
    sun_explained : float
        Share of the shading that the sun explains, in [0, 1].
    sun_cone : float
        Angular spread of the light, degrees.
    roughness : float
        Roughness as Blender defines it; NaN if unknown.
    specular_level : float
        Level of the specular lobe for `base_color`, 1 is plastic; NaN if unknown.
    photo_size : (2,) ndarray of int32
        Width and height of the photo in pixels.
    crop_scale : float
        Map pixels per photo pixel.
    specular_variation : (H, W) ndarray or None
        Spatial factor of the specular level.
    texture : (rows, columns, 3) ndarray of uint8 or None
        `base_color` as sRGB codes at the photo's resolution, over the same frame.
    cover : (H, W) ndarray or None
        Share of each pixel that the object covers, where more is known than the mask says.
    soft : (H, W) ndarray of bool or None
        Where the rim is soft; None for nowhere.
    alpha : (rows, columns) ndarray of uint8 or None
        Opacity, of an object with a soft rim; without a texture of the size of the maps.
    lamp_direction, lamp_strength : (K, 3) ndarray or None
        Unit vectors toward the lamps of the highlights and their irradiances for `base_color`,
        after `isc refine`; at most three.
    focal_length : float or None
        Of the photo's camera in pixels of the maps; None for an orthographic view.
    principal_point : (2,) ndarray or None
        Its (x, y) in pixels from the left and upper edge of the maps.
    eye : (3,) ndarray or None
        Its place, in metres as `vertices`.
    frame : (4,) ndarray of int32 or None
        Column and row of the arrays' upper left pixel in the frame of the result, and the width and
        height of that; None if the arrays cover it.
    description : dict
        Content of decomposition.json.
    folder : Path
        Folder the result was read from.
    """

    image: np.ndarray
    diffuse: np.ndarray
    specular: np.ndarray
    residual: np.ndarray
    reflectance: np.ndarray
    shading: np.ndarray
    normal: np.ndarray
    height: np.ndarray
    mask: np.ndarray
    confidence: np.ndarray
    lobe: np.ndarray
    vertices: np.ndarray
    faces: np.ndarray
    vertex_normals: np.ndarray
    uv: np.ndarray
    vertex_pixel: np.ndarray
    base_color: np.ndarray
    normal_map: np.ndarray
    reflectance_scale: float
    metres_per_pixel: float
    origin: np.ndarray
    illumination: np.ndarray
    mesh_illumination: np.ndarray
    environment_map: np.ndarray
    sun_direction: np.ndarray
    sun_strength: np.ndarray
    sun_ambient: np.ndarray
    sun_explained: float
    sun_cone: float
    roughness: float
    specular_level: float
    photo_size: np.ndarray
    crop_scale: float
    specular_variation: np.ndarray | None = None
    texture: np.ndarray | None = None
    cover: np.ndarray | None = None
    soft: np.ndarray | None = None
    alpha: np.ndarray | None = None
    lamp_direction: np.ndarray | None = None
    lamp_strength: np.ndarray | None = None
    focal_length: float | None = None
    principal_point: np.ndarray | None = None
    eye: np.ndarray | None = None
    frame: np.ndarray | None = None
    description: dict[str, Any] = field(default_factory=dict)
    folder: Path = Path()

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the result's frame in pixels of the maps."""
        if self.frame is None:
            return self.mask.shape[1], self.mask.shape[0]
        return int(self.frame[2]), int(self.frame[3])

    @property
    def part(self) -> FramePart:
        """The part of the frame that the arrays cover."""
        height, width = self.mask.shape
        x, y = (0, 0) if self.frame is None else map(int, self.frame[:2])
        return FramePart(slice(y, y + height), slice(x, x + width), self.size[::-1])

    @property
    def origin_in_frame(self) -> tuple[float, float]:
        """Column and row of the origin of `vertices` in the result's frame."""
        (left, top), (column, row, _) = self.part.corner, self.origin.astype(float)
        return float(left + column), float(top + row)

    @property
    def camera(self) -> Camera | None:
        """The pinhole camera of the photo, for the maps; None for an orthographic view."""
        if self.focal_length is None or self.principal_point is None:
            return None
        x, y = map(float, self.principal_point)
        return Camera(self.focal_length, (x, y))

    @property
    def name(self) -> str:
        """Name of the object: the photo's name without its suffix, else the folder's name."""
        given = self.description.get("input", {}).get("name", "")
        return Path(str(given)).stem or self.folder.resolve().name or "object"

    @property
    def longest_side(self) -> float:
        """Longer side of the object across the view, which has the size given in metres: in pixels,
        with a pinhole camera in those at its mean distance, of which its far parts have more.
        """
        if self.eye is not None:
            return float(np.ptp(self.vertices[:, :2], axis=0).max() / self.metres_per_pixel) + 1
        return max(float(np.ptp(np.flatnonzero(self.mask.any(axis)))) + 1 for axis in (0, 1))


def read_result(folder: Path | str) -> ResultArrays:
    """Read a result folder of `isc decompose --arrays`.

    Parameters
    ----------
    folder : Path or str
        Result folder.

    Returns
    -------
    ResultArrays
        The decomposition.

    Raises
    ------
    InputError
        If the folder is no result, is damaged, or has no arrays.
    """
    folder = Path(folder)
    description = read_description(folder / DESCRIPTION)
    if not (folder / ARRAYS).is_file():
        raise InputError(
            f"{folder} has no {ARRAYS}: run `isc arrays` on it, or decompose with --arrays"
        )
    values = _check_arrays(read_arrays(folder / ARRAYS), folder / ARRAYS)
    return ResultArrays(**values, description=description, folder=folder)


def read_description(path: Path) -> dict[str, Any]:
    """Read the description of a result.

    Parameters
    ----------
    path : Path
        A decomposition.json.

    Returns
    -------
    dict
        Its content. The entries `input`, `settings` and `status` are dicts where present.

    Raises
    ------
    InputError
        If the file cannot be read or is no description.
    """
    description = read_json(path, "decompose the photo again")
    parts = (
        [description.get(name, {}) for name in ("input", "settings", "status")]
        if isinstance(description, dict)
        else [None]
    )
    if not all(isinstance(part, dict) for part in parts):
        raise InputError(f"{path} is not the description of a result: decompose the photo again")
    return dict(description)


def _check_arrays(arrays: dict[str, np.ndarray], path: Path) -> dict[str, Any]:
    """The arrays of `ResultArrays` by name, once shapes, types and values are checked."""
    sizes: dict[str, int] = {}
    values: dict[str, Any] = {}
    for name, shape in _SHAPES.items():
        array = arrays.get(name, arrays.get(_FORMER_NAMES.get(name, name)))
        if array is None and name in _OPTIONAL:
            continue
        problem = "is missing" if array is None else _find_problem(name, array, sizes)
        if array is None or problem:
            raise InputError(
                f"{path} is damaged or of an unsupported version ({name} {problem}): "
                "decompose the photo again"
            )
        values[name] = array if shape else float(array)
    if not values["mask"].any() or not values["metres_per_pixel"] > 0 or not len(values["faces"]):
        raise InputError(f"{path} contains no object: decompose the photo again")
    camera = [name for name in _CAMERA if name in values]
    if camera and (len(camera) < len(_CAMERA) or not values["focal_length"] > 0):
        raise InputError(f"{path} is damaged (half a camera): decompose the photo again")
    lamps = [name for name in _LAMPS if name in values]
    if lamps and (len(lamps) < len(_LAMPS) or sizes["lamps"] > _MAX_LAMPS):
        raise InputError(f"{path} is damaged (lamps): decompose the photo again")
    frame = values.get("frame")
    if frame is not None and not (
        min(frame[:2]) >= 0
        and frame[0] + sizes["W"] <= frame[2]
        and frame[1] + sizes["H"] <= frame[3]
    ):
        raise InputError(f"{path} is damaged (frame): decompose the photo again")
    faces, (rows, columns) = values["faces"], values["vertex_pixel"].T
    outside = faces.min() < 0 or faces.max() >= sizes["V"] or min(rows.min(), columns.min()) < 0
    if outside or rows.max() >= sizes["H"] or columns.max() >= sizes["W"]:
        raise InputError(
            f"{path} is damaged (the mesh refers to missing vertices or pixels): "
            "decompose the photo again"
        )
    return values


def _find_problem(name: str, array: np.ndarray, sizes: dict[str, int]) -> str:
    """What is wrong with an array, "" if nothing; `sizes` collects the lettered sizes."""
    shape, dtype = _SHAPES[name], _DTYPES.get(name, np.dtype(np.float32))
    fits = len(shape) == array.ndim and all(
        n == (sizes.setdefault(wanted, n) if isinstance(wanted, str) else wanted)
        for n, wanted in zip(array.shape, shape, strict=True)
    )
    if not fits:
        return f"has the shape {array.shape}"
    if array.dtype != dtype:
        return f"is {array.dtype}"
    if dtype.kind == "f" and name not in _MAY_BE_NAN and not np.isfinite(array).all():
        return "contains NaN or infinite values"
    return ""
