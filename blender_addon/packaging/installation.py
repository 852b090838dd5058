"""What an installed zip must do, tried in a `bpy` module: `python -P installation.py ZIP FOLDER
[RESULT]`.

Stands alone and is run by its path, so that nothing of the source tree can be imported: only what
the zip carries. Installs the zip as Blender's preferences do, decomposes a painted photo by driving
the poller, twice, cancels a third run in the middle, kills the worker of a fourth, saves, opens,
appends, and uninstalls. The last line is JSON with what was measured; a check that fails raises.
With RESULT, a folder with arrays, that is imported instead of the two whole runs: seconds instead
of a minute. `try_out` makes the environment and starts it; BLENDER_USER_RESOURCES has to be set
before.

Limits: a zip without wheels is tried in an environment that has the packages, and then the source
tree may be in reach.
"""

import importlib
import importlib.util
import json
import os
import signal
import sys
import time
import zipfile
from pathlib import Path
from typing import Any

import bpy
import numpy as np

MODULE = "bl_ext.user_default.isc_intrinsic"
SIDE = 96


def main(archive: Path, folder: Path, result: Path | None = None) -> None:
    """Does it all; `folder`: an empty one to work in. `result`: of a photo called "photo"."""
    report: dict[str, Any] = {
        "blender": bpy.app.version_string,
        "python": sys.version.split()[0],
        "numpy": np.__version__,
    }
    install(archive, report)
    before = files_of(extension_folder())
    photo = paint_photo()
    use(photo)
    for name in ("run", "second run"):
        report[name] = run_to_the_end() if result is None else import_result(result)
        check_object()
    report["cancelled"] = cancel_in_the_middle()
    report["killed"] = kill_the_worker()
    check_object()
    blend = folder / "saved.blend"
    save_and_open(blend)
    append(blend)
    check(
        files_of(extension_folder()) == before,
        "nothing was written beside the extension's own files",
    )
    uninstall()
    print("REPORT", json.dumps(report), flush=True)


def check(fact: bool, what: str) -> None:
    """Raises `AssertionError` unless `fact`."""
    if not fact:
        raise AssertionError(what)


def install(archive: Path, report: dict[str, Any]) -> None:
    """Installs and enables the zip."""
    began = time.perf_counter()
    done = bpy.ops.extensions.package_install_files(
        filepath=str(archive), repo="user_default", enable_on_install=True
    )
    report["install seconds"] = round(time.perf_counter() - began, 1)
    check(
        done == {"FINISHED"} and MODULE in bpy.context.preferences.addons,
        "the extension is installed and enabled",
    )
    with zipfile.ZipFile(archive) as opened:
        alone = any(name.startswith("wheels/") for name in opened.namelist())
    reach = [
        name for name in ("isc_core", "blender_addon") if alone and importlib.util.find_spec(name)
    ]
    check(not reach, f"nothing of the source tree is in reach: {reach}")
    loaded = {name.partition(".")[0] for name in sys.modules} & {
        "scipy",
        "numba",
        "cv2",
        "OpenEXR",
        "trimesh",
        "PIL",
    }
    check(not loaded, f"Blender's own process loads none of the wheels: {loaded}")


def extension_folder() -> Path:
    """Where the extension lies."""
    return Path(str(sys.modules[MODULE].__file__)).parent


def files_of(folder: Path) -> dict[str, int]:
    """Sizes of all files under a folder; the byte code of Blender's own process is Python's
    business.
    """
    return {
        str(path.relative_to(folder)): path.stat().st_size
        for path in folder.rglob("*")
        if path.is_file() and path.suffix != ".pyc"
    }


def paint_photo() -> Any:
    """A glossy ball on nothing, as an image that was never a file."""
    row, column = (np.indices((SIDE, SIDE)) - (SIDE - 1) / 2) / (0.42 * SIDE)
    square = row**2 + column**2
    z = np.sqrt(np.clip(1 - square, 0, 1))
    shade = np.clip(0.25 + 0.6 * (-0.4 * column - 0.5 * row + 0.77 * z), 0, None)
    gloss = np.exp(-60 * ((row + 0.3) ** 2 + (column + 0.25) ** 2))
    pixels = np.ones((SIDE, SIDE, 4), np.float32)
    pixels[..., :3] = np.clip(
        np.array([0.8, 0.45, 0.3]) * shade[..., None] + 0.4 * gloss[..., None], 0, 1
    )
    pixels[..., 3] = square < 1
    image = bpy.data.images.new("photo", SIDE, SIDE, alpha=True)
    image.pixels.foreach_set(pixels[::-1].ravel())
    image.pack()
    return image


def use(photo: Any) -> None:
    """Chooses the photo in the panel."""
    settings = bpy.context.scene.isc
    settings.image, settings.max_size = photo, 64


def part(name: str) -> Any:
    """A module of the installed extension."""
    return importlib.import_module(f"{MODULE}.{name}")


def begin_run() -> Any:
    """What the button does, without its window."""
    request = part("operators.request").request_from_settings(bpy.data.scenes[0])
    return part("operators.worker_run").begin(
        part("operators.decompose").run_of(bpy.context, request)
    )


def tick(run: Any, seconds: float = 600.0, until: float = 2.0) -> list[str]:
    """Polls as the timer does, until the run has ended or `until` of it is done; the stages that
    were shown.
    """
    stages, end = [], time.monotonic() + seconds
    while (
        time.monotonic() < end
        and not part("operators.modal").advance(bpy.context, run)
        and run.status.fraction < until
    ):
        if run.status.stage not in stages:
            stages.append(run.status.stage)
        time.sleep(0.05)
    return stages


