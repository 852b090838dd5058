"""The camera of a result in decomposition.json.

The entry `camera` has `type` ("perspective" or "orthographic") and `source` ("exif", "option" or
"none"); for a perspective camera also `focal_length`, pixels of the maps, `principal_point`, (x, y)
in pixels from the left and upper edge of the maps, and `axis`, the unit vector from the camera to
the object along which heights are measured. Results of earlier versions have no such entry, and are
orthographic. The file is not trusted.
"""

from typing import Any

from ..imaging.bounding_box import FramePart
from ..io.json_files import numbers
from ..photo.camera import Camera, CameraSource
from ..scene.decomposition import Decomposition
from ..shading.perspective import object_axis

PERSPECTIVE, ORTHOGRAPHIC = "perspective", "orthographic"


def camera_to_json(d: Decomposition, part: FramePart | None = None) -> dict[str, Any]:
    """Describe the camera of a result.

    Parameters
    ----------
    d : Decomposition
    part : FramePart, optional
        The part of the frame that the maps of `d` are of; by default all of it.

    Returns
    -------
    dict
        Ready for JSON except for its arrays.
    """
    if d.camera is None:
        return {"type": ORTHOGRAPHIC, "source": "none"}
    return {
        "type": PERSPECTIVE,
        "source": d.camera.source,
        "focal_length": d.camera.focal_length,
        "principal_point": d.camera.moved(*(part.corner if part else (0, 0))).principal_point,
        "axis": object_axis(d.camera, d.mask),
    }


def camera_from_json(record: Any) -> Camera | None:
    """Read the camera of a result.

    Parameters
    ----------
    record : Any
        The entry as JSON values; None without one.

    Returns
    -------
    Camera or None
        None for an orthographic view.

    Raises
    ------
    ValueError
        If the entry is not a camera.
    """
    if record is None or (isinstance(record, dict) and record.get("type") == ORTHOGRAPHIC):
        return None
    if not isinstance(record, dict) or record.get("type") != PERSPECTIVE:
        raise ValueError("it has an unknown type")
    focal = numbers(record.get("focal_length"), ())
    point = numbers(record.get("principal_point"), (2,))
    if focal is None or point is None or not focal > 0:
        raise ValueError("its numbers are missing")
    return Camera(
        float(focal), (float(point[0]), float(point[1])), CameraSource(str(record.get("source")))
    )
