"""Drives a real Blender window with a real mouse and keyboard, as an artist would: a photo, its
automatic mask if it has no transparency, the object at the cursor, orbit, a lamp, another color,
glTF and USD, a second run, undo, redo, an asset, a box, Esc, the Cancel button, save, load during a
run, a new scene, two objects of one photo, a furry ball, a refined result with its lamps, the asset
dragged into another file.

Run by ../shared/tools/blender_window/blender_acceptance.sh on Linux, as root:
    blender_acceptance.sh --ext dist/isc_intrinsic-VERSION-linux-x64-cp314.zip --tab ISC --in
    PHOTOS/photo.png --size 1280x800 \\
        --timeout 1300 --driver tests/addon/window_driver.py --out OUT
then `window_reopened.py` looks at what this has written. `--in FOLDER/refined`, a result of `isc
decompose --refine --arrays` whose lamps were kept, adds their step; without it, it is left out.
`-- each_object soft_rim` at the end runs these steps alone.
`acc` is that script's helper: `find` moves the mouse until the button under it runs the operator,
`shot` saves the screen, a number that is yielded is waited for. Exit code 1 where a check fails;
OUT/measured.txt holds the longest calls.
"""

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np

NAME = "photo"
_SHADERS = 75.0  # seconds until a software renderer has compiled the shaders of a new material


def main(acc: Any) -> Iterator[float]:
    """The whole of it."""
    measured: list[str] = []
    yield 1.5
    yield acc.shot("01_start")
    if not acc.args:
        yield from first_steps(acc, measured)
    for step in (each_object, soft_rim, refined):
        if not acc.args or step.__name__ in acc.args:
            yield from step(acc, measured)
    if not acc.args:
        yield from another_file(acc)
    Path(acc.out, "measured.txt").write_text("\n".join(measured) + "\n")


def first_steps(acc: Any, measured: list[str]) -> Iterator[float]:
    """With one photo."""
    yield from mask(acc, measured)
    yield from create(acc, measured)
    yield from look_around(acc)
    yield from export(acc)
    yield from second_run(acc, measured)
    yield from undo_and_redo(acc)
    yield from import_result(acc, measured)
    yield from asset(acc)
    yield from box(acc, measured)
    yield from stroke(acc, measured)
    yield from marked_highlight(acc)
    settings = bpy.context.scene.isc
    chosen = settings.image, settings.mask, settings.mask_source
    large = glossy_ball(2400, 1100.0, (0.7, 0.25, 0.12))  # time to press
    settings.image, settings.mask_source = picture(acc, "large", large), "ALPHA"
    settings.separator, settings.max_size = "none", 2048
    yield from cancel(acc, measured, "Esc", escape)
    yield from cancel(acc, measured, "Cancel", press_cancel)
    # the automatic mask of a photo is not used for the next one
    settings.image = chosen[0]
    settings.mask, settings.mask_source = chosen[1:]
    settings.max_size = 512
    yield from load_during_a_run(acc, measured)
    yield from load_while_drawing(acc)
    yield from new_scene(acc, measured)


def mask(acc: Any, measured: list[str]) -> Iterator[float]:
    """A photo as dropped on the view: its mask is found, and shown."""
    with acc.context():
        bpy.ops.isc.photo_as_object("INVOKE_DEFAULT", filepath=f"{acc.inp}/{NAME}.png")
    yield from until(lambda: shown().state == "running", 10)
    yield acc.shot("02_started")
    if shown().title.startswith("Create"):
        return  # a photo with transparency needs no mask
    yield from ended(60)
    note(acc, measured, "mask")
    found = bpy.context.scene.isc.mask
    acc.check(found is not None and shown().state == "done", f"a mask: {shown().message}")
    yield 2
    yield acc.shot("03_mask")


