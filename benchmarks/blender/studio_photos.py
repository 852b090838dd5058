"""Photos of made objects on a table: pictures for the documentation, free of anyone's rights.

  python -m benchmarks.blender.studio_photos -o FOLDER

Bodies and their colours are those of `synth`; Cycles renders them on a grey sweep of paper under
two softboxes and a dim room, without alpha. Their masks are exact.

Limits: nothing is measured on them. Bodies stand upright; the camera is a 135 mm lens, slightly
from above.
"""

import argparse
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector
from PIL import Image
from scipy.spatial.transform import Rotation

from benchmarks.program import run_program
from blender_addon.datablocks.images import COLOR, map_file, new_image
from synth.albedos import make_albedo
from synth.capture.recipe import FamilyMember
from synth.scene.meshes import Mesh
from synth.shapes import make_shape
from synth.shapes.gourd import gourd, gourd_albedo

ABOVE = 0.16  # height of the camera over the body's middle, as a share of its distance
_LENS, _DISTANCE = 135.0, 8.6  # mm; object units
_PAPER, _ROOM = (0.32, 0.33, 0.35), (0.09, 0.10, 0.12)
# Place, size, watts and colour of the softboxes.
_SOFTBOXES = (
    ((-3.2, -3.2, 4.4), 1.7, 420.0, (1.0, 0.94, 0.86)),
    ((4.2, -2.2, 2.6), 1.1, 110.0, (0.85, 0.92, 1.0)),
)
_TEXELS = 2048


@dataclass(frozen=True)
class Body:
    """What is photographed, a body of revolution.

    Attributes
    ----------
    shape : FamilyMember or None
        Of the lathe in `synth.shapes`; None for the gourd.
    albedo : FamilyMember or None
        Of `synth.albedos`; None for the gourd's.
    roughness : float
        Blender's, of its varnish.
    """

    shape: FamilyMember | None = None
    albedo: FamilyMember | None = None
    roughness: float = 0.25

    def mesh(self) -> Mesh:
        """Return its shape, upright, y up."""
        if self.shape is None:
            return gourd()
        return upright(make_shape(self.shape.family, self.shape.generator("shape")))

    def colors(self) -> np.ndarray:
        """Return its albedo, (h, w, 3), linear."""
        if self.albedo is None:
            return gourd_albedo(_TEXELS)
        return make_albedo(self.albedo.family, self.albedo.generator("albedo"), _TEXELS)


def upright(mesh: Mesh) -> Mesh:
    """Turn a body of revolution so that its axis is vertical.

    Parameters
    ----------
    mesh : Mesh
        Leaning by less than 90 degrees.

    Returns
    -------
    Mesh
        The same body, 2 units wide or high. Its axis is that of the principal moments which has no
        equal.
    """
    moments, axes = np.linalg.eigh(np.cov(mesh.vertices.T))
    axis = axes[:, 2 if moments[2] - moments[1] > moments[1] - moments[0] else 0]
    axis = axis * np.sign(axis[1])
    turn, _ = Rotation.align_vectors([[0, 1, 0]], [axis])
    return mesh.rotated(turn.as_matrix()).fitted()


BODIES: Mapping[str, Body] = {
    "gourd": Body(),
    "beaker": Body(FamilyMember("lathe", 3), FamilyMember("print", 3)),
    "pawn": Body(FamilyMember("lathe", 5), FamilyMember("patches", 5)),
    "bottle": Body(FamilyMember("lathe", 4), FamilyMember("noise", 4)),
    "pear": Body(FamilyMember("lathe", 11), FamilyMember("noise", 11)),
}


def photograph(body: Body, path: Path, size: int = 900, samples: int = 10) -> None:
    """Render the photo of a body. Blender's file is emptied first.

    Parameters
    ----------
    body : Body
        The body.
    path : Path
        PNG file to write, 8 bits, without alpha.
    size : int, optional
        Side of the picture in pixels.
    samples : int, optional
        As of `render_picture`.
    """
    _arrange(body)
    render_picture(path, (size, size), samples)


def draw_mask(body: Body, path: Path, size: int = 900) -> None:
    """Draw the mask of the photo of a body. Blender's file is emptied first.

    Parameters
    ----------
    body : Body
        The body.
    path : Path
        PNG file to write: white is the body, its outline is antialiased.
    size : int, optional
        Side of the picture in pixels.
    """
    _arrange(body)
    bpy.data.objects.remove(bpy.data.objects["paper"])
    bpy.context.scene.render.film_transparent = True
    with tempfile.TemporaryDirectory() as folder:
        render_picture(Path(folder) / "body.png", (size, size), 8, "RGBA")
        Image.open(Path(folder) / "body.png").getchannel("A").save(path)


def _arrange(body: Body) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    top = add_body(body).bound_box[1][2]
    studio(Vector((0, 0, top / 2)))


