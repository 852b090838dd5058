"""Options of the mesh of a result."""

from dataclasses import dataclass

from ..solids.back import Back


@dataclass(frozen=True)
class MeshOptions:
    """Options of the mesh.

    Attributes
    ----------
    longest_side : float
        Longest side of the mask's bounding box, in metres.
    metres_per_pixel : float or None
        Replaces `longest_side`.
    triangles : int
        Largest number of triangles, unless a closed mesh, or an outline between the pixels, needs
        more for its outline; 0 for a vertex at each pixel.
    rim : int
        Rings of border pixels whose height is limited; 0 for none.
    bleed : int
        Pixels by which the texture is extended beyond the mask.
    roughness, metallic : float
        Default glTF factors in [0, 1]; a fitted roughness takes precedence.
    back : Back
        The kind of back, on the side that the photo does not show.
    """

    longest_side: float = 0.1
    metres_per_pixel: float | None = None
    triangles: int = 100_000
    rim: int = 3
    bleed: int = 16
    roughness: float = 0.5
    metallic: float = 0.0
    back: Back = Back.OPEN