def create(acc: Any, measured: list[str]) -> Iterator[float]:
    """Accepting the mask is a click on Create Object; the object arrives beside the cube."""
    began = time.monotonic()
    if shown().state != "running":
        yield from begin(acc)
    yield from until(lambda: shown().fraction > 0.4, 240)
    yield acc.shot("04_running")
    yield from ended(400)
    note(acc, measured, f"created in {time.monotonic() - began:.0f} s")
    acc.check(shown().state == "done" and objects() == [NAME], f"it ends well: {shown().message}")
    acc.check(bpy.context.scene.name == "Scene", "the user's scene is shown")
    acc.check(bpy.context.object.name == NAME, "the object is active")
    space = acc.view3d()[1].spaces.active
    acc.check(space.shading.type == "MATERIAL", "in Material Preview")
    yield _SHADERS
    yield acc.shot("05_created")


def look_around(acc: Any) -> Iterator[float]:
    """Orbit, gloss, move the lamp, recolor."""
    view = acc.view3d()[1].spaces.active
    for _ in range(2):
        yield keys(acc, "KP_4", 1)
    yield 2
    yield acc.shot("06_orbit")
    for _ in range(2):
        yield keys(acc, "KP_6", 1)
    obj, lamp = bpy.data.objects[NAME], bpy.data.objects["Light"]
    view.shading.use_scene_lights = view.shading.use_scene_world = True
    yield _SHADERS
    edits = material_inputs()
    edits["Specular Level"].default_value, edits["Roughness"].default_value = 1.0, 0.25
    lamp.data.energy = 500
    for number, side in enumerate((-0.8, 2.5)):  # the cube would throw its shadow from further left
        lamp.location = (obj.location.x + side, obj.location.y - 3.5, obj.location.z + 1.5)
        yield 8
        yield acc.shot(f"07_lamp_{number}")
    with acc.context():
        bpy.ops.isc.recolour("EXEC_DEFAULT", True, hue=0.8)
    yield 8
    yield acc.shot("08_recolored")


def export(acc: Any) -> Iterator[float]:
    """File > Export > glTF of what is shown, edited a moment before; USD where Blender has it."""
    yield acc.xdo("mousemove 400 300", 1)
    with acc.context():
        bpy.ops.wm.call_menu(name="TOPBAR_MT_file_export")
    yield 3
    yield acc.xdo("mousemove 396 424 sleep .3 mousemove 400 426", 3)  # glTF, the last one
    yield acc.shot("08_export")
    yield acc.xdo("key Escape", 2)
    with acc.context():
        material_inputs()["Value"].default_value = 0.8
        done = bpy.ops.export_scene.gltf(filepath=f"{acc.out}/{NAME}.glb", use_selection=True)
        acc.check(done == {"FINISHED"}, "glTF is exported")
        if bpy.app.build_options.usd:  # Debian's Blender is built without
            path = f"{acc.out}/{NAME}.usdc"
            done = bpy.ops.wm.usd_export(filepath=path, selected_objects_only=True)
            acc.check(done == {"FINISHED"}, "USD is exported")
    bpy.ops.wm.save_as_mainfile(filepath=f"{acc.out}/scene.blend", copy=True)
    yield 1


def second_run(acc: Any, measured: list[str]) -> Iterator[float]:
    """The same photo with other output: from the cache."""
    bpy.context.scene.isc.back = "flat"
    yield from begin(acc)  # which looks for the button
    began = time.monotonic()
    yield from ended(100)
    seconds = time.monotonic() - began
    note(acc, measured, f"second run, other output options, in {seconds:.1f} s")
    acc.check(shown().message == f"{NAME} updated", f"the second run: {shown().message}")
    acc.check(material_inputs()["Specular Level"].default_value == 1, "edits of gloss are kept")
    bpy.context.scene.isc.back = "rounded"


