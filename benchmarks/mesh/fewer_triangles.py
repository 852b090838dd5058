"""Measure what a mesh of fewer triangles loses.

  python -m benchmarks.mesh.fewer_triangles [RESULT ...] [--size 1024] [--triangles 100000,20000]

Without results of `isc decompose`, five bodies are made: a smooth form of random lobes with an
outline of its own, under relief of 8, 16 and 32 pixels wavelength. For each body and number of
triangles:

  max, rms     distance in pixels from the pixels of the height map to the triangles over them
  silhouette   units of the outline that the meshes do not share
  PSNR         of the normals at the pixels, as colours (n + 1) / 2: from vertex normals and the
               normal map in 8 bits, against the recovered ones; with the tangents of the file, with
               tangents computed from the texture coordinates, and without the map
  s, MB        time and peak of memory of the whole mesh

Writes a table of all bodies to the standard output.
"""

import argparse
import time
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy import ndimage

from benchmarks.program import run_program
from isc_core.result_files.mesh.build import build_mesh
from isc_core.result_files.mesh.options import MeshOptions
from isc_core.result_files.mesh.result import MeshResult
from isc_core.result_files.mesh.rim_heights import limit_rim
from isc_core.result_files.result_folder import load
from isc_core.result_files.triangulation.adaptive_triangles import (
    Patch,
    Triangulation,
    covered_pixels,
)

_BODIES = 5
Maps = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Height, normal and mask."""


def made_body(seed: int, size: int) -> Maps:
    """Make a body with relief.

    Parameters
    ----------
    seed : int
    size : int
        Side of its maps in pixels; it is .84 of that long.

    Returns
    -------
    tuple of ndarray
        Height (size, size), normal (size, size, 3), mask (size, size).
    """
    rng = np.random.default_rng(seed)
    row, column = (np.indices((size, size)) + 0.5) / size * 2 - 1
    angle = np.arctan2(row, column)
    outline = np.full_like(angle, 1.0)
    for k in range(2, 7):
        outline += rng.normal(0, 0.25 / k) * np.cos(k * angle + rng.uniform(0, 2 * np.pi))
    outline *= 0.84 / outline.max()
    share = np.hypot(row, column) / outline
    mask = share < 1
    height = 0.5 * rng.uniform(0.5, 1) * np.sqrt(np.maximum(1 - share**2, 0))
    height *= size / 2
    for wavelength in (8, 16, 32):
        noise = ndimage.gaussian_filter(rng.standard_normal((size, size)), wavelength / 6)
        noise -= ndimage.gaussian_filter(noise, wavelength / 3)
        height += 0.02 * wavelength * noise / noise.std()
    down, right = np.gradient(height)
    normal = np.stack([-right, down, np.ones_like(height)], -1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.where(mask, height, 0), normal.astype(np.float32), mask


def bodies(results: list[Path], size: int) -> Iterator[tuple[str, Maps]]:
    """Iterate over the bodies to measure.

    Parameters
    ----------
    results : list of Path
        Folders; none for made bodies.
    size : int
        Of made bodies.

    Yields
    ------
    tuple of str and Maps
    """
    for path in results:
        d = load(path)
        yield path.name, (d.height, d.normal, d.mask)
    for seed in () if results else range(_BODIES):
        yield f"body {seed}", made_body(seed, size)


def triangulation_of(built: MeshResult) -> Triangulation:
    """Return the mesh over its pixels.

    Parameters
    ----------
    built : MeshResult

    Returns
    -------
    Triangulation
    """
    return Triangulation(built.vertex_pixel, built.mesh.faces)


def outline(built: MeshResult) -> set[tuple[tuple[int, int], ...]]:
    """Return the open edges of a mesh, in units of a pixel.

    Parameters
    ----------
    built : MeshResult

    Returns
    -------
    set of tuple
        Rows and columns of both ends.
    """
    pairs = np.sort(built.mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    pairs, count = np.unique(pairs, axis=0, return_counts=True)
    ends = built.vertex_pixel[pairs[count == 1]].reshape(-1, 4)
    return {tuple(sorted([(a, b), (c, d)])) for a, b, c, d in ends.tolist()}


def distances(built: MeshResult, height: np.ndarray) -> np.ndarray:
    """Measure how far the pixels are from the planes of their triangles.

    Parameters
    ----------
    built : MeshResult
        Of an orthographic view.
    height : (H, W) ndarray
        As the mesh has it at its vertices.

    Returns
    -------
    (N,) ndarray
        Pixels.
    """
    found, grid = [], triangulation_of(built)
    places = np.column_stack([built.vertex_pixel, height[tuple(built.vertex_pixel.T)]])
    for patch in covered_pixels(grid):
        corners = places[patch.faces]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        facing = np.abs(across[:, 2]) / np.linalg.norm(across, axis=1)
        level = corners[..., 2] @ patch.weights.T
        row, column = patch.pixels[..., 0], patch.pixels[..., 1]
        found.append(np.abs(height[row, column] - level) * facing[:, None])
    return np.concatenate([one.ravel() for one in found])


def computed_tangents(built: MeshResult) -> np.ndarray:
    """Compute tangents as programs do that find none in a file.

    Parameters
    ----------
    built : MeshResult

    Returns
    -------
    (V, 3) ndarray
        Directions in which u grows on the triangles, on average over the triangles of a vertex,
        weighted by their angles there and perpendicular to its normal.
    """
    mesh = built.mesh
    corners, uv = mesh.vertices[mesh.faces], mesh.uv[mesh.faces]
    (a, b), edges = (uv[:, 1:] - uv[:, :1]).transpose(1, 0, 2), corners[:, 1:] - corners[:, :1]
    grows = edges[:, 0] * b[:, 1:] - edges[:, 1] * a[:, 1:]
    grows *= np.sign(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])[:, None]
    sums = np.zeros_like(mesh.vertices)
    for k in range(3):
        one, other = (corners[:, (k + n) % 3] - corners[:, k] for n in (1, 2))
        cosine = (one * other).sum(1) / np.linalg.norm(one, axis=1) / np.linalg.norm(other, axis=1)
        normal = mesh.vertex_normals[mesh.faces[:, k]]
        part = grows - normal * (grows * normal).sum(1, keepdims=True)
        part *= (np.arccos(np.clip(cosine, -1, 1)) / np.linalg.norm(part, axis=1))[:, None]
        np.add.at(sums, mesh.faces[:, k], part)
    return sums / np.linalg.norm(sums, axis=1, keepdims=True)


def rendered_normals(
    built: MeshResult, tangents: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Render the normals of a mesh at the pixels.

    Parameters
    ----------
    built : MeshResult
    tangents : (V, 3) ndarray or None
        None to leave out the normal map.

    Returns
    -------
    normal : (H, W, 3) ndarray
    covered : (H, W) ndarray of bool
    """
    normal, covered = np.zeros(built.detail.shape), np.zeros(built.detail.shape[:2], bool)
    codes = np.rint(np.clip(built.detail * 127.5 + 127.5, 0, 255)) / 127.5 - 1
    for patch in covered_pixels(triangulation_of(built)):
        row, column = patch.pixels[..., 0], patch.pixels[..., 1]
        found = interpolated(built.mesh.vertex_normals, patch)
        if tangents is not None:
            tangent, (x, y, z) = (
                interpolated(tangents, patch),
                np.moveaxis(codes[row, column], -1, 0),
            )
            across = np.cross(found, tangent)
            found = x[..., None] * tangent + y[..., None] * across + z[..., None] * found
        normal[row, column] = found / np.linalg.norm(found, axis=-1, keepdims=True)
        covered[row, column] = True
    return normal, covered