def render_picture(path: Path, size: tuple[int, int], samples: int, channels: str = "RGB") -> None:
    """Render the current scene, denoised.

    Parameters
    ----------
    path : Path
        PNG file to write, 8 bits.
    size : tuple of int
        Width and height in pixels.
    samples : int
        Samples of Cycles per pixel.
    channels : str, optional
        "RGB" or "RGBA".
    """
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.device = "CYCLES", "CPU"
    scene.cycles.samples, scene.cycles.seed = samples, 0
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.view_settings.view_transform = "Standard"
    image = scene.render.image_settings
    image.file_format, image.color_mode = "PNG", channels
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


def add_body(body: Body) -> bpy.types.Object:
    """Add a body to the scene, upright on the origin.

    Parameters
    ----------
    body : Body
        The body.

    Returns
    -------
    bpy.types.Object
        The object; its mesh has the pose, z up.
    """
    made = body.mesh()
    x, y, z = made.vertices.T
    points = np.stack([x, -z, y - y.min()], -1)
    mesh = bpy.data.meshes.new("body")
    mesh.from_pydata(points.tolist(), [], made.faces.tolist())
    uv = np.stack([made.uv[:, 0], 1 - made.uv[:, 1]], -1)[made.faces.ravel()]
    mesh.uv_layers.new().uv.foreach_set("vector", uv.ravel().astype(np.float32))
    mesh.shade_smooth()
    mesh.materials.append(_varnished(body))
    obj = bpy.data.objects.new("body", mesh)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def _varnished(body: Body) -> bpy.types.Material:
    material = new_material("body", (1, 1, 1), body.roughness)
    nodes, links = material.node_tree.nodes, material.node_tree.links
    texture = nodes.new("ShaderNodeTexImage")
    texture.image = new_image(map_file(body.colors(), COLOR))
    links.new(texture.outputs["Color"], nodes["Principled BSDF"].inputs["Base Color"])
    return material


def new_material(
    name: str, color: tuple[float, float, float], roughness: float
) -> bpy.types.Material:
    """Create a plain material.

    Parameters
    ----------
    name : str
        Its name.
    color : tuple of float
        Linear.
    roughness : float
        Blender's.

    Returns
    -------
    bpy.types.Material
        With a Principled BSDF.
    """
    material = bpy.data.materials.new(name)
    if material.node_tree is None:  # before Blender 5
        material.use_nodes = True
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*color, 1)
    shader.inputs["Roughness"].default_value = roughness
    return material


def studio(middle: Vector) -> None:
    """Add paper, softboxes, the dim room and the camera to the scene.

    Parameters
    ----------
    middle : Vector
        What the camera looks at.
    """
    scene = bpy.context.scene
    add_paper()
    for place, size, watts, color in _SOFTBOXES:
        light = bpy.data.lights.new("softbox", "AREA")
        light.size, light.energy, light.color = size, watts, color
        add_toward("softbox", light, Vector(place), middle)
    set_room(_ROOM)
    camera = bpy.data.cameras.new("camera")
    camera.lens = _LENS
    place = middle + Vector((0, -_DISTANCE, ABOVE * _DISTANCE))
    scene.camera = add_toward("camera", camera, place, middle)


def set_room(color: tuple[float, float, float]) -> None:
    """Give the scene an even light from all sides.

    Parameters
    ----------
    color : tuple of float
        Linear radiance.
    """
    world = bpy.data.worlds.new("room")
    if world.node_tree is None:  # before Blender 5
        world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (*color, 1)
    bpy.context.scene.world = world


def add_paper() -> None:
    """Add a sweep of paper: the table, and the wall behind it."""
    bend = np.linspace(0, 0.5 * np.pi, 24)
    y = np.concatenate([[-12.0], 3 + 2 * np.sin(bend), [5.0]])
    z = np.concatenate([[0.0], 2 - 2 * np.cos(bend), [12.0]])
    points = [(x, b, c) for b, c in zip(y, z, strict=True) for x in (-15.0, 15.0)]
    faces = [(2 * i, 2 * i + 1, 2 * i + 3, 2 * i + 2) for i in range(len(y) - 1)]
    mesh = bpy.data.meshes.new("paper")
    mesh.from_pydata(points, [], faces)
    mesh.shade_smooth()
    mesh.materials.append(new_material("paper", _PAPER, 0.9))
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("paper", mesh))


def add_toward(name: str, data: bpy.types.ID, place: Vector, middle: Vector) -> bpy.types.Object:
    """Add a lamp or a camera that looks at a point.

    Parameters
    ----------
    name : str
        Its name.
    data : bpy.types.ID
        Its data.
    place, middle : Vector
        Where it is, and the point.

    Returns
    -------
    bpy.types.Object
        The object.
    """
    obj = bpy.data.objects.new(name, data)
    obj.location = place
    obj.rotation_euler = (middle - place).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(obj)
    return obj


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the photos into a folder.

    Parameters
    ----------
    arguments : sequence of str, optional
        Command line, sys.argv by default.

    Returns
    -------
    int
        0.
    """
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder to write to")
    parser.add_argument("--names", nargs="+", choices=BODIES, default=list(BODIES))
    parser.add_argument("--size", type=int, default=900, help="pixels (default: %(default)s)")
    options = parser.parse_args(arguments)
    for name in options.names:
        photograph(BODIES[name], options.output / f"{name}.png", options.size)
    return 0


if __name__ == "__main__":
    run_program(main)
