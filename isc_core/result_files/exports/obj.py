"""A mesh as Wavefront OBJ with its material library.

Format: lines of vertices (`v`), texture coordinates (`vt`, v from the bottom), normals (`vn`) and
faces (`f`), whose indices begin at 1. The material's roughness `Pr`, metallic `Pm` and normal map
`norm` are the extension for physically based materials (R. Mach, exocortex, 2013), which Blender
and others read; `Ns` and `Ks` are what Blender writes for the same roughness and specular level, .5
being plastic. A level above 1 raises the index of refraction `Ni` instead. Blender reads the normal
map from `map_Bump`, which programs that support `norm` ignore. It imports all images as sRGB, and
the format has no way to say otherwise: `map_Ks`, a colour, is stored as sRGB; for the normal map,
users must set the colour space to Non-Color.

Citation: M. Ramey et al., "Object files (.obj)", Wavefront Technologies 1995 (no DOI).

Limits: no tangents; programs compute them from the texture coordinates.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...imaging.srgb import srgb_codes
from ..mesh.result import MeshResult
from .textures import PLASTIC, MeshTextures, plain_stem, refraction

_ROWS = 1 << 14  # formatted at a time


def encode_obj(built: MeshResult, path: Path) -> dict[str, bytes]:
    """Encode a mesh; equal meshes give equal bytes.

    Parameters
    ----------
    built : MeshResult
    path : Path
        Of the `.obj` file.

    Returns
    -------
    dict of str to bytes
        Name and content of each file, that of `path` first.
    """
    mesh, name = built.mesh, plain_stem(path)
    library, textures = f"{name}.mtl", MeshTextures.of(built, name)
    corner = mesh.faces + 1
    lines = [
        f"# ISC\nmtllib {library}\no {name}\n",
        *_rows("v %.7g %.7g %.7g\n", mesh.vertices),
        *_rows("vt %.7g %.7g\n", mesh.uv),
        *_rows("vn %.6f %.6f %.6f\n", mesh.vertex_normals),
        f"usemtl {name}\ns 1\n",
        *_rows("f %d/%d/%d %d/%d/%d %d/%d/%d\n", np.repeat(corner, 3, axis=1)),
    ]
    material = _material(built, name, textures)
    return {
        path.name: "".join(lines).encode(),
        library: material.encode(),
        **textures.files,
    }


def _rows(line: str, values: np.ndarray) -> Iterator[str]:
    for start in range(0, len(values), _ROWS):
        part = values[start : start + _ROWS]
        yield line * len(part) % tuple(part.reshape(-1).tolist())


def _material(built: MeshResult, name: str, textures: MeshTextures) -> str:
    variation, alpha = built.gloss.variation, built.alpha
    level = PLASTIC * built.specular
    largest = level if variation is None else level * float(variation.max())
    strength = min(level, 1.0)
    maps = [f"map_Kd {textures.base_color}"]
    if textures.normal:
        maps += [f"norm {textures.normal}", f"map_Bump -bm 1 {textures.normal}"]
    if variation is not None:
        strength = 1.0
        share = level / max(largest, 1.0) * variation
        maps.append(f"map_Ks {textures.add('specular', srgb_codes(share))}")
    if alpha is not None:
        # Some programs read the grey value, others, such as Blender, the alpha channel.
        maps.append(f"map_d {textures.add('alpha', np.dstack([alpha] * 4))}")
    lines = [
        f"newmtl {name}",
        "Kd 1 1 1",
        f"Ks {strength:.6g} {strength:.6g} {strength:.6g}",
        f"Ns {1000 * (1 - built.roughness) ** 2:.6g}",
        f"Ni {refraction(max(largest, 1.0)):.6g}",
        "illum 2",
        f"Pr {built.roughness:.6g}",
        f"Pm {built.options.metallic:.6g}",
        *maps,
    ]
    return "\n".join(["# ISC", *lines, ""])
