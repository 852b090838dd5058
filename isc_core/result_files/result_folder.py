"""The folder of a result: maps, mesh, preview and provenance.

A decomposition's folder holds `maps.exr` (one multilayer float32 file, see `maps_file`),
`decomposition.json`, `mesh.glb`, `preview.png`, and under `maps/` the main maps also as single-
layer files, for programs that cannot read multilayer ones; on request `arrays.npz`, see
`arrays_file`; `mask.png`, if the mask was found in the photo or is soft. With a fitted lobe,
`maps.exr` has another layer, `lobe`: the specular image predicted by the fit; `expected_error` has
the expected errors, if known. A refined light has other layers, `visibility` and `indirect`, and
its image as `environment.exr`. A separation's folder holds `separation.exr`, `diffuse.png`,
`specular.png`, `preview.png`. A folder appears completely or not at all (see `io.atomic`).
"""

import json
import math
import shutil
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from ..errors import InputError
from ..imaging.bounding_box import FramePart, mask_slices
from ..imaging.srgb import linear_to_srgb
from ..io.atomic import new_folder, require_writable
from ..io.exr import read_channels, write_channels
from ..io.json_files import numbers, read_json
from ..io.memory import release_memory
from ..io.png import encode_png
from ..io.printable_names import readable
from ..photo.camera import Camera
from ..photo.grabcut import encoded_mask
from ..progress import Monitor
from ..scene.decomposition import COLOR_MAPS, Decomposition, Provenance, Separation
from ..scene.expected_error import ExpectedError
from ..scene.lobe_fit import LobeFit
from ..scene.part_of_result import ResultPart, placed_result
from .arrays_file import ARRAYS, finer_by, main_lights, mesh_of, write_arrays
from .camera_json import camera_from_json, camera_to_json
from .contact_sheet import contact_sheet, separation_sheet
from .layer_pngs import LAYER_PNGS, write_layer_pngs
from .maps_file import (
    ENVIRONMENT,
    EXPECTED_ERROR,
    LAYERS,
    LOBE,
    MAPS,
    REFINED_LIGHT,
    SINGLE,
    StoredMaps,
    layer_channels,
    map_channels,
    stored_part,
    write_environment,
    write_maps,
)
from .mesh.object_cover import object_cover
from .mesh.options import MeshOptions
from .mesh.result import MeshResult

# 2: diagnostics are values instead of sentences; 3: files of large frames may store a part
SCHEMA_VERSION = 3
DECOMPOSITION_FILES = (
    "decomposition.json",
    MAPS,
    "mesh.glb",
    "preview.png",
    *(f"maps/{name}.exr" for name in SINGLE),
)
MASK = "mask.png"
_RESULT_FILES = (
    *DECOMPOSITION_FILES,
    ARRAYS,
    MASK,
    ENVIRONMENT,
    *LAYER_PNGS,
)  # including files written on demand
_PREVIEW_COMPRESSION = 2  # of 9: a quarter of the time of the default 6 for 18 % more bytes
# Pixels of the object's box: beyond, maps are written before the mesh is built, to save memory.
_MOST_AT_ONCE = 1 << 21
_LONGEST_SIDE = 1 << 31  # of a photo, pixels
_LEAST_BYTES, _LEAST_BYTES_A_PIXEL = 200_000, 30  # lower bounds, from measured results
_ARRAY_BYTES_A_PIXEL = 129  # the maps of the arrays file are not compressed
SEPARATION_FILES = ("separation.exr", "diffuse.png", "specular.png", "preview.png")


