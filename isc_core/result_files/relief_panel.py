"""The height map as a relief lit from the upper left, with contour lines at round numbers."""

from collections.abc import Mapping

import numpy as np

from ..scene.decomposition import Decomposition
from .panels import Frame, Panel, unit_normals


def relief_panel(d: Decomposition, frame: Frame, small: Mapping[str, np.ndarray]) -> Panel:
    """Draw the height map.

    Parameters
    ----------
    d : Decomposition
    frame : Frame
    small : mapping
        Maps of the panel's size; normal and height are used.

    Returns
    -------
    Panel
    """
    heights = frame.inside(d.height)
    low, high = float(heights.min()), float(heights.max())
    spacing = _round_step((high - low) / 12)
    normal = unit_normals(small["normal"])
    light, low_tone, high_tone, key_tone, fill_tone = np.array(
        [
            [-0.52, 0.58, 0.63],
            [0.36, 0.44, 0.52],
            [0.86, 0.78, 0.66],
            [1, 0.97, 0.9],
            [0.75, 0.88, 1],
        ],
        np.float32,
    )
    facing, fill_light = np.clip((normal @ light + 0.3) / 1.3, 0, 1), 0.6 + 0.4 * normal[..., 1]
    key = facing * np.sqrt(facing)  # an area light: a soft shadow edge
    height = small["height"]
    tint = np.clip((height - low) / max(high - low, 1e-9), 0, 1)[..., None]
    base = (1 - tint) * low_tone + tint * high_tone
    color = base * (0.95 * key[..., None] * key_tone + 0.16 * fill_light[..., None] * fill_tone)
    color *= 1 - 0.55 * _contours(height / spacing, frame.coverage)[..., None]
    return Panel(
        color, frame.coverage, "Height", f"range {high - low:.0f} px, lines every {spacing:g}"
    )


def _contours(level: np.ndarray, coverage: np.ndarray) -> np.ndarray:
    """Coverage of each pixel by contour lines, [0, 1]: at integers of `level`, faded where they
    converge.
    """
    slope = np.hypot(*np.gradient(level))
    distance = np.abs(level - np.rint(level)) / np.maximum(slope, 1e-6)  # pixels to the line
    fade = np.clip((0.25 - slope) / 0.15, 0, 1) * (coverage > 0.99)
    return np.clip(1.1 - distance, 0, 1) * fade


def _round_step(step: float) -> float:
    """The smallest of 1, 2, 5 times a power of ten that is at least `step`; 1 for 0."""
    if step <= 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(step))
    return float(power * next(m for m in (1, 2, 5, 10) if m * power >= step * (1 - 1e-9)))
