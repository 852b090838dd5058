"""Random cameras that look at objects on a table, or past them, for Mitsuba.

Problem: people photograph a thing from in front or from above, seldom exactly in the middle.

Equation: the distance is such that the object's longer side fills a share of the picture.

Limits: pinholes; nothing is out of focus.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from synth.scene.variant import load_mitsuba

_FIELDS = (22.0, 32.0, 45.0, 60.0)  # degrees, of the picture's longer side
_OFF_CENTRE = 0.15  # share of the pictures whose object may be cut by the frame


@dataclass(frozen=True)
class Box:
    """Bounds of what stands on the plane y = 0, around the y axis.

    Attributes
    ----------
    half_x, half_z : float
        Half the sides.
    height : float
    """

    half_x: float
    half_z: float
    height: float


def camera(
    box: Box, azimuth: float, rng: np.random.Generator, beside: bool = False
) -> dict[str, Any]:
    """Draw a camera, 4 to 60 degrees from above.

    Parameters
    ----------
    box : Box
        Of the objects.
    azimuth : float
        Of the camera, radians from the x axis to the z axis.
    rng : numpy.random.Generator
    beside : bool
        Look past the objects, at the table beside them.

    Returns
    -------
    dict
        For `mitsuba.load_dict`, without film and sampler.
    """
    wide, middle = float(np.hypot(box.half_x, box.half_z)), np.array([0, box.height / 2, 0])
    above, field = np.radians(rng.uniform(4, 60)), float(rng.choice(_FIELDS))
    fill, tangent = rng.uniform(0.28, 0.85), float(np.tan(np.radians(field / 2)))
    distance = max(box.height, 1.2 * wide) / (2 * tangent * fill) + wide / 2
    ground = np.cos(above) * np.array([np.cos(azimuth), np.sin(azimuth)])
    eye = middle + distance * np.array([ground[0], np.sin(above), ground[1]])
    forward = (middle - eye) / np.linalg.norm(middle - eye)
    right = np.cross(forward, [0, 1, 0])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    shift = (1 - fill) * distance * tangent * (1.4 if rng.random() < _OFF_CENTRE else 0.6)
    aim = middle + shift * (right * rng.uniform(-1, 1) + 0.6 * up * rng.uniform(-1, 1))
    if beside:
        away = right * rng.choice([-1, 1]) * (rng.uniform(1.1, 1.6) * distance * tangent + wide)
        eye, aim = eye + away, aim + away
    tilted = up + right * np.tan(np.radians(rng.normal(0, 3)))
    transform = load_mitsuba().ScalarTransform4f()
    return {
        "type": "perspective",
        "fov": field,
        "fov_axis": "larger",
        "to_world": transform.look_at(origin=eye.tolist(), target=aim.tolist(), up=tilted.tolist()),
    }
