"""Views from the side of recovered bodies against the truth, for each kind of back.

  python -m benchmarks.blender.side_views -o FOLDER
  python -m benchmarks.blender.side_views -o FOLDER --chosen-on --true-heights
  python -m benchmarks.blender.side_views -o FOLDER --sheet JPG

The first form measures the reported bodies, the second those that constants were chosen on, with
their true heights in place of the recovered ones: the best that any recovery could reach. The third
draws four of the reported bodies: truth, former closed mesh, rounded, from five sides.

Equation: IoU = sum min(a, b) / sum max(a, b) over the coverages a, b; PSNR over the pixels that
either covers, with the 99.9th percentile of the truth as peak, and black where one is missing. The
depth of a photo's object is unknown, and moves it sideways in a turned view: each picture is
shifted by whole pixels to where the silhouettes overlap most. Means over both sides; the interval
of a mean over bodies is +- 2 standard errors.

Limits: `result_files.turned_view` draws; light as `shading` has it, without shadows.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from PIL import Image

from benchmarks.program import run_program
from blender_addon.datablocks.mesh import front_geometry
from blender_addon.files.result_arrays import ResultArrays, read_result
from isc_core.evaluation.metrics import psnr
from isc_core.imaging.srgb import linear_to_srgb
from isc_core.result_files.solids.back import Back
from isc_core.result_files.solids.rim import Rim
from isc_core.result_files.solids.solid_mesh import make_solid_mesh
from isc_core.result_files.solids.surface import vertex_normals, vertex_positions
from isc_core.result_files.turned_view import View, turned_view
from isc_core.shading.spherical_harmonics import real_sh

from . import side_view_bodies as bodies
from .former_back import close_back

ANGLES = (30, 60)
BEFORE = ("former open", "former flat")
_SIDE = 200  # pixels of a view
_BACK_DISTANCE = 0.02
_SHOWN, _SIDES = (6, 7, 8, 10), (0, 30, 60, 90, 180)
_CROP = 45  # pixels at each border of a view
_GREY = 0.2
_SHEET = (880, 528)


@dataclass(frozen=True, eq=False)
class Drawn:
    """A mesh with colours, in the pixels of the photo.

    Attributes
    ----------
    vertices : (V, 3) ndarray
        Camera frame.
    faces : (F, 3) ndarray of int
        Vertices of each triangle.
    color : (V, 3) ndarray
        Linear.
    """

    vertices: np.ndarray
    faces: np.ndarray
    color: np.ndarray


def drawn(result: ResultArrays, kind: str) -> Drawn:
    """Return a mesh of a result, lit by its recovered light.

    Parameters
    ----------
    result : ResultArrays
        The result.
    kind : str
        One of `BEFORE`, or a `Back`.

    Returns
    -------
    Drawn
        The mesh.
    """
    if kind in BEFORE:
        return _former(result, kind == "former flat")
    body = make_solid_mesh(
        result.height,
        result.normal[..., 2],
        result.mask,
        Rim(result.mask),
        Back(kind),
        0,
    )
    vertices = vertex_positions(body, None)
    normal = vertex_normals(vertices, body.faces)
    rows, columns = body.pixels.T
    normal[body.front] = result.normal[rows, columns][body.front]
    texture = np.clip(np.rint(body.texture).astype(int), 0, np.array(result.mask.shape) - 1)
    return _lit(result, vertices, body.faces, normal, texture)


def _former(result: ResultArrays, flat: bool) -> Drawn:
    size = result.longest_side * result.metres_per_pixel
    geometry = front_geometry(result, size)
    pixels = result.vertex_pixel
    if flat:
        geometry = close_back(geometry, _BACK_DISTANCE * size)
    count = len(geometry.vertices)
    vertices = geometry.vertices[:, [0, 2, 1]] * (1, 1, -1) / result.metres_per_pixel
    corners, starts = geometry.corners, np.append(geometry.starts, len(geometry.corners))
    sides = np.diff(starts)
    faces = [
        corners[np.stack([s, s + k, s + k + 1], -1)]
        for k in (1, 2)
        for s in (starts[:-1][sides > k + 1],)
    ]
    normal = vertex_normals(vertices, np.concatenate(faces))
    normal[: len(pixels)] = result.vertex_normals
    near = np.rint(vertices[:, :2] * (1, -1) + result.origin[:2])[:, ::-1].astype(int)
    assert len(near) == count
    return _lit(result, vertices, np.concatenate(faces), normal, near)


def _lit(
    result: ResultArrays,
    vertices: np.ndarray,
    faces: np.ndarray,
    normal: np.ndarray,
    pixels: np.ndarray,
) -> Drawn:
    paint = result.base_color[pixels[:, 0], pixels[:, 1]]
    brightest = (result.reflectance_scale**-1) * result.shading[result.mask].max()
    shading = np.exp(real_sh(normal) @ result.mesh_illumination.astype(np.float64))
    return Drawn(vertices, faces, paint * np.minimum(shading, brightest))


def view(mesh: Drawn | bodies.Body, yaw: float) -> View:
    """Draw a mesh from the side at the photo's scale.

    Parameters
    ----------
    mesh : Drawn or Body
        The mesh.
    yaw : float
        Degrees.

    Returns
    -------
    View
        The picture; black outside.
    """
    seen = turned_view(mesh.vertices, mesh.faces, mesh.color, yaw, _SIDE, 1.0)
    return replace(seen, values=seen.values * seen.coverage[..., None])


def compared(truth: View, found: View) -> tuple[float, float]:
    """Return the PSNR in dB and the IoU of two views.

    Parameters
    ----------
    truth, found : View
        Of one size.

    Returns
    -------
    tuple of float
        After the shift of the largest overlap.
    """
    overlap = np.fft.irfft2(
        np.fft.rfft2(truth.coverage) * np.conj(np.fft.rfft2(found.coverage)), s=(_SIDE, _SIDE)
    )
    shift = np.unravel_index(int(overlap.argmax()), overlap.shape)
    cover = np.roll(found.coverage, shift, (0, 1))
    values = np.roll(found.values, shift, (0, 1))
    either = np.maximum(truth.coverage, cover)
    peak = float(np.percentile(truth.values[truth.coverage > 0.5], 99.9))
    iou = float(np.minimum(truth.coverage, cover).sum() / either.sum())
    return psnr(truth.values, values, either > 0.5, peak=peak), iou


def measured(numbers: Sequence[int], folder: Path, true_heights: bool) -> dict[str, np.ndarray]:
    """Measure bodies.

    Parameters
    ----------
    numbers : sequence of int
        The bodies.
    folder : Path
        Where results are kept.
    true_heights : bool
        Replace the recovered heights and normals by the true ones.

    Returns
    -------
    dict of str to (N, 4) ndarray
        For each kind of mesh: PSNR at 30 and 60 degrees, IoU at 30 and 60 degrees.
    """
    kinds = (*BEFORE, *map(str, Back))
    rows: dict[str, list[list[float]]] = {kind: [] for kind in kinds}
    for number in numbers:
        body = bodies.make_body(number)
        result = read_result(bodies.decompose_body(body, folder))
        if true_heights:
            result = bodies.with_true_heights(body, result)
        truth = {sign * yaw: view(body, sign * yaw) for yaw in ANGLES for sign in (-1, 1)}
        for kind in kinds:
            mesh = drawn(result, kind)
            found = [
                np.mean([compared(truth[s * yaw], view(mesh, s * yaw)) for s in (-1, 1)], axis=0)
                for yaw in ANGLES
            ]
            rows[kind].append([*np.stack(found, -1).reshape(-1)])
        print(body.name, flush=True)
    return {kind: np.array(values) for kind, values in rows.items()}


def table(figures: dict[str, np.ndarray]) -> str:
    """Format figures as Markdown.

    Parameters
    ----------
    figures : dict of str to (N, 4) ndarray
        Of `measured`.

    Returns
    -------
    str
        Means, and gains over the former open mesh with their intervals.
    """
    lines = [
        "| back | PSNR 30 | PSNR 60 | IoU 30 | IoU 60 | gains over the former open mesh |",
        "|---" * 6 + "|",
    ]
    for kind, values in figures.items():
        mean, gains = values.mean(0), values - figures[BEFORE[0]]
        spread = 2 * gains.std(0, ddof=1) / np.sqrt(len(gains))
        cells = [f"{v:.2f} dB" for v in mean[:2]] + [f"{v:.3f}" for v in mean[2:]]
        over = ", ".join(f"{g:+.3f} ± {s:.3f}" for g, s in zip(gains.mean(0), spread, strict=True))
        lines.append(f"| {kind} | " + " | ".join(cells) + f" | {over} |")
    return "\n".join(lines) + "\n"


def sheet(folder: Path) -> Image.Image:
    """Draw bodies from five sides.

    Parameters
    ----------
    folder : Path
        Where results are kept.

    Returns
    -------
    PIL.Image.Image
        For each body the truth, the former closed mesh and the rounded one, below each other.
    """
    blocks = []
    for number in _SHOWN:
        body = bodies.make_body(number)
        result = read_result(bodies.decompose_body(body, folder))
        meshes = (body, drawn(result, "former flat"), drawn(result, Back.ROUNDED))
        rows = [np.hstack([_pixels(view(mesh, yaw)) for yaw in _SIDES]) for mesh in meshes]
        blocks.append(np.vstack(rows))
    lines = [np.hstack(blocks[k : k + 2]) for k in range(0, len(blocks), 2)]
    picture = Image.fromarray(np.vstack(lines))
    return picture.resize(_SHEET, Image.Resampling.LANCZOS)


def _pixels(seen: View) -> np.ndarray:
    light = seen.values + _GREY * (1 - seen.coverage[..., None])
    codes = np.rint(255 * linear_to_srgb(np.clip(light, 0, 1))).astype(np.uint8)
    return np.asarray(codes[_CROP:-_CROP, _CROP:-_CROP])


def main(arguments: list[str] | None = None) -> int:
    """Run the program.

    Parameters
    ----------
    arguments : list of str, optional
        The command line.

    Returns
    -------
    int
        0.
    """
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--chosen-on", action="store_true")
    parser.add_argument("--true-heights", action="store_true")
    parser.add_argument("--sheet", type=Path)
    given = parser.parse_args(arguments)
    if given.sheet:
        sheet(given.output).save(given.sheet, quality=82)
        return 0
    first = 0 if given.chosen_on else bodies.CHOSEN_ON
    count = bodies.CHOSEN_ON if given.chosen_on else bodies.REPORTED
    figures = measured(range(first, first + count), given.output, given.true_heights)
    print(table(figures))
    return 0


if __name__ == "__main__":
    run_program(main)