def undo_and_redo(acc: Any) -> Iterator[float]:
    """Steps back take all of it away, steps forward bring it back."""
    for _ in range(3):
        yield keys(acc, "ctrl+z", 2)
    acc.check(objects() == [], f"undo takes all of it away: {objects()}")
    for _ in range(3):
        yield keys(acc, "ctrl+shift+z", 2)
    acc.check(objects() == [NAME], "redo brings it back")


def import_result(acc: Any, measured: list[str]) -> Iterator[float]:
    """The folder of the result, as if selected in the file browser."""
    folder = next(Path.home().rglob("arrays.npz")).parent
    acc.view3d()[1].spaces.active.shading.type = "SOLID"
    with acc.context():
        bpy.ops.isc.read_result("INVOKE_DEFAULT", directory=str(folder))
    acc.check(shown().state == "running", "an import goes on while the window is used")
    yield from ended(60)
    note(acc, measured, "imported")
    acc.check(shown().state == "done" and objects() == [NAME], f"a result: {shown().message}")
    acc.view3d()[1].spaces.active.shading.type = "MATERIAL"
    yield 5


def new_scene(acc: Any, measured: list[str]) -> Iterator[float]:
    """In a new scene, and back by one button."""
    bpy.context.scene.isc.own_scene = True
    yield from begin(acc)
    yield from ended(100)
    note(acc, measured, "new scene")
    acc.check(bpy.context.scene.name == NAME, "the object's own scene is shown")
    acc.view3d()[1].spaces.active.shading.type = "RENDERED"
    yield 20
    yield acc.shot("09_new_scene")
    acc.view3d()[1].spaces.active.shading.type = "MATERIAL"
    yield from press(acc, "isc.return_to_scene")
    yield 1.5
    acc.check(bpy.context.scene.name == "Scene", "and leads back")
    bpy.context.scene.isc.own_scene = False


def each_object(acc: Any, measured: list[str]) -> Iterator[float]:
    """The two objects of a photo: progress of both, Esc in the second one, one undo step."""
    settings, before = bpy.context.scene.isc, objects()
    settings.image, settings.mask_source = picture(acc, "pair", balls()), "ALPHA"
    settings.each, settings.max_size, settings.own_scene = True, 256, False
    calm(acc)
    yield from begin(acc)
    told: list[tuple[float, str]] = []

    def told_of_second() -> bool:
        told.append((shown().fraction, shown().stage))
        return at_object(2)

    yield from until(told_of_second, 300)
    acc.check(at_object(2), f"the second object is at work: {shown().stage}, {shown().message}")
    yield acc.shot("16_each_running")
    shares, stages = [share for share, _ in told], [stage for _, stage in told]
    acc.check(shares == sorted(shares) and shares[-1] < 0.9, f"progress of both: {shares[-1]:.2f}")
    acc.check(any("1/2: " in stage and "left" in stage for stage in stages), "time left")
    yield from escape(acc)
    yield from until(lambda: shown().state == "cancelled" and not workers(), 8)
    acc.check(shown().state == "cancelled" and objects() == before, "Esc leaves none of both")
    began = time.monotonic()
    yield from begin(acc)
    yield from ended(400)
    note(acc, measured, f"two objects in {time.monotonic() - began:.0f} s")
    acc.check(set(objects()) == {*before, "pair 1", "pair 2"}, f"both: {shown().message}")
    yield _SHADERS
    yield acc.shot("16_each_created")
    yield keys(acc, "ctrl+z", 3)
    acc.check(objects() == before, f"one undo step takes both away: {objects()}")
    yield keys(acc, "ctrl+shift+z", 3)
    acc.check({"pair 1", "pair 2"} <= set(objects()), "one step brings both back")
    bpy.context.scene.isc.each = False


def at_object(number: int) -> bool:
    """Whether this object of two is at work, or the run is over."""
    return f"{number}/2: " in shown().stage or shown().state != "running"


