"""The camera of all maps.

World and camera share one frame: x right, y up, z toward the viewer, the origin in the middle of
the picture. Lengths are object units, `pixels_per_unit` pixels each at the origin, so height in
pixels = z * pixels_per_unit. Pixel (row, column) covers [column, column + 1] x [row, row + 1]; its
centre is at (column + .5, row + .5), row 0 at the top.

Equation: orthographic, x = (column + .5 - width / 2) / pixels_per_unit, y = (height / 2 - row - .5)
/ pixels_per_unit, along -z. Perspective: a pinhole at z = `distance`, scaled so that the plane z =
0 appears at the same size.

Citation: R. Hartley and A. Zisserman, "Multiple view geometry in computer vision", 2nd edition
(2004), doi:10.1017/CBO9780511811685.

Limits: no lens distortion, no depth of field.
"""

import math
from dataclasses import dataclass

import numpy as np

from isc_core.errors import InputError

# Start of orthographic rays in object units, far in front of any object.
FAR = 100.0
SMALLEST, LARGEST = 8, 4096


@dataclass(frozen=True)
class Camera:
    """An orthographic or pinhole camera on the z axis.

    Attributes
    ----------
    width, height : int
        Size of the picture in pixels, 8 to 4096.
    pixels_per_unit : float
        Scale at the origin, > 0.
    distance : float
        Distance of the pinhole from the origin in object units, > 1.5; infinite for an orthographic
        camera.

    Raises
    ------
    InputError
        Outside these ranges.
    """

    width: int
    height: int
    pixels_per_unit: float
    distance: float = math.inf

    def __post_init__(self) -> None:
        if not (SMALLEST <= self.width <= LARGEST and SMALLEST <= self.height <= LARGEST):
            raise InputError(
                f"a picture of {self.width} x {self.height} pixels cannot be rendered: choose "
                f"{SMALLEST} to {LARGEST} a side"
            )
        if not (math.isfinite(self.pixels_per_unit) and self.pixels_per_unit > 0):
            raise InputError("pixels_per_unit must be finite and above 0")
        if not self.distance > 1.5:
            raise InputError(
                "the camera is inside the object: its distance must be above 1.5 object units"
            )

    @property
    def perspective(self) -> bool:
        """Whether this is a pinhole camera."""
        return math.isfinite(self.distance)

    def rays(self, across: float = 0.5, down: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
        """Return the rays through one point of each pixel.

        Parameters
        ----------
        across, down : float, optional
            The point within the pixel, [0, 1]; its centre by default.

        Returns
        -------
        origins, directions : (H, W, 3) ndarray
            Origins and unit directions.
        """
        x = (np.arange(self.width) + across - self.width / 2) / self.pixels_per_unit
        y = (self.height / 2 - np.arange(self.height) - down) / self.pixels_per_unit
        x, y = np.meshgrid(x, y)
        plane = np.stack([x, y, np.zeros_like(x)], -1)
        if not self.perspective:
            return plane + (0.0, 0.0, FAR), np.broadcast_to(
                np.array([0.0, 0.0, -1.0]), plane.shape
            ).copy()
        eye = np.array([0.0, 0.0, self.distance])
        toward = plane - eye
        return np.broadcast_to(eye, plane.shape).copy(), toward / np.linalg.norm(
            toward, axis=-1, keepdims=True
        )

    def matrices(self) -> dict[str, list[list[float]]]:
        """Return the world-to-camera matrices.

        Returns
        -------
        dict
            4 x 4 matrices: "opencv" (x right, y down, z away from the viewer) and "blender" (x
            right, y up, z toward the viewer, the camera at the origin). An orthographic camera is
            at z = `FAR`.
        """
        back = self.distance if self.perspective else FAR
        blender = np.eye(4)
        blender[2, 3] = -back
        opencv = np.diag([1.0, -1.0, -1.0, 1.0]) @ blender
        return {"opencv": opencv.tolist(), "blender": blender.tolist()}
