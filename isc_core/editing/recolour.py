"""Recolouring: new reflectance under the same light and gloss (thesis, figure 4.51).

Equation, for a colour r, the reflectance times the light's mean colour, with luminance Y(r), in
Oklab (L, a, b) with hue h and chroma C: h' = h + shift, C' = saturation C; or, for a target colour,
the target's hue and the chroma C_target L / L_target, which is the target in more or less light. In
linear light the result is scaled to Y(r') = value Y(r), so that texture and shading are preserved.
A colour outside the gamut at that luminance is desaturated just until it is inside. diffuse' = ((1
- w) r + w r') shading, with w the region's weight; the specular layer does not change. Where r'
shading would exceed both white and the brightest channel of the old diffuse light, it is
desaturated at its own luminance, too, so that it does not clip; floats have no white.

Citation: B. Ottosson 2020 (Oklab, see `chroma`); H. Akbar 2016 (recolouring).

Limits: an object that becomes brighter than white, by `value` or a brighter target, is clipped, and
a note says so. Highlights on bright colours may clip. Highlights that remain in the diffuse layer
are recoloured, too. Black and pure white can hardly be coloured.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..errors import InputError
from ..imaging.luminance import luminance, white_of
from ..scene.decomposition import Decomposition
from ..shading.brdf.model import check_range
from .chroma import from_oklab, to_oklab
from .edited import Edited, edited, light_color

_MOST_CLIPPED = 0.01  # of the object's pixels: below it there is no note


@dataclass(frozen=True, eq=False)
class ColourEdit:
    """A change of colour. Raises `InputError` outside these ranges.

    Attributes
    ----------
    hue : float
        Rotation of the hue in degrees.
    saturation, value : float
        Factors of chroma and luminance, not negative.
    target : (3,) ndarray or None
        Linear colour in [0, 1]; hue, saturation and value are applied to it.
    target_luminance : bool
        Whether to match the mean luminance of the target, too.
    """

    hue: float = 0.0
    saturation: float = 1.0
    value: float = 1.0
    target: np.ndarray | None = None
    target_luminance: bool = False

    def __post_init__(self) -> None:
        check_range("hue", self.hue, -1e6, 1e6)
        check_range("saturation", self.saturation, 0, 100)
        check_range("value", self.value, 0, 100)
        if self.target is not None:
            check_range("colour", self.target, 0, 1)
            if np.shape(self.target) != (3,):
                raise InputError("a target colour needs three numbers")
        if self.target_luminance and (self.target is None or not np.any(self.target)):
            raise InputError("matching the brightness needs a target colour that is not black")

    @property
    def changes(self) -> bool:
        """Whether anything changes."""
        return (
            self.target is not None
            or self.hue % 360 != 0
            or self.saturation != 1
            or self.value != 1
        )


def recolour(d: Decomposition, change: ColourEdit, region: np.ndarray | None = None) -> Edited:
    """Return the scene with a changed reflectance.

    Parameters
    ----------
    d : Decomposition
    change : ColourEdit
    region : (H, W) ndarray, optional
        Weight in [0, 1]; by default the whole object.

    Returns
    -------
    Edited

    Raises
    ------
    InputError
        If the region has another size or does not overlap the object.
    """
    if region is not None and region.shape != d.mask.shape:
        raise InputError(
            f"the region is {region.shape}, the maps are {d.mask.shape}: use a region of their size"
        )
    weight = np.where(d.mask, 1.0 if region is None else region, 0.0)
    check_range("the region's weight", weight, 0, 1)
    if not weight.any():
        raise InputError(
            "the region does not overlap the object: mark the part to recolour in white"
        )
    if not change.changes:
        return edited(d)
    inside = weight > 0
    share = weight[inside][:, None]
    tint = light_color(d)
    old = np.maximum(d.reflectance[inside] * tint, 0)
    new = change_colours(old, change, _max_level(d, tint), share)
    diffuse, light = d.diffuse.copy(), new * (d.shading[inside] / tint)
    if not _is_float(d):
        most = np.maximum(d.diffuse[inside].max(-1), 1)
        light = _at_luminance(light, luminance(light), most)
    diffuse[inside] = (1 - share) * d.diffuse[inside] + share * light
    result = edited(d, diffuse)
    return replace(result, notes=_notes(d, result))


def _notes(d: Decomposition, result: Edited) -> tuple[str, ...]:
    """Whether a part of the object became brighter than white."""
    if _is_float(d):
        return ()
    clipped = (luminance(result.diffuse) > 1) & (luminance(d.diffuse) <= 1)
    share = float(clipped[d.mask].mean())
    if share < _MOST_CLIPPED:
        return ()
    return (
        f"{share:.0%} of the object is brighter than white and is clipped: use a smaller --value "
        "or a darker colour",
    )


def change_colours(
    colors: np.ndarray, change: ColourEdit, white: float, weight: np.ndarray
) -> np.ndarray:
    """Change colours.

    Parameters
    ----------
    colors : (N, 3) ndarray
        Linear, not negative.
    change : ColourEdit
    white : float
        Largest value of a colour.
    weight : (N, 1) ndarray
        Weight of each colour in the mean.

    Returns
    -------
    (N, 3) ndarray
    """
    old = luminance(colors)
    lab = to_oklab(colors)
    lightness, chroma, hue = (
        lab[:, 0],
        np.hypot(lab[:, 1], lab[:, 2]),
        np.arctan2(lab[:, 2], lab[:, 1]),
    )
    target_level = change.value * old
    if change.target is not None:
        target_lab = to_oklab(np.maximum(change.target, 1e-6))
        chroma = float(np.hypot(target_lab[1], target_lab[2])) * lightness / float(target_lab[0])
        hue = np.full_like(hue, np.arctan2(target_lab[2], target_lab[1]))
        if change.target_luminance:
            mean = float((weight[:, 0] * old).sum() / weight.sum())
            target_level = target_level * float(luminance(change.target)) / max(mean, 1e-9)
    hue, chroma = hue + np.deg2rad(change.hue), chroma * change.saturation
    color = from_oklab(np.stack([lightness, chroma * np.cos(hue), chroma * np.sin(hue)], -1))
    return _at_luminance(
        np.maximum(color, 0),
        target_level,
        np.maximum(white * max(change.value, 1.0), colors.max(-1)),
    )


def _is_float(d: Decomposition) -> bool:
    """Whether the photo is of floats, which have no white."""
    return bool(d.provenance.input.get("bit_depth", 8) == 32)


def _max_level(d: Decomposition, tint: np.ndarray) -> float:
    """Largest value of a new colour: the object's brightest, or that which is the photo's white in
    the object's brightest light.
    """
    white = white_of(d.image, d.mask) if _is_float(d) else 1.0
    return max(white_of(d.reflectance * tint, d.mask), white / white_of(d.shading / tint, d.mask))


def _at_luminance(color: np.ndarray, target_level: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Colours (N, 3) >= 0 scaled to the luminance `target_level` (N,), and mixed with the grey of
    that luminance where a channel would exceed `most` (N,).
    """
    current = luminance(color)
    grey = np.broadcast_to(target_level[:, None], color.shape)
    scaled = np.where(
        current[:, None] > 1e-12, color * (target_level / np.maximum(current, 1e-12))[:, None], grey
    )
    excess = scaled.max(-1) - target_level
    headroom = np.maximum(most - target_level, 0)
    share = np.where(excess > headroom, headroom / np.maximum(excess, 1e-12), 1)[:, None]
    return grey + share * (scaled - grey)
