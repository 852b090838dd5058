"""The result of an edit: the edited layers, and their image.

Equation, per channel, with L = diffuse + specular the light and L' the edited one: image' = L' +
residual' where the residual is not negative; it belongs to a highlight and follows it, residual' =
residual min(1, specular' / specular). A negative residual is the part of L that the sensor clipped:
there the picture stays clipped at the photo's value while the light is sufficient, and a stronger
light raises it in proportion (Y: luminance),

    image' = min(L', image max(1, Y(L') / Y(L))).

A pixel whose layers are unchanged keeps the photo's own value exactly, without the rounding of the
sum.
"""

from dataclasses import dataclass

import numpy as np

from ..imaging.luminance import luminance
from ..scene.decomposition import Decomposition

MOST_GAIN = 1e6  # largest gain of a layer
_MOST_LIGHT = 1e30  # far below the range of single precision


@dataclass(frozen=True, eq=False)
class Edited:
    """The layers of an edited scene.

    Attributes
    ----------
    image, diffuse, specular : (H, W, 3) float32 ndarray
        Linear, 0 outside the mask; diffuse and specular are not negative.
    notes : tuple of str
        Notes for the user, one sentence each.
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
    """Return the scene with another diffuse or specular layer.

    Parameters
    ----------
    d : Decomposition
    diffuse, specular : (H, W, 3) ndarray, optional
        None keeps the present layer. Negative light becomes 0.
    notes : tuple of str

    Returns
    -------
    Edited
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
    """Return the mean colour of the light on the object, of luminance 1.

    One photo cannot determine how much of a tint is light and how much is reflectance. `reflectance
    * light_color` is the colour in the photo, which users expect to edit.

    Parameters
    ----------
    d : Decomposition

    Returns
    -------
    (3,) ndarray
        Linear Rec.709.
    """
    mean = d.shading[d.mask].mean(0, dtype=float)
    return np.maximum(mean, 1e-3 * mean.max()) / float(
        luminance(np.maximum(mean, 1e-3 * mean.max()))
    )


def _layer(values: np.ndarray, mask: np.ndarray) -> np.ndarray:
    return np.where(mask[..., None], np.clip(values, 0, _MOST_LIGHT), 0).astype(np.float32)
