"""The textures of a mesh as PNG files, for formats that refer to them by name."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...lobe_fitting.specular_layer import MOST
from ...shading.brdf.ggx import F0
from ..mesh.result import MeshResult
from ..mesh.texture_codes import encoded_png

PLASTIC = 0.5  # a specular texture's value for f0 = .04, as in Blender and Unreal


def plain_stem(path: Path) -> str:
    """Return the name of a file without its suffix, nor spaces and a leading hyphen, which would
    begin an option in a material library.

    Parameters
    ----------
    path : Path

    Returns
    -------
    str
    """
    return re.sub(r"[^\w.-]|^-", "_", path.stem)


def refraction(level: float | np.ndarray) -> np.ndarray:
    """Return the index of refraction whose reflectance along the normal is .04 level.

    Parameters
    ----------
    level : float or ndarray
        Specular level, not negative; 1 is plastic.

    Returns
    -------
    ndarray
    """
    amplitude = np.sqrt(np.minimum(F0 * np.asarray(level, float), MOST))
    return np.asarray((1 + amplitude) / (1 - amplitude))


@dataclass(frozen=True)
class MeshTextures:
    """Names and contents of the textures of a mesh that all formats share.

    Attributes
    ----------
    name : str
        Prefix of the file names.
    files : dict of str to bytes
        Name and content of each file; `add` extends it.
    base_color : str
        Name. Its alpha channel is the opacity of a soft rim.
    normal : str or None
        Name; None where the mesh needs no normal map.
    """

    name: str
    files: dict[str, bytes]
    base_color: str
    normal: str | None

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
        normal = f"{name}_mesh_normal.png" if built.needs_normal_map else None
        if normal is not None:
            files[normal] = built.normal_png()
        return MeshTextures(name, files, base_color, normal)

    def add(self, quantity: str, pixels: np.ndarray) -> str:
        """Add a texture, and return its file name.

        Parameters
        ----------
        quantity : str
            Last part of the name.
        pixels : (H, W) or (H, W, C) uint8 ndarray

        Returns
        -------
        str
        """
        file = f"{self.name}_{quantity}.png"
        self.files[file] = encoded_png(pixels)
        return file
