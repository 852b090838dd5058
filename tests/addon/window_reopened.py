"""Opens what `window_driver.py` has written in a Blender that does not have the extension, and
compares renders with those of the window's own scene: glTF, USD, the asset dragged into another
file, the asset appended from its library.

Run by ../shared/tools/blender_window/blender_acceptance.sh on Linux, as root, or in a Python with
`bpy`; OUT is the folder of the window's test:
    blender_acceptance.sh --background --in OUT --driver tests/addon/window_reopened.py \\
        --timeout 300 --out LOOK -- OUT
    python tests/addon/window_reopened.py OUT LOOK
The second form also exports USD from the window's file, as Debian's Blender has none. All are
rendered by Cycles from the photo's camera, with the lamp and the world of that scene; PSNR is taken
where the object is, its peak is the 99.9th percentile. Exit code 1 where one is below 30 dB; LOOK
has the renders.
"""

import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

LEAST, SIZE, SAMPLES = 30.0, 320, 32


def main(acc: Any) -> None:
    """All of them, in the folder that the first argument names."""
    compare(acc, f"{acc.inp}/{os.path.basename(os.path.normpath(acc.args[0]))}")


def compare(acc: Any, folder: str) -> None:
    """All of them."""
    scene, asset = f"{folder}/scene.blend", f"{folder}/library/photo.blend"
    bpy.ops.wm.open_mainfile(filepath=scene)
    usd = usd_file(acc, folder)
    place = only_object("photo").matrix_world.copy()
    names = light_and_camera()
    wanted = render(f"{acc.out}/window")
    readers: dict[str, Callable[[], Any]] = {
        "glTF": lambda: bpy.ops.import_scene.gltf(filepath=f"{folder}/photo.glb"),
        "asset, dragged": lambda: bpy.ops.wm.open_mainfile(filepath=f"{folder}/another.blend"),
        "asset, appended": lambda: append(asset),
    }
    if usd:
        readers["USD"] = lambda: bpy.ops.wm.usd_import(filepath=usd)
    for name, read in readers.items():
        bpy.ops.wm.read_factory_settings(use_empty=True)
        read()
        moved = only_object("photo").matrix_world @ place.inverted()
        if not name.startswith("asset"):  # those lie where they are dropped
            acc.check(np.allclose(moved, Matrix(), atol=1e-4), f"{name}: it is where it was")
        light(scene, names, moved)
        found = render(f"{acc.out}/{name.replace(', ', '_')}")
        decibels = psnr(wanted, found)
        acc.check(decibels >= LEAST, f"{name}: {decibels:.1f} dB")


def usd_file(acc: Any, folder: str) -> str:
    """The window's export, or one of the open file; "" where this Blender has no USD."""
    if not bpy.app.build_options.usd:
        acc.log("USD: this Blender is built without it")
        return ""
    path = f"{folder}/photo.usdc"
    if not os.path.isfile(path):
        path = f"{acc.out}/photo.usdc"
        for obj in bpy.context.scene.objects:
            obj.select_set(obj.type == "MESH" and "isc_key" in obj)
        bpy.ops.wm.usd_export(filepath=path, selected_objects_only=True)
    return path


def only_object(name: str) -> Any:
    """The object of the photo; everything else is removed but its parents."""
    found = next(
        obj for obj in bpy.data.objects if obj.type == "MESH" and obj.name.startswith(name)
    )
    kept = {found}
    while found.parent is not None and found.parent not in kept:
        kept.add(found.parent)
    for obj in list(bpy.data.objects):
        if obj.type == "MESH" and obj not in kept:
            bpy.data.objects.remove(obj)
    return found


def light_and_camera() -> dict[str, list[str]]:
    """Names of the lamp, of the photo's camera, which becomes the scene's, and of the world."""
    scene = bpy.context.scene
    camera = next(obj for obj in bpy.data.objects if obj.type == "CAMERA" and "isc_key" in obj)
    for obj in list(bpy.data.objects):
        if obj.type == "LIGHT" and "isc_key" in obj:  # of a collection that is not shown
            bpy.data.objects.remove(obj)
    scene.camera = camera
    return {"objects": [camera.name, "Light"], "worlds": [scene.world.name]}


def light(path: str, names: dict[str, list[str]], moved: Matrix) -> None:
    """Replace lamps, camera and world by those of a file, at the place of the object."""
    for obj in list(bpy.data.objects):
        if obj.type in {"LIGHT", "CAMERA"}:
            bpy.data.objects.remove(obj)
    with bpy.data.libraries.load(path) as (_, wanted):
        for kind, values in names.items():
            setattr(wanted, kind, list(values))
    scene = bpy.context.scene
    for obj in wanted.objects:
        scene.collection.objects.link(obj)
    bpy.context.view_layer.update()
    for obj in wanted.objects:
        obj.matrix_world = moved @ obj.matrix_world
    scene.camera, scene.world = wanted.objects[0], wanted.worlds[0]


def append(path: str) -> None:
    """Append the asset of a library file."""
    with bpy.data.libraries.load(path, assets_only=True) as (stored, wanted):
        wanted.objects = stored.objects
    for obj in wanted.objects:
        bpy.context.scene.collection.objects.link(obj)
    bpy.context.view_layer.update()


def render(path: str) -> np.ndarray:
    """Render the scene; (H, W, 4), linear, row 0 at the bottom. Also written as PNG."""
    scene = bpy.context.scene
    scene.render.engine, scene.render.film_transparent = "CYCLES", True
    cycles, image = scene.cycles, scene.render.image_settings
    cycles.device, cycles.samples, cycles.seed = "CPU", SAMPLES, 0
    cycles.use_denoising, cycles.use_adaptive_sampling = False, False
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    image.file_format, image.color_mode, image.color_depth = "OPEN_EXR", "RGBA", "32"
    scene.render.filepath = f"{path}.exr"
    bpy.ops.render.render(write_still=True)
    picture = bpy.data.images.load(f"{path}.exr")
    pixels = np.empty(4 * SIZE * SIZE, np.float32)
    picture.pixels.foreach_get(pixels)
    image.file_format, image.color_depth = "PNG", "8"
    picture.save_render(f"{path}.png", scene=scene)
    Path(f"{path}.exr").unlink()
    return pixels.reshape(SIZE, SIZE, 4)


def psnr(wanted: np.ndarray, found: np.ndarray) -> float:
    """In dB, where the object of `wanted` is."""
    mask = wanted[..., 3] > 0.99
    peak = np.percentile(wanted[mask][:, :3], 99.9)
    error = np.mean((wanted[mask][:, :3] - found[mask][:, :3]) ** 2)
    return float(10 * np.log10(peak**2 / max(error, 1e-12)))


def without_window(arguments: list[str]) -> int:
    """The comparison by the module `bpy`; the exit code."""
    failed = []

    def check(fine: bool, text: str) -> bool:
        print("ok   " if fine else "WRONG", text, flush=True)
        if not fine:
            failed.append(text)
        return fine

    os.makedirs(arguments[1], exist_ok=True)
    compare(SimpleNamespace(out=arguments[1], check=check, log=print), arguments[0])
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(without_window(sys.argv[1:]))
