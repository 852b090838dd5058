"""Dichromatic editing: separate edits of the diffuse and specular layers (thesis, figure 4.50).

Equation, for a layer l with white w (its 99.5th percentile), m its largest channel, G a Gaussian
average inside the mask: sharpened u = max(0, l + amount (l - G l)); then l' = gain u (m(u) /
w)^(gamma - 1). All channels of a pixel share the factor, so that gamma keeps the hue. Gain 0
removes the layer.

Citation: S. A. Shafer, "Using color to separate reflection components", Color Research and
Application 10(4), 210-218 (1985), doi:10.1002/col.5080100409; H. Akbar, "3D Intrinsic Scene
Characteristics Extraction Framework for a Single Image" (2016).

Limits: a gamma below 1 amplifies errors of the separation; sharpening amplifies its noise.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy import ndimage

from ..imaging.luminance import white_of
from ..scene.decomposition import Decomposition
from ..shading.brdf.model import check_range
from .edited import MOST_GAIN, Edited, edited


@dataclass(frozen=True)
class LayerEdit:
    """A change of one layer. Raises `InputError` outside these ranges.

    Attributes
    ----------
    gain : float
        In [0, 1e6]; 0 removes the layer.
    gamma : float
        In [0.05, 20]; above 1 is more contrast.
    sharpen : float
        Share of detail that is added, in [-1, 20]; -1 removes all detail.
    radius : float
        Standard deviation that separates detail, in pixels, in [0.3, 100].
    """

    gain: float = 1.0
    gamma: float = 1.0
    sharpen: float = 0.0
    radius: float = 2.0

    def __post_init__(self) -> None:
        for name, low, high in (
            ("gain", 0, MOST_GAIN),
            ("gamma", 0.05, 20),
            ("sharpen", -1, 20),
            ("radius", 0.3, 100),
        ):
            check_range(name, getattr(self, name), low, high)


@dataclass(frozen=True)
class DichromaticEdit:
    """Changes of both layers.

    Attributes
    ----------
    diffuse, specular : LayerEdit
    """

    diffuse: LayerEdit = field(default_factory=LayerEdit)
    specular: LayerEdit = field(default_factory=LayerEdit)


def edit_layers(d: Decomposition, change: DichromaticEdit) -> Edited:
    """Return the scene with both layers changed and added again.

    Parameters
    ----------
    d : Decomposition
    change : DichromaticEdit

    Returns
    -------
    Edited
    """
    return edited(
        d,
        edited_layer(d.diffuse, d.mask, change.diffuse),
        edited_layer(d.specular, d.mask, change.specular),
    )


def edited_layer(layer: np.ndarray, mask: np.ndarray, change: LayerEdit) -> np.ndarray:
    """Change one layer; a default edit returns the same values.

    Parameters
    ----------
    layer : (H, W, 3) ndarray
        Not negative.
    mask : (H, W) bool ndarray
    change : LayerEdit

    Returns
    -------
    (H, W, 3) ndarray
    """
    if change.gain == 0:
        return np.zeros_like(layer)
    result = layer
    if change.sharpen:
        result = np.maximum(
            result + change.sharpen * (result - masked_blur(result, mask, change.radius)), 0
        )
    if change.gamma != 1:
        level = result.max(-1, keepdims=True).astype(float) / white_of(layer, mask)
        # The factor of gamma < 1 is unbounded at black, which stays unchanged.
        result = result * np.where(level > 1e-6, np.maximum(level, 1e-6) ** (change.gamma - 1), 0)
    return result if change.gain == 1 else result * change.gain


def masked_blur(values: np.ndarray, mask: np.ndarray, sigma: float) -> np.ndarray:
    """Smooth values by a Gaussian over the pixels of a mask; 0 outside it.

    Parameters
    ----------
    values : (H, W) or (H, W, C) ndarray
    mask : (H, W) bool ndarray
    sigma : float
        In pixels.

    Returns
    -------
    ndarray
    """
    if values.ndim == 3:
        return np.stack(
            [masked_blur(plane, mask, sigma) for plane in np.moveaxis(values, -1, 0)], -1
        )
    weight = ndimage.gaussian_filter(mask.astype(float), sigma, mode="constant")
    total = ndimage.gaussian_filter(np.where(mask, values, 0).astype(float), sigma, mode="constant")
    return np.where(mask, total / np.maximum(weight, 1e-12), 0)
