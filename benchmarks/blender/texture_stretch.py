"""How far textures are stretched over the front and the rounded back of objects.

  python -m benchmarks.blender.texture_stretch RESULT ...

RESULT is a folder of `isc decompose --arrays`. The map from the texture to the surface is linear on
each triangle; its singular values s1 >= s2 are surface pixels per texel in two directions.

Equation: stretch = s1 / s2. On the front, which is a graph over the photo, it is 1 / cos of the
angle between normal and view.

Citation: P. Sander, J. Snyder, S. Gortler and H. Hoppe, "Texture mapping progressive meshes",
SIGGRAPH 2001, doi:10.1145/383259.383307 (the singular values).

Limits: parallel projection; figures are weighted by the area of the recovered surface.
"""

import argparse
from pathlib import Path

import numpy as np

from benchmarks.program import run_program
from blender_addon.files.result_arrays import read_result
from isc_core.result_files.solids.back import Back
from isc_core.result_files.solids.rim import Rim
from isc_core.result_files.solids.solid_mesh import SolidMesh, make_solid_mesh
from isc_core.result_files.solids.surface import vertex_positions

_MUCH = 4.0


def stretched(body: SolidMesh) -> dict[str, tuple[float, float, float]]:
    """Measure the stretch of a mesh's texture.

    Parameters
    ----------
    body : SolidMesh
        With a back.

    Returns
    -------
    dict of str to tuple of float
        For "front" and "back": median and 90th percentile of the stretch, and the share of the
        surface where it exceeds 4.
    """
    points = vertex_positions(body, None)[body.faces]
    texels = body.texture[body.faces]
    edges = np.stack([points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]], -1)
    steps = np.stack([texels[:, 1] - texels[:, 0], texels[:, 2] - texels[:, 0]], -1)
    normals = np.cross(edges[..., 0], edges[..., 1])
    areas = np.linalg.norm(normals, axis=1)
    stretch = np.full(len(areas), np.inf)
    spread = np.abs(np.linalg.det(steps)) > 1e-9  # others show a line of the texture
    scales = np.linalg.svd(edges[spread] @ np.linalg.inv(steps[spread]), compute_uv=False)
    stretch[spread] = scales[:, 0] / np.maximum(scales[:, 1], 1e-12)
    seen = normals[:, 2] > 0
    return {
        name: _summary(stretch[side], areas[side])
        for name, side in (("front", seen), ("back", ~seen))
    }


def _summary(stretch: np.ndarray, areas: np.ndarray) -> tuple[float, float, float]:
    order = np.argsort(stretch)
    share = np.cumsum(areas[order]) / areas.sum()
    median, most = (float(stretch[order][np.searchsorted(share, level)]) for level in (0.5, 0.9))
    return median, most, float(areas[stretch > _MUCH].sum() / areas.sum())


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
    parser.add_argument("results", type=Path, nargs="+", metavar="RESULT")
    print(
        "| object | side | median | 90th percentile | share above 4 |", "|---" * 5 + "|", sep="\n"
    )
    for folder in parser.parse_args(arguments).results:
        result = read_result(folder)
        cover = result.mask if result.cover is None else result.cover
        cosine, rim = result.normal[..., 2], Rim(cover, result.soft)
        body = make_solid_mesh(result.height, cosine, result.mask, rim, Back.ROUNDED, 50_000)
        for side, (median, most, share) in stretched(body).items():
            print(f"| {folder.name} | {side} | {median:.1f} | {most:.1f} | {100 * share:.0f} % |")
    return 0


if __name__ == "__main__":
    run_program(main)
