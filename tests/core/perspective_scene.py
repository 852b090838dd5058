"""A result with a perspective camera: a bump off the centre of a wide-angle photo."""

import numpy as np

from isc_core.decomposition.pipeline import assemble
from isc_core.decomposition.task import SceneEstimate
from isc_core.photo import Photo, PhotoSource
from isc_core.photo.camera import Camera
from isc_core.scene.decomposition import Decomposition, Provenance, Separation
from isc_core.scene.diagnostics import Diagnostics
from isc_core.shading.spherical_harmonics import light_to_reference
from tests.core.ball_scene import LIGHT

SHAPE = (60, 84)
CENTRE = (24.0, 58.0)
CAMERA = Camera.of_frame(62.0, (84, 60))


def bump_height(shape: tuple[int, int] = SHAPE, radius: float = 18.0) -> np.ndarray:
    """A paraboloid around `CENTRE`, (H, W) pixels toward the viewer; it continues beyond the
    mask.
    """
    row, column = np.indices(shape).astype(float)
    square = ((row - CENTRE[0]) ** 2 + (column - CENTRE[1]) ** 2) / radius**2
    return np.asarray(0.8 * radius * (1 - square))


def bump_photo(camera: Camera | None = CAMERA, radius: float = 18.0) -> Photo:
    """A photo of it in two colours; the light does not matter."""
    height = bump_height(radius=radius)
    mask = height > 0.05
    image = np.where((np.indices(SHAPE)[0] % 14 < 7)[..., None], [0.5, 0.3, 0.1], [0.2, 0.3, 0.6])
    image = (image * (1 + 0.02 * height[..., None]) * mask[..., None]).astype(np.float32)
    source = PhotoSource("0" * 64, SHAPE[::-1], 8, "srgb", "file")
    return Photo(image, mask, 1e-3, np.zeros_like(mask), source, camera=camera)


def bump_estimate(photo: Photo) -> SceneEstimate:
    """The estimate of an orthographic solver."""
    zero = np.zeros_like(photo.image)
    split = Separation(photo.image, zero, zero, photo.mask.astype(np.float32))
    return SceneEstimate(split, bump_height(), light_to_reference(LIGHT), Diagnostics())


def bump_before_camera(camera: Camera | None = CAMERA) -> Decomposition:
    """The result."""
    photo = bump_photo(camera)
    about = {"name": "bump.png", "sha256": "0" * 64, "size": list(SHAPE[::-1]), "scale": 1.0}
    provenance = Provenance({"model": "mdr", "separator": "isc"}, 0, {"isc": "0.1.0"}, {}, about)
    return assemble(photo, bump_estimate(photo), provenance)
