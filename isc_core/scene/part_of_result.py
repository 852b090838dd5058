"""A result as a part of a larger frame, and a part of a result."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..imaging.bounding_box import FramePart
from .decomposition import Decomposition
from .expected_error import ExpectedError


def cut_result(d: Decomposition, part: FramePart) -> Decomposition:
    """Return a part of a result.

    Parameters
    ----------
    d : Decomposition
    part : FramePart
        Of the frame of its maps; contains the object.

    Returns
    -------
    Decomposition
        Its maps are views; the result itself if the part is the whole frame.
    """
    x, y = part.corner
    return d if part.is_whole else _changed(d, part.cut, (-x, -y))


def placed_result(d: Decomposition, part: FramePart) -> Decomposition:
    """Return a result in a larger frame.

    Parameters
    ----------
    d : Decomposition
    part : FramePart
        Its place in the frame.

    Returns
    -------
    Decomposition
        Its maps have, around the part, the values of pixels outside the mask.
    """
    if part.is_whole:
        return d
    found = _changed(d, part.placed, part.corner)
    outside = ~found.mask
    found.normal[outside, 2] = 1
    if found.visibility is not None:
        found.visibility[outside] = 1
    return found


def _changed(
    d: Decomposition, change: Callable[[np.ndarray], np.ndarray], moved: tuple[int, int]
) -> Decomposition:
    """A result whose maps are changed, and whose frame begins elsewhere."""
    brdf, error = d.brdf, d.expected_error
    return replace(
        d,
        image=change(d.image),
        diffuse=change(d.diffuse),
        specular=change(d.specular),
        residual=change(d.residual),
        reflectance=change(d.reflectance),
        shading=change(d.shading),
        normal=change(d.normal),
        height=change(d.height),
        mask=change(d.mask),
        confidence=change(d.confidence),
        brdf=None if brdf is None else replace(brdf, predicted=change(brdf.predicted)),
        expected_error=None
        if error is None
        else ExpectedError(change(error.normal), change(error.reflectance)),
        camera=None if d.camera is None else d.camera.moved(*moved),
        visibility=None if d.visibility is None else change(d.visibility),
        indirect=None if d.indirect is None else change(d.indirect),
    )