def save(
    decomposition: Decomposition,
    folder: Path | str,
    *,
    mesh: MeshOptions | None = None,
    arrays: bool = False,
    texture: np.ndarray | None = None,
    png: bool = False,
    cover: np.ndarray | None = None,
    part: FramePart | None = None,
    monitor: Monitor | None = None,
) -> None:
    """Write the folder of a decomposition, completely or not at all; an earlier result is replaced.

    Parameters
    ----------
    decomposition : Decomposition
    folder : Path or str
    mesh : MeshOptions, optional
    arrays : bool
        Whether to write `arrays.npz`, too.
    texture : (h, w, 3) uint8 ndarray, optional
        Fine base colour for `arrays.npz`, see `exports.full_texture`.
    png : bool
        Whether to write the layers as PNG files, too, see `layer_pngs`.
    cover : (H, W) ndarray, optional
        Coverage of the photo's pixels by the object, to write as `mask.png`.
    part : FramePart, optional
        The part of the frame that the maps of `decomposition` are of; by default all of it. The
        files are those of the frame.
    monitor : Monitor, optional

    Raises
    ------
    InputError
        If the folder cannot be replaced or written, or the mask is too small for a mesh.
    Cancelled
        If the user cancels.
    ValueError
        If a map has NaN or infinite values.
    """
    monitor = monitor or Monitor()
    given = ResultPart.of(decomposition, part)
    place = stored_part(given.mask)
    stored = given.at(place)
    channels = map_channels(stored)
    # The pool is inside the folder's block, so that its files are finished, or have failed, before
    # the folder is removed.
    with new_folder(folder, _RESULT_FILES) as partial, ThreadPoolExecutor(3) as pool:
        monitor.report("writing maps", 0.0)
        d = decomposition
        (partial / "maps").mkdir()
        maps = pool.submit(write_maps, stored, channels, place, partial)
        lights = pool.submit(main_lights, d) if arrays else None
        preview = pool.submit(_write_preview, given, partial / "preview.png")
        if d.mask[mask_slices(d.mask)].size > _MOST_AT_ONCE:
            maps.result()
            release_memory()
        monitor.report("building the mesh", 0.4)
        edge = object_cover(given, cover)
        finer = finer_by(texture, place.shape)
        built = mesh_of(given, mesh, edge, finer=finer)
        plain = None
        if arrays and edge is not None:
            # Vertices of the arrays are pixels, unlike those of an outline between the pixels.
            plain = pool.submit(mesh_of, given, mesh, None, built.gloss, finer)
        (partial / "mesh.glb").write_bytes(built.glb())
        if lights is not None:
            monitor.report("writing arrays", 0.6)
            of_pixels = built if plain is None else plain.result()
            write_arrays(given, partial / ARRAYS, of_pixels, texture, edge, lights.result())
        if png:
            write_layer_pngs(placed_result(d, given.part), partial)
        if d.environment is not None:
            write_environment(d.environment, partial)
        if cover is not None:
            (partial / MASK).write_bytes(encoded_mask(cover))
        _write_description(given, built, partial / "decomposition.json")
        monitor.report("drawing the preview", 0.7)
        maps.result()
        preview.result()
        monitor.report("writing maps", 1.0)


def _write_preview(given: ResultPart, path: Path) -> None:
    _write_sheet(contact_sheet(given.result, given.part), path)


def _write_sheet(sheet: Image.Image, path: Path) -> None:
    path.write_bytes(encode_png(np.asarray(sheet), _PREVIEW_COMPRESSION))


