"""Novel views of the object: from the left, from the right, and under another light.

Equation: diffuse radiance does not depend on the view, so that the turned mesh is textured with the
diffuse image; the fitted lobe is evaluated toward the new viewer under the fitted lights, which are
fixed to the object. The relit view is reflectance x (key max(0, n . l) + fill), plus the same lobe
under its brightest light moved to l; key and fill have the mean colour of the recovered light, and
l is on the opposite side of that light. Where a lobe predicts more light than the specular layer
has, it is scaled down to it.

Unobserved sides and back are those of a rounded solid (`solids`) with the light and colour of the
visible side.

Limits: the views are orthographic, from maps of a panel's size; no cast shadows, no
interreflection. Without a fitted lobe there are no highlights.
"""

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from ..filters.distance import distances, nearest_pixels
from ..filters.morphology import eroded, opened_by_blocks
from ..imaging.luminance import luminance
from ..photo.camera import Camera
from ..scene.decomposition import Decomposition
from ..scene.lobe_fit import LobeFit
from ..shading.brdf.ggx import F0
from ..shading.brdf.model import Model
from ..shading.lights import VIEW, DirectionalLight, sphere_directions, toward, turn
from ..shading.radiance import DistantLights, radiance, sh_shading
from .mesh.options import MeshOptions
from .mesh.rim_heights import limit_rim
from .panels import MARGIN, SIDE, Frame, Panel, exposure, unit_normals
from .solids.back import Back
from .solids.rim import Rim
from .solids.solid_mesh import SolidMesh, make_solid_mesh
from .solids.surface import vertex_positions, view_heights
from .turned_view import turned_view

ANGLE = 30.0  # degrees
_STEP = 2  # pixels of the panel between vertices of the turned mesh
_RIM = 3  # pixels of the panel, whose colours are not those of the surface
_KEY, _FILL = 0.85, 0.15  # shares of the new light
_NARROWEST = 0.03  # alpha: narrower highlights are smaller than a panel's pixel


def turned_panels(
    d: Decomposition, frame: Frame, small: Mapping[str, np.ndarray], gain: float
) -> list[Panel]:
    """Render the object from the left and from the right.

    Parameters
    ----------
    d : Decomposition
    frame : Frame
        Of the object.
    small : mapping of str to ndarray
        The maps diffuse, specular, normal and height, scaled to the panel.
    gain : float
        Exposure.

    Returns
    -------
    list of Panel
        Two; empty ones for an object too thin for a mesh.
    """
    names = ("From the left", "From the right")
    found = _coarse_body(frame, small, d.camera)
    if found is None:
        empty = np.zeros((SIDE, SIDE))
        return [Panel(np.zeros((SIDE, SIDE, 3)), empty, name, "too thin") for name in names]
    body, vertices = found
    diffuse = _without_rim(small["diffuse"], frame.coverage > 0.5)
    places = (body.texture + 0.5) * _STEP - 0.5

    def panel(name: str, yaw: float) -> Panel:
        texture = diffuse + _highlights(d.brdf, frame, small, VIEW @ turn(yaw), None)
        room = 1 - 2 * MARGIN
        view = turned_view(vertices, body.faces, places, yaw, SIDE, 1.0, room, True, texture)
        return Panel(gain * view.values, view.coverage, name, f"{ANGLE:.0f}°, sides are a guess")

    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(panel, names, (ANGLE, -ANGLE)))