def soft_rim(acc: Any, measured: list[str]) -> Iterator[float]:
    """A furry ball from a soft alpha channel: its material has an opacity."""
    settings = bpy.context.scene.isc
    settings.image, settings.mask_source = picture(acc, "fur", furry_ball()), "ALPHA"
    settings.each, settings.max_size, settings.own_scene = False, 512, False
    calm(acc)
    yield from begin(acc)
    yield from ended(400)
    note(acc, measured, "soft rim")
    acc.check("fur" in objects(), f"a furry ball: {shown().message}")
    nodes = bpy.data.objects["fur"].active_material.node_tree.nodes
    shader = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    acc.check(shader.inputs["Alpha"].is_linked, "its material has an opacity")
    with acc.context():
        bpy.ops.view3d.view_axis(type="FRONT")
        bpy.ops.view3d.view_selected()
    yield _SHADERS
    yield acc.shot("17_soft_rim")


def refined(acc: Any, measured: list[str]) -> Iterator[float]:
    """A refined result in a scene of its own: the lamps of its highlights shine there."""
    folder = Path(acc.inp, "refined")
    if not folder.is_dir():
        acc.log("no refined result is given")
        return
    home = bpy.context.scene.name
    bpy.context.scene.isc.own_scene = True
    calm(acc)
    with acc.context():
        bpy.ops.isc.read_result("INVOKE_DEFAULT", directory=str(folder))
    yield from ended(100)
    note(acc, measured, "refined")
    roles = {str(obj.get("isc_role", "")): obj for obj in bpy.context.scene.objects}
    lamps = sorted(role for role in roles if role.startswith("lamp"))
    acc.check(bpy.context.scene.name != home, f"a refined result: {shown().message}")
    acc.check(lamps, f"its lamps are there: {lamps}")
    acc.check(all(not roles[role].hide_render for role in lamps), "and shine")
    acc.view3d()[1].spaces.active.shading.type = "RENDERED"
    yield _SHADERS
    yield acc.shot("18_refined")
    acc.view3d()[1].spaces.active.shading.type = "MATERIAL"
    yield from press(acc, "isc.return_to_scene")
    yield 1.5
    acc.check(bpy.context.scene.name == home, "and back")
    bpy.context.scene.isc.own_scene = False


def calm(acc: Any) -> None:
    """No materials in the view: compiling their shaders on the processor delays every call."""
    acc.view3d()[1].spaces.active.shading.type = "SOLID"


def picture(acc: Any, name: str, codes: np.ndarray) -> Any:
    """A photo (H, W, 4) in sRGB codes from 0 to 1, row 0 at the top, as a file, and opened."""
    height, width = codes.shape[:2]
    made = bpy.data.images.new(name, width, height, alpha=True)
    made.pixels.foreach_set(codes[::-1].astype(np.float32).ravel())
    made.filepath_raw, made.file_format = f"{acc.out}/{name}.png", "PNG"
    made.save()
    bpy.data.images.remove(made)
    return bpy.data.images.load(f"{acc.out}/{name}.png")


def balls() -> np.ndarray:
    """Two glossy balls side by side before nothing."""
    return np.concatenate(
        [glossy_ball(320, 140.0, (0.7, 0.25, 0.12)), glossy_ball(320, 110.0, (0.15, 0.4, 0.6))], 1
    )


def glossy_ball(size: int, radius: float, color: tuple[float, float, float]) -> np.ndarray:
    """A ball under a lamp, (size, size, 4)."""
    down, across = (np.indices((size, size)) + 0.5 - size / 2) / radius
    inside = np.hypot(down, across) < 1
    normal = np.stack([across, -down, np.sqrt(np.maximum(1 - across**2 - down**2, 0))])
    lamp = np.array([0.4, 0.5, 0.77])
    half = (lamp + (0, 0, 1)) / np.linalg.norm(lamp + (0, 0, 1))
    diffuse = 0.2 + 0.7 * np.maximum(np.tensordot(lamp, normal, 1), 0)
    gloss = 0.6 * np.maximum(np.tensordot(half, normal, 1), 0) ** 80
    light = diffuse[..., None] * color + gloss[..., None]
    return np.dstack([np.clip(light, 0, 1) ** (1 / 2.2), inside]) * inside[..., None]


