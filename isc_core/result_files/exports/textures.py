"""The textures of a mesh as PNG files, for formats that refer to them by name."""

import re
from dataclasses import dataclass
from pathlib import Path

from ...imaging.srgb import share_codes
from ..mesh.result import MeshResult
from ..mesh.texture_codes import encoded_png

PLASTIC = 0.5  # a specular texture's value for f0 = .04, as in Blender and Unreal


def plain_stem(path: Path) -> str:
    """Return the name of a file without its suffix and spaces, which formats do not allow.

    Parameters
    ----------
    path : Path

    Returns
    -------
    str
    """
    return re.sub(r"[^\w.-]", "_", path.stem)


@dataclass(frozen=True)
class MeshTextures:
    """Names and contents of the textures of a mesh.

    Attributes
    ----------
    files : dict of str to bytes
        Name and content of each file.
    base_color : str
        Name.
    normal, specular, alpha : str or None
        Names; None where a value is enough. The opacity is in the base colour's alpha channel, too.
    """

    files: dict[str, bytes]
    base_color: str
    normal: str | None
    specular: str | None
    alpha: str | None

    @staticmethod
    def of(built: MeshResult, name: str) -> "MeshTextures":
        """Encode the textures of a mesh.

        Parameters
        ----------
        built : MeshResult
        name : str
            Prefix of the file names.

        Returns
        -------
        MeshTextures
        """
        base_color = f"{name}_basecolor.png"
        files = {base_color: built.base_color_png()}
        normal = specular = alpha = None
        if built.needs_normal_map:
            normal = f"{name}_mesh_normal.png"
            files[normal] = built.normal_png()
        if built.gloss.variation is not None:
            specular = f"{name}_specular.png"
            level = PLASTIC * built.specular * built.gloss.variation
            files[specular] = encoded_png(share_codes(level))
        if built.alpha is not None:
            alpha = f"{name}_alpha.png"
            files[alpha] = encoded_png(built.alpha)
        return MeshTextures(files, base_color, normal, specular, alpha)
