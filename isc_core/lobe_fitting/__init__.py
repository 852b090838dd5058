"""Lobes from specular images: the roughness of an object, the strength of its highlights, and the
direction of its lights, with intervals.

Four modules estimate light directions from different inputs: `starts` derives initial directions
for the least squares in `lamps` from the peaks of a specular image; `recovered` derives one
direction from a highlight on blurred recovered normals; `light_direction` approximates a finished
decomposition by one distant light, for editing; `baselines.light_direction` is the published
estimate of the shape-from-shading baselines, from the gradients of a photo without normals.
`networks.scene_network` predicts the direction from the photo alone. They share the half-vector
geometry of `starts.light_of_half_vector`.
"""

from typing import TYPE_CHECKING

from ..lazy import exports

if TYPE_CHECKING:
    from ..scene.lobe_fit import Interval, LobeFit, LobeFitOptions, LobeFitOutcome, LobeLight
    from .fit import fit_lobe
    from .observed import GivenLight, PixelData, RecoveredScene
else:
    __getattr__ = exports(
        __name__,
        {
            "GivenLight": ".observed",
            "Interval": "..scene.lobe_fit",
            "LobeFit": "..scene.lobe_fit",
            "LobeFitOptions": "..scene.lobe_fit",
            "LobeFitOutcome": "..scene.lobe_fit",
            "LobeLight": "..scene.lobe_fit",
            "PixelData": ".observed",
            "RecoveredScene": ".observed",
            "fit_lobe": ".fit",
        },
    )

__all__ = [
    "GivenLight",
    "Interval",
    "LobeFit",
    "LobeFitOptions",
    "LobeFitOutcome",
    "LobeLight",
    "PixelData",
    "RecoveredScene",
    "fit_lobe",
]
