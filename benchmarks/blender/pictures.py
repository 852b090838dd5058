"""The pictures of docs/blender.md: five objects, a still life of them, a texture set, the window.

  python -m benchmarks.blender.pictures objects -o FOLDER
  python -m benchmarks.blender.pictures window OUT -o FOLDER

The first form photographs the bodies of `studio_photos`, draws their masks, and decomposes them by
the users' command with the model mdr, which takes every highlight that colour shows; what is in
FOLDER/work is kept. The second form crops the screenshots in OUT, the folder of
`tests/addon/window_driver.py` with a photo of the first form.

Limits: the photo's camera looked down by some degrees; objects are tilted back by these, by hand as
it were, to stand upright.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector
from PIL import Image, ImageDraw

from blender_addon.files.result_arrays import ARRAYS, read_result
from blender_addon.operators.texture_set import write_texture_set
from blender_addon.scene.build import build_object
from blender_addon.scene.built_object import BuiltObject
from blender_addon.scene.preparation import BuildOptions
from isc_core.cli.main import main as isc
from isc_core.errors import InputError

from .still_life import still_life
from .studio_photos import ABOVE, BODIES, draw_mask, photograph, render_picture, studio

TURNS = (0, -45, 45, 180)  # degrees, about the vertical axis
_SIDE, _GAP, _QUALITY = 190, 4, 75
_BODY_SIZE = 2.0  # of the longer side, as the bodies have
_TEXTURES = ("basecolor", "normal", "height", "roughness", "specular")
_FEW_TRIANGLES = 1500  # as in a game: the normal map holds what the mesh does not
_SIZE, _SAMPLES = "512", 16


@dataclass(frozen=True)
class Crop:
    """A part of a screenshot.

    Attributes
    ----------
    shot : str
        Its name.
    box : tuple of int
        Left, top, right, bottom in pixels of a screen of 1280 x 800.
    """

    shot: str
    box: tuple[int, int, int, int]


@dataclass(frozen=True)
class WindowPicture:
    """Parts of screenshots beside each other.

    Attributes
    ----------
    crops : tuple of Crop
        The parts, of one size.
    columns : int
        How many in a row.
    width : int
        Of the picture in pixels.
    """

    crops: tuple[Crop, ...]
    columns: int
    width: int


_PANEL, _OBJECT, _FLOOR = (764, 82, 1050, 545), (370, 90, 740, 640), (150, 55, 850, 700)
_EDITS = ("06_orbit", "07_lamp_0", "07_lamp_1", "08_recolored")
WINDOW: Mapping[str, WindowPicture] = {
    "window_rendered": WindowPicture((Crop("05_created", (0, 0, 1280, 722)),), 1, 1040),
    "window_mask": WindowPicture((Crop("03_mask", _PANEL), Crop("04_running", _PANEL)), 2, 580),
    "window_edits": WindowPicture(tuple(Crop(shot, _OBJECT) for shot in _EDITS), 4, 1000),
    "window_export": WindowPicture((Crop("08_export", (230, 100, 764, 460)),), 1, 480),
    "window_asset": WindowPicture(
        (Crop("14_asset_dragged", _FLOOR), Crop("15_another_file", _FLOOR)), 2, 1000
    ),
    "mask_box": WindowPicture((Crop("10_box", (2, 28, 1050, 718)),), 1, 735),
}


def result_of(name: str, work: Path) -> Path:
    """Return the result folder of a body's photo; made where it is missing.

    Parameters
    ----------
    name : str
        One of `BODIES`.
    work : Path
        Folder of photos, masks and results.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    InputError
        If the command fails.
    """
    photo, mask, result = work / f"{name}.png", work / f"{name}_mask.png", work / name
    body = BODIES[name]
    if not photo.is_file():
        photograph(body, photo)
    if not mask.is_file():
        draw_mask(body, mask)
    if not (result / ARRAYS).is_file():
        command = ["decompose", str(photo), "--mask", str(mask), "--max-size", _SIZE]
        if isc([*command, "--model", "mdr", "--arrays", "--quiet", "-o", str(result)]) != 0:
            raise InputError(f"cannot decompose {photo}")
    return result


def build(result: Path, triangles: int = 50_000) -> BuiltObject:
    """Build an object into the current scene, upright on the table as its body was.

    Parameters
    ----------
    result : Path
        Its result folder.
    triangles : int, optional
        As of `BuildOptions`.

    Returns
    -------
    BuiltObject
        The object.
    """
    options = BuildOptions(
        size_metres=_BODY_SIZE,
        own_scene=False,
        light_and_camera=False,
        back="rounded",
        triangles=triangles,
    )
    built = build_object(read_result(result), options)
    obj = built.object
    obj.matrix_world = Matrix.Rotation(np.arctan(ABOVE), 4, "X")
    stand(obj, Vector())
    return built


def stand(obj: bpy.types.Object, place: Vector) -> None:
    """Move an object so that its lowest point touches the table and its middle is above a place.

    Parameters
    ----------
    obj : bpy.types.Object
        The object; rotation and scale are kept.
    place : Vector
        On the table, z = 0.
    """
    bpy.context.view_layer.update()
    points = np.empty((len(obj.data.vertices), 3), np.float32)
    obj.data.vertices.foreach_get("co", points.ravel())
    seen = points @ np.array(obj.matrix_world.to_3x3()).T
    low, high = seen.min(0), seen.max(0)
    middle = (low + high) / 2
    obj.location = place - Vector((middle[0], middle[1], low[2]))


def objects_sheet(work: Path, results: Mapping[str, Path]) -> Image.Image:
    """Return a sheet: a row for each object, its photo and its turns in the studio.

    Parameters
    ----------
    work : Path
        Folder of the photos, for renders too.
    results : mapping of str to Path
        Result folders.

    Returns
    -------
    PIL.Image.Image
        The sheet.
    """
    rows = []
    for name, result in results.items():
        row = [Image.open(work / f"{name}.png").convert("RGB")]
        for turn in TURNS:
            path = work / f"{name}_{turn}.png"
            if not path.is_file():
                render_turned(result, turn, path)
            row.append(Image.open(path).convert("RGB"))
        rows.append(row)
    return sheet(rows, (_SIDE, _SIDE))


def render_turned(result: Path, turn: float, path: Path) -> None:
    """Render an object in the studio of the photos. Blender's file is emptied first.

    Parameters
    ----------
    result : Path
        Its result folder.
    turn : float
        Degrees about the vertical axis.
    path : Path
        PNG file to write.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    obj = build(result).object
    obj.matrix_world = Matrix.Rotation(np.radians(turn), 4, "Z") @ obj.matrix_world
    stand(obj, Vector())
    bpy.context.view_layer.update()
    studio(Vector((0, 0, obj.dimensions.z / 2)))
    render_picture(path, (2 * _SIDE, 2 * _SIDE), _SAMPLES)


