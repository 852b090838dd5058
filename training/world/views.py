"""Views of bodies: what rays know of a body seen by a camera, kept to light it again and again.

Problem: rendering a new picture for every training step takes seconds; lighting stored buffers
takes milliseconds. All that needs rays is the same in every light: where the surface is, how it is
turned, which directions see past the rest of the body, and how thick it is.

Equation: the camera looks along -z at the rotated body. A pixel at (x, y) of the image plane looks
along the ray through (x, y, 0) from (0, 0, d), d the distance, or along -z for d infinite. Each of
`DIRECTIONS` directions, spread evenly over the cap z > `LOWEST` by a spiral turned at random, is
tested for a hit with the body.

Citation: directions: R. Swinbank, R. J. Purser, "Fibonacci grids: a novel approach to global
modelling", 2006, doi:10.1256/qj.05.227.

Limits: one ray a pixel, through its centre. Light from behind the cap is not known.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from isc_core.errors import InputError
from synth.scene.meshes import Mesh
from synth.scene.tracing import LIFT, Tracer

SIDE = 160  # pixels
DIRECTIONS, LOWEST = 64, -0.5
FILL = 0.95  # longer side of the body, relative to the picture
_NEAREST = 2.9  # of the camera, in half sides of the picture: a 35 mm lens on a 36 x 24 mm frame
_ORTHOGRAPHIC, _UPRIGHT = 0.4, 0.7  # shares of the views
_LEAST_COVER = 0.04  # of the picture: a body seen edge-on is drawn again
_TRIES = 6


@dataclass(frozen=True, eq=False)
class View:
    """A body as a camera sees it, N pixels.

    Attributes
    ----------
    name : str
        The body's.
    source : str
        The source of the body.
    mask : (SIDE, SIDE) ndarray of bool
        Pixels of the body, N of them.
    normal : (N, 3) float16 ndarray
        Unit, camera frame: x right, y up, z toward the viewer.
    depth : (N,) float16 ndarray
        z of the surface; the picture reaches from -1 to 1 in x and y at z = 0.
    thickness : (N,) float16 ndarray
        Length of the ray inside the body, up to the first exit.
    visible : (N, DIRECTIONS / 8) uint8 ndarray
        Bits: whether each direction sees past the body.
    directions : (DIRECTIONS, 3) float32 ndarray
        Unit, camera frame.
    distance : float
        Of the camera from z = 0; infinite for an orthographic one.
    up : (3,) float32 ndarray
        Unit vector away from the ground on which the body stands, camera frame; 0 for a body that
        lies anyhow.
    """

    name: str
    source: str
    mask: np.ndarray
    normal: np.ndarray
    depth: np.ndarray
    thickness: np.ndarray
    visible: np.ndarray
    directions: np.ndarray
    distance: float
    up: np.ndarray


def trace_view(name: str, source: str, mesh: Mesh, rng: np.random.Generator) -> View:
    """Trace a body from a random side.

    Parameters
    ----------
    name, source : str
        Stored with the view.
    mesh : Mesh
        The body, y up.
    rng : numpy.random.Generator
        Draws the side, the distance and the directions.

    Returns
    -------
    View

    Raises
    ------
    InputError
        If no side shows enough of it.
    """
    for _ in range(_TRIES):
        distance = np.inf
        if rng.random() > _ORTHOGRAPHIC:
            distance = _NEAREST / rng.uniform(0.02, 1)
        side, up = random_side(rng)
        placed = in_picture(mesh.rotated(side), distance)
        if (view := view_of(name, source, placed, distance, rng, up)) is not None:
            return view
    raise InputError(f"{name}: no side shows enough of its surface")


def view_of(
    name: str,
    source: str,
    placed: Mesh,
    distance: float,
    rng: np.random.Generator,
    up: np.ndarray,
) -> View | None:
    """Trace a body from the front.

    Parameters
    ----------
    name, source : str
        Stored with the view.
    placed : Mesh
        Of `in_picture`.
    distance : float
        Of the camera; infinite for an orthographic one.
    rng : numpy.random.Generator
        Draws the directions.
    up : (3,) ndarray
        See `View`.

    Returns
    -------
    View or None
        None where too little is seen.
    """
    tracer = Tracer(placed)
    origins, rays = camera_rays(SIDE, distance)
    hits = tracer.hits(origins, rays)
    if hits.valid.mean() < _LEAST_COVER:
        return None
    position, normal = hits.position[hits.valid], hits.normal[hits.valid]
    directions = spread_directions(rng)
    return View(
        name,
        source,
        hits.valid.reshape(SIDE, SIDE),
        normal.astype(np.float16),
        position[:, 2].astype(np.float16),
        _thickness(tracer, position, rays[hits.valid]).astype(np.float16),
        _visibility(tracer, position + LIFT * normal, directions),
        directions.astype(np.float32),
        float(distance),
        up.astype(np.float32),
    )


def camera_rays(side: int, distance: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the rays of all pixels, row by row from the top.

    Parameters
    ----------
    side : int
        Of the picture, in pixels.
    distance : float
        Of the camera.

    Returns
    -------
    origins, directions : (side * side, 3) ndarray
    """
    across = (np.arange(side) + 0.5) * (2 / side) - 1
    x, y = np.meshgrid(across, -across)
    plane = np.stack([x.ravel(), y.ravel(), np.zeros(side * side)], axis=1)
    if np.isinf(distance):
        return plane + (0, 0, 10.0), np.broadcast_to((0.0, 0.0, -1.0), plane.shape)
    eye = np.array([0, 0, distance])
    along = plane - eye
    return np.broadcast_to(eye, plane.shape), along / np.linalg.norm(along, axis=1, keepdims=True)


