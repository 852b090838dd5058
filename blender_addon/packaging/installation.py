"""Test of an installed zip in a `bpy` module: `python -P installation.py ZIP FOLDER [RESULT]`.

Runs by its path and imports nothing of the source tree, only what the zip contains. It installs the
zip as Blender's preferences do, decomposes a generated photo twice by driving the poller, cancels a
third run midway, kills the worker of a fourth, saves, opens, appends, and uninstalls. The last line
of its output is JSON with measurements; a failed check raises. With RESULT, it imports this result
folder, which has arrays, instead of the two complete runs: this takes seconds, not a minute.
`try_out` creates the environment and starts this file; BLENDER_USER_RESOURCES must be set.

Limits: a zip without wheels is tested in an environment that has the packages; the source tree may
then be importable.
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
    """Run the whole test.

    Parameters
    ----------
    archive : Path
        The zip.
    folder : Path
        Empty folder to work in.
    result : Path, optional
        Result folder of a photo named "photo".
    """
    report: dict[str, Any] = {
        "blender": bpy.app.version_string,
        "python": sys.version.split()[0],
        "numpy": np.__version__,
    }
    install(archive, report)
    before = files_of(extension_folder())
    photo = create_photo()
    select_photo(photo)
    for name in ("run", "second run"):
        report[name] = complete_run() if result is None else import_result(result)
        check_object()
    report["cancelled"] = cancel_run()
    report["killed"] = kill_worker()
    check_object()
    blend = folder / "saved.blend"
    save_and_load(blend)
    append(blend)
    changed = sorted({name for name, _ in files_of(extension_folder()).items() ^ before.items()})
    check(not changed, f"no file of the extension's folder is changed: {', '.join(changed)}")
    uninstall()
    print("REPORT", json.dumps(report), flush=True)


def check(condition: bool, expectation: str) -> None:
    """Check a condition.

    Parameters
    ----------
    condition : bool
        The condition.
    expectation : str
        What is expected.

    Raises
    ------
    AssertionError
        If the condition is false.
    """
    if not condition:
        raise AssertionError(expectation)


def install(archive: Path, report: dict[str, Any]) -> None:
    """Install and enable the zip; adds the duration to `report`.

    Parameters
    ----------
    archive : Path
        The zip.
    report : dict of str to Any
        Measurements; gets "install seconds".

    Raises
    ------
    AssertionError
        If the extension is not enabled, the source tree is importable although the zip contains
        wheels, or Blender's process has loaded one of the packages in the wheels.
    """
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
        has_wheels = any(name.startswith("wheels/") for name in opened.namelist())
    importable = [
        name
        for name in ("isc_core", "blender_addon")
        if has_wheels and importlib.util.find_spec(name)
    ]
    check(not importable, f"the source tree is not importable: {importable}")
    loaded = {name.partition(".")[0] for name in sys.modules} & {
        "scipy",
        "numba",
        "OpenEXR",
        "trimesh",
        "PIL",
    }
    check(not loaded, f"Blender's own process loads none of the wheels: {loaded}")


def extension_folder() -> Path:
    """Return the folder of the installed extension."""
    return Path(str(sys.modules[MODULE].__file__)).parent


def files_of(folder: Path) -> dict[str, int]:
    """Return the sizes of all files in a folder by relative path, except Python's byte code.

    Parameters
    ----------
    folder : Path
        The folder, searched recursively.

    Returns
    -------
    dict of str to int
        Size in bytes by path relative to the folder.
    """
    return {
        str(path.relative_to(folder)): path.stat().st_size
        for path in folder.rglob("*")
        if path.is_file() and path.suffix != ".pyc"
    }


def create_photo() -> Any:
    """Create a generated image of a glossy ball on a transparent background."""
    row, column = (np.indices((SIDE, SIDE)) - (SIDE - 1) / 2) / (0.42 * SIDE)
    square = row**2 + column**2
    z = np.sqrt(np.clip(1 - square, 0, 1))
    shade = np.clip(0.25 + 0.6 * (-0.4 * column - 0.5 * row + 0.77 * z), 0, None)
    highlight = np.exp(-60 * ((row + 0.3) ** 2 + (column + 0.25) ** 2))
    pixels = np.ones((SIDE, SIDE, 4), np.float32)
    pixels[..., :3] = np.clip(
        np.array([0.8, 0.45, 0.3]) * shade[..., None] + 0.4 * highlight[..., None], 0, 1
    )
    pixels[..., 3] = square < 1
    image = bpy.data.images.new("photo", SIDE, SIDE, alpha=True)
    image.pixels.foreach_set(pixels[::-1].ravel())
    image.pack()
    return image


def select_photo(photo: Any) -> None:
    """Select the photo in the panel.

    Parameters
    ----------
    photo : bpy.types.Image
        The photo; the longer side of its object is set to 64 pixels.
    """
    settings = bpy.context.scene.isc
    settings.own_scene = True
    settings.image, settings.max_size = photo, 64


def extension_module(name: str) -> Any:
    """Import a module of the installed extension.

    Parameters
    ----------
    name : str
        Name relative to the extension, for example "operators.modal".

    Returns
    -------
    module
    """
    return importlib.import_module(f"{MODULE}.{name}")


def begin_run() -> Any:
    """Start a run as the button does, without a window."""
    request = extension_module("runs.request").request_from_settings(bpy.data.scenes[0])
    run = extension_module("operators.decompose").create_decompose_run(bpy.context, request)
    return extension_module("runs.active_run").begin_run(run)


def poll_run(run: Any, seconds: float = 600.0, until: float = 2.0) -> list[str]:
    """Poll a run as the timer does.

    Parameters
    ----------
    run : WorkerRun
        The run.
    seconds : float, optional
        Maximum duration.
    until : float, optional
        Fraction of the work at which to stop; above 1 for its end.

    Returns
    -------
    list of str
        The stages shown.
    """
    stages, end = [], time.monotonic() + seconds
    while (
        time.monotonic() < end
        and not extension_module("operators.modal").advance_run(bpy.context, run)
        and run.status.fraction < until
    ):
        if run.status.stage not in stages:
            stages.append(run.status.stage)
        time.sleep(0.05)
    return stages


def complete_run() -> dict[str, Any]:
    """Make one complete run and return its durations."""
    began = time.perf_counter()
    run = begin_run()
    stages = poll_run(run)
    check(run.status.state == "done", f"the run succeeds: {run.status}")
    seconds = round(time.perf_counter() - began, 1)
    return {
        "seconds": seconds,
        "longest call ms": round(run.longest_call_ms, 1),
        "import ms": round(run.import_ms),
        "stages": stages,
    }


def import_result(folder: Path) -> dict[str, Any]:
    """Import a result folder by the operator and return its duration.

    Parameters
    ----------
    folder : Path
        Result folder with arrays.

    Returns
    -------
    dict of str to float
        Duration as "seconds".

    Raises
    ------
    AssertionError
        If the import does not finish.
    """
    began = time.perf_counter()
    check(
        bpy.ops.isc.import_result(directory=str(folder)) == {"FINISHED"}, "the result is imported"
    )
    return {"seconds": round(time.perf_counter() - began, 2)}


def check_object() -> None:
    """Check that the object exists once, with all that belongs to it."""
    found = [
        obj for obj in bpy.data.objects if obj.type == "MESH" and obj.get("isc_key") == "photo"
    ]
    check(len(found) == 1, f"one object of the photo, not {[obj.name for obj in found]}")
    built = extension_module("scene.built_object").find_built(found[0])
    check(built is not None and len(built.object.data.vertices) > 500, "the object is complete")
    check(
        built.scene.camera == built.camera and built.scene.world == built.world,
        "its scene uses its camera and world",
    )


def cancel_run() -> dict[str, Any]:
    """Cancel a run and check that its worker and its files are gone."""
    bpy.data.scenes[0].isc.max_size = 0
    before = len(bpy.data.objects)
    run = begin_run()
    poll_run(run, until=0.02)
    check(run.status.state == "running", f"the run is active: {run.status}")
    stage = run.status.stage
    began = time.perf_counter()
    run.cancel()
    seconds = time.perf_counter() - began
    check(
        run.status.state == "cancelled" and len(bpy.data.objects) == before,
        "cancelled, and the scene unchanged",
    )
    gone = _wait_for(5, lambda: not run.folder.exists() and not child_processes())
    check(gone, f"a cancelled run leaves nothing: {child_processes()} {run.folder}")
    return {"stage": stage, "call ms": round(1e3 * seconds, 1)}


def kill_worker() -> str:
    """Kill a worker and return the message of its run."""
    if not Path("/proc").is_dir():
        return "not tested: the system has no /proc to find the worker"
    run = begin_run()
    poll_run(run, until=0.02)
    for child in child_processes():
        os.kill(child, signal.SIGKILL)
    poll_run(run, seconds=30)
    check(
        run.status.state == "failed" and run.status.message != "",
        f"the run reports the killed worker: {run.status}",
    )
    bpy.data.scenes[0].isc.max_size = 64
    return str(run.status.message)


def child_processes() -> list[int]:
    """Return the running child processes; empty on a system without /proc."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == os.getpid() and fields[0] != "Z":
            found.append(int(path.parent.name))
    return found