def interpolated(values: np.ndarray, patch: Patch) -> np.ndarray:
    """Interpolate vectors of the vertices at the pixels of triangles.

    Parameters
    ----------
    values : (V, 3) ndarray
    patch : Patch

    Returns
    -------
    (T, P, 3) ndarray
    """
    return np.einsum("pk,tkc->tpc", patch.weights, values[patch.faces])


def measure(maps: Maps, triangles: int) -> list[float]:
    """Measure one mesh.

    Parameters
    ----------
    maps : tuple of ndarray
    triangles : int

    Returns
    -------
    list of float
        Triangles, max and rms distance, units of silhouette, three PSNR, seconds, megabytes.
    """
    height, normal, mask = maps
    white, options = np.ones((*mask.shape, 3), np.float32), MeshOptions(triangles=triangles)
    start = time.perf_counter()
    built = build_mesh(height, normal, mask, white, options)
    seconds = time.perf_counter() - start
    tracemalloc.start()
    build_mesh(height, normal, mask, white, options)
    peak = tracemalloc.get_traced_memory()[1] / 1e6
    tracemalloc.stop()
    far = distances(built, limit_rim(height, mask, options.rim))
    full = build_mesh(height, normal, mask, white, MeshOptions(triangles=0))
    row = [len(built.mesh.faces), far.max(), np.sqrt(np.mean(far**2))]
    row.append(len(outline(built) ^ outline(full)))
    for tangents in (built.mesh.tangents, computed_tangents(built), None):
        rendered, covered = rendered_normals(built, tangents)
        error = np.square((rendered - normal)[covered] / 2).mean()
        row.append(-10 * np.log10(max(float(error), 1e-12)))
    return [*map(float, row), seconds, peak]


def main() -> None:
    """Run the command line of this module."""
    parser = argparse.ArgumentParser()
    parser.add_argument("results", nargs="*", type=Path)
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--triangles", default="100000,20000")
    options = parser.parse_args()
    names = "triangles | max | rms | silhouette | PSNR, file | computed | without map | s | MB"
    print(f"| body | {names} |\n|{' --- |' * 10}")
    for name, maps in bodies(options.results, options.size):
        for triangles in map(int, options.triangles.split(",")):
            row = " | ".join(f"{value:.4g}" for value in measure(maps, triangles))
            print(f"| {name} | {row} |", flush=True)


if __name__ == "__main__":
    run_program(main)