def furry_ball() -> np.ndarray:
    """A ball whose strands fade outward, (640, 640, 4)."""
    codes, rng = glossy_ball(640, 300.0, (0.5, 0.35, 0.22)), np.random.default_rng(0)
    down, across = np.indices((640, 640)) + 0.5 - 320
    strand = ((np.arctan2(down, across) / np.pi + 1) * 300).astype(int)
    length = np.convolve(rng.uniform(20, 90, 603), np.ones(3) / 3, "valid")[strand]
    codes[..., 3] = np.clip((300 - np.hypot(down, across)) / length, 0, 1)
    return codes


def box(acc: Any, measured: list[str]) -> Iterator[float]:
    """A box drawn on the photo over the 3D view."""
    left, top, width, height = acc.rect("VIEW_3D", "WINDOW")
    with acc.context():
        bpy.ops.isc.draw_box("INVOKE_DEFAULT")
    yield 1.5
    side = 0.45 * min(width, height)
    x, y = (left + acc.rect("VIEW_3D", "UI")[0]) / 2, top + height / 2
    start, end = (
        (int(x - side * 0.6), int(y - side * 0.94)),
        (int(x + side * 0.6), int(y + side * 0.94)),
    )
    drag = (
        f"mousemove {start[0]} {start[1]} sleep 1 mousedown 1 sleep 1 mousemove {end[0]} {end[1]}"
    )
    yield acc.xdo(drag, 5)
    yield acc.shot("10_box")
    yield acc.xdo("mouseup 1", 1)
    yield from until(lambda: shown().state == "running", 20)
    yield from ended(60)
    note(acc, measured, "box")
    acc.check(shown().title == "Cut Out", f"the box is cut out: {shown().message}")


def stroke(acc: Any, measured: list[str]) -> Iterator[float]:
    """A stroke down the photo over the 3D view, over which the mask is shown."""
    settings = bpy.context.scene.isc
    left, top, _, height = acc.rect("VIEW_3D", "WINDOW")
    x, y = int((left + acc.rect("VIEW_3D", "UI")[0]) / 2), int(top + height / 2)
    with acc.context():
        bpy.ops.isc.mark_point("INVOKE_DEFAULT")
    yield 1.5
    down = " ".join(f"mousemove {x} {y + 12 * step} sleep .2" for step in range(8))
    yield acc.xdo(f"mousemove {x} {y} sleep 1 mousedown 1 sleep .5 {down}", 6)
    yield acc.shot("10_stroke")
    yield acc.xdo("mouseup 1", 1)
    yield from until(lambda: shown().state == "running", 20)
    yield from ended(60)
    note(acc, measured, "stroke")
    acc.check(len(settings.points.split()) > 2, f"a stroke is points: {settings.points}")
    acc.check(shown().state == "done", f"the mask follows it: {shown().message}")
    with acc.context():
        bpy.ops.isc.clear_points()


def marked_highlight(acc: Any) -> Iterator[float]:
    """A click on the photo over the 3D view is a pixel of it."""
    settings = bpy.context.scene.isc
    left, top, _, height = acc.rect("VIEW_3D", "WINDOW")
    with acc.context():
        bpy.ops.isc.mark_highlight("INVOKE_DEFAULT")
    yield 1.5
    x, y = int((left + acc.rect("VIEW_3D", "UI")[0]) / 2), int(top + height / 2)
    yield acc.xdo(f"mousemove {x} {y} sleep 1 click 1", 3)
    middle = [size / 2 for size in settings.image.size]
    found = [int(part) for part in (settings.highlights or "0,0").split(",")]
    off = max(abs(a - b) / max(middle) for a, b in zip(found, middle, strict=True))
    acc.check(off < 0.05, f"a click marks a highlight: {settings.highlights}")
    settings.highlights = ""
    yield 0.5


