"""Random lights of a scene by kind: from a single directional light to a photographed environment.

Directions and lengths are those of `synth.scene.lights`: the object is about 2 wide, around the
origin, the viewer toward +z. Every draw reaches the visible side. The overall brightness is left to
the caller (`synth.capture.truth.exposed`): the strongest light, or the mean of an environment,
gives a white diffuse surface a radiance of about 1.

Limits: colours of generated lights are within a few per cent of white; those of files are
unchanged.
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
    "natural": "the folder of natural_lights.mat",
    "hdr": "an .hdr or .exr file in latitude-longitude layout, or a folder of them",
}
_GENERATED = {
    "point": point_lights,
    "directional": directional_lights,
    "area": area_lights,
    "sh": harmonic_lights,
}


def make_lights(
    name: str, rng: np.random.Generator, source: Path | None = None
) -> tuple[Light, ...]:
    """Draw the lights of a scene.

    Parameters
    ----------
    name : str
        Their kind, one of `RIGS`.
    rng : numpy.random.Generator
        Random numbers; the same state gives the same lights.
    source : Path, optional
        For "natural" the folder of natural_lights.mat; for "hdr" an .hdr or .exr latitude-longitude
        image, or a folder of them.

    Returns
    -------
    tuple of Light
        The lights.

    Raises
    ------
    InputError
        For an unknown name, a missing source, or files that cannot be used.
    """
    if name in _GENERATED:
        return _GENERATED[name](rng)
    if name not in RIGS:
        raise InputError(f"unknown light {name!r}: choose {', '.join(RIGS)}")
    if source is None:
        raise InputError(f"the light {name!r} is read from files: give {FROM_FILES[name]}")
    return natural_lights(rng, source) if name == "natural" else hdr_lights(rng, source)