def _without_rim(image: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """An image (N, N, C) whose outermost pixels have the colours next to them.

    The triangles that join front and sides alternate between the outline and the pixels near it: a
    rim of another colour, such as a mixture with the background, would look like a comb.
    """
    inner = eroded(inside, _RIM)
    if not inner.any():
        return image
    nearest = nearest_pixels(inner)
    near = distances(*nearest) <= 2 * _RIM  # thin parts keep their own colours
    return np.where(near[..., None], image[nearest], image)


def _coarse_body(
    frame: Frame, small: Mapping[str, np.ndarray], camera: Camera | None
) -> tuple[SolidMesh, np.ndarray] | None:
    """The solid of a panel's maps with a vertex every `_STEP` pixels, and its vertices in the
    panel's pixels; None for an object that is too thin.
    """
    share = _blocks(frame.coverage)
    inside = share > 0.5
    if not opened_by_blocks(inside).any():
        return None
    weight = frame.coverage > 0.5
    sums, count = _blocks(np.where(weight, small["height"], 0)), _blocks(weight)
    height = sums / np.maximum(count, 1e-3) * (frame.zoom / _STEP)
    if camera is not None:
        x, y = frame.place(*camera.principal_point)
        camera = replace(
            camera,
            focal_length=camera.focal_length * frame.zoom / _STEP,
            principal_point=(x / _STEP, y / _STEP),
        )
    limited = limit_rim(height, inside, MeshOptions().rim)
    seen = view_heights(limited, inside, camera)
    body = make_solid_mesh(seen, np.ones(inside.shape), inside, Rim(share), Back.ROUNDED, 0)
    return body, vertex_positions(body, camera) * _STEP


def _blocks(plane: np.ndarray) -> np.ndarray:
    """Means of a panel's plane (N, N) over blocks of `_STEP` x `_STEP` pixels."""
    side = SIDE // _STEP
    return np.asarray(plane.reshape(side, _STEP, side, _STEP).mean(axis=(1, 3), dtype=np.float64))


def relit_panel(d: Decomposition, frame: Frame, small: Mapping[str, np.ndarray]) -> Panel:
    """Render the object under a light from the other side.

    Parameters
    ----------
    d : Decomposition
    frame : Frame
        Of the object.
    small : mapping of str to ndarray
        The maps specular, normal, reflectance and shading, scaled to the panel.

    Returns
    -------
    Panel
        With its own exposure.
    """
    inside = frame.coverage > 0
    reflectance, light = small["reflectance"][inside], small["shading"][inside]
    direction, side = _other_side(d)
    tint = frame.inside(d.shading).mean(axis=0, dtype=np.float64)
    rig = DirectionalLight(direction, np.pi * _KEY * tint, _FILL * tint)
    diffuse = reflectance * rig.shading(unit_normals(small["normal"][inside]))
    before = float(luminance(reflectance * light).sum())
    diffuse *= before / max(float(luminance(diffuse).sum()), 1e-12)
    color = _highlights(d.brdf, frame, small, VIEW, direction)
    color[inside] += diffuse
    color *= exposure(color[inside])
    return Panel(
        color,
        frame.coverage,
        "Relit",
        f"key light from the {side}",
    )


def _other_side(d: Decomposition) -> tuple[np.ndarray, str]:
    """A unit vector (3,) to the upper left or right, opposite the present light, and its name."""
    around = sphere_directions(256)
    around = around[around[:, 2] > 0]
    present = luminance(sh_shading(around, d.illumination)) @ around
    if d.brdf is not None and d.brdf.direction is not None:
        present = d.brdf.direction
    return (
        (toward(-0.75, 0.5, 0.6), "left") if present[0] > 0 else (toward(0.75, 0.5, 0.6), "right")
    )


def _highlights(
    fit: LobeFit | None,
    frame: Frame,
    small: Mapping[str, np.ndarray],
    view: np.ndarray,
    moved: np.ndarray | None,
) -> np.ndarray:
    """Specular light (N, N, 3) toward `view`, under the brightest light moved to `moved`, or under
    all lights at their positions.
    """
    layer = np.zeros((SIDE, SIDE, 3))
    if fit is None or fit.alpha is None or not fit.lights:
        return layer
    model, inside = _model(fit), frame.coverage > 0
    normal = unit_normals(small["normal"][inside])
    directions = np.stack([light.direction for light in fit.lights])
    strengths = np.stack([light.strength_light for light in fit.lights])
    present = radiance(model, normal, VIEW, DistantLights(directions, strengths))
    observed = float(small["specular"][inside].sum())
    share = min(1.0, observed / max(float(present.sum()), 1e-12))
    if moved is not None:
        directions, strengths = moved[None], strengths.sum(axis=0, keepdims=True)
    layer[inside] = share * radiance(model, normal, view, DistantLights(directions, strengths))
    return layer


def _model(fit: LobeFit) -> Model:
    from ..shading.lobe_rendering import Lobe  # for results with highlights

    alpha = float(np.clip(fit.alpha or 1.0, _NARROWEST, 1.0))
    if fit.model.startswith("ggx"):
        return Lobe(alpha=alpha, f0=F0).model
    return Lobe(max(2 / alpha**2 - 2, 1.0)).model