def asset(acc: Any) -> Iterator[float]:
    """The object becomes an asset, found by F3."""
    library = Path(acc.out, "library")
    library.mkdir(exist_ok=True)
    bpy.ops.preferences.asset_library_add(directory=str(library))
    with acc.context():
        bpy.context.view_layer.objects.active = bpy.data.objects[NAME]
        libraries = bpy.context.preferences.filepaths.asset_libraries
        done = bpy.ops.isc.save_asset("EXEC_DEFAULT", library=libraries[-1].name)
    acc.check(done == {"FINISHED"} and (library / f"{NAME}.blend").is_file(), "an asset is saved")
    acc.view3d()[1].spaces.active.shading.type = "SOLID"  # typing waits for the drawing
    yield 3
    for number, words in enumerate(("photo as 3d", "ISC")):
        yield keys(acc, "F3", 4)
        yield acc.type(words, 4)
        yield acc.shot(f"11_search_{number}")
        yield acc.xdo("key Escape", 2)


def cancel(
    acc: Any, measured: list[str], how: str, stop: Callable[[Any], Iterator[float]]
) -> Iterator[float]:
    """A run that is ended from the window: its worker dies, the scene is as before."""
    yield from begin(acc)
    yield from until(lambda: shown().fraction > 0.02, 100)
    acc.check(shown().state == "running" and workers(), "a worker is at work")
    yield from stop(acc)
    yield from until(lambda: shown().state == "cancelled", 5)
    acc.check(shown().state == "cancelled", f"{how} cancels")
    note(acc, measured, how)
    yield from until(lambda: not workers(), 5)
    acc.check(
        not workers() and objects() == [NAME], "no worker is left, and the scene is as before"
    )


def load_during_a_run(acc: Any, measured: list[str]) -> Iterator[float]:
    """The file is saved; loading it ends the run that goes on; all is there."""
    blend = f"{acc.out}/saved.blend"
    bpy.ops.wm.save_as_mainfile(filepath=blend)
    yield from begin(acc)
    acc.check(shown().state == "running", "a run goes on while a file is loaded")
    bpy.ops.wm.open_mainfile(filepath=blend)
    yield 3
    yield from until(lambda: not workers(), 5)
    acc.check(not workers(), "loading a file ends the worker")
    acc.check(objects() == [NAME], "the object is in the file")
    note(acc, measured, "loaded")
    acc.tab("ISC")
    yield 2
    yield acc.shot("13_loaded")


def load_while_drawing(acc: Any) -> Iterator[float]:
    """Loading a file ends the drawing of a box."""
    with acc.context():
        bpy.ops.isc.draw_box("INVOKE_DEFAULT")
    yield 1.5
    bpy.ops.wm.open_mainfile(filepath=f"{acc.out}/saved.blend")
    yield 3
    acc.check(objects() == [NAME], "a file is loaded while a box is drawn")
    acc.tab("ISC")
    yield 1


