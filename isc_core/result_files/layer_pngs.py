"""The layers of a result as PNG files, for programs that cannot read EXR.

Files: `diffuse`, `specular`, `reflectance` and `shading` in 8-bit sRGB with the mask as alpha;
`normal` as (n + 1) / 2 (x right, y up, z toward the viewer: OpenGL's convention) in 8 bits;
`height` in 16 bits, from 0 to the largest height.

Limits: 8 bits clip light above 1. Shading, whose scale a photo cannot determine, is divided by its
maximum first. The EXR files have the exact values.
"""

from pathlib import Path

import numpy as np
from PIL import Image

from ..imaging.srgb import linear_to_srgb
from ..scene.decomposition import Decomposition

LAYER_PNGS = tuple(
    f"maps/{name}.png"
    for name in ("diffuse", "specular", "reflectance", "shading", "normal", "height")
)


def write_layer_pngs(d: Decomposition, folder: Path) -> None:
    """Write the PNG files of `LAYER_PNGS`.

    Parameters
    ----------
    d : Decomposition
    folder : Path
        The folder of the result; it has a folder `maps`.
    """
    shading = d.shading / max(float(d.shading[d.mask].max()), 1e-12)
    layers = {
        "diffuse": linear_to_srgb(np.clip(d.diffuse, 0, 1)),
        "specular": linear_to_srgb(np.clip(d.specular, 0, 1)),
        "reflectance": linear_to_srgb(np.clip(d.reflectance, 0, 1)),
        "shading": linear_to_srgb(np.clip(shading, 0, 1)),
        "normal": np.clip((d.normal + 1) / 2, 0, 1),
    }
    for name, values in layers.items():
        codes = np.rint(255 * np.dstack([values, d.mask])).astype(np.uint8)
        Image.fromarray(codes).save(folder / "maps" / f"{name}.png")
    height = d.height / max(float(d.height.max()), 1e-12)
    codes = np.rint(65535 * np.clip(height, 0, 1)).astype(np.uint16)
    Image.fromarray(codes).save(folder / "maps" / "height.png")
