"""A result folder that is exact, for tests of the scene: a bump under a known light, and its scene
rendered to linear arrays.
"""

import json
from pathlib import Path

import numpy as np

from isc_core.result_files.arrays_file import write_arrays
from isc_core.result_files.mesh.build import build_mesh
from isc_core.result_files.mesh.options import MeshOptions
from isc_core.scene.decomposition import Decomposition, Provenance
from isc_core.scene.diagnostics import Diagnostics
from isc_core.scene.part_of_result import ResultPart
from isc_core.shading.spherical_harmonics import real_sh


def bump(
    rows: int = 64, columns: int = 88, centre: tuple[float, float] = (27.0, 38.0)
) -> Decomposition:
    """A dome off the middle of a wide frame, red above and blue below, lit from the upper left;
    heights and normals are exact.
    """
    row, column = np.indices((rows, columns)).astype(float)
    radius = 0.4 * rows
    x, y = (column - centre[1]) / radius, (centre[0] - row) / radius
    square = x * x + y * y
    mask = square < 0.9
    # z = r (1 - s^2) / 2 for s = distance / r: a paraboloid, whose slope at the rim is finite
    normal = np.dstack([x, y, np.ones_like(x)]) / np.sqrt(1 + square)[..., None]
    normal = np.where(mask[..., None], normal, np.array([0.0, 0, 1])).astype(np.float32)
    height = (np.where(mask, 0.5 * radius * (0.9 - square), 0)).astype(np.float32)
    light = np.zeros((9, 3))
    light[0], light[1], light[3] = [-2.2, -2.6, -3.0], 0.5, -0.4
    shading = (np.exp(real_sh(normal.astype(float)) @ light) * mask[..., None]).astype(np.float32)
    paint = np.where((y > 0)[..., None], [0.45, 0.10, 0.08], [0.08, 0.14, 0.40]) * mask[..., None]
    reflectance = paint.astype(np.float32)
    diffuse = reflectance * shading
    specular = (
        (0.3 * np.exp(-40 * ((x + 0.3) ** 2 + (y - 0.3) ** 2)) * mask)[..., None]
        .repeat(3, -1)
        .astype(np.float32)
    )
    about = {
        "name": "bump.png",
        "sha256": "0" * 64,
        "size": [columns, rows],
        "scale": 1.0,
        "crop_box": [0, 0, columns, rows],
    }
    provenance = Provenance(
        {"model": "mdr", "separator": "isc"},
        0,
        {"isc": "0.1.0"},
        {},
        about,
        Diagnostics(converged=True),
    )
    residual = np.zeros_like(diffuse)
    trust = (mask * np.clip(normal[..., 2], 0, 1)).astype(np.float32)
    maps = (
        diffuse + specular,
        diffuse,
        specular,
        residual,
        reflectance,
        shading,
        normal,
        height,
        mask,
        trust,
    )
    return Decomposition(*maps, light, provenance)


def write_result(
    folder: Path, decomposition: Decomposition | None = None, mesh: MeshOptions | None = None
) -> Path:
    """A folder with arrays.npz and decomposition.json, as little as the scene needs of a result."""
    d = decomposition or bump()
    folder.mkdir(parents=True, exist_ok=True)
    write_arrays(
        ResultPart.of(d),
        folder / "arrays.npz",
        build_mesh(d.height, d.normal, d.mask, d.reflectance, mesh),
    )
    p = d.provenance
    text = {
        "schema_version": 2,
        "settings": p.settings,
        "versions": p.versions,
        "input": p.input,
        "status": p.diagnostics.to_json(),
    }
    (folder / "decomposition.json").write_text(json.dumps(text), encoding="utf-8")
    return folder
