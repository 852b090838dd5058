"""Photos without colours of their own: grey ones, and grey ones that were toned, such as sepia.

Problem: the tone of such a photo is neither the object's colour nor the light's. A solver of
colours explains it by both.

Equation: the grey photo, of the luminance Y, is solved with one channel. Every layer, and so the
reflectance, is then multiplied by I / Y, pixel by pixel: the layers sum to the photo again, and the
light is white.

Limits: a photo is toned only if the user says so, since a toned photo and a photo of objects of one
colour look the same. Otherwise the light is expected to be white, and most of the tone goes into
the reflectance.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..imaging import channels
from ..imaging.luminance import luminance
from ..photo import Photo
from ..scene.decomposition import Separation
from ..scene.diagnostics import PhotoColours
from .settings import LightColour
from .task import DecompositionTask, SceneEstimate


def solve_toned(
    task: DecompositionTask, solver: Callable[[DecompositionTask], SceneEstimate]
) -> SceneEstimate:
    """Run a solver on the grey photo where a photo is toned, and put the tone back.

    Parameters
    ----------
    task : DecompositionTask
    solver : callable
        The rest of the pipeline, predictions included.

    Returns
    -------
    SceneEstimate
        Its diagnostics say whether the photo has colours.

    Raises
    ------
    InputError
        If the model cannot explain this photo.
    Cancelled
        If the monitor cancels.
    """
    if is_grey(task.maps):
        return _described(solver(task), PhotoColours.GREY)
    if task.settings.light_colour != LightColour.TONED:
        return _described(solver(task), PhotoColours.COLOURED)
    working = _greyed(task.working)
    maps = working if task.one_scale else _greyed(task.maps)
    split = None if task.split is None else _grey_layers(task.split)
    estimate = solver(replace(task, working=working, maps=maps, split=split))
    estimate = replace(estimate, split=_toned(estimate.split, task.maps, maps))
    return _described(estimate, PhotoColours.TONED)


def is_grey(photo: Photo) -> bool:
    """Return whether the channels of a photo's object are equal.

    Parameters
    ----------
    photo : Photo

    Returns
    -------
    bool
    """
    return channels.is_grey(photo.image, photo.mask)


def _described(estimate: SceneEstimate, colours: PhotoColours) -> SceneEstimate:
    return replace(estimate, diagnostics=replace(estimate.diagnostics, photo_colours=colours))


def _grey(image: np.ndarray) -> np.ndarray:
    return np.repeat(luminance(image).astype(image.dtype)[..., None], 3, axis=-1)


def _greyed(photo: Photo) -> Photo:
    return replace(photo, image=_grey(photo.image))


def _grey_layers(split: Separation) -> Separation:
    diffuse, specular, residual = (
        _grey(layer) for layer in (split.diffuse, split.specular, split.residual)
    )
    return Separation(diffuse, specular, residual, split.confidence)


def _toned(split: Separation, photo: Photo, grey: Photo) -> Separation:
    """The layers of the grey photo with the colours of the photo; they sum to it again."""
    tone = photo.image / np.where(grey.image > 0, grey.image, 1)
    diffuse, specular, residual = (
        (layer * tone).astype(layer.dtype)
        for layer in (split.diffuse, split.specular, split.residual)
    )
    return Separation(diffuse, specular, residual, split.confidence)