def another_file(acc: Any) -> Iterator[float]:
    """The asset is dragged with the mouse from the asset browser into a new file."""
    bpy.ops.wm.read_homefile()
    yield 3
    with acc.context():
        bpy.ops.screen.area_split(direction="HORIZONTAL", factor=0.36)
    yield 1
    areas = [area for area in bpy.context.window.screen.areas if area.type == "VIEW_3D"]
    browser = min(areas, key=lambda area: area.y)
    browser.ui_type = "ASSETS"
    yield 3
    shelf = browser.spaces.active.params
    libraries = bpy.context.preferences.filepaths.asset_libraries
    shelf.asset_library_reference = libraries[-1].name
    shelf.filter_asset_id.filter_material = False
    yield 5
    region = next(region for region in browser.regions if region.type == "WINDOW")
    with bpy.context.temp_override(area=browser, region=region):
        acc.check(not bpy.ops.asset.catalogs_save.poll(), "no catalog waits to be saved")
    yield acc.shot("14_asset_browser")
    left, top, width, height = acc.rect("VIEW_3D", "WINDOW")
    goal = f"{left + width * 2 // 5} {top + height * 3 // 5}"
    left, top, _, _ = acc.rect("FILE_BROWSER", "WINDOW")
    start = f"mousemove {left + 60} {top + 60} sleep .5 mousedown 1 sleep .5"
    way = f"mousemove_relative 30 -30 sleep .5 mousemove {goal} sleep 1.5"
    yield acc.xdo(f"{start} {way}", 6)
    yield acc.shot("14_asset_dragged")
    yield acc.xdo("mouseup 1", 3)
    acc.check(objects() == [NAME], f"the asset is in another file: {objects()}")
    acc.view3d()[1].spaces.active.shading.type = "MATERIAL"
    with acc.context():
        bpy.ops.view3d.view_selected()
    yield _SHADERS
    yield acc.shot("15_another_file")
    bpy.ops.wm.save_as_mainfile(filepath=f"{acc.out}/another.blend")


def begin(acc: Any) -> Iterator[float]:
    """Clicks the button."""
    acc.tab("ISC")
    yield 1
    yield from press(acc, "isc.decompose")
    yield from until(lambda: shown().state == "running", 30)


def escape(acc: Any) -> Iterator[float]:
    """Presses Esc over the view."""
    yield keys(acc, "Escape", 1.5)


def press_cancel(acc: Any) -> Iterator[float]:
    """Clicks the button."""
    yield from press(acc, "isc.cancel")
    yield 0.5


def press(acc: Any, operator: str) -> Iterator[float]:
    """Clicks the button of an operator.

    `find` asks what is under the mouse, which is what it was before while a busy window has not yet
    read the mouse's movement: the search begins where no button is.
    """
    left, top, width, height = acc.rect("VIEW_3D", "WINDOW")
    yield acc.xdo(f"mousemove {left + width // 3} {top + height // 2}", 2)
    place = yield from acc.find(operator)
    if acc.check(place, f"the button of {operator} is found"):
        yield acc.click(*place, settle=0.5)


def keys(acc: Any, text: str, wait: float) -> float:
    """Presses keys with the mouse over the view; the seconds to wait."""
    left, top, width, height = acc.rect("VIEW_3D", "WINDOW")
    return float(
        acc.xdo(f"mousemove {left + width // 3} {top + height // 2} sleep .3 key {text}", wait)
    )


def ended(seconds: float) -> Iterator[float]:
    """Waits until no run is active."""
    yield from until(lambda: shown().state not in {"running", "ready"}, seconds)


def until(fact: Callable[[], Any], seconds: float) -> Iterator[float]:
    """Waits, the window alive."""
    end = time.monotonic() + seconds
    while not fact() and time.monotonic() < end:
        yield 0.3


def shown() -> Any:
    """The state of the run that the window shows."""
    return bpy.context.window_manager.isc


def objects() -> list[str]:
    """Meshes that the extension made."""
    return [obj.name for obj in bpy.data.objects if obj.type == "MESH" and "isc_key" in obj]


def material_inputs() -> Any:
    """What *Edit Object* shows."""
    return bpy.data.objects[NAME].active_material.node_tree.nodes["ISC Dichromatic"].inputs


def workers() -> list[int]:
    """Processes that Blender has started and that go on."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == os.getpid() and fields[0] != "Z":
            found.append(int(path.parent.name))
    return found


def note(acc: Any, measured: list[str], what: str) -> None:
    """Keeps how long the run's calls took."""
    run = shown()
    times = f"longest call {run.longest_call_ms:.1f} ms, import {run.import_ms:.0f} ms"
    line = f"{what}: {times}; {run.message}"
    acc.log(line)
    measured.append(line)
