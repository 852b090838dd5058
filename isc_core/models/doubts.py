"""What in a photo speaks against what the models assume: opaque glossy paint, one small lamp beside a smooth light of about one colour.

Problem: of a mirror, of glass, or under several lamps a model also finds paint, shape and light that add up to the photo: wrong ones.

Equation: `appearance` tells how likely the photo shows each of them. Beyond a bound that is a doubt: the confidence is multiplied by what
is left for ordinary paint, and the status says why.

Citation: see `appearance`.

Limits: measured in docs/methods/doubts.md. Strongly coloured light is another matter, see `light_gamut`.
"""

from dataclasses import replace

from ..appearance import GLASS, LAMPS, MIRROR, ORDINARY, kinds_of
from ..photo import Photo
from .layers import less_sure
from .task import Answer

LIKELY = 0.6  # of a mirror or glass together, or of several lamps: a doubt
_LEAST = 0.1  # of the confidence is left
CLEAR = "the object looks like a mirror or like something transparent: what was found would be an opaque one's, hardly its own"
SEVERAL = "there seem to be several lights: one was looked for, so shape, paint and gloss are less to be trusted; use one lamp if you can"


def doubts_of(kinds: dict[str, float]) -> list[str]:
    """Lines for people, of the probabilities that `appearance.kinds_of` found; none where there is no doubt."""
    clear, several = kinds[MIRROR] + kinds[GLASS], kinds[LAMPS]
    return [*([CLEAR] if clear > LIKELY else []), *([SEVERAL] if several > LIKELY else [])]


def doubted(maps: Photo, answer: Answer) -> Answer:
    """The answer to the photo of its maps, with its doubts in the status: `kinds`, the probabilities, and `doubts`, lines for people."""
    kinds = kinds_of(maps.image, maps.mask)
    doubts = doubts_of(kinds)
    split = less_sure(answer.split, max(kinds[ORDINARY], _LEAST)) if doubts else answer.split
    told = {kind: round(share, 4) for kind, share in kinds.items()}
    return replace(answer, split=split, status=answer.status | {"kinds": told, "doubts": doubts})
