"""What in a photo speaks against what the models assume: opaque glossy paint, one small lamp beside
a smooth light of about one colour.

Problem: of a mirror, of glass, or under several lamps a model also finds paint, shape and light
that add up to the photo: wrong ones.

Equation: `appearance` tells how likely the photo shows each of them, `lamp_network` how likely
several lamps; of the two for those the mean of the log odds. Beyond a bound that is a doubt: the
confidence is multiplied by what is left for opaque paint under one lamp, and the status says why.
It also says where much of the object is too bright for the photo, or the mask too ragged for a
mesh.

Citation: see `appearance` and `lamp_network`.

Limits: measured in docs/methods/doubts.md. Strongly coloured light is another matter, see
`light_gamut`.
"""

from dataclasses import replace

import numpy as np
from scipy import ndimage

from ..networks.scene_classifier import GLASS, LAMPS, MIRROR, ORDINARY, classify_scene
from ..photo.photo import Photo
from ..scene.light_estimate import LightEstimate
from .layers import scale_confidence
from .task import Answer

_MUCH_CLIPPED = 0.1  # of the object; where single highlights are, it is less
_RAGGED = 0.5  # of the mask that no block of 2 x 2 pixels holds, and no mesh will
LIKELY_CLEAR = 0.6  # of a mirror or glass together: a doubt
LIKELY_SEVERAL = 0.4  # of several lamps: lower, for a second lamp is often weak
_LEAST = 0.1  # of the confidence is left
_SURE = 1e-4  # no network is surer
CLEAR = "the object looks like a mirror or like something transparent: what was found would be an opaque one's, hardly its own"
SEVERAL = "there seem to be several lights: one was looked for, so shape, paint and gloss are less to be trusted; use one lamp if you can"


def doubts_of(kinds: dict[str, float], light_estimate: LightEstimate) -> list[str]:
    """Lines for people, of what `networks.scene_classifier.classify_scene` and `networks.light_network.predict_light` found; none
    where there is no doubt.
    """
    clear, several = kinds[MIRROR] + kinds[GLASS], several_lamps(kinds, light_estimate)
    return [
        *([CLEAR] if clear > LIKELY_CLEAR else []),
        *([SEVERAL] if several > LIKELY_SEVERAL else []),
    ]


def several_lamps(kinds: dict[str, float], light_estimate: LightEstimate) -> float:
    """The probability of several lamps: the mean of what two networks say, as the logarithms of
    odds. One has seen photos, mirrors and rooms, the other many more lamps.
    """
    odds = [
        np.log((share + _SURE) / (1 - share + _SURE))
        for share in (kinds[LAMPS], light_estimate.several)
    ]
    return float(1 / (1 + np.exp(-np.mean(odds))))


def doubts_of_photo(photo: Photo) -> list[str]:
    """Lines for people, of what the photo does not show and its mask leaves out."""
    clipped, ragged = float(photo.clipped[photo.mask].mean()), 1 - share_in_blocks(photo.mask)
    lines = []
    if clipped > _MUCH_CLIPPED:
        lines.append(
            f"{100 * clipped:.0f} % of the object is too bright for the photo: what is there is a guess; expose less"
        )
    if ragged > _RAGGED:
        lines.append(
            f"the mask is so thin or ragged that the mesh leaves out {100 * ragged:.0f} % of it: fill the mask"
        )
    return lines


def share_in_blocks(mask: np.ndarray) -> float:
    """Which share of the pixels of `mask` (H, W) bool lies in a block of 2 x 2 pixels that it holds
    whole.
    """
    return float(ndimage.binary_opening(mask, np.ones((2, 2))).sum() / max(int(mask.sum()), 1))


def with_warnings(maps: Photo, answer: Answer, light_estimate: LightEstimate) -> Answer:
    """The answer to the photo of its maps, whose light looks like `light_estimate`, with its doubts in the
    status: `kinds` and `lamps`, the probabilities, and `doubts`, lines for people.
    """
    kinds = classify_scene(maps.image, maps.mask)
    doubts = doubts_of(kinds, light_estimate)
    split = (
        scale_confidence(answer.split, max(_left(doubts, kinds, light_estimate), _LEAST))
        if doubts
        else answer.split
    )
    told = {
        "kinds": {kind: round(share, 4) for kind, share in kinds.items()},
        "lamps": {
            "none": round(light_estimate.none, 4),
            "one": round(light_estimate.one, 4),
            "several": round(light_estimate.several, 4),
        },
        "several_lamps": round(several_lamps(kinds, light_estimate), 4),
        "doubts": doubts + doubts_of_photo(maps),
    }
    return replace(answer, split=split, status=answer.status | told)


def _left(doubts: list[str], kinds: dict[str, float], light_estimate: LightEstimate) -> float:
    """How likely what is with_warnings is not so."""
    opaque = kinds[ORDINARY] + kinds[LAMPS] if CLEAR in doubts else 1.0
    return opaque * (1 - several_lamps(kinds, light_estimate) if SEVERAL in doubts else 1.0)
