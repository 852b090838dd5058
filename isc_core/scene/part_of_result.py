"""A result as a part of a larger frame, and a part of a result."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..imaging.bounding_box import FramePart
from .decomposition import Decomposition
from .expected_error import ExpectedError

AROUND = {"normal": np.array((0.0, 0.0, 1.0)), "visibility": np.ones(3)}
"""Values of maps outside the object, by field of `Decomposition`; those of the others are 0."""


@dataclass(frozen=True)
class ResultPart:
    """The object's part of a result.

    Attributes
    ----------
    result : Decomposition
        Its maps are those of the part.
    part : FramePart
        Its place in the frame of the maps.
    """

    result: Decomposition
    part: FramePart

    @classmethod
    def of(cls, d: Decomposition, part: FramePart | None = None) -> "ResultPart":
        """Return a result as a part of its frame.

        Parameters
        ----------
        d : Decomposition
        part : FramePart, optional
            The part that its maps are of; by default the whole frame.

        Returns
        -------
        ResultPart
        """
        return cls(d, part or FramePart.whole((d.mask.shape[0], d.mask.shape[1])))

    @property
    def mask(self) -> np.ndarray:
        """The object's pixels in the frame, (H, W) bool."""
        return self.part.placed(self.result.mask)

    def at(self, part: FramePart) -> Decomposition:
        """Return the result in another part of the frame.

        Parameters
        ----------
        part : FramePart
            Contains the object.

        Returns
        -------
        Decomposition
            Maps are views if this part contains the other one.
        """
        near = cut_result(self.result, part.within(self.part))
        return placed_result(near, self.part.within(part))


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
    return d if part.is_whole else _changed(d, lambda values, _: part.cut(values), (-x, -y))


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
    return d if part.is_whole else _changed(d, part.placed, part.corner)


def _changed(
    d: Decomposition,
    change: Callable[[np.ndarray, np.ndarray | None], np.ndarray],
    moved: tuple[int, int],
) -> Decomposition:
    """A result whose maps are changed, and whose frame begins elsewhere; the second argument of
    `change` is the value outside the object.
    """

    def changed(values: np.ndarray, name: str = "") -> np.ndarray:
        return change(values, AROUND.get(name))

    brdf, error = d.brdf, d.expected_error
    return replace(
        d,
        image=changed(d.image),
        diffuse=changed(d.diffuse),
        specular=changed(d.specular),
        residual=changed(d.residual),
        reflectance=changed(d.reflectance),
        shading=changed(d.shading),
        normal=changed(d.normal, "normal"),
        height=changed(d.height),
        mask=changed(d.mask),
        confidence=changed(d.confidence),
        brdf=None if brdf is None else replace(brdf, predicted=changed(brdf.predicted)),
        expected_error=None
        if error is None
        else ExpectedError(changed(error.normal), changed(error.reflectance)),
        camera=None if d.camera is None else d.camera.moved(*moved),
        visibility=None if d.visibility is None else changed(d.visibility, "visibility"),
        indirect=None if d.indirect is None else changed(d.indirect),
    )
