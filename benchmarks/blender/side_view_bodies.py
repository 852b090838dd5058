"""Bodies of known full shape and texture, and what `isc decompose` makes of one photo of each.

Random members of the families of `synth.shapes` that are closed, with a random texture, matte,
under a key light and a soft fill that cast no shadows: a point has one colour from every side, so
that a view from the side needs no renderer. The first `CHOSEN_ON` of them chose the constants of
`isc_core.result_files.solids`, the next `REPORTED` are reported.

Equation: colour = albedo(u, v) (f + (1 - f) ((1 + n . l) / 2)^2), f the fill.

Limits: no shadows, no gloss, parallel projection. Results in FOLDER are kept.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import ndimage

import isc_core
from blender_addon.files.result_arrays import ResultArrays
from isc_core.decomposition.settings import Settings
from isc_core.result_files.arrays_file import write_arrays
from isc_core.result_files.result_folder import save
from isc_core.result_files.turned_view import turned_view
from isc_core.scene.part_of_result import ResultPart
from synth.albedos import make_albedo
from synth.shapes import make_shape

CHOSEN_ON, REPORTED = 6, 12
_FAMILIES = ("superquadric", "blobby", "displaced", "lathe", "extruded")
_TEXTURES = ("patches", "print", "noise")
_FILL = 0.25
_SIDE, _ROOM = 120, 0.8  # pixels of the photo, and the share of it that the body may fill


@dataclass(frozen=True, eq=False)
class Body:
    """A body in the pixels of its photo.

    Attributes
    ----------
    name : str
        Its family and number.
    vertices : (V, 3) ndarray
        Pixels, camera frame; the middle of the photo is the origin.
    faces : (F, 3) ndarray of int
        Counter-clockwise from outside.
    color : (V, 3) ndarray
        Linear, as it is lit.
    normals : (V, 3) ndarray
        Unit, outward.
    """

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    color: np.ndarray
    normals: np.ndarray


def make_body(number: int) -> Body:
    """Make a body; equal numbers give equal bodies.

    Parameters
    ----------
    number : int
        From 0; the first `CHOSEN_ON` are those that chose constants.

    Returns
    -------
    Body
        The body.
    """
    rng = np.random.default_rng([28, number])
    family = _FAMILIES[number % len(_FAMILIES)]
    mesh = make_shape(family, rng)
    albedo = sampled(make_albedo(_TEXTURES[number % len(_TEXTURES)], rng, 512), mesh.uv)
    light = rng.uniform((-0.9, 0.0, 0.4), (0.9, 0.9, 1.0))
    light /= np.linalg.norm(light)
    lit = _FILL + (1 - _FILL) * ((1 + mesh.normals @ light) / 2) ** 2
    low, high = mesh.vertices.min(0), mesh.vertices.max(0)
    zoom = _ROOM * _SIDE / float((high - low)[:2].max())
    color = albedo * lit[:, None]
    color *= 0.9 / np.percentile(color, 99.9)
    vertices = (mesh.vertices - (low + high) / 2) * zoom
    return Body(f"{family} {number}", vertices, mesh.faces, color, mesh.normals)


def sampled(texture: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Read a texture bilinearly.

    Parameters
    ----------
    texture : (H, W, 3) ndarray
        Row 0 at the top.
    uv : (N, 2) ndarray
        In [0, 1], v from the bottom.

    Returns
    -------
    (N, 3) ndarray
        Colours.
    """
    rows, columns = texture.shape[:2]
    at = (1 - uv[:, 1]) * rows - 0.5, uv[:, 0] * columns - 0.5
    return np.stack(
        [
            ndimage.map_coordinates(texture[..., c], at, order=1, mode="nearest")
            for c in range(texture.shape[2])
        ],
        -1,
    )


def decompose_body(body: Body, folder: Path) -> Path:
    """Photograph a body and decompose the photo.

    Parameters
    ----------
    body : Body
        The body.
    folder : Path
        Where results are kept, one folder for each body.

    Returns
    -------
    Path
        The result folder, with arrays.
    """
    output = folder / body.name.replace(" ", "_")
    if not (output / "arrays.npz").is_file():
        view = turned_view(body.vertices, body.faces, body.color, 0.0, _SIDE, 1.0)
        settings = Settings(model="sirfs", detail=0)
        found = isc_core.decompose(
            view.values.astype(np.float32), view.coverage > 0.5, settings=settings
        )
        save(found, output)
        write_arrays(ResultPart.of(found), output / "arrays.npz")
    return output


def with_true_heights(body: Body, result: ResultArrays) -> ResultArrays:
    """Replace the heights and normals of a result by the true ones.

    Parameters
    ----------
    body : Body
        The body.
    result : ResultArrays
        Of its photo.

    Returns
    -------
    ResultArrays
        With the true height at each pixel and vertex.
    """
    carried = np.concatenate([body.vertices, body.normals], 1)
    seen = turned_view(body.vertices, body.faces, carried, 0.0, _SIDE, 1.0).values
    maps = seen.astype(np.float32)
    rows, columns = result.vertex_pixel.T
    vertices = result.vertices.copy()
    vertices[:, 2] = maps[rows, columns, 2] * result.metres_per_pixel
    return replace(
        result,
        height=np.where(result.mask, maps[..., 2], 0),
        normal=maps[..., 3:],
        vertices=vertices,
        vertex_normals=maps[rows, columns, 3:],
    )
