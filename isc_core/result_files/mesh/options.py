"""How the mesh of a result is built."""

from dataclasses import dataclass

from ..solids.back import Back


@dataclass(frozen=True)
class MeshOptions:
    """How the mesh is built.

    Attributes
    ----------
    longest_side : float
        Longest side of the mask's bounding box, in metres.
    metres_per_pixel : float or None
        Replaces `longest_side`.
    triangles : int
        The most that the mesh may have; 0 for a vertex at each pixel.
    rim : int
        Rings of border pixels whose height is limited; 0 for none.
    bleed : int
        Pixels by which the texture continues beyond the mask.
    roughness, metallic : float
        Default glTF factors in [0, 1]; a fitted gloss has its own roughness.
    back : Back
        What the mesh has on the side that the photo does not show.
    """

    longest_side: float = 0.1
    metres_per_pixel: float | None = None
    triangles: int = 100_000
    rim: int = 3
    bleed: int = 16
    roughness: float = 0.5
    metallic: float = 0.0
    back: Back = Back.OPEN
