"""What in an answer speaks against its own assumptions: opaque glossy paint, one small lamp beside a smooth light of about one colour.

Problem: of a mirror, of glass, or under several lamps a model also finds paint, shape and light that add up to the photo: wrong ones.

Equation: two spreads. One small lamp is mirrored at one normal; with blurred normals n and weights w, confidence times squared specular
light, highlights spread by

    arccos |sum w n| / sum w.

A smooth light of one colour gives one colour of shading; its chromaticities p, weighted by the shading, in the plane of colours of mean 1
(see `light_gamut`), spread by their standard deviation. Beyond a bound each is a doubt: the confidence is halved, and the status says why.

Limits: recovered normals are 10 to 20 degrees off, most under highlights: bumpy things under one lamp may be doubted, and three white lamps
close to each other may not. A mirror that shows grey surroundings without peaks looks like grey paint.
"""

from dataclasses import replace

import numpy as np

from ..brdf.fitting.recovered import blurred_normals
from ..light_gamut import bright_chromaticities
from ..photo import Photo
from .layers import less_sure, shaded
from .task import Answer

_FARTHEST = 20.0  # degrees that highlights spread
_MOST_COLOURS = 0.2  # of the shading
_LEAST_SHARE = 1e-3  # of the light is specular; of less there is nothing to say
_DARK = 0.2  # quantile of the shading, below which its colour does not count
_APART = (
    "the highlights lie farther apart than one small light's would: there may be several lights, or the object may be like a mirror or "
    "transparent; shape, paint and gloss are less to be trusted"
)
_COLOURS = (
    "the light seems to have several strong colours: there may be several lamps, or the object may mirror its surroundings or be "
    "transparent; shape and paint are less to be trusted"
)


def doubted(maps: Photo, answer: Answer) -> Answer:
    """The answer to the photo of its maps, with its doubts in the status, as `doubts`: lines for people, none where there are none."""
    normal, shading = shaded(answer.height, answer.light, maps.mask)
    spread, colours = highlight_spread(answer, normal, maps), colour_spread(shading[maps.mask])
    doubts = [*([_APART] if spread > _FARTHEST else []), *([_COLOURS] if colours > _MOST_COLOURS else [])]
    split = less_sure(answer.split) if doubts else answer.split
    return replace(answer, split=split, status=answer.status | {"doubts": doubts})


def highlight_spread(answer: Answer, normal: np.ndarray, maps: Photo) -> float:
    """Of the highlights among the blurred normals, degrees; 0 where there are next to none. `normal` (H, W, 3), unit."""
    inside = maps.mask
    specular, confidence = answer.split.specular[inside].mean(axis=1, dtype=float), answer.split.confidence[inside]
    weight = np.square(specular) * confidence
    if specular.sum() < _LEAST_SHARE * maps.image[inside].mean(axis=1, dtype=float).sum() or weight.sum() <= 0:
        return 0.0
    mean = weight @ blurred_normals(normal, inside)[inside] / weight.sum()
    return float(np.rad2deg(np.arccos(min(float(np.linalg.norm(mean)), 1.0))))


def colour_spread(shading: np.ndarray) -> float:
    """Standard deviation of the chromaticities of shadings (N, C) >= 0, C = 1 or 3."""
    if shading.shape[1] == 1:
        return 0.0
    places, weights = bright_chromaticities(shading, _DARK)
    if not len(places):
        return 0.0
    off = places - np.average(places, axis=0, weights=weights)
    return float(np.sqrt(np.average(np.square(off).sum(axis=1), weights=weights)))