def run_to_the_end() -> dict[str, Any]:
    """One whole run; how long it took and how long its longest call."""
    began = time.perf_counter()
    run = begin_run()
    stages = tick(run)
    check(run.status.state == "done", f"the run ends well: {run.status}")
    seconds = round(time.perf_counter() - began, 1)
    return {
        "seconds": seconds,
        "longest call ms": round(run.longest_call_ms, 1),
        "import ms": round(run.import_ms),
        "stages": stages,
    }


def import_result(folder: Path) -> dict[str, Any]:
    """A result folder, by the operator; how long it took."""
    began = time.perf_counter()
    check(
        bpy.ops.isc.import_result(directory=str(folder)) == {"FINISHED"}, "the result is imported"
    )
    return {"seconds": round(time.perf_counter() - began, 2)}


def check_object() -> None:
    """The object is there, once, with all that belongs to it."""
    found = [
        thing
        for thing in bpy.data.objects
        if thing.type == "MESH" and thing.get("isc_key") == "photo"
    ]
    check(len(found) == 1, f"one object of the photo, not {[thing.name for thing in found]}")
    built = part("scene.build").find(found[0])
    check(built is not None and len(built.object.data.vertices) > 500, "the object is whole")
    check(
        built.scene.camera == built.camera and built.scene.world == built.world,
        "its scene shows it",
    )


def cancel_in_the_middle() -> dict[str, Any]:
    """A run that is cancelled: the worker dies, its files go."""
    bpy.data.scenes[0].isc.max_size = 0
    before = len(bpy.data.objects)
    run = begin_run()
    tick(run, until=0.02)
    check(run.status.state == "running", f"the run is at work: {run.status}")
    at = run.status.stage
    began = time.perf_counter()
    run.cancel()
    took = time.perf_counter() - began
    check(
        run.status.state == "cancelled" and len(bpy.data.objects) == before,
        "cancelled, and the scene as before",
    )
    gone = _within(5, lambda: not run.folder.exists() and not children())
    check(gone, f"a cancelled run leaves nothing: {children()} {run.folder}")
    return {"at": at, "call ms": round(1e3 * took, 1)}


def kill_the_worker() -> str:
    """A worker that is killed from outside gives a message; Blender lives on."""
    if not Path("/proc").is_dir():
        return "not tried: the system does not tell which process the worker is"
    run = begin_run()
    tick(run, until=0.02)
    for child in children():
        os.kill(child, signal.SIGKILL)
    tick(run, seconds=30)
    check(
        run.status.state == "failed" and run.status.message != "",
        f"a killed worker is reported: {run.status}",
    )
    bpy.data.scenes[0].isc.max_size = 64
    return str(run.status.message)


def children() -> list[int]:
    """Processes that this one has started and that go on; empty where the system does not tell."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == os.getpid() and fields[0] != "Z":
            found.append(int(path.parent.name))
    return found


def _within(seconds: float, fact: Any) -> bool:
    end = time.monotonic() + seconds
    while not fact() and time.monotonic() < end:
        time.sleep(0.05)
    return bool(fact())


def save_and_open(blend: Path) -> None:
    """All of it is in the file."""
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    check(blend.stat().st_size > 50_000, "the file is written")
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    check_object()
    loose = [
        f"{image.name} ({image.type})"
        for image in bpy.data.images
        if image.type in {"IMAGE", "UV_TEST"} and image.size[0] and not image.packed_file
    ]
    check(not loose, f"all images are in the file, but for {loose}")
    check(bpy.data.scenes[0].isc.max_size == 64, "the panel's choices are in the file")


def append(blend: Path) -> None:
    """The object and its material go into another file."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(blend)) as (source, target):
        target.collections = [name for name in source.collections if name.startswith("photo")]
    check(len(target.collections) == 1, "the object's collection is found by the photo's name")
    bpy.context.scene.collection.children.link(target.collections[0])
    (thing,) = [thing for thing in target.collections[0].objects if thing.type == "MESH"]
    images = [
        node.image for node in thing.data.materials[0].node_tree.nodes if node.type == "TEX_IMAGE"
    ]
    check(
        bool(images) and all(image.packed_file and image.size[0] for image in images),
        "the material came with its images",
    )
    check("isc_request" in thing and "isc_decomposition" in thing, "how it was made came along")


def uninstall() -> None:
    """Nothing is left: no classes, no properties, no files of the extension or its wheels."""
    folder = extension_folder()
    wheels = folder.parent.parent / ".local"
    bpy.ops.extensions.package_uninstall(repo_index=_repository(), pkg_id="isc_intrinsic")
    check(MODULE not in bpy.context.preferences.addons, "the extension is disabled")
    check(
        not hasattr(bpy.types.Scene, "isc") and not hasattr(bpy.types.WindowManager, "isc"),
        "its properties are gone",
    )
    check(not folder.exists(), "its files are gone")
    left = [path.name for path in wheels.rglob("*") if path.suffix in {".so", ".pyd", ".py"}]
    check(not left, f"its wheels are gone: {left[:5]}")


def _repository() -> int:
    return next(
        index
        for index, repo in enumerate(bpy.context.preferences.extensions.repos)
        if repo.module == "user_default"
    )


if __name__ == "__main__":
    main(*(Path(argument).resolve() for argument in sys.argv[1:4]))
