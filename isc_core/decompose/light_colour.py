"""The colour of the light, where a photo tells it: the photo is explained as it would be under
white light, and the colour put back.

Problem: separations, and what a lamp may look like, take the light for white.

Equation: with the light's colour c of mean 1 (`illuminant`), I' = I / c is explained by a model as
I' = D' + S' + rest'. Then

    D = c D',   S = c S',   rest = c rest',   log shading = log shading' + log c,

so that I = D + S + rest and the reflectance D / shading is that under white light.

Citation: H.-C. Lee 1986, doi:10.1364/JOSAA.3.001694.

Limits: those of `illuminant`: few photos tell the colour. Where one does not, the light is taken
for white, and the status says why. Light of a stronger colour than a lamp's is mostly noticed, see
`light_gamut`; the result is then less to be trusted, and says so.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ..illuminant.illuminant import Illuminant, estimate_illuminant, tinted, whitened
from ..photo.photo import Photo
from ..scene.decomposition import Separation
from ..scene.lobe_fit import Interval, LobeFit
from .layers import scale_confidence, shifted
from .settings import LIGHT_COLOURS
from .task import Answer, Task

WHITE, ESTIMATE = LIGHT_COLOURS
_COLOURED = 0.1  # of a channel's share: less cannot be told from white
_STRONG = "the light may be strongly coloured, or all of the paint is: highlights and paint are less to be trusted; white light would tell"
_HINT = "the light is coloured: --light-colour estimate takes that into account"


def under_light(task: Task, solver: Callable[[Task], Answer]) -> Answer:
    """What `solver` makes of the photo under white light, back under the light's colour where that
    is known and asked for.

    Raises `InputError`, `Cancelled`.
    """
    with task.clock.stage("light colour"):
        light = estimate_illuminant(task.working.image, task.working.mask, task.working.clipped)
    used = light.determined and task.settings.light_colour == ESTIMATE
    answer = _back(solver(_whitened(task, light.colour)), light.colour) if used else solver(task)
    split = scale_confidence(answer.split) if light.too_strong else answer.split
    return replace(
        answer, split=split, status=answer.status | {"light_colour": _status(light, used)}
    )


def _status(light: Illuminant, used: bool) -> dict[str, Any]:
    """For people and programs, JSON-ready: the estimate, and what was made of it."""
    coloured = light.determined and float(np.abs(light.colour - 1).max()) > _COLOURED
    return {
        "used": ESTIMATE if used else WHITE,
        "estimate": [round(float(part), 4) for part in light.colour],
        "confidence": round(light.confidence, 4),
        "determined": light.determined,
        "reason": light.reason,
        "help": _STRONG if light.too_strong else _HINT if coloured and not used else "",
    }


def _whitened(task: Task, colour: np.ndarray) -> Task:
    """The same task under white light."""
    working = _recoloured(task.working, colour)
    maps = working if task.one_scale else _recoloured(task.maps, colour)
    split = None if task.split is None else _relit(task.split, 1 / colour)
    light = task.known.light
    known = (
        task.known if light is None else replace(task.known, light=shifted(light, -np.log(colour)))
    )
    return replace(task, working=working, maps=maps, split=split, known=known)


def _recoloured(photo: Photo, colour: np.ndarray) -> Photo:
    return replace(photo, image=whitened(photo.image, colour))


def _back(answer: Answer, colour: np.ndarray) -> Answer:
    """The answer under the light again; height and confidence stay."""
    brdf = None if answer.brdf is None else _lobe(answer.brdf, colour)
    return replace(
        answer,
        split=_relit(answer.split, colour),
        light=shifted(answer.light, np.log(colour)),
        brdf=brdf,
    )


def _relit(split: Separation, colour: np.ndarray) -> Separation:
    diffuse, specular, residual = (
        tinted(layer, colour) for layer in (split.diffuse, split.specular, split.residual)
    )
    return Separation(diffuse, specular, residual, split.confidence)


def _lobe(fit: LobeFit, colour: np.ndarray) -> LobeFit:
    lights = tuple(
        replace(
            light,
            strength_light=light.strength_light * colour,
            interval=Interval(light.interval.low * colour, light.interval.high * colour),
        )
        for light in fit.lights
    )
    return replace(fit, predicted=tinted(fit.predicted, colour), lights=lights)