def _wait_for(seconds: float, condition: Any) -> bool:
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.05)
    return bool(condition())


def save_and_load(blend: Path) -> None:
    """Save and load a file, and check that it contains everything.

    Parameters
    ----------
    blend : Path
        File to write.

    Raises
    ------
    AssertionError
        If the file is incomplete: its object, a packed image or the panel's settings.
    """
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    check(blend.stat().st_size > 50_000, "the file is written")
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    check_object()
    unpacked = [
        f"{image.name} ({image.type})"
        for image in bpy.data.images
        if image.type in {"IMAGE", "UV_TEST"} and image.size[0] and not image.packed_file
    ]
    check(not unpacked, f"all images are packed, except {unpacked}")
    check(bpy.data.scenes[0].isc.max_size == 64, "the panel's settings are in the file")


def append(blend: Path) -> None:
    """Append the object to another file, and check its material.

    Parameters
    ----------
    blend : Path
        File that contains the object.

    Raises
    ------
    AssertionError
        If the collection, an image of the material or the request is missing.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(blend)) as (source, target):
        target.collections = [name for name in source.collections if name.startswith("photo")]
    check(len(target.collections) == 1, "the collection has the photo's name")
    bpy.context.scene.collection.children.link(target.collections[0])
    (obj,) = [obj for obj in target.collections[0].objects if obj.type == "MESH"]
    images = [
        node.image for node in obj.data.materials[0].node_tree.nodes if node.type == "TEX_IMAGE"
    ]
    check(
        bool(images) and all(image.packed_file and image.size[0] for image in images),
        "the material is appended with its images",
    )
    check(
        "isc_request" in obj and "isc_decomposition" in obj,
        "the request is appended with the object",
    )


def uninstall() -> None:
    """Uninstall, and check that no properties, files and wheels of the extension remain."""
    folder = extension_folder()
    wheels = folder.parent.parent / ".local"
    bpy.ops.extensions.package_uninstall(repo_index=_repository(), pkg_id="isc_intrinsic")
    check(MODULE not in bpy.context.preferences.addons, "the extension is disabled")
    check(
        not hasattr(bpy.types.Scene, "isc") and not hasattr(bpy.types.WindowManager, "isc"),
        "its properties are removed",
    )
    check(not folder.exists(), "its files are removed")
    remaining = [path.name for path in wheels.rglob("*") if path.suffix in {".so", ".pyd", ".py"}]
    check(not remaining, f"its wheels are removed: {remaining[:5]}")


def _repository() -> int:
    return next(
        index
        for index, repo in enumerate(bpy.context.preferences.extensions.repos)
        if repo.module == "user_default"
    )


if __name__ == "__main__":
    main(*(Path(argument).resolve() for argument in sys.argv[1:4]))
