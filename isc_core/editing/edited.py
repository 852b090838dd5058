"""The result of an edit: the layers of the picture as it would have been.

Equation, per channel, with L = diffuse + specular the light and L' the edited one: image' = L' +
residual' where the residual is not below 0; it belongs to a highlight and goes with that, residual'
= residual min(1, specular' / specular). Below 0 it is what the sensor cut off of L: there the
picture stays cut off at the photo's value while the light is enough for it, and a stronger light
lifts it as much (Y: luminance),

    image' = min(L', image max(1, Y(L') / Y(L))).

A pixel whose layers are unchanged keeps the photo's own value, bit by bit, which the rounded sum
would not.
"""

from dataclasses import dataclass

import numpy as np

from ..imaging.luminance import luminance
from ..scene.decomposition import Decomposition

MOST_GAIN = 1e6  # of any layer that is made stronger
_MOST_LIGHT = 1e30  # far from what single precision cannot hold


@dataclass(frozen=True)
class Edited:
    """`image`, `diffuse`, `specular`: (H, W, 3) float32, linear, 0 outside the mask; diffuse and
    specular >= 0.

    `notes`: what a person should know of the edit, a sentence each.
    """

    image: np.ndarray
    diffuse: np.ndarray
    specular: np.ndarray
    notes: tuple[str, ...] = ()


def edited(
    d: Decomposition,
    diffuse: np.ndarray | None = None,
    specular: np.ndarray | None = None,
    notes: tuple[str, ...] = (),
) -> Edited:
    """The scene with another diffuse or specular layer (H, W, 3);

    None keeps the present one. Negative light becomes 0.
    """
    new_diffuse = d.diffuse if diffuse is None else _layer(diffuse, d.mask)
    new_specular = d.specular if specular is None else _layer(specular, d.mask)
    before, after = d.specular.sum(-1, keepdims=True), new_specular.sum(-1, keepdims=True)
    kept = np.divide(after, before, out=np.ones_like(before), where=before > after)
    same = ((new_diffuse == d.diffuse) & (new_specular == d.specular)).all(-1, keepdims=True)
    new_light = new_diffuse + new_specular
    levels = luminance(d.diffuse + d.specular), luminance(new_light)
    brighter = np.maximum(
        np.divide(levels[1], levels[0], out=np.ones_like(levels[0]), where=levels[0] > 0), 1
    )
    cut_off = np.minimum(new_light, d.image * brighter[..., None]).astype(np.float32)
    total = np.where(d.residual < 0, cut_off, np.maximum(new_light + d.residual * kept, 0))
    return Edited(np.where(same, d.image, total), new_diffuse, new_specular, notes)


def light_color(d: Decomposition) -> np.ndarray:
    """(3,) the mean colour of the light on the object, of luminance 1. One photo leaves open how
    much of a tint is light and how much is paint; `reflectance * light_color` is the paint as the
    photo shows it, and is what colours are chosen for.
    """
    mean = d.shading[d.mask].mean(0, dtype=float)
    return np.maximum(mean, 1e-3 * mean.max()) / float(
        luminance(np.maximum(mean, 1e-3 * mean.max()))
    )


def _layer(values: np.ndarray, mask: np.ndarray) -> np.ndarray:
    return np.where(mask[..., None], np.clip(values, 0, _MOST_LIGHT), 0).astype(np.float32)