def spread_directions(rng: np.random.Generator) -> np.ndarray:
    """Return directions spread evenly over the cap z > `LOWEST`.

    Parameters
    ----------
    rng : numpy.random.Generator
        Draws the turn about the z axis.

    Returns
    -------
    (DIRECTIONS, 3) ndarray
        Unit.
    """
    k = np.arange(DIRECTIONS) + 0.5
    z = 1 - (1 - LOWEST) * k / DIRECTIONS
    turn = np.pi * (1 + np.sqrt(5)) * k + rng.uniform(0, 2 * np.pi)
    across = np.sqrt(1 - z**2)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)


def random_side(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Draw the side from which a body is seen: most stand upright, seen from a little above.

    Parameters
    ----------
    rng : numpy.random.Generator

    Returns
    -------
    rotation : (3, 3) ndarray
        Of the body.
    up : (3,) ndarray
        Where its y axis points, if it stands upright; 0 if it lies anyhow.
    """
    if rng.random() > _UPRIGHT:
        side = Rotation.random(random_state=int(rng.integers(2**31))).as_matrix()
        return np.asarray(side), np.zeros(3)
    yaw, tilt, roll = rng.uniform(0, 360), rng.uniform(-10, 60), rng.normal(0, 5)
    # first about its own axis, then toward the camera: about the fixed axes y, x, z in turn
    side = Rotation.from_euler("yxz", [yaw, tilt, roll], degrees=True).as_matrix()
    return np.asarray(side), np.asarray(side[:, 1])


def in_picture(mesh: Mesh, distance: float) -> Mesh:
    """Move and scale a body so that its picture has a longer side of 2 * `FILL`.

    Parameters
    ----------
    mesh : Mesh
    distance : float
        Of the camera; infinite for an orthographic one.

    Returns
    -------
    Mesh
    """
    low, high = mesh.vertices.min(0), mesh.vertices.max(0)
    scale = 2 * FILL / max((high - low)[:2].max(), 1e-9)
    vertices = (mesh.vertices - (low + high) / 2) * scale
    if np.isinf(distance):
        return Mesh(vertices, mesh.normals, mesh.uv, mesh.faces)
    vertices *= min(1, 0.4 * distance / max(np.abs(vertices[:, 2]).max(), 1e-9))
    for _ in range(3):  # the picture of a near body depends on its place: a few corrections do
        seen = vertices[:, :2] / (1 - vertices[:, 2:] / distance)
        low2, high2 = seen.min(0), seen.max(0)
        vertices[:, :2] -= (low2 + high2) / 2
        vertices *= 2 * FILL / max((high2 - low2).max(), 1e-9)
    return Mesh(vertices, mesh.normals, mesh.uv, mesh.faces)


def _thickness(tracer: Tracer, position: np.ndarray, rays: np.ndarray) -> np.ndarray:
    start = position + 2 * LIFT * rays
    exits = tracer.hits(start, rays)
    return np.where(exits.valid, np.linalg.norm(exits.position - start, axis=1), 0)


def _visibility(tracer: Tracer, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    count = len(origins)
    rays = np.repeat(directions, count, axis=0)
    blocked = tracer.blocked(np.tile(origins, (len(directions), 1)), rays, np.inf)
    return np.packbits(~blocked.reshape(len(directions), count).T, axis=1)
