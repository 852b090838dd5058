"""The recovered object as a Blender scene: mesh, material, camera, light. Every function can be called again without harm.

Blender's axes are x right, y away from the viewer, z up: the camera's frame (x, y, z) becomes (x, -z, y), which is also how Blender's
glTF importer turns the mesh.
"""

from pathlib import Path

import bpy
import numpy as np

from isc_core.environment import environment_from_shading
from isc_core.errors import InputError

from .result import Placement

NAME = "ISC"


def clear_scene() -> bpy.types.Scene:
    """An empty file's only scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return bpy.context.scene


def import_mesh(path: Path) -> bpy.types.Object:
    """Puts the mesh of a `.glb` file into the scene, with its material. Raises `InputError` if it holds none."""
    before = set(bpy.data.objects)
    try:
        bpy.ops.import_scene.gltf(filepath=str(path))
    except RuntimeError as error:
        raise InputError(f"{path} cannot be imported: {str(error).strip().splitlines()[-1]}") from error
    found = [thing for thing in set(bpy.data.objects) - before if thing.type == "MESH"]
    if len(found) != 1:
        raise InputError(f"{path} holds {len(found)} meshes instead of one: decompose the photo again")
    found[0].name = NAME
    return found[0]


def frame_size(mesh: bpy.types.Object) -> tuple[int, int]:
    """Width and height in pixels of the photo's frame: the mesh's textures cover all of it. Raises `InputError` if it has none."""
    for slot in mesh.material_slots:
        nodes = slot.material.node_tree.nodes if slot.material else []
        sizes = [tuple(node.image.size) for node in nodes if node.type == "TEX_IMAGE" and node.image]
        if sizes:
            return int(sizes[0][0]), int(sizes[0][1])
    raise InputError("the mesh has no texture: decompose the photo again")


def place_camera(scene: bpy.types.Scene, placement: Placement, size: tuple[int, int]) -> bpy.types.Object:
    """An orthographic camera whose frame is the photo's: pixel by pixel where the render has the photo's size."""
    data = bpy.data.cameras.get(NAME) or bpy.data.cameras.new(NAME)
    camera = bpy.data.objects.get(f"{NAME} camera") or bpy.data.objects.new(f"{NAME} camera", data)
    if camera.name not in scene.collection.objects:
        scene.collection.objects.link(camera)
    step = placement.metres_per_pixel
    middle_x, middle_y = (0.5 * (size[0] - 1) - placement.origin[0]) * step, (placement.origin[1] - 0.5 * (size[1] - 1)) * step
    distance = 4 * max(size) * step
    data.type, data.sensor_fit, data.ortho_scale = "ORTHO", "AUTO", max(size) * step
    data.clip_start, data.clip_end = 0.01 * distance, 3 * distance
    camera.location, camera.rotation_euler = (middle_x, -distance, middle_y), (0.5 * np.pi, 0, 0)
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = size[0], size[1], 100
    return camera


def light_world(scene: bpy.types.Scene, illumination: np.ndarray) -> bpy.types.World:
    """A world that gives the mesh the recovered shading. `illumination`: (9, 3), for the mesh's base colour."""
    world = bpy.data.worlds.get(NAME) or bpy.data.worlds.new(NAME)
    nodes, links = world.node_tree.nodes, world.node_tree.links
    nodes.clear()
    picture, background, output = (nodes.new(f"ShaderNode{kind}") for kind in ("TexEnvironment", "Background", "OutputWorld"))
    picture.image = _sky_image(environment_from_shading(illumination))
    links.new(picture.outputs["Color"], background.inputs["Color"])
    links.new(background.outputs["Background"], output.inputs["Surface"])
    scene.world = world
    return world


def _sky_image(sky: np.ndarray) -> bpy.types.Image:
    rows, columns = sky.shape[:2]
    old = bpy.data.images.get(f"{NAME} sky")
    if old:
        bpy.data.images.remove(old)
    image = bpy.data.images.new(f"{NAME} sky", columns, rows, float_buffer=True)
    image.colorspace_settings.name = "Linear Rec.709"
    pixels = np.ones((rows, columns, 4), np.float32)
    # Blender counts rows from below, and its middle column looks right where ours looks toward the viewer.
    pixels[..., :3] = np.roll(sky, rows // 2, axis=1)[::-1]
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    return image


def set_rendering(scene: bpy.types.Scene, samples: int, seed: int = 0) -> None:
    """Cycles on the processor, the object alone, colours as they are (no film look)."""
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples, scene.cycles.seed = "CPU", samples, seed
    scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = False, False
    scene.render.film_transparent = True
    scene.view_settings.view_transform, scene.view_settings.look = "Standard", "None"
    scene.view_settings.exposure, scene.view_settings.gamma = 0, 1
    scene.render.image_settings.file_format, scene.render.image_settings.color_mode = "PNG", "RGBA"
    scene.render.image_settings.color_depth = "16"


def make_matte(mesh: bpy.types.Object) -> None:
    """Takes the gloss off the mesh's material: what remains should look like the photo's diffuse image."""
    for slot in mesh.material_slots:
        for node in slot.material.node_tree.nodes:
            if node.type == "BSDF_PRINCIPLED":
                node.inputs["Specular IOR Level"].default_value = 0


def build(placement: Placement, samples: int = 32, gloss: bool = False) -> bpy.types.Scene:
    """The whole scene in an empty file. `gloss`: keep the material's gloss even where it was not fitted.

    Raises `InputError` if the mesh cannot be used.
    """
    scene = clear_scene()
    mesh = import_mesh(placement.mesh)
    if not (gloss or placement.gloss_is_fitted):
        make_matte(mesh)
    place_camera(scene, placement, frame_size(mesh))
    light_world(scene, placement.illumination)
    set_rendering(scene, samples)
    return scene