def textures_sheet(work: Path, result: Path) -> Image.Image:
    """Return a strip of textures that *Export Texture Set* writes.

    Parameters
    ----------
    work : Path
        Folder of the textures.
    result : Path
        Result folder.

    Returns
    -------
    PIL.Image.Image
        The strip.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    built = build(result, _FEW_TRIANGLES)
    folder = work / "textures"
    folder.mkdir(exist_ok=True)
    write_texture_set(built, folder, "gourd", "generic", "PNG8", green_down=False)
    files = [folder / f"gourd_{name}.png" for name in _TEXTURES]
    pictures = [Image.open(path).convert("RGB") for path in files]
    width, height = pictures[0].size
    strip = sheet([pictures], (160, round(160 * height / width)))
    draw = ImageDraw.Draw(strip)
    for number, name in enumerate(_TEXTURES):
        place = (number * (160 + _GAP) + 6, 4)
        draw.text(place, name, fill="white", stroke_width=1, stroke_fill="black")
    return strip


def sheet(rows: Sequence[Sequence[Image.Image]], size: tuple[int, int]) -> Image.Image:
    """Return pictures in rows, each scaled to one size.

    Parameters
    ----------
    rows : sequence of sequence of PIL.Image.Image
        The pictures.
    size : tuple of int
        Width and height of each.

    Returns
    -------
    PIL.Image.Image
        The sheet.
    """
    across, down = size[0] + _GAP, size[1] + _GAP
    whole = (across * max(map(len, rows)) - _GAP, down * len(rows) - _GAP)
    made = Image.new("RGB", whole, "white")
    for y, row in enumerate(rows):
        for x, picture in enumerate(row):
            scaled = picture.resize(size, Image.Resampling.LANCZOS)
            made.paste(scaled, (x * across, y * down))
    return made


def window_picture(shots: Path, what: WindowPicture) -> Image.Image:
    """Return a picture of the window.

    Parameters
    ----------
    shots : Path
        Folder of the screenshots.
    what : WindowPicture
        Its parts.

    Returns
    -------
    PIL.Image.Image
        The picture.
    """
    parts = [
        Image.open(shots / f"{crop.shot}.png").convert("RGB").crop(crop.box) for crop in what.crops
    ]
    across = (what.width - _GAP * (what.columns - 1)) // what.columns
    size = (across, round(across * parts[0].height / parts[0].width))
    rows = range(0, len(parts), what.columns)
    return sheet([parts[first : first + what.columns] for first in rows], size)


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the pictures.

    Parameters
    ----------
    arguments : sequence of str, optional
        Command line, sys.argv by default.

    Returns
    -------
    int
        0, or 2 if something is missing.
    """
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    objects = commands.add_parser("objects", help="five objects")
    window = commands.add_parser("window", help="screenshots")
    window.add_argument("shots", type=Path, help="folder of the window's test")
    for command in (objects, window):
        command.add_argument("-o", "--output", type=Path, required=True, help="folder to write to")
    options = parser.parse_args(arguments)
    try:
        made = _objects(options.output) if options.command == "objects" else _window(options.shots)
    except (InputError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    options.output.mkdir(parents=True, exist_ok=True)
    for name, picture in made.items():
        picture.save(options.output / f"{name}.jpg", quality=_QUALITY, optimize=True)
    return 0


def _objects(folder: Path) -> dict[str, Image.Image]:
    work = folder / "work"
    work.mkdir(parents=True, exist_ok=True)
    results = {name: result_of(name, work) for name in BODIES}
    made = {"objects": objects_sheet(work, results)}
    made["textures"] = textures_sheet(work, results["gourd"])
    whole = work / "still_life.png"
    if not whole.is_file():
        bpy.ops.wm.read_factory_settings(use_empty=True)
        still_life([build(result).object for result in results.values()], stand)
        render_picture(whole, (1000, 560), 2 * _SAMPLES)
    return made | {"still_life": Image.open(whole).convert("RGB")}


def _window(shots: Path) -> dict[str, Image.Image]:
    return {name: window_picture(shots, what) for name, what in WINDOW.items()}


if __name__ == "__main__":
    sys.exit(main())
