"""Lights of a scene by the name of their kind, drawn at random: from a single lamp to a
photographed environment.

Directions and lengths are those of `synth.scene.lights`: the object is about 2 wide, around the origin,
the viewer toward +z. Every draw reaches the side that the viewer sees. How bright it is on the
whole is left to the caller (`synth.capture.truth.exposed`): the strongest lamp, or an environment on the
average, gives a white matt surface a radiance of about 1.

Limits: colours of invented lights stay within some per cent of white; those of files are as they
are.
"""

from pathlib import Path

import numpy as np

from isc_core.errors import InputError

from ..scene.lights import Light
from .areas import area_lights
from .files import hdr_lights, natural_lights
from .harmonics import harmonic_lights
from .lamps import directional_lights, point_lights

RIGS = ("point", "directional", "area", "sh", "natural", "hdr")
FROM_FILES = {
    "natural": "the folder that holds natural_lights.mat",
    "hdr": "an .hdr or .exr file in latitude-longitude layout, or a folder of them",
}
_INVENTED = {
    "point": point_lights,
    "directional": directional_lights,
    "area": area_lights,
    "sh": harmonic_lights,
}


def make_lights(
    name: str, rng: np.random.Generator, source: Path | None = None
) -> tuple[Light, ...]:
    """One draw of the kind `name`, of `RIGS`; the same state of `rng` gives the same lights.

    `source`: for "natural" the folder that holds natural_lights.mat; for "hdr" an .hdr or .exr
    latitude-longitude picture, or a folder of them. Raises `InputError` for an unknown name, a
    source that is missing, and files that cannot be used.
    """
    if name in _INVENTED:
        return _INVENTED[name](rng)
    if name not in RIGS:
        raise InputError(f"unknown light {name!r}: choose {', '.join(RIGS)}")
    if source is None:
        raise InputError(f"the light {name!r} is read from files: name {FROM_FILES[name]}")
    return natural_lights(rng, source) if name == "natural" else hdr_lights(rng, source)
