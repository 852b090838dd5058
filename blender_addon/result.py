"""What the scene needs to know of a result folder: read with nothing but Python and NumPy."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from isc_core.errors import InputError


@dataclass(frozen=True)
class Placement:
    """How the mesh stands to the photo, and the light for its base colour.

    `mesh`: the .glb file. `illumination`: (9, 3), log shading in the camera's frame, for the mesh's base colour.
    `metres_per_pixel`: of the maps. `origin`: (column, row) in pixels of the mesh's origin.
    `gloss_is_fitted`: whether the material's gloss was measured in the photo, or is just a usual value.
    """

    mesh: Path
    illumination: np.ndarray
    metres_per_pixel: float
    origin: tuple[float, float]
    gloss_is_fitted: bool


def read_placement(folder: Path) -> Placement:
    """Reads a folder that `isc decompose` wrote. Raises `InputError` if it is none, or is damaged."""
    description, mesh = folder / "decomposition.json", folder / "mesh.glb"
    for path in (description, mesh):
        if not path.is_file():
            raise InputError(f"{folder} has no {path.name}: give the folder that isc decompose wrote")
    try:
        record = json.loads(description.read_text(encoding="utf-8"))["mesh"]
        light = np.array(record["illumination"]["coefficients"], dtype=np.float64)
        scale, origin = float(record["metres_per_pixel"]), (float(record["origin"]["column"]), float(record["origin"]["row"]))
        fitted = record["roughness"]["source"] == "fitted"
    except OSError as error:
        raise InputError(f"cannot read {description}: {error.strerror}") from error
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{description} is damaged or not a result of isc decompose: {error}") from error
    if light.shape != (9, 3) or not np.isfinite(light).all() or not scale > 0:
        raise InputError(f"{description} has no usable light or scale: decompose the photo again")
    return Placement(mesh, light, scale, origin, fitted)
