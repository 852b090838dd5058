"""A result as arrays: what `isc decompose --arrays` wrote, read with nothing but Python and NumPy.

`Result` has the names, shapes and units of `arrays.npz`: maps cover the photo's whole frame with
row 0 at the top and are 0 outside the mask, colours are linear Rec.709, vectors stand in the
camera's frame (x right, y up, z toward the viewer).

Limits: a file of another version, or a damaged one, is refused; nothing is repaired.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from isc_core.errors import InputError
from isc_core.json_files import read_json
from isc_core.numpy_files import read_arrays

ARRAYS, DESCRIPTION = "arrays.npz", "decomposition.json"


# The shape of each array: letters are sizes that arrays share.
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
_VALUES = ("height", "mask", "confidence", "specular_variation")
_NUMBERS = (
    "reflectance_scale",
    "metres_per_pixel",
    "sun_explained",
    "sun_cone",
    "roughness",
    "specular_level",
    "crop_scale",
)
_SHAPES: dict[str, tuple[str | int, ...]] = {
    **dict.fromkeys(_COLORS, ("H", "W", 3)),
    **dict.fromkeys(_VALUES, ("H", "W")),
    **dict.fromkeys(_NUMBERS, ()),
    **dict.fromkeys(("vertices", "vertex_normals"), ("V", 3)),
    **dict.fromkeys(("uv", "vertex_pixel"), ("V", 2)),
    **dict.fromkeys(("illumination", "mesh_illumination"), (9, 3)),
    **dict.fromkeys(("origin", "sun_direction", "sun_strength", "sun_ambient"), (3,)),
    "faces": ("F", 3),
    "sky": ("h", "w", 3),
    "photo_size": (2,),
}
_KINDS = {
    "mask": np.dtype(bool),
    **dict.fromkeys(("faces", "vertex_pixel", "photo_size"), np.dtype(np.int32)),
}
_OPTIONAL, _MAY_BE_UNKNOWN = {"specular_variation"}, {"roughness", "specular_level"}


@dataclass(frozen=True)
class Result:
    """One decomposition; arrays are float32 unless said otherwise.

    `image, diffuse, specular, residual, reflectance, shading`: (H, W, 3). `normal`: (H, W, 3) unit.
    `height`: (H, W), pixels toward the viewer. `mask`: (H, W) bool. `confidence`: (H, W) in [0, 1].
    `lobe`: (H, W, 3), the specular image that the fitted lobe predicts. `vertices`: (V, 3) metres,
    x right, y up, z toward the viewer. `faces`: (F, 3) int32, counter-clockwise for the viewer.
    `vertex_normals`: (V, 3) unit. `uv`: (V, 2), v from the bottom. `vertex_pixel`: (V, 2) int32,
    row and column. `base_color`: (H, W, 3), k * reflectance, continued beyond the mask.
    `normal_map`: (H, W, 3), tangent space, [0, 1] for [-1, 1]. `reflectance_scale`: k.
    `metres_per_pixel`: of `vertices`. `origin`: (3,), column, row and height in pixels of their
    origin. `illumination`, `mesh_illumination`: (9, 3), log shading for `reflectance` and for
    `base_color`. `sky`: (h, 2 h, 3), the radiance that gives `base_color` its shading, laid out as
    `isc_core.environment` says. `sun_direction`: (3,) unit, toward the light. `sun_strength`: (3,),
    its irradiance for `base_color`; `sun_ambient`: (3,), the shading it leaves to the rest;
    `sun_explained` in [0, 1]; `sun_cone` in degrees. `roughness`: Blender's; `specular_level`: for
    `base_color`, 1 is plastic; NaN where unknown. `specular_variation`: (H, W), a factor of the
    level, or None. `photo_size`: (2,) int32, width and height of the photo. `crop_scale`: map
    pixels to one of its pixels. `description`: what decomposition.json says. `folder`: where it was
    read from.
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
    sky: np.ndarray
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
    description: dict[str, Any] = field(default_factory=dict)
    folder: Path = Path()

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the maps in pixels."""
        return self.mask.shape[1], self.mask.shape[0]

    @property
    def name(self) -> str:
        """What to call the object: the photo's name without its suffix, else the folder's."""
        given = self.description.get("input", {}).get("name", "")
        return Path(str(given)).stem or self.folder.resolve().name or "object"

    @property
    def longest_side(self) -> int:
        """Pixels of the mask's bounding box, its longer side: what a size in metres is measured by."""
        return int((np.ptp(np.argwhere(self.mask), axis=0) + 1).max())


def read_result(folder: Path | str) -> Result:
    """Reads the result folder of `isc decompose --arrays`.

    Raises `InputError` if it is none, is damaged, or has no arrays.
    """
    folder = Path(folder)
    description = read_description(folder / DESCRIPTION)
    if not (folder / ARRAYS).is_file():
        raise InputError(
            f"{folder} has no {ARRAYS}: run `isc arrays` on it, or decompose with --arrays"
        )
    values = _checked(read_arrays(folder / ARRAYS), folder / ARRAYS)
    return Result(**values, description=description, folder=folder)


def read_description(path: Path) -> dict[str, Any]:
    """What decomposition.json says; its input, settings and status are objects.

    Raises `InputError` if it cannot be read or is none.
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


def _checked(held: dict[str, np.ndarray], path: Path) -> dict[str, Any]:
    """The arrays of `Result` by name, once shapes, kinds and values are what it promises."""
    sizes: dict[str, int] = {}
    values: dict[str, Any] = {}
    for name, shape in _SHAPES.items():
        if name not in held and name in _OPTIONAL:
            continue
        problem = "is missing" if name not in held else _problem(name, held[name], sizes)
        if problem:
            raise InputError(
                f"{path} is damaged or of another version ({name} {problem}): decompose the photo again"
            )
        values[name] = held[name] if shape else float(held[name])
    if not values["mask"].any() or not values["metres_per_pixel"] > 0 or not len(values["faces"]):
        raise InputError(f"{path} holds no object: decompose the photo again")
    faces, (rows, columns) = values["faces"], values["vertex_pixel"].T
    outside = faces.min() < 0 or faces.max() >= sizes["V"] or min(rows.min(), columns.min()) < 0
    if outside or rows.max() >= sizes["H"] or columns.max() >= sizes["W"]:
        raise InputError(
            f"{path} is damaged (the mesh points at what is not there): decompose the photo again"
        )
    return values


def _problem(name: str, array: np.ndarray, sizes: dict[str, int]) -> str:
    """What is wrong with an array, in words; nothing if it is as promised.

    `sizes` are the letters met so far.
    """
    shape, kind = _SHAPES[name], _KINDS.get(name, np.dtype(np.float32))
    fits = len(shape) == array.ndim and all(
        n == (sizes.setdefault(wanted, n) if isinstance(wanted, str) else wanted)
        for n, wanted in zip(array.shape, shape, strict=True)
    )
    if not fits:
        return f"has the shape {array.shape}"
    if array.dtype != kind:
        return f"is {array.dtype}"
    if kind.kind == "f" and name not in _MAY_BE_UNKNOWN and not np.isfinite(array).all():
        return "holds NaN or infinite values"
    return ""
