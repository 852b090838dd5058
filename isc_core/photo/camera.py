"""The camera of a photo: a pinhole of known focal length.

Equation: the viewing ray of the pixel (row, column) is (u, -v, -f), with u = column + 1/2 - x and v
= row + 1/2 - y counted from the principal point (x, y), f the focal length, all in pixels; camera
frame: x right, y up, z toward the viewer, the pinhole at the origin.

Citation: R. Hartley, A. Zisserman, "Multiple view geometry in computer vision" (2004),
doi:10.1017/CBO9780511811685.

Limits: square pixels, no lens distortion; the principal point is the centre of the photo, so the
photo must not be cropped.
"""

from dataclasses import dataclass, replace
from enum import StrEnum


class CameraSource(StrEnum):
    """The source of the focal length.

    Attributes
    ----------
    EXIF
        The photo's metadata.
    OPTION
        The user.
    """

    EXIF = "exif"
    OPTION = "option"


@dataclass(frozen=True)
class Camera:
    """A pinhole camera.

    Attributes
    ----------
    focal_length : float
        Pixels, above 0.
    principal_point : tuple of float
        (x, y) in pixels from the left and upper edge of the frame.
    source : CameraSource
        The source of the focal length.
    """

    focal_length: float
    principal_point: tuple[float, float]
    source: CameraSource = CameraSource.EXIF

    @staticmethod
    def of_frame(
        focal_length: float, size: tuple[int, int], source: CameraSource = CameraSource.EXIF
    ) -> "Camera":
        """Return the camera of a whole photo.

        Parameters
        ----------
        focal_length : float
            Pixels.
        size : tuple of int
            Width and height of the photo.
        source : CameraSource, optional

        Returns
        -------
        Camera
        """
        return Camera(focal_length, (size[0] / 2, size[1] / 2), source)

    def moved(self, right: float, down: float) -> "Camera":
        """Return the camera of a frame that begins elsewhere.

        Parameters
        ----------
        right, down : float
            Position of this frame in the other one, pixels.

        Returns
        -------
        Camera
        """
        x, y = self.principal_point
        return replace(self, principal_point=(x + right, y + down))

    def scaled(self, factor: float) -> "Camera":
        """Return the camera of the photo resized by a factor.

        Parameters
        ----------
        factor : float

        Returns
        -------
        Camera
        """
        x, y = self.principal_point
        return replace(
            self,
            focal_length=factor * self.focal_length,
            principal_point=(factor * x, factor * y),
        )
