"""Shading: how light and surface make radiance.

`spherical_harmonics` and `irradiance_basis` describe a smooth light, `environment_map` one as an
image, `lights` and `radiance` distant lights; `brdf` holds the reflectance models, `lobe_rendering`
the specular lobes; `surface_stencils` and `occluding_contour` derive normals from heights and
masks.

Frames: the camera frame is x right, y up, z toward the viewer; the reference's frame (SIRFS) is
down, right, toward the viewer. Shading is that of a Lambertian surface of albedo 1; radiance =
albedo * shading.
"""

from typing import TYPE_CHECKING

from ..lazy import exports

if TYPE_CHECKING:
    from .lights import DirectionalLight
    from .radiance import DistantLights, sh_shading
    from .spherical_harmonics import (
        light_from_reference,
        light_to_reference,
        normal_from_reference,
        normal_to_reference,
        real_sh,
    )
else:
    __getattr__ = exports(
        __name__,
        {
            "DirectionalLight": ".lights",
            "DistantLights": ".radiance",
            "light_from_reference": ".spherical_harmonics",
            "light_to_reference": ".spherical_harmonics",
            "normal_from_reference": ".spherical_harmonics",
            "normal_to_reference": ".spherical_harmonics",
            "real_sh": ".spherical_harmonics",
            "sh_shading": ".radiance",
        },
    )

__all__ = [
    "DirectionalLight",
    "DistantLights",
    "light_from_reference",
    "light_to_reference",
    "normal_from_reference",
    "normal_to_reference",
    "real_sh",
    "sh_shading",
]