def _write_description(given: ResultPart, built: MeshResult, path: Path) -> None:
    description = _plain(_description(given, built))
    text = json.dumps(description, indent=2, ensure_ascii=False, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")


def load(folder: Path | str) -> Decomposition:
    """Read a folder that `save` wrote.

    Parameters
    ----------
    folder : Path or str

    Returns
    -------
    Decomposition

    Raises
    ------
    InputError
        If a file is missing, damaged, or inconsistent.
    """
    stored = load_part(folder)
    return placed_result(stored.result, stored.part)


def load_part(folder: Path | str) -> ResultPart:
    """Read the object's part of a result, for work that does not need its frame.

    Parameters
    ----------
    folder : Path or str

    Returns
    -------
    ResultPart
        The whole frame where that is small, or mostly the object, see `maps_file`.

    Raises
    ------
    InputError
        If a file is missing, damaged, or inconsistent.
    """
    folder = Path(folder)
    if not (folder / "decomposition.json").is_file():
        raise InputError(
            f"{folder} is not a result folder (it has no decomposition.json): give the folder that "
            "isc decompose wrote"
        )
    description = _read_json(folder / "decomposition.json")
    stored = StoredMaps.read(folder / MAPS)
    maps = stored.layers(LAYERS)
    mask = maps["mask"] > 0.5
    if not mask.any():
        raise InputError(f"{folder} has an empty mask: it is damaged; decompose the photo again")
    x, y = stored.part.corner
    camera = _camera(description, folder)
    result = Decomposition(
        **{name: maps[name] for name in (*COLOR_MAPS, "normal", "height", "confidence")},
        mask=mask,
        illumination=_coefficients(description, folder),
        provenance=_provenance(description, folder),
        brdf=_brdf(description, stored, folder),
        expected_error=_expected_error(stored),
        camera=None if camera is None else camera.moved(-x, -y),
        visibility=_refined_light("visibility", stored),
        indirect=_refined_light("indirect", stored),
        environment=_environment(folder / ENVIRONMENT),
    )
    return ResultPart(result, stored.part)


def save_separation(
    separation: Separation,
    image: np.ndarray,
    folder: Path | str,
    *,
    mask: np.ndarray | None = None,
    title: str = "",
    cover: np.ndarray | None = None,
) -> None:
    """Write the folder of a separation.

    Parameters
    ----------
    separation : Separation
    image : (H, W, 3) ndarray
        Linear.
    folder : Path or str
    mask : (H, W) bool ndarray, optional
        By default the pixels that are not black.
    title : str
    cover : (H, W) ndarray, optional
        A mask that was found, to write as `mask.png`.

    Raises
    ------
    InputError
        If the folder cannot be replaced or written.
    """
    inside = image.max(-1) > 0 if mask is None else mask
    if not inside.any():
        raise InputError("the image is black inside the mask: there is nothing to separate")
    part = stored_part(inside)
    layers = {"diffuse": "RGB", "specular": "RGB", "residual": "RGB", "confidence": "Y"}
    maps = {name: part.cut(getattr(separation, name)) for name in layers}
    channels = layer_channels({"image": part.cut(image), **maps}, {"image": "RGB", **layers})
    with new_folder(folder, (*SEPARATION_FILES, MASK)) as partial:
        write_channels(partial / "separation.exr", channels, part.corner, part.shape)
        for name in ("diffuse", "specular"):
            codes = np.rint(255 * linear_to_srgb(np.clip(maps[name], 0, 1))).astype(np.uint8)
            Image.fromarray(part.placed(codes)).save(partial / f"{name}.png")
        if cover is not None:
            (partial / MASK).write_bytes(encoded_mask(cover))
        sheet = separation_sheet(separation, image, inside, title)
        _write_sheet(sheet, partial / "preview.png")


def require_writable_result(
    folder: Path | str, *, separation: bool = False, inputs: Iterable[Path | None] = ()
) -> None:
    """Check, before the work, that its result can be written without loss of its inputs.

    Parameters
    ----------
    folder : Path or str
    separation : bool
    inputs : iterable of Path

    Raises
    ------
    InputError
        If it cannot.
    """
    files = (*SEPARATION_FILES, MASK) if separation else _RESULT_FILES
    require_writable(folder, files, inputs)


def require_room(folder: Path | str, pixels: int, *, arrays: bool = False) -> None:
    """Raise `InputError` if the disk has less space than the lower bound of a result's size.

    Parameters
    ----------
    folder : Path or str
    pixels : int
        Of the object.
    arrays : bool
    """
    existing = next(
        parent for parent in (Path(folder).resolve() / "maps").parents if parent.exists()
    )
    required = _LEAST_BYTES + (_LEAST_BYTES_A_PIXEL + _ARRAY_BYTES_A_PIXEL * arrays) * pixels
    if (free := shutil.disk_usage(existing).free) < required:
        raise InputError(
            f"cannot write {folder}: no space is left on the disk ({free / 1e6:.1f} MB, "
            f"{required / 1e6:.1f} MB needed); "
            "free some space or choose another folder"
        )


def _description(given: ResultPart, built: MeshResult) -> dict[str, Any]:
    d, p = given.result, given.result.provenance
    convention = (
        "log shading_c(n) = sum_k coefficients[k][c] Y_k(n); orthonormal real spherical harmonics, "
        "x right, y up, z toward the viewer"
    )
    return {
        "schema_version": SCHEMA_VERSION,
        "illumination": {"coefficients": d.illumination, "convention": convention},
        "camera": camera_to_json(d, given.part),
        "brdf": None if d.brdf is None else d.brdf.to_json(),
        "mesh": {
            **built.describe(),
            "illumination": {
                "coefficients": built.illumination(d.illumination),
                "convention": convention,
            },
        },
        "settings": p.settings,
        "seed": p.seed,
        "versions": p.versions,
        "timings": p.timings,
        "input": p.input,
        "status": p.diagnostics.to_json(),
    }


def _plain(value: Any) -> Any:
    """The value as JSON types: arrays as lists, paths as printable text, non-finite numbers as
    null.
    """
    if isinstance(value, Mapping):
        return {str(key): _plain(part) for key, part in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    if isinstance(value, str | Path):
        return readable(str(value))
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _read_json(path: Path) -> dict[str, Any]:
    description = read_json(path)
    version = description.get("schema_version") if isinstance(description, dict) else None
    if not isinstance(version, int):
        raise InputError(f"{path} has no schema_version: it is not a result of isc decompose")
    if version > SCHEMA_VERSION:
        raise InputError(
            f"{path} was written by a newer version (schema {version}, this version reads up to "
            f"{SCHEMA_VERSION}): update ISC"
        )
    return dict(description)


def _coefficients(description: Mapping[str, Any], folder: Path) -> np.ndarray:
    given = description.get("illumination")
    light = numbers(given.get("coefficients"), (9, 3)) if isinstance(given, dict) else None
    if light is None:
        raise InputError(
            f"{folder / 'decomposition.json'} has no illumination of 9 x 3 numbers: it is damaged"
        )
    return light


def _camera(description: Mapping[str, Any], folder: Path) -> Camera | None:
    """The camera; None for an orthographic view, as in results of earlier versions."""
    try:
        return camera_from_json(description.get("camera"))
    except ValueError as error:
        raise InputError(
            f"{folder / 'decomposition.json'} has no usable camera: it is damaged ({error})"
        ) from error


def _brdf(description: Mapping[str, Any], stored: StoredMaps, folder: Path) -> LobeFit | None:
    """The fit; None without one, as in results of earlier versions."""
    if description.get("brdf") is None:
        return None
    from .lobe_json import lobe_fit_from_json

    predicted = stored.layers(LOBE)["lobe"]
    try:
        return lobe_fit_from_json(description["brdf"], predicted)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{folder / 'decomposition.json'} has no usable brdf: it is damaged ({error})"
        ) from error


def _expected_error(stored: StoredMaps) -> ExpectedError | None:
    """None without one, as in results of baselines and of earlier versions."""
    if not any(name in stored.channels for name in EXPECTED_ERROR):
        return None
    maps = stored.layers(dict.fromkeys(EXPECTED_ERROR, ""))
    return ExpectedError(*(maps[name] for name in EXPECTED_ERROR))


def _refined_light(name: str, stored: StoredMaps) -> np.ndarray | None:
    """A layer of `REFINED_LIGHT`; None if the light was not refined."""
    if f"{name}.R" not in stored.channels:
        return None
    return stored.layers({name: REFINED_LIGHT[name]})[name]


def _environment(path: Path) -> np.ndarray | None:
    """The light as an image; None if the result was not refined."""
    if not path.is_file():
        return None
    channels = read_channels(path)
    missing = [name for name in "RGB" if name not in channels]
    radiance = None if missing else np.stack([channels[name] for name in "RGB"], -1)
    if radiance is None or radiance.shape[1] != 2 * len(radiance) or not (radiance >= 0).all():
        raise InputError(f"{path} is no environment map: it is damaged; refine the result again")
    return radiance


def _provenance(description: Mapping[str, Any], folder: Path) -> Provenance:
    from .diagnostics_json import diagnostics_from_json

    types = {
        "settings": dict,
        "seed": int,
        "versions": dict,
        "timings": dict,
        "input": dict,
        "status": dict,
    }
    for name, kind in types.items():
        if not isinstance(description.get(name), kind):
            raise InputError(f"{folder / 'decomposition.json'} has no usable {name}: it is damaged")
    if wrong := _wrong_input(description["input"]):
        raise InputError(
            f"{folder / 'decomposition.json'} has no usable input.{wrong}: it is damaged"
        )
    kept = {name: description[name] for name in types if name != "status"}
    return Provenance(**kept, diagnostics=diagnostics_from_json(description["status"]))


def _wrong_input(given: Mapping[str, Any]) -> str:
    """The first invalid entry of the record of the photo, or "". All entries are optional."""
    scale, size = numbers(given.get("scale", 1.0), ()), given.get("size", [1, 1])
    if scale is None or not 0 < scale <= 1:
        return "scale"
    if (
        not isinstance(size, list)
        or len(size) != 2
        or any(type(side) is not int or not 0 < side < _LONGEST_SIDE for side in size)
    ):
        return "size"
    texts = (
        name
        for name in ("name", "sha256", "transfer", "mask_from", "colour_profile")
        if not isinstance(given.get(name, ""), str)
    )
    return next(texts, "" if type(given.get("bit_depth", 8)) is int else "bit_depth")
